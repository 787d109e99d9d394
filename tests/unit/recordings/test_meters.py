"""Test sheets with phase volts or three meters in place of one, in several languages. Truth: the three tests of IEEE 112 in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose
from commissioner.operations.recordings.identify import IdentifiedSheets, IdentifyRequest, identify_any
from commissioner.recordings.imported import kind_of
from commissioner.recordings.importers import contract_table
from commissioner.recordings.names import meanings_of
from commissioner.recordings.sheet_names import sheet_columns

TRUTH = [0.2429, 0.1514, 3.484e-3, 35.11e-3]
"""208 V, 8.17 A, 420 W; 25 V, 27.9 A, 920 W at 15 Hz; 0.4857 ohm between terminals."""
IDLE, LOCKED = (208 / np.sqrt(3.0), 8.17, 420), (25 / np.sqrt(3.0), 27.9, 920)


def sheet(
    tmp_path: Path, head: str, *rows: str, above: str = "# R_uv (ohm): 0.4857\n", encoding: str = "utf-8"
) -> Path:
    path = tmp_path / "sheet.csv"
    path.write_text("\n".join([above + head, *rows]) + "\n", encoding=encoding)
    return path


def of_phase(separator: str = ",") -> list[str]:
    """No load and locked rotor with volts to the neutral."""
    rows = [("no load", 60, *IDLE), ("locked rotor", 15, *LOCKED)]
    return [separator.join(str(cell) for cell in row) for row in rows]


def identified(path: Path, motor: str | None = None) -> IdentifiedSheets:
    done = identify_any(IdentifyRequest((path,), motor=motor))
    assert isinstance(done, IdentifiedSheets)
    return done


def is_true(done: IdentifiedSheets) -> bool:
    return np.allclose([q["value"] for q in done.document["parameters"].values()][:4], TRUTH, rtol=1e-3)


@pytest.mark.parametrize(
    "volts",
    ["voltage_phase_v", "phase voltage", "U phase", "U (phase)", "Strangspannung [V]", "U_Str/V", "tension simple", "V_ph (V)", "voltage_neutral_v",
     "tensión de fase (V)", "tensione di fase [V]", "Sternspannung", "phase-to-neutral voltage", "U_LN", "V_an"],
)  # fmt: skip
def test_phase_volts_are_read_as_line_volts_and_it_is_said(tmp_path: Path, volts: str) -> None:
    done = identified(sheet(tmp_path, f"# connection: star\ntest,f (Hz),{volts},I (A),P (W)", *of_phase()))
    assert is_true(done)
    assert any("voltage_line_v is sqrt(3) times" in remark for remark in done.document["remarks"])


@pytest.mark.parametrize(
    ("volts", "amps"),
    [("V_ab,V_bc,V_ca", "I_a,I_b,I_c"), ("U12,U23,U31", "I1,I2,I3"), ("V_RY,V_YB,V_BR", "I_R,I_Y,I_B"),
     ("U_UV,U_VW,U_WU", "I_u [A],I_v [A],I_w [A]"), ("U_RS,U_ST,U_TR", "I_R,I_S,I_T"),
     ("R-Y voltage (V),Y-B voltage (V),B-R voltage (V)", "R phase current (A),Y phase current (A),B phase current (A)")],
)  # fmt: skip
def test_of_three_meters_the_mean_is_taken(tmp_path: Path, volts: str, amps: str) -> None:
    rows = ["no load,60,206,210,208,8.07,8.37,8.07,420", "locked rotor,15,24.8,25.2,25,27.8,28.1,27.8,920"]
    done = identified(sheet(tmp_path, f"test,f,{volts},{amps},P", *rows))
    assert is_true(done)
    assert sum("is the mean of" in remark for remark in done.document["remarks"]) == 2


@pytest.mark.parametrize(
    ("row", "says"),
    [
        ("no load,60,208,208,208,8.17,4.71,8.17,420", r"current_v_a is 4\.71 in row 1 and its neighbours are not"),
        ("no load,60,208,208,120,8.17,8.17,8.17,420", r"voltage_wu_v is 120 in row 1"),
        ("no load,60,208,208,208,8.17,8.17,0,420", r"current_w_a is 0 in row 1"),
        ("no load,60,208,208,208,8.17,8.17,,420", r"current_w_a holds no number in row 1"),
    ],
)
@pytest.mark.parametrize("verb", [identify_any, diagnose])
def test_a_meter_that_its_neighbours_contradict_is_named(tmp_path, row, says, verb):
    path = sheet(tmp_path, "test,f,U12,U23,U31,I1,I2,I3,P", row, "locked rotor,15,25,25,25,27.9,27.9,27.9,920")
    request = IdentifyRequest((path,)) if verb is identify_any else DiagnoseRequest((path,))
    with pytest.raises(DataRefused, match=says) as refused:
        verb(request)
    assert refused.value.limit and refused.value.remedy


@pytest.mark.parametrize(
    ("head", "above"),
    [
        ("voltage_phase_v,I", ""),
        ("voltage_phase_v,I", "# connection: delta\n"),
        ("U_Str,I", "# Conexión: triángulo\n"),
        ("U,I phase", ""),
        ("U,I phase", "# connection: delta\n"),
    ],
)
def test_what_phase_means_is_asked_where_no_star_is_said(tmp_path: Path, head: str, above: str) -> None:
    path = sheet(tmp_path, f"test,f,{head},P", *of_phase(), above=f"# R_uv (ohm): 0.4857\n{above}")
    with pytest.raises(DataRefused, match="may be of a winding or of a line"):
        identify_any(IdentifyRequest((path,)))


def test_volts_to_the_neutral_need_no_connection(tmp_path: Path) -> None:
    assert is_true(identified(sheet(tmp_path, "test,f,U_LN,I,P", *of_phase())))


def test_in_a_star_amperes_of_a_phase_are_those_of_a_line(tmp_path: Path) -> None:
    assert is_true(identified(sheet(tmp_path, "# connection: star\ntest,f,V phase,I phase,P", *of_phase())))


def test_direct_current_between_two_terminals_shows_in_two_of_three_meters(tmp_path: Path) -> None:
    rows = [
        "dc,0,13.6,,,28,-28,0,",
        "no load,60,208,208,208,8.17,8.17,8.17,420",
        "locked rotor,15,25,25,25,27.9,27.9,27.9,920",
    ]
    assert is_true(identified(sheet(tmp_path, "test,f,U12,U23,U31,I1,I2,I3,P", *rows, above="")))


@pytest.mark.parametrize(("told", "volts"), [("line_to_line", 13.6), ("star_equivalent", 6.8)])
def test_volts_of_direct_current_among_phase_volts_need_to_be_told(tmp_path: Path, told: str, volts: float) -> None:
    rows = [f"dc,0,{volts},28,", *of_phase()]
    with pytest.raises(DataRefused, match="volts of direct current stand among phase voltages"):
        identify_any(IdentifyRequest((sheet(tmp_path, "test,f,U_LN,I,P", *rows, above=""),)))
    assert is_true(identified(sheet(tmp_path, "test,f,U_LN,I,P", *rows, above=f"# resistance_measured: {told}\n")))


def test_volts_said_twice_must_agree(tmp_path: Path) -> None:
    rows = ["no load,60,208,208,8.17,420", "locked rotor,15,25,25,27.9,920"]
    with pytest.raises(DataRefused, match="voltage_line_v and voltage_phase_v contradict each other"):
        identify_any(IdentifyRequest((sheet(tmp_path, "test,f,U,U phase,I,P", *rows),)))


def test_points_of_a_locked_rotor_are_read_from_three_meters(tmp_path: Path) -> None:
    z = {50: (0.39, 0.34 * 50 / 15), 25: (0.39, 0.34 * 25 / 15)}
    rows = [
        f"{f},{i * abs(complex(*rx)):.6f},{i},{i},{i},{3 * i * i * rx[0]:.6f},0.4857"
        for f, rx in z.items()
        for i in (10, 15, 20)
    ]
    head = "f (Hz),U phase (V),I_R,I_Y,I_B,P (W),R_uv"
    document = diagnose(DiagnoseRequest((sheet(tmp_path, head, *rows, above="# connection: star\n"),))).document
    assert document["parameters_after"]["rotor_resistance_ohm"]["value"] == pytest.approx(0.39 - 0.2429, rel=0.05)
    assert any("is the mean of current_u_a, current_v_a, current_w_a" in said for said in document["remarks"])


ABROAD = {
    "spanish": ("Ensayo;Frecuencia (Hz);Tensión de línea (V);Corriente de línea (A);Potencia (W);Resistencia del estator R_uv (ohm)",
                "En vacío", "Rotor bloqueado"),
    "italian": ("Prova;Frequenza [Hz];Tensione concatenata [V];Corrente [A];Potenza assorbita [W];R_uv [ohm]", "Prova a vuoto", "Rotore bloccato"),
    "french": ("Essai;Fréquence (Hz);Tension composée (V);Intensité (A);Puissance absorbée (W);R_uv (ohm)", "Essai à vide", "Rotor bloqué"),
    "portuguese": ("Ensaio;Frequência (Hz);Tensão (V);Corrente (A);Potência (W);R_uv (ohm)", "Em vazio", "Rotor bloqueado"),
    "dutch": ("Proef;Frequentie (Hz);Spanning (V);Stroom (A);Vermogen (W);R_uv (ohm)", "Nullast", "Kortsluiting"),
    "german": ("Versuch;Frequenz in Hz;Leiterspannung in V;Leiterstrom in A;Leistung in W;R_uv in ohm", "Leerlaufversuch", "Kurzschlussversuch"),
}  # fmt: skip


@pytest.mark.parametrize("language", ABROAD)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_a_sheet_is_read_in_the_languages_of_its_neighbours(tmp_path: Path, language: str, encoding: str) -> None:
    head, idle, locked = ABROAD[language]
    head = head.replace("Resistencia del estator ", "")
    rows = [f"{idle};60;208;8,17;420;0,4857", f"{locked};15;25;27,9;920;0,4857"]
    assert is_true(identified(sheet(tmp_path, head, *rows, above="", encoding=encoding)))


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("Resistencia del estator (ohm)", "stator_resistance_ohm"),
        ("Resistenza statorica [Ω]", "stator_resistance_ohm"),
        ("Résistance entre bornes", "winding_resistance_line_ohm"),
        ("Résistance par phase", "phase_resistance_ohm"),
        ("Resistencia del devanado", "winding_resistance_ohm"),
        ("Resistenza tra morsetti U-V", "winding_resistance_uv_ohm"),
        ("Potencia activa (kW)", "power_w"),
        ("Velocità", None),
        ("Par (Nm)", None),
    ],
)
def test_a_sheets_names_abroad(name: str, column: str | None) -> None:
    assert sheet_columns([name]).get(name) == column


@pytest.mark.parametrize(
    ("names", "meant"),
    [
        (("R phase current", "Y phase current", "B phase current"), "uvw"),
        (("Phase R current (A)", "Phase Y current (A)", "Phase B current (A)"), "uvw"),
        (("I_R", "I_B"), "uw"),
        (("R-N voltage", "Y-N voltage", "B-N voltage"), "uvw"),
        (("Line voltage RY", "Line voltage YB", "Line voltage BR"), "uvw"),
        (("Red phase current", "Yellow phase current", "Blue phase current"), "uvw"),
        (("Sternspannung L1", "Sternspannung L2", "Tensione stellata L3"), "uvw"),
        (("Corriente en la fase U", "Corrente nella fase V"), "uv"),
        (("Ia", "Ib", "Ir"), "uvu"),
        (("i_x", "i_y"), ""),
        (("Corriente fase R", "Corriente fase S", "Corriente fase T"), "uvw"),
        (("Corrente L1", "Corrente L2", "Corrente L3"), "uvw"),
    ],
)
def test_what_a_letter_is_follows_from_its_company(names: tuple[str, ...], meant: str) -> None:
    assert [column[8] for column in meanings_of(names).values()] == list(meant)


@pytest.mark.parametrize(("head", "kind"), [("f,U phase,I1,I2,I3,P", "points"), ("f,U1,U2,U3,I1,I2,I3,P", "running")])
def test_import_says_what_a_sheet_is(tmp_path: Path, head: str, kind: str) -> None:
    row = ",".join(["60", *["120"] * (head.count("U")), "8", "8", "8", "420"])
    path = sheet(tmp_path, head, row, row.replace("60", "15", 1), above="")
    assert kind_of(contract_table(path)) == kind


def test_a_nameplate_in_place_of_a_recording_is_told_where_it_belongs(tmp_path: Path) -> None:
    path = tmp_path / "motor.toml"
    path.write_text("rated_power_w = 2200.0\nrated_voltage_v = 400.0\n")
    with pytest.raises(DataRefused, match="this is a TOML file, which is not read") as refused:
        identify_any(IdentifyRequest((path,)))
    assert "--motor" in refused.value.remedy


def two_wattmeters(volts: float, amperes: float, watts: float) -> tuple[float, float]:
    """What two wattmeters show: P1,2 = P/2 +- Q / (2 sqrt(3))."""
    reactive = np.sqrt(3.0 * (volts * amperes) ** 2 - watts**2)
    return (watts + reactive / np.sqrt(3.0)) / 2.0, (watts - reactive / np.sqrt(3.0)) / 2.0


def wattmeter_rows(sign: float = 1.0, unit: float = 1.0) -> list[str]:
    rows = [
        ("no load", 60, 208, 8.17, *two_wattmeters(208, 8.17, 420)),
        ("locked rotor", 15, 25, 27.9, *two_wattmeters(25, 27.9, 920)),
    ]
    return [
        f"{test},{f},{v},{i},{w1 * unit:.6g},{(w2 if w2 > 0 else sign * w2) * unit:.6g}"
        for test, f, v, i, w1, w2 in rows
    ]


@pytest.mark.parametrize(
    ("watts", "unit"),
    [("W1,W2", 1.0), ("P1 [W],P2 [W]", 1.0), ("P_1 (kW),P_2 (kW)", 1e-3), ("power_1_w,power_2_w", 1.0), ("Wattmeter 1 (W),Wattmeter 2 (W)", 1.0),
     ("P_a (W),P_c (W)", 1.0)],
)  # fmt: skip
def test_two_wattmeters_are_added(tmp_path: Path, watts: str, unit: float) -> None:
    done = identified(sheet(tmp_path, f"test,f (Hz),V (V),I (A),{watts}", *wattmeter_rows(unit=unit)))
    assert is_true(done)
    assert any("power_w is the sum of" in remark for remark in done.document["remarks"])


def test_a_wattmeter_that_was_read_backward_is_named(tmp_path: Path) -> None:
    """At no load the power factor is 0.14: the second one deflects backward, and without its sign the loss would be several times as high."""
    with pytest.raises(
        DataRefused, match=r"power_2_w is 63[01]\..* W in row 1, and the apparent power wants the other sign"
    ):
        identified(sheet(tmp_path, "test,f (Hz),V (V),I (A),W1,W2", *wattmeter_rows(-1.0)))


def test_three_wattmeters_are_added_and_one_alone_is_asked_about(tmp_path: Path) -> None:
    rows = ["no load,60,208,8.17,150,140,130", "locked rotor,15,25,27.9,306,307,307"]
    assert is_true(identified(sheet(tmp_path, "test,f (Hz),V (V),I (A),P_R (W),P_S (W),P_T (W)", *rows)))
    with pytest.raises(DataRefused, match="one wattmeter's alone"):
        identified(
            sheet(
                tmp_path,
                "test,frequency_hz,voltage_line_v,current_line_a,power_1_w",
                "no load,60,208,8.17,150",
                "locked rotor,15,25,27.9,306",
            )
        )


@pytest.mark.parametrize(
    "names",
    [
        ("Frequenz f [Hz]", "Spannung U [V]", "Strom I [A]", "Leistung P [W]"),
        ("Frequency f (Hz)", "Voltage V (V)", "Current I (A)", "Power P (W)"),
        ("Fréquence f [Hz]", "Tension U [V]", "Courant I [A]", "Puissance P [W]"),
    ],
)
def test_a_quantity_with_its_own_symbol_is_no_phase(names):
    """`Spannung U` of a test sheet was phase u's: sqrt(3) too many volts, beside `I` and `P`; `Strom I` was nothing."""
    assert list(sheet_columns(names).values()) == ["frequency_hz", "voltage_line_v", "current_line_a", "power_w"]


def test_beside_another_phase_it_is_one():
    assert sheet_columns(["f [Hz]", "Spannung U [V]", "Spannung V [V]", "Spannung W [V]", "I", "P"]) == {
        "f [Hz]": "frequency_hz", "I": "current_line_a", "P": "power_w",
    }  # fmt: skip
