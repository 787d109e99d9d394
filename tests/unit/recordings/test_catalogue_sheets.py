"""Sheets of manufacturers as people type them: a value a line or a row below its names, English and German, units, decimal commas."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from commissioner.cli.verbs.identify import identify as verb
from commissioner.errors import DataRefused, UsageError
from commissioner.identify.catalogue.contradictions import settled
from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose
from commissioner.operations.recordings.identify import IdentifiedCatalogue, IdentifyRequest, identify, identify_any
from commissioner.operations.recordings.simulate import SimulateRequest, simulate
from commissioner.recordings.catalogue.reading import sheet_in
from commissioner.recordings.plate import start_from
from commissioner.settings import load_motor

GERMAN = """Bemessungsleistung;11;kW
Bemessungsspannung;400;V
Frequenz;50;Hz
Bemessungsdrehzahl;1465;1/min
Bemessungsstrom;21,5;A
cos φ;0,81
Wirkungsgrad 4/4;91,4;%
Anzugsmoment M_A/M_N;2,3
Anzugsstrom I_A/I_N;7,4
Kippmoment M_K/M_N;2,9
Massenträgheitsmoment J;0,044;kgm²
Schaltung;Dreieck
"""
FORMS = {
    "german": GERMAN,
    "spanish": "Potencia nominal;11;kW\nTensión nominal;400;V\nFrecuencia;50;Hz\nVelocidad nominal;1465;r/min\nCorriente nominal;21,5;A\n"
    "Factor de potencia;0,81\nRendimiento;91,4;%\nPar de arranque M_A/M_N;2,3\nCorriente de arranque I_A/I_N;7,4\nPar máximo M_K/M_N;2,9\n"
    "Momento de inercia J;0,044;kgm²\nConexión;triángulo\n",
    "spanish, in one row": "Potencia\tTensión\tFrecuencia\tVelocidad\tCorriente\tcos φ\tRendimiento\tIa/In\tMa/Mn\tMk/Mn\tInercia\tConexión\n"
    "kW\tV\tHz\trpm\tA\t\t%\t\t\t\tkgm2\t\n11\t400\t50\t1465\t21,5\t0,81\t91,4\t7,4\t2,3\t2,9\t0,044\tD\n",
    "over the rated one": "Potencia nominal;11;kW\nTensión nominal;400/690;V\nFrecuencia nominal;50;Hz\nVelocidad nominal;1465;min^-1\n"
    "Corriente nominal;21,5;A\nFactor de potencia;0,81\nRendimiento;91,4;%\nCorriente de arranque / Corriente nominal;7,4\n"
    "Par de arranque / Par nominal;2,3\nPar máximo / Par nominal;2,9\nMomento de inercia;0,044;kgm²\nConexión;triángulo\n",
    "italian symbols": "Potenza resa;11 kW\nTensione;400 V\nFrequenza;50 Hz\nGiri;1465 giri/min\nCorrente;21,5 A\ncosφ;0,81\nRendimento;91,4 %\n"
    "Corrente di spunto Is/In;7,4\nCoppia di spunto Cs/Cn;2,3\nCoppia massima Cm/Cn;2,9\nJ;0,044 kgm2\nCollegamento;D\n",
    "french symbols": "Puissance utile;11 kW\nTension;400 V\nFréquence;50 Hz\nVitesse;1465 tr/min\nIntensité;21,5 A\ncos φ;0,81\nRendement;91,4 %\n"
    "Id/In;7,4\nCd/Cn;2,3\nCm/Cn;2,9\nInertie;0,044 kgm2\nCouplage;D\n",
    "italian": "Potenza nominale (kW): 11\nTensione nominale (V): 400\nFrequenza: 50 Hz\nVelocità nominale: 1465 giri/min\n"
    "Corrente nominale: 21,5 A\ncosfi: 0,81\nRendimento (%): 91,4\nCoppia di spunto (%): 230\nCorrente di spunto I_A/I_N: 7,4\n"
    "Coppia massima (%): 290\nMomento d'inerzia: 0,044 kg m2\nCollegamento: triangolo\n",
    "french": "Puissance nominale;11 kW\nTension nominale;400 V\nFréquence;50 Hz\nVitesse nominale;1465 tr/min\nCourant nominal;21,5 A\n"
    "Facteur de puissance;0,81\nRendement;91,4 %\nCouple de démarrage;230 %\nCourant de démarrage I_A/I_N;7,4\nCouple maximal;290 %\n"
    "Moment d'inertie;0,044 kgm²\nCouplage;triangle\n",
    "one row": "P_N [kW];U [V];f [Hz];n [1/min];I_N [A];cos phi;eta [%];M_A/M_N;I_A/I_N;M_K/M_N;J [kgm2];Schaltung\n"
    "11;400;50;1465;21,5;0,81;91,4;2,3;7,4;2,9;0,044;D\n",
    "units below": "P_N,U_N,f,n_N,I_N,cos phi,eta,M_A/M_N,I_A/I_N,M_K/M_N,J,connection\nkW,V,Hz,1/min,A,,%,,,,kgm2,\n"
    "11,400,50,1465,21.5,0.81,91.4,2.3,7.4,2.9,0.044,delta\n",
    "footnotes": GERMAN.replace("91,4;%", "91,4 1);%").replace("21,5;A", "21,5 A (2)"),
    "keys": "# rated_power_w: 11000\n# rated_voltage_v: 400\n# rated_frequency_hz: 50\n# rated_speed_rpm: 1465\n# rated_current_a: 21.5\n"
    "# power_factor: 0.81\n# efficiency: 0.914\n# starting_torque_ratio: 2.3\n# starting_current_ratio: 7.4\n"
    "# breakdown_torque_ratio: 2.9\n# inertia_kg_m2: 0.044\n# connection: delta\n",
    "units beside the values": "P_N,U_N,f,n,I_N,cos phi,eta,T_A/T_N,I_A/I_N,T_K/T_N,J,connection\n"
    "11 kW,400 V,50 Hz,1 465 1/min,21.5 A,0.81,91.4 %,2.3,7.4,2.9,0.044 kgm2,D\n",
    "both connections": "Leistung;11 kW\nSpannung;400/690 V D/Y\nFrequenz;50 Hz\nDrehzahl;1465 1/min\nStrom;21,5/12,4 A\ncos phi;0,81\n"
    "Wirkungsgrad;91,4\nAnzugsmoment M_A/M_N;2,3\nAnzugsstrom I_A/I_N;7,4\nKippmoment M_K/M_N;2,9\n"
    "J;0,044 kgm2\nSchaltung;Dreieck\n",
    "each with its connection": "Leistung;11 kW\nSpannung;400 V D / 690 V Y\nFrequenz;50 Hz\nDrehzahl;1465 1/min\nStrom;21,5 A D / 12,4 A Y\n"
    "cos phi;0,81\nWirkungsgrad;91,4\nAnzugsmoment M_A/M_N;2,3\nAnzugsstrom I_A/I_N;7,4\nKippmoment M_K/M_N;2,9\nJ;0,044 kgm2\n"
    "Schaltung;Dreieck\n",
    "english": "Rated output (kW): 11\nRated voltage: 400 V\nFrequency = 50 Hz\nFull load speed: 1465 rpm\nFull-load current (A): 21.5\n"
    "Power factor: 81 %\nEfficiency: 91.4\nLocked rotor torque: 230 %\nLocked rotor current ratio: 7.4\nBreakdown torque (%): 290\n"
    "Moment of inertia: 0.044 kg m2\nConnection: Delta\n",
}


def read(tmp_path: Path, text: str, name: str = "sheet.csv"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return sheet_in(path)


@pytest.mark.parametrize("name", FORMS)
def test_a_page_is_the_same_sheet_in_anybodys_form(tmp_path, name):
    sheet = read(tmp_path, FORMS[name])
    assert sheet is not None and sheet.connection == "delta"
    assert {k: v.value for k, v in sheet.values.items()} == pytest.approx({
        "rated_power_w": 11000, "rated_voltage_v": 400, "rated_frequency_hz": 50, "rated_speed_rpm": 1465, "rated_current_a": 21.5,
        "power_factor": 0.81, "efficiency": 0.914, "starting_torque_ratio": 2.3, "starting_current_ratio": 7.4,
        "breakdown_torque_ratio": 2.9, "inertia_kg_m2": 0.044,
    })  # fmt: skip
    assert sheet.values["efficiency"].half_step == pytest.approx(5e-4)
    assert sheet.values["rated_current_a"].half_step == pytest.approx(0.05)


@pytest.mark.parametrize(
    "name", ["Wirkungsgrad (4/4, 3/4, 1/2)", "Rendimiento (100/75/50 %)", "Wirkungsgrad 4/4, 3/4, 1/2 [%]"]
)
def test_three_loads_in_one_cell(tmp_path, name):
    sheet = read(tmp_path, GERMAN.replace("Wirkungsgrad 4/4;91,4;%", f"{name};91,4 / 91,5 / 90,6"))
    found = [sheet.values[f"efficiency{at}"].value for at in ("", "_75", "_50")]
    assert found == pytest.approx([0.914, 0.915, 0.906])


def test_three_values_of_a_sheet_are_told_what_is_missing(tmp_path):
    path = tmp_path / "sheet.csv"
    path.write_text("Rated power (kW),11\nRated voltage (V),400\nRated speed (rpm),1475\n", encoding="utf-8")
    with pytest.raises(DataRefused, match="lacks rated frequency"):
        identify_any(IdentifyRequest((path,)))


def test_loads_connections_poles_absolute_values_and_horse_power_are_understood(tmp_path):
    sheet = read(
        tmp_path,
        "Rated power: 15 hp\nRated voltage: 230/460 V\nconnection: star\nFrequency: 60 Hz\nRated speed: 1765 rpm\nFull load current: 36/18 A\n"
        "Power factor (100%): 0.83\nPower factor 75: 0.78\nEfficiency 100/75/50 %: 92.4/92.5/91.0\nLocked rotor current: 116 A\n"
        "Breakdown torque: 162 Nm\nNumber of poles: 4\nWinding resistance between terminals: 0.52 ohm\nR phase: 0.26\n",
    )
    assert sheet is not None
    got = {k: v.value for k, v in sheet.values.items()}
    assert got == pytest.approx({
        "rated_power_w": 11185.5, "rated_voltage_v": 460, "rated_frequency_hz": 60, "rated_speed_rpm": 1765, "rated_current_a": 18,
        "power_factor": 0.83, "power_factor_75": 0.78, "efficiency": 0.924, "efficiency_75": 0.925, "efficiency_50": 0.91,
        "starting_current_a": 116, "breakdown_torque_nm": 162, "pole_pairs": 2, "winding_resistance_uv_ohm": 0.52,
        "winding_resistance_phase_ohm": 0.26,
    })  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        (("91,4;%", "0,914;%"), "per cent and per unit mixed"),
        (("cos φ;0,81", "cos φ;8,1"), "cos φ is"),
        (("400;V", "400;A"), "the unit A of Bemessungsspannung is none of V"),
        (("400;V", "230/400 V\nSchaltung;Stern/Dreieck"), "two connections and the sheet does not say|cannot"),
        (("50;Hz", "50;Hz\nFrequenz;60;Hz"), "rated frequency is said twice .*50 and 60 Hz"),
        (("Frequenz;50;Hz", "Frequenz;50/60 Hz"), "holds two values"),
        (("Kippmoment M_K/M_N;2,9", "Kippmoment M_K/M_N;0,8"), "the breakdown torque is below the rated one"),
        (("11;kW", "15;kW"), "contradict the efficiency"),
    ],
)
@pytest.mark.parametrize("carry_out", [identify_any, diagnose])
def test_what_cannot_be_is_refused_by_name(tmp_path, carry_out, changed, says):
    text = GERMAN.replace("Schaltung;Dreieck\n", "") if "Schaltung" in changed[1] else GERMAN
    path = tmp_path / "sheet.csv"
    path.write_text(text.replace(*changed), encoding="utf-8")
    request = IdentifyRequest((path,)) if carry_out is identify_any else DiagnoseRequest((path,))
    with pytest.raises(DataRefused, match=says) as refused:
        carry_out(request)
    assert refused.value.step == "read the sheet" and refused.value.remedy


@pytest.mark.parametrize(
    "text",
    [
        "test,frequency_hz,voltage_line_v,current_line_a,power_w\ndc,0,13.6,28.0,380.8\nno_load,60,208,8.17,420\n",
        "# rated_power_w: 2200\n# rated_voltage_v: 400\n# rated_frequency_hz: 50\n# rated_current_a: 5\n# rated_speed_rpm: 1436\n"
        "# power_factor: 0.8\ntime_s,segment,axis_deg,voltage_axis_v,current_u_a,current_v_a\n0,0,0,12.5,0.01,0\n0.0002,0,0,12.6,0.04,0\n",
        "# rated_power_w: 2200\n# rated_voltage_v: 400\n# rated_frequency_hz: 50\n# rated_speed_rpm: 1436\n# power_factor: 0.8\n"
        "f,U,I,P\n50,100,3,200\n50,150,4,300\n50,200,5,400\n50,250,6,500\n",
        "f [Hz],U [V],I [A],cos phi\n50,400,3,0.2\n25,400,3,0.2\n",
        "a,b,c\n1,2,3\n",
    ],
)
def test_recordings_and_tests_are_no_manufacturers_sheet(tmp_path, text):
    assert read(tmp_path, text) is None


def test_several_motors_of_one_table_are_asked_apart(tmp_path):
    row = FORMS["one row"].splitlines()[1]
    with pytest.raises(DataRefused, match="2 rows of values"):
        read(tmp_path, FORMS["one row"] + row + "\n")


def test_it_is_a_source_of_a_model_for_every_verb(tmp_path):
    path, out = tmp_path / "elf.csv", tmp_path / "out"
    path.write_text(GERMAN, encoding="utf-8")
    done = identify_any(IdentifyRequest((path,), out=out))
    assert isinstance(done, IdentifiedCatalogue) and done.document["kind"] == "manufacturer's sheet"
    assert done.document["outcome"] == "identified" and "sheet" in done.document["reason"]
    assert {"report.html", "identification.json", "model.json", "motor.toml", "motor.mo", "motor.py", "motor.mat", "motor.csv", "motor.json"} == {
        p.name for p in out.iterdir()
    }  # fmt: skip
    plate = load_motor(str(out / "motor.toml"))
    assert (plate.rated_power_w, plate.pole_pairs, plate.connection, plate.inertia_kg_m2) == (11000, 2, "delta", 0.044)
    played = simulate(SimulateRequest(str(out / "model.json"), tmp_path / "played.csv", seconds=0.5))
    assert played.samples > 1000
    assert simulate(SimulateRequest(str(path), tmp_path / "same.csv", seconds=0.5)).samples == played.samples
    assert (tmp_path / "same.csv").read_text() == (tmp_path / "played.csv").read_text()
    start, stated = start_from(out / "identification.json"), done.document["parameters"]["stator_resistance_ohm"]
    assert start.log_std[0] == pytest.approx(stated["std"] / stated["value"]) and "sheet" in start.origin
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "of a motor of this type" in page and "IEC 60034-1" in page
    assert all(abs(v["reproduced"] / v["given"] - 1) < 0.02 for v in done.document["values"])


def test_the_plays_scenario_is_the_sheets_motor(tmp_path):
    from sim.scenario import load

    path, out = tmp_path / "elf.csv", tmp_path / "out"
    path.write_text(GERMAN, encoding="utf-8")
    done = identify_any(IdentifyRequest((path,), out=out))
    assert isinstance(done, IdentifiedCatalogue)
    machine = load(str(out / "model.json")).document["machine"]
    assert machine["stator_resistance_ohm"] == pytest.approx(
        done.document["parameters"]["stator_resistance_ohm"]["value"]
    )


def test_a_diagnosis_says_what_a_sheet_can_and_cannot_tell(tmp_path):
    path = tmp_path / "elf.csv"
    path.write_text(GERMAN, encoding="utf-8")
    done = diagnose(DiagnoseRequest((path,), out=tmp_path / "out"))
    assert done.document["causes"] == [] and "leaves nothing over" in done.document["reason"]
    assert any("No sheet tells iron that bends" in r for r in done.document["remarks"])
    assert json.loads((tmp_path / "out" / "diagnosis.json").read_text())["test"] == "manufacturer's sheet"


def test_a_plate_fills_the_sheet_or_contradicts_it(tmp_path):
    path = tmp_path / "elf.csv"
    path.write_text(GERMAN, encoding="utf-8")
    with pytest.raises(DataRefused, match="sheet and plate contradict") as refused:
        identify_any(IdentifyRequest((path,), motor="motor_2kw2"))
    assert "--trust plate or --trust data" in refused.value.remedy
    trusted = identify_any(IdentifyRequest((path,), motor="motor_2kw2", trust="data"))
    assert trusted.document["nameplate"]["rated_power_w"] == 11000
    with pytest.raises(UsageError, match="no trust in 'me'"):
        identify_any(IdentifyRequest((path,), trust="me"))


def test_no_drive_is_set_from_a_sheet_and_no_part_of_a_motor_is_played(tmp_path):
    path = tmp_path / "elf.csv"
    path.write_text(GERMAN, encoding="utf-8")
    with pytest.raises(DataRefused, match="no measurement of the motor at the drive"):
        identify(IdentifyRequest((path,)))
    path.write_text(
        "".join(line for line in GERMAN.splitlines(True) if "moment" not in line and "Anzug" not in line),
        encoding="utf-8",
    )
    with pytest.raises(DataRefused, match="only a part of the motor"):
        simulate(SimulateRequest(str(path), tmp_path / "played.csv"))


def test_the_screen_shows_values_errors_and_what_stays_open(tmp_path, capsys):
    path = tmp_path / "elf.csv"
    path.write_text(GERMAN, encoding="utf-8")
    verb(IdentifyRequest((path,)), as_json=False)
    shown = capsys.readouterr().out
    assert (
        "of the type" in shown
        and "breakdown torque M_K/M_N" in shown
        and "two cages" in shown
        and "IEC 60034-1" in shown
    )


@pytest.mark.parametrize("seed", range(3))
def test_torn_sheets_end_in_an_answer_or_in_one_error(tmp_path, seed):
    random = np.random.default_rng(seed)
    for _ in range(25):
        lines = list(FORMS.values())[random.integers(len(FORMS))].splitlines()
        for _ in range(int(random.integers(1, 4))):
            k = int(random.integers(len(lines)))
            cut = int(random.integers(len(lines[k]) + 1))
            lines[k] = [
                lines[k][:cut],
                lines[k][cut:],
                lines[k].replace("1", "9" * 40),
                lines[k].replace(";", ","),
                lines[k] + " %",
            ][random.integers(5)]
        try:
            sheet = read(tmp_path, "\n".join(lines))
            if sheet is not None:
                settled(sheet, frozenset())
        except DataRefused as refused:
            assert refused.step and refused.limit and refused.remedy


PLAIN = (
    "P_N: 2.2 kW\nU_N: 400 V\nf_N: 50 Hz\nn_N: 1430 1/min\nI_N: 4.8 A\nM_K/M_N: 2.9\neta: 84.3 %\nconnection: star\n"
)


@pytest.mark.parametrize(
    "line", ["cos phi 50/75/100 %: 0.63/0.75/0.81", "cos phi: 0.63/0.75/0.81", "cos phi (50/75/100 %): 0,63 / 0,75 / 0,81",
             "cos phi: 0.81 0.75 0.63", "cos phi 100/75/50: 81/75/63 %", "cos phi 2/4, 3/4, 4/4: 0.63 - 0.75 - 0.81",
             "cos phi 25/50/75/100 %: 0.40/0.63/0.75/0.81", "Leistungsfaktor 50/75/100 %;0,63;0,75;0,81"],
)  # fmt: skip
def test_three_power_factors_of_one_cell_belong_to_their_loads(tmp_path, line):
    sheet = read(tmp_path, PLAIN + line + "\n")
    found = [sheet.values[f"power_factor{at}"].value for at in ("", "_75", "_50")]
    assert found == pytest.approx([0.81, 0.75, 0.63])
    is_said = "/4" in line or "100" in line
    assert any("% load" in remark for remark in sheet.remarks) != is_said


@pytest.mark.parametrize(
    "line", ["cos phi 100/75/50: 0.81/0.75", "cos phi 100/75/50 %: 0.81", "eta 100/75 %: 84/84/82"]
)
def test_fewer_values_than_loads_are_refused(tmp_path, line):
    with pytest.raises(DataRefused, match=r"names . loads"):
        read(tmp_path, PLAIN + line + "\n")


@pytest.mark.parametrize(
    "line", ["GD²: 0.032 kgm²", "GD2: 0.032 kgfm2", "GD2 (kgf m²): 0.032", "Schwungmoment GD²;0,032;kp·m²", "PD2: 320 kg cm2",
             "Flywheel effect: 0.032 kg m2", "Schwungmoment: 0.032"],
)  # fmt: skip
def test_a_flywheel_effect_is_four_times_the_inertia_and_said(tmp_path, line):
    sheet = read(tmp_path, PLAIN + line + "\n")
    assert sheet.values["inertia_kg_m2"].value == pytest.approx(0.008)
    assert any("J = 0.008 kg m2" in remark for remark in sheet.remarks)
    assert read(tmp_path, PLAIN + line + "\nJ: 0.008 kgm2\n").values["inertia_kg_m2"].value == pytest.approx(0.008)
    with pytest.raises(DataRefused, match="is said twice"):
        read(tmp_path, PLAIN + line + "\nJ: 0.032 kgm2\n")


def test_pound_feet_squared_are_a_mass_times_a_radius_squared(tmp_path):
    for name in ("WK2", "Rotor inertia"):
        sheet = read(tmp_path, PLAIN + f"{name}: 0.19 lb ft²\n")
        assert sheet.values["inertia_kg_m2"].value == pytest.approx(0.19 * 0.45359237 * 0.3048**2, rel=1e-5)


@pytest.mark.parametrize(
    "line",
    [
        "R_UV at 68 °F: 3.1 Ohm",
        "R_UV: 3.1 Ohm @ 68 °F",
        "R_UV: 3.1 Ohm\nTemperature: 68 degF",
        "R_UV: 3.1 Ohm\nTemperature: 293.15 K",
    ],
)
def test_a_temperature_has_its_zero(tmp_path, line):
    sheet = read(tmp_path, PLAIN + line + "\n")
    assert sheet.values["winding_temperature_c"].value == pytest.approx(20.0)
    assert sheet.values["winding_resistance_uv_ohm"].value == pytest.approx(3.1)
