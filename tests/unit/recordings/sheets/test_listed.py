"""Lists with columns of their own for parameter, symbol, unit and value, in any order: a manufacturer's sheet, and a motor's tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from commissioner.errors import DataRefused
from commissioner.operations.recordings.identify import IdentifiedSheets, IdentifyRequest, identify_any
from commissioner.recordings.catalogue.reading import sheet_in
from commissioner.recordings.sheet_names import resistance_meaning, sheet_columns

Row = tuple[str, str, str, str]
PAGE: Sequence[Row] = (
    ("Rated power", "P_N", "kW", "11"), ("Rated voltage", "U_N", "V", "400"), ("Rated frequency", "f_N", "Hz", "50"),
    ("Rated speed", "n_N", "1/min", "1465"), ("Rated current", "I_N", "A", "21.5"), ("Power factor", "cos φ", "-", "0.81"),
    ("Efficiency", "η", "%", "91.4"), ("Locked rotor torque ratio", "M_A/M_N", "-", "2.3"),
    ("Starting current ratio", "I_A/I_N", "-", "7.4"), ("Breakdown torque ratio", "M_K/M_N", "-", "2.9"),
    ("Moment of inertia", "J", "kg m²", "0.044"), ("Rated torque", "T", "N m", "71.7"), ("Connection", "", "", "delta"),
    ("Weight", "m", "kg", "120"), ("No-load losses", "P", "W", "300"), ("Starting time", "t", "s", "1.2"),
)  # fmt: skip
VALUES = {
    "rated_power_w": 11000, "rated_voltage_v": 400, "rated_frequency_hz": 50, "rated_speed_rpm": 1465, "rated_current_a": 21.5,
    "power_factor": 0.81, "efficiency": 0.914, "starting_torque_ratio": 2.3, "starting_current_ratio": 7.4, "breakdown_torque_ratio": 2.9,
    "inertia_kg_m2": 0.044, "rated_torque_nm": 71.7,
}  # fmt: skip
HEAD: Row = ("Parameter", "Symbol", "Unit", "Value")
TESTS: Sequence[Row] = (
    ("DC voltage", "U_dc", "V", "13.6"), ("DC current", "I_dc", "A", "28.0"), ("No-load voltage", "U0", "V", "208"),
    ("No-load frequency", "f0", "Hz", "60"), ("No-load current", "I0", "A", "8.17"), ("No-load power", "P0", "kW", "0.42"),
    ("Locked-rotor voltage", "Uk", "V", "25"), ("Locked-rotor frequency", "fk", "Hz", "15"), ("Locked-rotor current", "Ik", "A", "27.9"),
    ("Locked-rotor power", "Pk", "W", "920"),
)  # fmt: skip
CIRCUIT = [0.24286, 0.15142, 3.4843e-3, 35.106e-3]
"""Of the textbook's three tests: see `test_test_sheets`."""


def lines(rows: Sequence[Row], order: Sequence[int], mark: str, head: Row | None = HEAD) -> str:
    return "".join(mark.join(row[k] for k in order) + "\n" for row in ([head] if head else []) + list(rows))


def write(tmp_path: Path, text: str, name: str = "sheet.csv") -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def circuit(path: Path) -> list[float]:
    found = identify_any(IdentifyRequest((path,)))
    assert isinstance(found, IdentifiedSheets)
    names = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
    return [found.document["parameters"][name]["value"] or 0.0 for name in names]


@pytest.mark.parametrize("mark", [";", ",", "\t", "|"])
@pytest.mark.parametrize("order", [(0, 1, 2, 3), (0, 1, 3, 2), (1, 0, 2, 3), (0, 2, 3), (0, 3, 2)])
@pytest.mark.parametrize("head", [HEAD, ("Größe", "Formelzeichen", "Einheit", "Wert"), None])
def test_a_page_in_columns_is_read_in_any_order(tmp_path, mark, order, head):
    if head is None and order[0] == 1:
        head = ("Grandeur", "Symbole", "Unité", "Valeur")
    sheet = sheet_in(write(tmp_path, lines(PAGE, order, mark, head)))
    assert sheet is not None and sheet.connection == "delta"
    assert {key: value.value for key, value in sheet.values.items()} == pytest.approx(VALUES)


def test_a_page_is_read_between_wide_spaces_and_drawn_lines(tmp_path):
    spaced = "".join(f"{name:32s}{symbol:10s}{value:>8s} {unit}\n" for name, symbol, unit, value in PAGE)
    drawn = "| Parameter | Unit | Value |\n|---|---|---|\n" + "".join(f"| {n} | {u} | {v} |\n" for n, _, u, v in PAGE)
    comma = (
        "".join(f"{n}, {u}: {v}\n" if u not in ("", "-") else f"{n}: {v}\n" for n, _, u, v in PAGE[:11])
        + "Connection: delta\n"
    )
    for text, missing in ((spaced, set()), (drawn, set()), (comma, {"rated_torque_nm"})):
        sheet = sheet_in(write(tmp_path, text, "sheet.txt"))
        assert sheet is not None
        assert {k: v.value for k, v in sheet.values.items()} == pytest.approx(
            {k: v for k, v in VALUES.items() if k not in missing}
        )


def test_a_decimal_comma_between_commas_is_whole_again_where_it_is_the_only_one(tmp_path):
    text = lines([(*row[:3], row[3].replace(".", ",")) for row in PAGE], (0, 1, 2, 3), ",")
    sheet = sheet_in(write(tmp_path, text))
    assert sheet is not None and sheet.get("rated_current_a") == 21.5 and sheet.get("inertia_kg_m2") == 0.044


def test_values_at_loads_stand_below_them_and_those_of_two_motors_are_refused(tmp_path):
    rest = "".join(
        f"{name};{unit};{value};;\n" for name, _, unit, value in PAGE if name not in ("Efficiency", "Power factor")
    )
    loads = "Parameter;Unit;100 %;75 %;50 %\nEfficiency;%;91.4;91.6;90.5\nPower factor;-;0.81;0.75;0.63\n" + rest
    sheet = sheet_in(write(tmp_path, loads))
    assert sheet is not None
    assert [sheet.get(f"efficiency{at}") for at in ("", "_75", "_50")] == pytest.approx([0.914, 0.916, 0.905])
    assert [sheet.get(f"power_factor{at}") for at in ("", "_75", "_50")] == pytest.approx([0.81, 0.75, 0.63])
    with pytest.raises(DataRefused, match="2 values of Rated power stand beside each other"):
        sheet_in(write(tmp_path, lines([(*r[:3], f"{r[3]};{r[3]}1") for r in PAGE], (0, 2, 3), ";", None)))


@pytest.mark.parametrize(
    ("said", "inertia"),
    [("J = GD²/4: 0.02 kg m²", 0.02), ("Inertia J (=GD²/4): 0.02 kg·m²", 0.02), ("Inertia GD2/4, kg m2: 0.02", 0.02),
     ("J: 0.02 kg·m2 (GD² = 0.08)", 0.02), ("GD²: 0.08 kgf·m²", 0.02), ("GD²/4 = 0.02 kg m²", 0.02)],
)  # fmt: skip
@pytest.mark.parametrize("mark", [";", ": "])
def test_an_inertia_beside_a_flywheel_effect_is_not_lost(tmp_path, said, inertia, mark):
    page = "".join(f"{name}{mark}{value} {unit.strip('-')}\n" for name, _, unit, value in PAGE[:10])
    sheet = sheet_in(write(tmp_path, page + said + "\n"))
    assert sheet is not None and sheet.get("inertia_kg_m2") == pytest.approx(inertia)


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (0, 1, 3, 2), (1, 2, 3), (0, 2, 3), (0, 3, 2)])
@pytest.mark.parametrize("mark", [";", ",", "\t"])
@pytest.mark.parametrize("head", [HEAD, None])
def test_a_motors_tests_are_read_in_columns(tmp_path, order, mark, head):
    text = "# connection: star\n# rated_frequency_hz: 60\n" + lines(TESTS, order, mark, head)
    assert circuit(write(tmp_path, text)) == pytest.approx(CIRCUIT, rel=1e-3)


@pytest.mark.parametrize(
    "text",
    [
        "Größe;Formelzeichen;Einheit;Messwert\nLeerlaufspannung;U_0;V;208\nLeerlauffrequenz;f_0;Hz;60\nLeerlaufstrom;I_0;A;8,17\n"
        "Leerlaufleistung;P_0;kW;0,42\nKurzschlussspannung;U_k;V;25\nKurzschlussfrequenz;f_k;Hz;15\nKurzschlussstrom;I_k;A;27,9\n"
        "Kurzschlussleistung;P_k;kW;0,92\nWicklungswiderstand;R_UV;mΩ;485,71\n",
        "Parameter;Symbol;Unit;Value\nDC test;;;\nVoltage;U;V;13.6\nCurrent;I;A;28.0\nNo-load test;;;\nVoltage;U;V;208\nFrequency;f;Hz;60\n"
        "Current;I;A;8.17\nPower;P;W;420\nLocked-rotor test;;;\nVoltage;U;V;25\nFrequency;f;Hz;15\nCurrent;I;A;27.9\nPower;P;W;920\n",
        "No-load test\nVoltage: 208 V\nFrequency: 60 Hz\nCurrent: 8.17 A\nPower: 420 W\n\nLocked rotor test\nVoltage: 25 V\nFrequency: 15 Hz\n"
        "Current: 27.9 A\nPower: 920 W\n\nWinding resistance R_uv: 0.48571 Ohm\n",
        "Parameter;No load;Locked rotor\nVoltage;208 V;25 V\nCurrent;8170 mA;27.9 A\nPower;0.42 kW;920 W\nFrequency;60 Hz;15 Hz\n"
        "Rs (between terminals);0.48571 Ohm;485.71 mOhm\n",
        "Quantity;Symbol;Unit;DC test;No-load test;Locked-rotor test\nFrequency;f;Hz;;60;15\nVoltage;U;V;13.6;208;25\nCurrent;I;A;28;8.17;27.9\n"
        "Power;P;W;;420;920\n",
    ],
)  # fmt: skip
def test_tests_are_told_by_words_symbols_titles_or_columns(tmp_path, text):
    assert circuit(write(tmp_path, "# connection: star\n# rated_frequency_hz: 60\n" + text)) == pytest.approx(
        CIRCUIT, rel=1e-3
    )


@pytest.mark.parametrize(
    ("name", "column"),
    [("Stator resistance Rs [Ohm]", "stator_resistance_ohm"), ("Winding resistance Rs", "winding_resistance_ohm"),
     ("Stator resistance R1 (ohm)", "stator_resistance_ohm"), ("Winding resistance R_UV [mOhm]", "winding_resistance_uv_ohm"),
     ("Resistance R1-2", "winding_resistance_uv_ohm"), ("Rs (between terminals)", "winding_resistance_line_ohm")],
)  # fmt: skip
def test_a_symbol_behind_the_words_of_a_resistance_makes_it_none_between_terminals_s(name, column):
    """`Stator resistance Rs` had been taken as between the terminals R and S: half of it."""
    assert resistance_meaning(name) == column


@pytest.mark.parametrize("cell", ["1,420", "1.420", "1.234,5"])
def test_thousands_beside_another_unit_are_not_guessed(tmp_path, cell):
    text = f"Parameter;No load;Locked rotor\nVoltage;208 V;25 V\nCurrent;8.17 A;27.9 A\nPower;{cell} W;0.92 kW\nFrequency;60 Hz;15 Hz\n"
    with pytest.raises(DataRefused):
        identify_any(IdentifyRequest((write(tmp_path, text + "R_uv;0.4857 Ohm;0.4857 Ohm\n"),)))


def test_terminals_r_and_s_are_told_by_the_other_pairs():
    columns = sheet_columns(["Resistance RS", "Resistance ST", "Resistance TR"])
    assert list(columns.values()) == [f"winding_resistance_{pair}_ohm" for pair in ("uv", "vw", "wu")]
