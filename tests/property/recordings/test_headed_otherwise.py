"""One recording under other headers, stamps and marks: the same numbers, or a refusal that names its cause; never other numbers."""

import numpy as np
import openpyxl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat

from commissioner.errors import DataRefused
from commissioner.recordings.importers import contract_table
from tests.property.recordings.test_stored_otherwise import (
    HEAD,
    MEANT,
    ROWS,
    SIGNALS,
    STEP,
    TABLE,
    TIME,
    assert_same,
    tdms,
)
from tests.unit.recordings.test_workbook import workbook

CURRENTS, VOLTS = [MEANT[n] for n in SIGNALS[:3]], [MEANT[n] for n in SIGNALS[3:]]
MILLI = [TIME, *(1e3 * i for i in CURRENTS), *VOLTS]
NAMES, UNITS = ["Time", "Ia", "Ib", "Ic", "Va", "Vb", "Vc"], ["s", "mA", "mA", "mA", "V", "V", "V"]
GROUPS = ["Time", "Current", "", "", "Voltage", "", ""]


def written(path, rows, columns, mark=","):
    cells = zip(*([c if isinstance(c, str) else f"{c:.6f}" for c in column] for column in columns), strict=True)
    path.write_text("\n".join(mark.join(row) for row in [*rows, *cells]) + "\n", encoding="utf-8")
    return path


OVER = {
    "channels below": [NAMES, ["", *(f"CH{k}" for k in range(1, 7))], UNITS],
    "types below": [NAMES, UNITS, ["REAL"] * 7],
    "ranges below": [NAMES, UNITS, ["Max", *["9"] * 6], ["Min", *["-9"] * 6]],
    "groups": [GROUPS, ["", "U", "V", "W", "U", "V", "W"], UNITS],
    "groups repeated": [[*GROUPS[:2], "Current", "Current", *["Voltage"] * 3], ["", "L1", "L2", "L3", "L1", "L2", "L3"], UNITS],
    "units of the groups": [["Time", "Current [mA]", "", "", "Voltage [V]", "", ""], ["s", "A", "B", "C", "A", "B", "C"]],
    "units behind their key": [["Units: s", *UNITS[1:]], NAMES],
    "units in a comment": [["# units: s", *UNITS[1:]], NAMES],
}  # fmt: skip


@pytest.mark.parametrize("rows", OVER.values(), ids=OVER)
def test_names_and_units_among_other_rows(tmp_path, rows):
    """Units behind their key were passed over: a thousand times the current."""
    assert_same(written(tmp_path / "a.csv", rows, MILLI))


def test_a_scale_between_names_and_numbers_is_still_said(tmp_path):
    rows = [NAMES, ["s", *"AAAVVV"], ["scale", *["10"] * 6]]
    path = written(tmp_path / "a.csv", rows, [TIME, *CURRENTS, *VOLTS])
    assert_same(path)
    assert any(note.code == "factors" for note in contract_table(path).notes)


def test_merged_cells_over_phases_in_a_workbook(tmp_path):
    book = openpyxl.Workbook()
    page = book.active
    for row in [[cell or None for cell in GROUPS], ["s", *"UVWUVW"], *TABLE[1:]]:
        page.append(row)
    page.merge_cells("B1:D1")
    page.merge_cells("E1:G1")
    book.save(tmp_path / "a.xlsx")
    book.save(tmp_path / "a.xlsm")
    assert_same(tmp_path / "a.xlsx")
    assert_same(tmp_path / "a.xlsm")


def test_a_function_of_time_has_no_unit_t(tmp_path):
    assert_same(
        written(tmp_path / "a.csv", [["t (s)", *(f"{n.lower()}(t)" for n in NAMES[1:])]], [TIME, *CURRENTS, *VOLTS])
    )


def clock(seconds, form):
    hours, minutes = int(seconds // 3600) % 24, int(seconds % 3600 // 60)
    return form.format(
        h=hours, h12=(hours - 1) % 12 + 1, half="AM" if hours < 12 else "PM", m=minutes, s=round(seconds % 60, 4)
    )


@pytest.mark.parametrize(
    ("form", "begin"),
    [
        ("{m:02d}:{s:07.4f}", 59.998),
        ("{h12}:{m:02d}:{s:07.4f} {half}", 43199.998),
        ("5/13/2026 {h12}:{m:02d}:{s:07.4f} {half}", 43199.998),
        ("{h12}:{m:02d}:{s:07.4f} {half}", 86399.998),
    ],
)
def test_times_of_day_as_spreadsheets_write_them(tmp_path, form, begin):
    assert_same(
        written(tmp_path / "a.csv", [["Time", *HEAD[1:]]], [[clock(begin + t, form) for t in TIME], *CURRENTS, *VOLTS])
    )


def test_the_month_comes_first_beside_am_and_pm(tmp_path):
    stamps = [
        f"5/{4 + (t >= 0.002 - 1e-9)}/2026 {clock(86399.998 + t, '{h12}:{m:02d}:{s:07.4f} {half}')}" for t in TIME
    ]
    assert_same(written(tmp_path / "a.csv", [["Time", *HEAD[1:]]], [stamps, *CURRENTS, *VOLTS]))


@pytest.mark.parametrize("per_second", [1e3, 1e6, 1e9])
@pytest.mark.parametrize("ending", ["csv", "parquet", "mat"])
def test_stamps_since_1970_without_a_unit_are_no_seconds(tmp_path, per_second, ending):
    whole = 1_777_000_000 * int(per_second)
    stamps, path = whole + np.round(TIME * per_second, 1), tmp_path / f"a.{ending}"
    if ending == "csv":
        written(path, [["timestamp", *HEAD[1:]]], [stamps, *CURRENTS, *VOLTS])
    elif ending == "mat":
        savemat(path, {"timestamp": stamps, **{n: MEANT[n] for n in SIGNALS}})
    else:
        counts = pa.array([whole + round(t * per_second) for t in TIME]) if per_second > 1e3 else pa.array(stamps)
        pq.write_table(pa.table({"timestamp": counts, **{n: MEANT[n] for n in SIGNALS}}), path)
    assert_same(path, coarse=2e-3)
    assert any(note.code == "epoch" for note in contract_table(path).notes)


@pytest.mark.parametrize("stamp", ["10:11:12", ""])
def test_an_interval_beside_stamps_that_say_nothing_is_the_time(tmp_path, stamp):
    """The refusal's own remedy was refused: a period beside stamps of one second."""
    assert_same(
        written(
            tmp_path / "a.csv",
            [[f"# sample_period_s: {STEP}"], ["Time", *HEAD[1:]]],
            [[stamp] * ROWS, *CURRENTS, *VOLTS],
        )
    )


@pytest.mark.parametrize(("said", "mark"), [("fs: 5,000 Hz", "."), ("Abtastrate: 5.000 Hz", ",")])
def test_a_rate_that_may_be_thousands_is_not_taken(tmp_path, said, mark):
    """5 Hz was."""
    cells = [[f"{v:.4f}".replace(".", mark) for v in column] for column in [*CURRENTS, *VOLTS]]
    path = written(tmp_path / "a.csv", [[said], HEAD[1:]], cells, ";" if mark == "," else ",")
    assert "time_s" not in contract_table(path).columns


@pytest.mark.parametrize("form", ["csv", "xlsx"])
def test_whole_numbers_with_points_between_thousands_are_no_decimals(tmp_path, form):
    """`954`, `1.012` were read as 954 and 1.012."""
    grouped = [f"{round(v):,}".replace(",", ".") for v in 1e3 * CURRENTS[0]]
    columns = [
        [f"{round(1e6 * t)}" for t in TIME],
        grouped,
        *([f"{round(v)}" for v in 1e3 * c] for c in [*CURRENTS[1:], *VOLTS]),
    ]
    names = ["t [us]", "Ia [mA]", "Ib [mA]", "Ic [mA]", "Va [mV]", "Vb [mV]", "Vc [mV]"]
    if form == "csv":
        path = written(tmp_path / "a.csv", [names], columns, ";")
    else:
        rows = [[c if k == 1 else float(c) for k, c in enumerate(row)] for row in zip(*columns, strict=True)]
        path = workbook(tmp_path / "a.xlsx", Data=[names, *rows])
    with pytest.raises(DataRefused, match="may be thousands"):
        contract_table(path)


def test_formulas_whose_values_were_not_stored_are_said_to_be_that(tmp_path):
    """The rows of a time of formulas were left out as if they held none."""
    rows = [[f"=A{k + 1}+{STEP}" if k else 0.0, *row[1:]] for k, row in enumerate(TABLE[1:])]
    with pytest.raises(DataRefused, match="formulas whose values were not stored") as refused:
        contract_table(workbook(tmp_path / "a.xlsx", Data=[HEAD, *rows]))
    assert refused.value.value == f"{ROWS - 1} cells, {ROWS - 1} of them in the table"


STANDSTILL = {"time_s": TIME, "segment": np.arange(ROWS) // 20, "axis_deg": np.zeros(ROWS), "voltage_axis_v": VOLTS[0],
              "current_u_a": CURRENTS[0], "current_v_a": CURRENTS[1]}  # fmt: skip


@pytest.mark.parametrize("is_dictionary", [False, True])
def test_an_axis_of_texts_in_parquet_is_not_said_to_be_missing(tmp_path, is_dictionary):
    axis = pa.array(["0.0"] * ROWS)
    pq.write_table(
        pa.table(STANDSTILL | {"axis_deg": axis.dictionary_encode() if is_dictionary else axis}), tmp_path / "a.parquet"
    )
    with pytest.raises(DataRefused, match="column axis_deg is not numeric"):
        contract_table(tmp_path / "a.parquet")


def test_what_parquet_holds_of_time_and_truth(tmp_path):
    """The only stamps whatever they are called, a segment of true and false, a rate among the keys, an ending in capitals."""
    stamps = pa.array(1_777_000_000_000_000 + np.round(TIME * 1e6).astype(np.int64)).cast(pa.timestamp("us"))
    pq.write_table(pa.table({"ts": stamps, **{n: MEANT[n] for n in SIGNALS}}), tmp_path / "a.PARQUET")
    assert_same(tmp_path / "a.PARQUET")
    pq.write_table(pa.table(STANDSTILL | {"segment": STANDSTILL["segment"] > 0}), tmp_path / "b.parquet")
    assert contract_table(tmp_path / "b.parquet").columns["segment"].tolist() == STANDSTILL["segment"].tolist()
    rate = pa.table({n: MEANT[n] for n in SIGNALS}).replace_schema_metadata({"fs": "5 kHz"})
    pq.write_table(rate, tmp_path / "c.parquet")
    assert_same(tmp_path / "c.parquet")


@pytest.mark.parametrize("name", ["unit", "Units"])
def test_a_unit_under_a_plain_property_of_tdms_counts(tmp_path, name):
    """A thousand times the current was read."""
    channels = [
        ("time_s", TIME, []),
        *((n, c, [(name, u)]) for n, c, u in zip(SIGNALS, MILLI[1:], UNITS[1:], strict=True)),
    ]
    assert_same(tdms(tmp_path / "a.tdms", channels))


@pytest.mark.parametrize(
    ("i", "v", "turn"), [("i_abc", "v_abc", False), ("Iabc", "Vabc", True), ("iuvw", "uuvw", False)]
)
def test_a_matrix_whose_name_says_its_phases(tmp_path, i, v, turn):
    stack = {i: np.stack(CURRENTS, 1), v: np.stack(VOLTS, 1)}
    savemat(tmp_path / "a.mat", {"t": TIME, **{n: m.T if turn else m for n, m in stack.items()}})
    assert_same(tmp_path / "a.mat")


def test_a_shorter_signal_is_not_left_out_in_silence(tmp_path):
    savemat(tmp_path / "a.mat", {**MEANT, "current_w_a": MEANT["current_w_a"][:-3]})
    assert [n.what for n in contract_table(tmp_path / "a.mat").notes if n.code == "length"] == [
        "time_s holds 40 values, current_w_a 37: not used"
    ]


def test_hdf5_is_named_with_what_to_do(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM" + b"\0" * 384 + b"\x89HDF\r\n\x1a\n")
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    for ending in ("mat", "h5"):
        with pytest.raises(DataRefused, match="HDF5") as refused:
            contract_table(tmp_path / f"a.{ending}")
        assert "or Parquet" in str(refused.value.remedy)
