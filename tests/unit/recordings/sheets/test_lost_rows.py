"""Rows and columns that would be lost, or read as another's, with the values of those that are left."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.operations.recordings.identify import IdentifiedSheets, IdentifyRequest, identify_any
from commissioner.recordings.importers import contract_table, read_running

TESTS = "test,f (Hz),U (V),I (A),P (W)\ndc,0,13.6,28.0,\nno load,60,208,8.17,420\nlocked rotor,15,25,27.9,920\n"
TRUE = [0.2429, 0.1514, 3.484e-3, 35.11e-3]
NAMES = "Time,Ia,Ib,Ic,Vab,Vbc,Vca\n"


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "given.csv"
    path.write_text(text, encoding="utf-8")
    return path


def running(times: int = 64, **columns: float) -> str:
    """Rows of three currents and three line voltages; `columns`: more of the first current, times a factor."""
    t = np.arange(times) / 5000.0
    angles = [100 * np.pi * t - 2 * np.pi * k / 3 for k in range(3)]
    six = [*(7.0 * np.cos(a - 0.6) for a in angles), *(565.0 * np.cos(a + np.pi / 6) for a in angles)]
    more = [factor * six[0] for factor in columns.values()]
    rows = [",".join(f"{x:.6g}" for x in row) for row in zip(t, *six, *more, strict=True)]
    return "\n".join([",".join([*NAMES.strip().split(","), *columns]), *rows]) + "\n"


def test_a_test_named_once_for_its_points_loses_none(tmp_path: Path) -> None:
    text = "Report\ntest,f,U,I,P\n,Hz,V,A,W\nno load,60,208,8.17,420\n,60,150,5.7,260\nlocked rotor,15,25,27.9,920\ndc,0,13.6,28,\n"
    table = contract_table(written(tmp_path, text))
    np.testing.assert_array_equal(table.columns["voltage_line_v"], [208, 150, 25, 13.6])
    np.testing.assert_array_equal(table.columns["test"], [1, np.nan, 2, 0])


def test_a_plate_beside_the_rows_loses_none(tmp_path: Path) -> None:
    lines = TESTS.splitlines()
    beside = [",,Rated power,5.5,kW", ",,Rated voltage,208,V", ",,Rated current,27.9,A", ",,,,"]
    table = contract_table(written(tmp_path, "\n".join(a + b for a, b in zip(lines, beside, strict=True)) + "\n"))
    np.testing.assert_array_equal(table.columns["frequency_hz"], [0, 60, 15])


def test_a_first_row_that_is_too_short_is_refused(tmp_path: Path) -> None:
    text = TESTS.replace("P (W)", "P (W),T (degC)").replace("420", "420,25").replace("920", "920,25")
    with pytest.raises(DataRefused, match="a row holds 5 columns"):
        contract_table(written(tmp_path, text))


@pytest.mark.parametrize("title", ["DC test\nU (V),I (A)\n13.6,28\n", "U (V),I (A),f (Hz),P (W)\n13.6,28,0,0\n"])
def test_tables_one_below_the_other_are_refused_by_their_rows(tmp_path: Path, title: str) -> None:
    """Frequency 13.6 Hz and 28 V were read of the direct-current test, under the names of the first table."""
    text = "No-load test\nf (Hz),U (V),I (A),P (W)\n60,208,8.17,420\n\n" + title
    with pytest.raises(DataRefused, match=r"as 60, 208, 8\.17, 420") as refused:
        contract_table(written(tmp_path, text))
    assert "a column `test`" in refused.value.remedy


@pytest.mark.parametrize("named", ["rated", "Full load", "Nennlast", "charge nominale", "Belastungsversuch", "plate"])
def test_a_row_of_a_load_is_no_locked_rotor(tmp_path: Path, named: str) -> None:
    """R_R was 21 % too large, extrapolated over frequency from a rated row taken as a locked rotor."""
    done = identify_any(IdentifyRequest((written(tmp_path, f"{TESTS}{named},60,208,27.9,8200\n"),)))
    assert isinstance(done, IdentifiedSheets)
    found = [q["value"] for q in done.document["parameters"].values()]
    assert found[:4] == pytest.approx(TRUE, rel=1e-3)
    assert any("1 rows of a loaded motor or of another name" in remark for remark in done.document["remarks"])


def test_two_columns_of_one_current_that_differ_are_asked_for(tmp_path: Path) -> None:
    """The mains' currents were taken for the motor's, which stood behind them."""
    with pytest.raises(
        DataRefused, match=r"Ia \(column 2\) and Motor current A \(column 8\) both mean current_u_a"
    ) as refused:
        read_running(written(tmp_path, running(**{"Motor current A": 1.3})))
    assert refused.value.value == "0.3 of the largest value"
    seen = read_running(written(tmp_path, running(**{"Motor current A": 1.01})))
    assert {note.code for note in seen.notes} >= {"second_column"}


@pytest.mark.parametrize("cell", ["9.91E+37", "-9.9e37", "+9.90000000E+037"])
def test_what_instruments_print_for_no_reading_is_none(tmp_path: Path, cell: str) -> None:
    lines = running().splitlines()
    lines[30] = ",".join([lines[30].split(",")[0], cell, *lines[30].split(",")[2:]])
    table = contract_table(written(tmp_path, "\n".join(lines) + "\n"))
    assert np.flatnonzero(~np.isfinite(table.columns["current_u_a"])).tolist() == [29]


def test_a_row_of_units_that_begins_with_a_multiple_is_not_lost(tmp_path: Path) -> None:
    text = running().replace(NAMES, NAMES + "100 ns,mA,mA,mA,V,V,V\n")
    with pytest.raises(DataRefused, match="100 ns of Time is none that is known"):
        read_running(written(tmp_path, text))


@pytest.mark.parametrize(("scale", "is_time"), [(1.0, True), (5000.0, False)])
def test_an_index_without_a_name_is_the_time_unless_it_counts(tmp_path: Path, scale: float, is_time: bool) -> None:
    rows = [line.split(",") for line in running().splitlines()[1:]]
    lines = [NAMES.strip().replace("Time", ""), *(",".join([f"{scale * float(r[0]):.4f}", *r[1:]]) for r in rows)]
    path = written(tmp_path, "\n".join(lines) + "\n")
    if is_time:
        seen = read_running(path)
        assert seen.sample_period_s == pytest.approx(2e-4) and "index" in {note.code for note in seen.notes}
    else:
        with pytest.raises(DataRefused, match="lacks time"):
            read_running(path)


@pytest.mark.parametrize("named", ["100 %", "S1", "Punkt 7", "mean"])
def test_a_row_of_another_name_is_neither_test_beside_both(tmp_path: Path, named: str) -> None:
    done = identify_any(
        IdentifyRequest((written(tmp_path, f"{TESTS}{named},60,208,27.9,8200\nno load warm,60,208,8.17,420\n"),))
    )
    assert isinstance(done, IdentifiedSheets)
    found = [q["value"] for q in done.document["parameters"].values()]
    assert found[:4] == pytest.approx(TRUE, rel=1e-3)
    assert any("1 rows of a loaded motor or of another name" in remark for remark in done.document["remarks"])


@pytest.mark.parametrize(("column", "others"), [("Motor", ("M1", "M2")), ("Serial no.", ("4711", "4712"))])
def test_rows_of_two_motors_are_not_taken_together(tmp_path: Path, column: str, others: tuple[str, str]) -> None:
    """R_s of the two was averaged."""
    head, *rows = TESTS.splitlines()
    lines = [f"{column},{head}", *(f"{motor},{row}" for motor in others for row in rows)]
    with pytest.raises(DataRefused, match="its rows are of 2 motors") as refused:
        contract_table(written(tmp_path, "\n".join(lines) + "\n"))
    assert refused.value.value == ", ".join(others)
    one = "\n".join([lines[0], *lines[1:4]]) + "\n"
    np.testing.assert_array_equal(contract_table(written(tmp_path, one)).columns["test"], [0, 1, 2])


def test_a_row_without_a_name_is_no_locked_rotor_by_its_inductance(tmp_path: Path) -> None:
    done = identify_any(IdentifyRequest((written(tmp_path, f"{TESTS},60,208,27.9,8200\n,15,20,22.32,588.8\n"),)))
    assert isinstance(done, IdentifiedSheets)
    found = [q["value"] for q in done.document["parameters"].values()]
    assert found[:4] == pytest.approx(TRUE, rel=1e-3) and done.document["rows"]["locked rotor"] == 2
    assert "1 points of a loaded motor were not used." in done.document["remarks"]
