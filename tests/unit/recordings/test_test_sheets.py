"""Test sheets as people write them: names, units, decimal commas, the test's name in a column of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose
from commissioner.operations.recordings.identify import IdentifiedSheets, IdentifyRequest, identify_any
from commissioner.recordings.importers import contract_table
from commissioner.recordings.sheet_names import resistance_meaning
from commissioner.recordings.table import read_table

SHEETS = {
    "contract": "test,frequency_hz,voltage_line_v,current_line_a,power_w\ndc,0,13.6,28.0,380.8\nno_load,60,208,8.17,420\n"
    "locked_rotor,15,25,27.9,920\n",
    "units": "Test type,Line voltage (V),Line current (A),Input power (W),Frequency (Hz)\nBlocked rotor,25,27.9,920,15\n"
    "No load,208,8.17,420,60\nDC,13.6,28.0,,0\n",
    "german": "Versuch;f [Hz];U [V];I [A];P [kW]\nGleichstrom;;13,6;28,0;\nLeerlauf;60;208;8,17;0,42\nKurzschluss;15;25;27,9;0,92\n",
    "french": "Essai;Fréquence (Hz);Tension (V);Courant (A);Puissance (W)\nCourant continu;0;13,6;28,0;380,8\n"
    "À vide;60;208;8,17;420\nRotor bloqué;15;25;27,9;920\n",
    "a meter in every line": "test,f (Hz),V_ab (V),V_bc (V),V_ca (V),I_a (A),I_b (A),I_c (A),W1 (W),W2 (W)\ndc,0,13.6,,,28,,,,\n"
    "no_load,60,208,208,208,8.17,8.17,8.17,1051,-631\nlocked_rotor,15,25,25,25,27.9,27.9,27.9,694,226\n",
    "transposed": "Quantity,DC,No-load,Locked rotor\nf [Hz],0,60,15\nU [V],13.6,208,25\nI [A],28.0,8.17,27.9\nP [W],380.8,420,920\n",
    "transposed with units apart": "Prüfer;Müller\nGröße;Einheit;Gleichstrom;Leerlauf;Kurzschluss\nU;V;13,6;208;25\nI;A;28,0;8,17;27,9\n"
    "P;kW;;0,42;0,92\nf;Hz;0;60;15\n",
    "lists": "U0 [V];I0 [A];P0 [kW];f0 [Hz];Uk [V];Ik [A];Pk [W];fk [Hz];R_UV [Ohm]\n208;8,17;0,42;60;25;27,9;920;15;0,4857\n",
    "a list of lines": "U_0: 208 V\nI_0: 8.17 A\nP_0: 420 W\nf_0: 60 Hz\nU_k: 25 V\nI_k: 27.9 A\nP_k: 0.92 kW\nf_k: 15 Hz\nR_UV: 485.7 mOhm\n",
    "lists between spaces": "# R_UV (mOhm): 485.7\nV0 I0 P0 f0 Vcc Icc Pcc fcc\n208 8.17 420 60 25 27.9 920 15\n",
    "short": "test,voltage_v,current_a,power_kw,frequency_hz,winding_resistance_uv_ohm\nno-load,208,8.17,0.42,60,0.4857\n"
    "locked,25,27.9,0.92,15,0.4857\n",
}


@pytest.mark.parametrize("name", SHEETS)
def test_a_sheet_gives_its_circuit_under_anybodys_headers(tmp_path: Path, name: str) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(SHEETS[name], encoding="utf-8")
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    assert done.document["outcome"] == "identified" and "no-load" in done.document["reason"]
    found = [q["value"] for q in done.document["parameters"].values()]
    assert found[:4] == pytest.approx([0.2429, 0.1514, 3.484e-3, 35.11e-3], rel=1e-3)
    assert all(q["std"] is None for q in done.document["parameters"].values())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("U;400\nI;4,8\nP;2200\n", None),  # may be a plate
        ("t,U0,I0,I1\n0,1,2,3\n1,1,2,3\n2,1,2,3\n", None),
        ("U0,I0,U1,I1,P0\n1,2,3,4,5\n1,2,3,4,6\n", None),  # phases counted from zero
        ("U0,I0,P0\n400,2.1,180\n300,1.5,120\n200,1.1,90\n", "U0, I0, P0: the no load test"),
        ("f;50;50;50\nU;400;300;110\nI;2,1;1,5;5,0\nP;180;120;420\n", "quantities stand down the rows"),
    ],
)
def test_a_list_is_taken_for_tests_where_its_names_are_certain(tmp_path: Path, text: str, says: str | None) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(text, encoding="utf-8")
    try:
        table = contract_table(path)
    except DataRefused:
        assert says is None
        return
    found = [note.what for note in table.notes if note.code in ("upright", "indexed_tests")]
    assert bool(found) == (says is not None) and (says is None or says in found[0])
    if says:
        assert table.columns["voltage_line_v"].size == 3 and table.columns["power_w"].tolist()[0] == 180.0


def test_one_frequency_may_stand_above_a_list(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text("# f: 60 Hz\nU0,I0,P0\n208,8.17,420\n180,6,330\n", encoding="utf-8")
    assert contract_table(path).columns["frequency_hz"].tolist() == [60.0, 60.0]


def test_each_test_may_stand_in_a_file_of_its_own(tmp_path: Path) -> None:
    head, *rows = SHEETS["contract"].splitlines()
    paths = tuple(tmp_path / f"{k}.csv" for k in range(len(rows)))
    for path, row in zip(paths, rows, strict=True):
        path.write_text(f"# connection: star\n{head}\n{row}\n", encoding="utf-8")
    done = identify_any(IdentifyRequest(paths))
    assert isinstance(done, IdentifiedSheets)
    assert done.document["parameters"]["rotor_resistance_ohm"]["value"] == pytest.approx(0.1514, rel=1e-3)


def test_a_diagnosis_of_three_tests_says_that_nothing_is_left_over(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(SHEETS["contract"], encoding="utf-8")
    done = diagnose(DiagnoseRequest((path,), out=tmp_path / "out"))
    assert done.document["causes"] == [] and "leave nothing over" in done.document["reason"]
    assert np.isclose(done.document["parameters_after"]["rotor_resistance_ohm"]["value"] or 0.0, 0.1514, rtol=1e-3)
    page = (tmp_path / "out" / "report_sheet.html").read_text(encoding="utf-8")
    assert "three tests" in page and "0.2429" in page


@pytest.mark.parametrize(
    ("head", "row", "lacks"),
    [
        ("f,U,I,W1", "50,400,3,900", "power_w"),
        ("f [Hz],U [V],I [A],S [VA]", "50,400,3,2078", "power_w"),
        ("U [V],I [A],cos phi", "50,3,0.2", "power_w"),
        ("f,U1,U2,U3,I,P", "50,231,231,231,3,400", "voltage_line_v"),
        ("Frecuencia (Hz),Tensión (V),Corriente (A)", "50,231,3", "power_w"),
    ],
)
@pytest.mark.parametrize("verb", [identify_any, diagnose])
def test_a_sheet_that_lacks_a_column_is_told_which(tmp_path, verb, head, row, lacks):
    path = tmp_path / "sheet.csv"
    path.write_text(f"{head}\n{row}\n{row.replace('50', '25', 1)}\n")
    request = IdentifyRequest((path,)) if verb is identify_any else DiagnoseRequest((path,))
    with pytest.raises(DataRefused, match=f"looks like a test sheet and lacks {lacks}$") as refused:
        verb(request)
    assert "of two wattmeters" in refused.value.remedy


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (SHEETS["contract"].replace("no_load,60", "locked_rotor,60").replace("locked_rotor,15", "no_load,15"), "is called locked rotor and is no load"),
        (SHEETS["german"].replace("Leerlauf", "Kurzschluss"), "is called locked rotor and is no load by its inductance"),
        (SHEETS["units"].replace("Blocked rotor", "Leerlauf"), "is called no load and is locked rotor by its inductance"),
        (SHEETS["contract"].replace("dc,0", "dc,50"), "is called direct current and has a frequency of 50 Hz"),
        (SHEETS["contract"].replace("no_load,60", "no_load,0"), "frequency_hz is 0 in point 1"),
    ],
)  # fmt: skip
def test_a_row_that_is_not_what_the_sheet_calls_it_is_refused_by_name(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DataRefused, match=says) as refused:
        identify_any(IdentifyRequest((path,)))
    assert refused.value.value is not None and refused.value.limit and refused.value.remedy


def test_rows_whose_inductances_do_not_tell_them_apart_are_what_the_sheet_calls_them(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(
        "Versuch;f [Hz];U [V];I [A];P [W]\nGleichstrom;0;13,6;28,0;\nLeerlauf;60;208;20;420\nKurzschluss;15;50;27,9;920\n",
        encoding="utf-8",
    )
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    assert done.document["rows"] == {"direct current": 1, "no load": 1, "locked rotor": 1}


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("R_UV [Ohm]", "winding_resistance_uv_ohm"),
        ("R 1-2", "winding_resistance_uv_ohm"),
        ("Wicklungswiderstand V-W [Ω]", "winding_resistance_vw_ohm"),
        ("winding_resistance_wu_mohm", "winding_resistance_wu_ohm"),
        ("R_ac (mOhm)", "winding_resistance_wu_ohm"),
        ("R_U1V1/Ohm", "winding_resistance_uv_ohm"),
        ("Wicklungswiderstand V1-W1 [Ohm]", "winding_resistance_vw_ohm"),
        ("R(W1-U1) in Ω", "winding_resistance_wu_ohm"),
        ("R T1-T2 (Ohm)", "winding_resistance_uv_ohm"),
        ("R (U-V)", "winding_resistance_uv_ohm"),
        ("R_U1-U2 [Ohm]", "winding_resistance_phase_ohm"),
        ("R T1-T4 (Ohm)", None),
        ("R_U1W2 [Ohm]", None),
        ("R (20C)", None),
        ("Terminal resistance", "winding_resistance_line_ohm"),
        ("Klemmenwiderstand", "winding_resistance_line_ohm"),
        ("Strangwiderstand [Ohm]", "winding_resistance_phase_ohm"),
        ("Winding resistance per phase", "winding_resistance_phase_ohm"),
        ("Wicklungswiderstand", "winding_resistance_ohm"),
        ("Ständerwiderstand", "stator_resistance_ohm"),
        ("R_s/Ohm", "stator_resistance_ohm"),
        ("R_ph", "phase_resistance_ohm"),
        ("Résistance (ohm)", "resistance_ohm"),
        ("R_u1", None),
        ("RPM", None),
        ("R", None),
    ],
)
def test_a_winding_resistance_is_known_by_anybodys_name(name: str, column: str | None) -> None:
    assert resistance_meaning(name) == column


HEAD = "# connection: delta\ntest,f (Hz),U (V),I (A),P (W)"


@pytest.mark.parametrize(
    ("above", "name", "cell"),
    [
        ("", ",R_UV [Ohm]", ",0.4858"),
        ("", ",R_uv (mOhm)", ",485.8"),
        ("", ",winding_resistance_uv_mohm", ",485.8"),
        ("", ",Strangwiderstand [Ohm]", ",0.7287"),
        ("", ",R_UV,R_VW,R_WU", ",0.4758,0.4858,0.4958"),
        ("# R_uv (mOhm): 485.8\n", "", ""),
        ("# Wicklungswiderstand U-V: 0,4858 Ohm\n", "", ""),
        ("# winding_resistance_phase_ohm: 0.7287\n", "", ""),
    ],
)
def test_it_is_read_in_ohm_per_star_phase(tmp_path: Path, above: str, name: str, cell: str) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(f"{above}{HEAD}{name}\nno load,60,208,8.17,420{cell}\nlocked rotor,15,25,27.9,920{cell}\n", "utf-8")
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    assert done.document["parameters"]["stator_resistance_ohm"]["value"] == pytest.approx(0.2429)


@pytest.mark.parametrize("ohm", ["0", "0.9"])
def test_a_resistance_that_leaves_no_rotor_is_refused(tmp_path: Path, ohm: str) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(f"{HEAD},R_UV\nno load,60,208,8.17,420,{ohm}\nlocked rotor,15,25,27.9,920,{ohm}\n")
    with pytest.raises(
        DataRefused, match=r"winding_resistance_uv_ohm (does not fit the points|makes more copper loss)"
    ):
        identify_any(IdentifyRequest((path,)))


def test_a_decimal_comma_in_a_comment_is_no_whole_number(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(f"# rated_current_a: 4,86\n{HEAD}\nno load,60,208,8.17,420\nlocked rotor,15,25,27.9,920\n")
    with pytest.raises(DataRefused, match="rated_current_a is no positive number") as refused:
        identify_any(IdentifyRequest((path,)))
    assert refused.value.value == "4,86"


def test_pairs_of_terminals_that_differ_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    row = "0.4858,0.4858,0.7"
    path.write_text(f"{HEAD},R_UV,R_VW,R_WU\nno load,60,208,8.17,420,{row}\nlocked rotor,15,25,27.9,920,{row}\n")
    with pytest.raises(DataRefused, match="between the terminals differ"):
        identify_any(IdentifyRequest((path,)))


def test_a_resistance_that_is_not_understood_is_said_and_two_frequencies_are_not_called_one(tmp_path: Path) -> None:
    path = tmp_path / "locked.csv"
    rows = "".join(
        f"{f},{k * v},{k},{k * k * p},5\n" for f, v, p in ((50, 33.6, 38.5), (25, 26.0, 38.4)) for k in (1, 1.5, 2)
    )
    path.write_text(f"f (Hz),U (V),I (A),P (W),R_u1 (Ohm)\n{rows}")
    said = " ".join(diagnose(DiagnoseRequest((path,))).document["remarks"])
    assert "What is in R_u1 (Ohm) was not understood as a winding resistance" in said
    assert "25 ... 50 Hz tell the rotor at slip frequency only with the stator's resistance" in said
    assert "one frequency" not in said and "No winding resistance" not in said


def test_a_test_of_an_unknown_name_is_said_and_told_from_its_values(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(SHEETS["units"].replace("No load", "Zerlegeversuch"), encoding="utf-8")
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    assert any("no known test: Zerlegeversuch" in one.what for one in read_table(path).notes)
    assert done.document["parameters"]["magnetizing_inductance_h"]["value"] == pytest.approx(35.11e-3, rel=1e-3)


@pytest.mark.parametrize(
    "called", ["locked rotor, single-phase", "Kurzschluss einphasig", "blocked rotor (1~)", "à rotor bloqué monophasé"]
)
def test_a_single_phase_locked_rotor_is_the_three_phase_one_of_its_current(tmp_path: Path, called: str) -> None:
    """Between two terminals, the third open, lie two phases: V = 2 I Z, P = 2 I^2 R. It was taken for three phases: R_R -69 %."""
    single = f'"{called}",15,{25 * 2 / np.sqrt(3):.9g},27.9,{920 * 2 / 3:.9g}'
    path = tmp_path / "sheet.csv"
    path.write_text(SHEETS["contract"].replace("locked_rotor,15,25,27.9,920", single), encoding="utf-8")
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    found = [q["value"] for q in done.document["parameters"].values()]
    assert found[:4] == pytest.approx([0.2429, 0.1514, 3.484e-3, 35.11e-3], rel=1e-3)
    assert any("the third open" in remark for remark in done.document["remarks"])


def test_no_load_with_single_phase_current_is_no_test(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(SHEETS["contract"].replace("no_load", "no_load single phase"), encoding="utf-8")
    with pytest.raises(DataRefused, match="is called locked rotor and is no load by its inductance"):
        identify_any(IdentifyRequest((path,)))


WINDINGS = "{above}test,f (Hz),U (V),I (A),P (W),{names}\nno-load,60,208,8.17,420,{values}\nlocked,15,25,27.9,920,,,\n"


@pytest.mark.parametrize("connection", ["star", "delta"])
@pytest.mark.parametrize(
    "names", ["R_U (ohm),R_V (ohm),R_W (ohm)", "R L1 [Ω],R L2 [Ω],R L3 [Ω]", "Ra,Rb,Rc", "R_R_ohm,R_S_ohm,R_T_ohm"]
)
def test_of_three_windings_resistances_the_mean_is_taken(tmp_path: Path, names: str, connection: str) -> None:
    path, factor = tmp_path / "sheet.csv", 1.0 if connection == "star" else 3.0
    values = ",".join(f"{factor * ohm:.5f}" for ohm in (0.2416, 0.2429, 0.2442))
    path.write_text(
        WINDINGS.format(above=f"# connection: {connection}\n", names=names, values=values), encoding="utf-8"
    )
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    assert done.document["parameters"]["stator_resistance_ohm"]["value"] == pytest.approx(0.2429, rel=1e-4)


@pytest.mark.parametrize(
    ("above", "values", "match", "value"),
    [
        (
            "# connection: star\n",
            "0.24,0.243,0.246",
            "the windings' resistances differ",
            "winding_resistance_w_ohm 0.246",
        ),
        ("", "0.2416,0.2429,0.2442", "in star or in delta", "in delta: 0.08097 ohm"),
        ("", "0.2416,0.2429,0.2442", "in star or in delta", "in star: 0.2429 ohm"),
    ],
)
def test_three_windings_that_differ_or_are_not_told_are_refused(
    tmp_path: Path, above: str, values: str, match: str, value: str
) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(WINDINGS.format(above=above, names="R_U (ohm),R_V (ohm),R_W (ohm)", values=values))
    with pytest.raises(DataRefused, match=match) as refusal:
        identify_any(IdentifyRequest((path,)))
    assert value in str(refusal.value.value)


def test_three_windings_above_a_sheet_and_beside_a_recording_are_no_volts(tmp_path: Path) -> None:
    above = "# connection: star\n# R_U (mOhm): 241.6\n# R_V (mOhm): 242.9\n# R_W (mOhm): 244.2\n"
    path = tmp_path / "sheet.csv"
    path.write_text(
        above + "\n".join(SHEETS["short"].replace(",winding_resistance_uv_ohm", "").replace(",0.4857", "").splitlines())
    )
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    assert done.document["parameters"]["stator_resistance_ohm"]["value"] == pytest.approx(0.2429, rel=1e-4)
    path.write_text("t (s),I (A),R_U (ohm),R_V (ohm),R_W (ohm)\n" + "".join(f"{k},1,2,2,2\n" for k in range(5)))
    assert contract_table(path).columns["winding_resistance_v_ohm"][0] == 2.0


def test_a_resistance_that_is_not_understood_is_named(tmp_path: Path) -> None:
    path, sheet = tmp_path / "sheet.csv", SHEETS["short"].replace("winding_resistance_uv_ohm", "Odporność (ohm)")
    path.write_text("# Résistance mystère: 1.3 ohm\n" + sheet, encoding="utf-8")
    with pytest.raises(DataRefused, match="resistance is not given") as refusal:
        identify_any(IdentifyRequest((path,)))
    assert "Odporność (ohm)" in str(refusal.value.value) and "mystère" in str(refusal.value.value)


@pytest.mark.parametrize(
    ("name", "meaning"),
    [
        ("Résistance d'enroulement par phase [Ω]", "winding_resistance_phase_ohm"),
        ("Résistance de l’enroulement (mΩ)", "winding_resistance_ohm"),
        ("Résistance par enroulement", "winding_resistance_phase_ohm"),
        ("Résistance entre lignes", "winding_resistance_line_ohm"),
        ("Resistencia del devanado por fase (Ω)", "winding_resistance_phase_ohm"),
        ("Resistencia de los devanados", "winding_resistance_ohm"),
        ("Resistencia por fase", "phase_resistance_ohm"),
        ("Resistenza dell'avvolgimento per fase", "winding_resistance_phase_ohm"),
        ("Resistenza degli avvolgimenti", "winding_resistance_ohm"),
        ("Resistenza fra le fasi", "winding_resistance_line_ohm"),
        ("Resistência do enrolamento por fase", "winding_resistance_phase_ohm"),
        ("Resistência entre terminais", "winding_resistance_line_ohm"),
        ("Widerstand je Strang", "winding_resistance_phase_ohm"),
        ("R1 (Ohm)", "stator_resistance_ohm"),
    ],
)
def test_a_resistance_says_in_any_language_where_it_was_measured(name: str, meaning: str) -> None:
    assert resistance_meaning(name) == meaning


def in_one_table(named: bool, direct: bool, idle_volts: tuple[float, ...]) -> str:
    """Two cages, R_R 0.561 ohm at running slip: R_1 0.62 ohm, L_1 4 mH, L_m 110 mH, cages 1.9 ohm, 3.5 mH and 0.9 ohm, 9.5 mH; idle with
    35 W of friction, iron as the square of the voltage, 65 W at 400 V."""
    lines = []
    for hz in (50.0, 25.0, 12.5):
        w = 2j * np.pi * hz
        cages = 1.0 / (1.9 + w * 3.5e-3) + 1.0 / (0.9 + w * 9.5e-3)
        z = 0.62 + w * 4e-3 + 1.0 / (1.0 / (w * 0.11) + cages)
        lines += [
            ("locked rotor", hz, np.sqrt(3.0) * abs(z) * a, a, 3.0 * a**2 * z.real, 1.24) for a in (6.0, 10.0, 15.0)
        ]
    for volts in idle_volts:
        amps = volts / np.sqrt(3.0) / abs(0.62 + 2j * np.pi * 50.0 * 0.114)
        lines.append(("no load", 50.0, volts, amps, 3.0 * amps**2 * 0.62 + 35.0 + 65.0 * (volts / 400.0) ** 2, 1.24))
    rows = [",".join([row[0], *(f"{x:.7g}" for x in (row[1:5] if direct else row[1:]))]) for row in lines]
    head = "test,frequency_hz,voltage_line_v,current_line_a,power_w" + ("" if direct else ",winding_resistance_uv_ohm")
    rows += ["dc,0,12.4,10,"] if direct else []
    return "\n".join(row if named else row.partition(",")[2] for row in [head, *rows])


@pytest.mark.parametrize("direct", [True, False])
@pytest.mark.parametrize("named", [True, False])
def test_series_of_two_tests_in_one_table_are_each_judged(tmp_path: Path, named: bool, direct: bool) -> None:
    path = tmp_path / "type_test_no_load.csv"
    path.write_text(in_one_table(named, direct, (120.0, 200.0, 280.0, 340.0, 400.0, 430.0)), encoding="utf-8")
    document = diagnose(DiagnoseRequest((path,), out=tmp_path / "out")).document
    idle, locked = document["tables"].values()
    assert list(document["tables"]) == ["type_test_no_load_no_load.csv", "type_test_no_load_locked_rotor.csv"]
    assert [c["name"] for c in locked["causes"]] == ["rotor_skin_effect"]
    assert [c["name"] for c in idle["causes"]] == ["iron_loss"]
    found = locked["parameters_after"]["rotor_resistance_ohm"]
    assert abs((found["value"] or 0.0) - 0.5612) < 2.0 * (found["std"] or 0.0) < 0.12
    assert sorted(p.name for p in (tmp_path / "out").glob("*.html")) == [
        f"report_{name[:-4]}.html" for name in sorted(document["tables"])
    ]


def test_a_series_beside_a_few_points_of_another_test_is_judged_and_the_circuit_told(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    path.write_text(in_one_table(True, False, (200.0, 400.0)), encoding="utf-8")
    document = diagnose(DiagnoseRequest((path,))).document
    assert document["verdict"] == "explained" and [c["name"] for c in document["causes"]] == ["rotor_skin_effect"]
    assert (
        list(document["tables"]) == ["circuit", "sheet_locked_rotor.csv"]
        and "leave nothing over" not in document["reason"]
    )
    assert document["parameters_after"]["magnetizing_inductance_h"]["value"] == pytest.approx(0.11, rel=0.05)


def test_a_row_of_a_series_that_is_called_by_another_tests_name_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "sheet.csv"
    text = in_one_table(True, False, (120.0, 200.0, 280.0, 340.0, 400.0, 430.0))
    path.write_text(text.replace("no load,50,280", "locked rotor,50,280"), encoding="utf-8")
    with pytest.raises(
        DataRefused, match=r"280 V and 4\.51.* A is called locked rotor and is no load by its inductance"
    ):
        diagnose(DiagnoseRequest((path,)))


def test_the_leakage_of_a_motor_with_soft_iron_is_that_without_its_saturation(tmp_path: Path) -> None:
    """With the no-load inductance of rated voltage kept in a locked rotor's 5 Hz, where iron is far from it, L_sigma was 17 to 45 % off."""
    r_1, r_2, leak, main = 0.9, 0.8, 4e-3, 0.1
    rows = ["frequency_hz,voltage_line_v,current_line_a,power_w,winding_resistance_uv_ohm"]
    for hz in (50.0, 5.0):
        w = 2j * np.pi * hz
        z = r_1 + w * leak + 1.0 / (1.0 / (w * main) + 1.0 / (r_2 + w * leak))
        rows.append(f"{hz},{np.sqrt(3.0) * abs(z) * 8.0:.8g},8,{3.0 * 64.0 * z.real:.8g},1.8")
    for volts in (120.0, 400.0):
        z = r_1 + 2j * np.pi * 50.0 * (leak + main / (1.0 + 0.4 * (volts / 400.0) ** 6))
        amps = volts / np.sqrt(3.0) / z + 60.0 / (np.sqrt(3.0) * volts)
        rows.append(f"50,{volts},{abs(amps):.8g},{np.sqrt(3.0) * volts * amps.real:.8g},1.8")
    (path := tmp_path / "sheet.csv").write_text("\n".join(rows), encoding="utf-8")
    done = identify_any(IdentifyRequest((path,)))
    assert isinstance(done, IdentifiedSheets)
    found = done.document["parameters"]
    unsaturated = main**2 / (main + leak)
    assert found["leakage_inductance_h"]["value"] == pytest.approx(leak + main - unsaturated, rel=0.01)
    assert found["rotor_resistance_ohm"]["value"] == pytest.approx(r_2 * (unsaturated / main) ** 2, rel=0.01)
    assert found["magnetizing_inductance_h"]["value"] == pytest.approx(
        leak + main / 1.4 - (leak + main - unsaturated), rel=0.03
    )
    assert found["magnetizing_inductance_h"]["at_stator_flux_wb"] == pytest.approx(
        np.sqrt(2.0 / 3.0) * 400.0 / (100.0 * np.pi)
    )
    assert any("at 400 V and 50 Hz, a stator flux of 1.04 Wb" in remark for remark in done.document["remarks"])
