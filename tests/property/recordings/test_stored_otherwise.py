"""One recording in whatever container it is stored: the same numbers, or a typed refusal; never other numbers without a word."""

import datetime as dt
import struct

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from commissioner.errors import DataRefused
from commissioner.recordings.catalogue.reading import sheet_in
from commissioner.recordings.importers import contract_table
from commissioner.recordings.names import meanings_of
from tests.unit.recordings.test_workbook import workbook

ROWS, STEP = 40, 2e-4
TIME = np.arange(ROWS) * STEP
MEANT = {
    "time_s": TIME,
    **{f"current_{p}_a": np.round(7.3 * np.sin(314.0 * TIME - 2.1 * k + 0.1), 4) for k, p in enumerate("uvw")},
    **{f"voltage_{p}_v": np.round(326.0 * np.cos(314.0 * TIME - 2.1 * k + 0.1), 2) for k, p in enumerate("uvw")},
}
SIGNALS = [name for name in MEANT if name != "time_s"]
MILLI = {"current": "mA", "voltage": "mV"}
few = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def assert_same(path, coarse=1e-4):
    """The numbers are those that were meant; time from any zero."""
    read = contract_table(path).columns
    for name, values in MEANT.items():
        found = read[name] - (read[name][0] if name == "time_s" else 0.0)
        np.testing.assert_allclose(found, values, rtol=0, atol=coarse * np.abs(values).max(), err_msg=name)


def counts_of(values):
    step = float(np.abs(values).max() / 30000)
    return np.round(values / step).astype(np.int16), step


@few
@given(data=st.data())
def test_a_parquet_file_with_types_units_and_scales_of_its_own(tmp_path, data):
    fields, arrays = [], []
    nanoseconds = pa.array(1_777_900_000_000_000_000 + np.round(TIME * 1e9).astype(np.int64))
    stamps = {
        "timestamp": pa.timestamp("ns"),
        "zone": pa.timestamp("ns", tz="Europe/Berlin"),
        "index": pa.timestamp("us"),
    }
    for name, values in MEANT.items():
        kinds = ["plain", "timestamp", "zone", "index", "duration"] if name == "time_s" else ["plain", "decimal", "counts", "milli", "text"]  # fmt: skip
        kind = data.draw(st.sampled_from(kinds))
        said, array, own = {}, pa.array(values), name
        if kind in stamps:
            unit = pa.int64() if kind != "index" else None
            array = (nanoseconds.cast(unit) if unit else pa.array(np.asarray(nanoseconds) // 1000)).cast(stamps[kind])
            own = "__index_level_0__" if kind == "index" else "Time"
        elif kind == "duration":
            array = pa.array(np.round(TIME * 1e9).astype(np.int64)).cast(pa.duration("ns"))
        elif kind == "decimal":
            array = pa.array([f"{v:.4f}" for v in values]).cast(pa.decimal128(12, 4))
        elif kind == "counts":
            counts, step = counts_of(values)
            array, said = pa.array(counts), {"scale": repr(step)}
        elif kind == "milli":
            array, said = pa.array(1e3 * values), {"unit": MILLI[name.split("_")[0]]}
        elif kind == "text":
            array = pa.array([f"{v:.4f}" for v in values])
        fields.append(pa.field(own, array.type, metadata=said or None))
        arrays.append(array)
    pq.write_table(pa.Table.from_arrays(arrays, schema=pa.schema(fields)), tmp_path / "a.parquet", row_group_size=17)
    try:
        assert_same(tmp_path / "a.parquet")
    except DataRefused as refusal:
        assert any(pa.types.is_string(f.type) for f in fields) and "is not numeric" in refusal.what


@few
@given(data=st.data())
def test_a_matlab_file_with_structures_units_and_scales(tmp_path, data):
    form = data.draw(st.sampled_from(["vectors", "Data", "values", "scale", "unit", "units", "dates"]))
    turned = data.draw(st.sampled_from([(1, -1), (-1, 1)]))
    shaped = {name: values.reshape(turned) for name, values in MEANT.items()}
    short = {
        name: "t" if name == "time_s" else name[0].replace("c", "i") + "_" + name.split("_")[1].upper()
        for name in MEANT
    }
    stored = {short[name]: values for name, values in shaped.items()}
    if form in {"Data", "values"}:
        kept = {"Data": lambda v: {"Time": shaped["time_s"], "Data": v}, "values": lambda v: {"time": shaped["time_s"], "signals": {"values": v}}}  # fmt: skip
        stored = {short[name]: kept[form](shaped[name]) for name in SIGNALS}
    elif form == "scale":
        for name in SIGNALS:
            stored[short[name]], stored[f"{short[name]}_scale"] = counts_of(shaped[name])
    elif form == "unit":
        stored |= {short[n]: {"data": 1e3 * shaped[n], "unit": MILLI[n.split("_")[0]]} for n in SIGNALS}
    elif form == "units":
        stored |= {short[n]: 1e3 * shaped[n] for n in SIGNALS}
        stored["units"] = {short[n]: MILLI[n.split("_")[0]] for n in SIGNALS}
    elif form == "dates":
        stored["t"] = 739000.4 + shaped["time_s"] / 86400
    savemat(tmp_path / "a.mat", stored, do_compression=data.draw(st.booleans()))
    assert_same(tmp_path / "a.mat", coarse=2e-3 if form == "dates" else 1e-4)


def test_a_gain_of_counts_is_asked_for(tmp_path):
    """It may multiply or divide."""
    counts, step = counts_of(MEANT["current_u_a"])
    savemat(tmp_path / "a.mat", {**MEANT, "current_u_a": counts, "current_u_a_gain": step})
    with pytest.raises(DataRefused, match="may multiply or divide"):
        contract_table(tmp_path / "a.mat")


def test_what_a_matlab_file_holds_beside_plain_numbers_is_said(tmp_path):
    savemat(tmp_path / "a.mat", {**MEANT, "current_w_a": MEANT["current_w_a"] + 1j})
    assert "current_w_a was not read: complex" in [note.what for note in contract_table(tmp_path / "a.mat").notes]


def tdms(path, channels, of_group=()):
    """One segment of doubles; properties by channel."""

    def text(words):
        return struct.pack("<I", len(words.encode())) + words.encode()

    def said(properties):
        out = struct.pack("<I", len(properties))
        for name, value in properties:
            kinds = {str: (0x20, text), float: (10, lambda v: struct.pack("<d", v)), bytes: (0x44, bytes)}
            kind, packed = kinds[type(value)]
            out += text(name) + struct.pack("<I", kind) + packed(value)
        return out

    body = struct.pack("<I", len(channels) + 1) + text("/'Data'") + struct.pack("<I", 0xFFFFFFFF) + said(of_group)
    for name, values, properties in channels:
        body += text(f"/'Data'/'{name}'") + struct.pack("<IIIQ", 20, 10, 1, values.size) + said(properties)
    raw = b"".join(values.astype("<f8").tobytes() for _, values, _ in channels)
    path.write_bytes(b"TDSm" + struct.pack("<IiQQ", 2 | 4 | 8, 4713, len(body) + len(raw), len(body)) + body + raw)
    return path


@pytest.mark.parametrize("status", ["unscaled", "scaled"])
@pytest.mark.parametrize("of_group", [True, False])
def test_a_tdms_file_by_any_of_its_properties(tmp_path, status, of_group):
    """The unit under either of its names; a scaling of the group's, and one that was applied before."""
    scaling = [("NI_Number_Of_Scales", 1.0), ("NI_Scale[0]_Scale_Type", "Linear"), ("NI_Scaling_Status", status),
               ("NI_Scale[0]_Linear_Slope", 2.0), ("NI_Scale[0]_Linear_Y_Intercept", 0.0)]  # fmt: skip
    factor = 1e3 / (2.0 if status == "unscaled" else 1.0)
    channels = [("time_s", TIME, [("NI_Number_Of_Scales", 0.0)])]
    for name in SIGNALS:
        unit = [("NI_UnitDescription", MILLI[name.split("_")[0]])]
        channels.append((name, factor * MEANT[name], unit + ([] if of_group else scaling)))
    assert_same(tdms(tmp_path / "a.tdms", channels, scaling if of_group else []))


def stamp(seconds, parts=0.0):
    """As LabVIEW writes it: 2^-64 s, and seconds since 1904."""
    return struct.pack("<Qq", int(parts * 2**64), 3_860_000_000 + seconds)


def late_tdms(path, later, said_late, said_early):
    """`current_u_a` begins `later` samples after the others, and is as much shorter."""
    channels = []
    for name in SIGNALS:
        is_late = name == "current_u_a"
        begin = said_late if is_late else said_early
        channels.append((name, MEANT[name][later if is_late else 0 :], [("wf_increment", STEP), *begin]))
    return tdms(path, channels)


BEGINS = {
    "stamp": ([("wf_start_time", stamp(1, 0.1 + 7 * STEP))], [("wf_start_time", stamp(1, 0.1))]),
    "second": ([("wf_start_time", stamp(2, 7 * STEP - 0.0005))], [("wf_start_time", stamp(1, 0.9995))]),
    "offset": ([("wf_start_offset", 7 * STEP)], [("wf_start_offset", 0.0)]),
    "both": ([("wf_start_time", stamp(5)), ("wf_start_offset", 7 * STEP)], [("wf_start_time", stamp(5))]),
}


@pytest.mark.parametrize("said", BEGINS.values(), ids=BEGINS)
def test_channels_of_a_tdms_file_that_begin_at_different_times_are_laid_together(tmp_path, said):
    table = contract_table(late_tdms(tmp_path / "a.tdms", 7, *said))
    assert "current_u_a begins 7 samples" in next(note.what for note in table.notes if note.code == "begins")
    for name in SIGNALS:
        np.testing.assert_allclose(table.columns[name], MEANT[name][7:], atol=1e-9)


@pytest.mark.parametrize(
    ("late", "early", "match"),
    [
        ([("wf_start_offset", 7.3 * STEP)], [], "part of a sample apart"),
        ([("wf_start_offset", 1e3)], [], "no time in common"),
        ([("wf_start_offset", 1e308)], [], "no time in common"),
    ],
)
def test_channels_of_a_tdms_file_that_cannot_be_laid_together_are_refused(tmp_path, late, early, match):
    with pytest.raises(DataRefused, match=match):
        contract_table(late_tdms(tmp_path / "a.tdms", 0, late, early))


def test_a_begin_of_a_tdms_channel_that_is_not_told_is_asked_for_where_others_differ(tmp_path):
    at = [("wf_start_time", stamp(5))]
    assert_same(late_tdms(tmp_path / "a.tdms", 0, [], at))
    assert_same(late_tdms(tmp_path / "a.tdms", 0, [("wf_start_offset", float("nan"))], []))
    channels = [(name, MEANT[name], [("wf_increment", STEP), *at]) for name in SIGNALS]
    channels[0][2][1:] = []
    channels[1][2].append(("wf_start_offset", STEP))
    with pytest.raises(DataRefused, match=r"when Data\.current_u_a begins is not told"):
        contract_table(tdms(tmp_path / "a.tdms", channels))


@pytest.mark.parametrize(("digits", "unit"), [("000000", 1e6), ("000000000", 1e9)])
@pytest.mark.parametrize("skew", [0, 50])
def test_a_comtrade_of_2013_counts_nanoseconds_where_its_dates_do(tmp_path, digits, unit, skew):
    lines = ["a,b,2013", "6,6A,0D"]
    step = {name: float(np.abs(MEANT[name]).max() / 30000) for name in SIGNALS}
    for k, name in enumerate(SIGNALS):
        of = f"{name[0].upper().replace('C', 'I').replace('V', 'U')}_{name.split('_')[1].upper()}"
        lines.append(f"{k + 1},{of},,,{name[-1].upper()},{step[name]!r},0,{skew if k == 1 else 0},-32767,32767,1,1,P")
    lines += ["50", "0", f"0,{ROWS}", *[f"01/02/2026,10:00:00.{digits}"] * 2, "ASCII", "1"]
    rows = [
        ",".join(
            [str(n + 1), str(round(TIME[n] * unit)), *(str(round(MEANT[name][n] / step[name])) for name in SIGNALS)]
        )
        for n in range(ROWS)
    ]
    (tmp_path / "a.cfg").write_text("\r\n".join(lines) + "\r\n")
    (tmp_path / "a.dat").write_text("\r\n".join(rows) + "\r\n")
    assert_same(tmp_path / "a.cfg")
    assert any(note.code == "skew" for note in contract_table(tmp_path / "a.cfg").notes) == bool(skew)


HEAD = [
    "t (s)",
    *(f"{name[0].replace('c', 'i')}_{name.split('_')[1].upper()} ({name[-1].upper()})" for name in SIGNALS),
]
TABLE = [HEAD, *(list(map(float, row)) for row in np.column_stack(list(MEANT.values())))]


def as_text(rows):
    return [[c if isinstance(c, str) else f"{c:.6f}".replace(".", ",") for c in row] for row in rows]


def test_of_two_sheets_of_numbers_as_text_none_is_taken_in_silence(tmp_path):
    assert_same(workbook(tmp_path / "one.xlsx", Data=as_text(TABLE), Cover=[["Motor", "17"]]))
    with pytest.raises(DataRefused, match="tables on several sheets"):
        contract_table(workbook(tmp_path / "a.xlsx", Raw=as_text(TABLE), Data=as_text(TABLE)))


@pytest.mark.parametrize("title", ["Date/Time", "Datum/Uhrzeit", "Fecha y hora", "Horodatage"])
def test_a_date_that_is_stored_as_days_is_a_time(tmp_path, title):
    """A spreadsheet keeps 15 digits: 9 microseconds."""
    begin = dt.datetime(2026, 5, 4, 10, 11, 12)
    serial = (begin - dt.datetime(1899, 12, 30)).total_seconds() / 86400
    rows = [[title, *HEAD[1:]], *([serial + row[0] / 86400, *row[1:]] for row in TABLE[1:])]
    assert_same(workbook(tmp_path / "a.xlsx", Data=rows), coarse=1.5e-3)


def test_statistics_below_operating_points_are_no_points(tmp_path):
    rows = [
        ["No.", "f (Hz)", "U (V)", "I (A)", "P (W)"],
        *([k, 50, 40 + 10 * k, 7.5 + 2 * k, 200 + 90 * k] for k in range(6)),
    ]
    path = workbook(tmp_path / "a.xlsx", Data=[*rows, [], ["Mean", 50, 65, 12.5, 425], ["Max", 50, 90, 17.5, 650]])
    assert contract_table(path).columns["voltage_line_v"].tolist() == [40, 50, 60, 70, 80, 90]


def test_a_unit_that_is_a_phase_is_one_in_company_that_has_units():
    names = ["G1.Corriente U [A]", "G2.Corriente_V", "G3.Corriente W [mA]"]
    assert list(meanings_of(names).values()) == ["current_u_a", "current_v_a", "current_w_a"]


RATED = (
    "Rated power: 7.5 kW\nVoltage: 400 V\nFrequency: 50 Hz\nSpeed: 1455 rpm\nEfficiency: 88.7 %\nPower factor: 0.83\n"
)


@pytest.mark.parametrize(
    ("line", "key", "ohm"),
    [
        ("Resistencia entre fases (75 °C): 1310 mΩ", "winding_resistance_uv_ohm", 1.31),
        ("Resistenza tra le fasi a 75 °C: 1,31 Ohm", "winding_resistance_uv_ohm", 1.31),
        ("Klemmenwiderstand bei 75 °C [Ohm]: 1,31", "winding_resistance_uv_ohm", 1.31),
        ("Line-to-line resistance: 1.31 Ohm at 75 °C", "winding_resistance_uv_ohm", 1.31),
        ("Resistance per phase @ 75°C: 1.31 Ω", "winding_resistance_phase_ohm", 1.31),
    ],
)
def test_a_sheets_resistance_keeps_where_and_at_what_temperature_it_was_measured(tmp_path, line, key, ohm):
    """Between the phases was read as of one, half of R_s too much; and 75 °C as the 20 °C of a sheet that says none."""
    (tmp_path / "a.txt").write_text(RATED + line + "\n", encoding="utf-8")
    sheet = sheet_in(tmp_path / "a.txt")
    assert sheet is not None and sheet.get(key) == pytest.approx(ohm) and sheet.get("winding_temperature_c") == 75.0


def test_a_sheets_units_of_small_and_old_machines(tmp_path):
    lines = "Rated current: 14700 mA\nInertia: 320 kgcm²\nBreakdown torque: 15.26 daNm\n"
    (tmp_path / "a.txt").write_text(RATED + lines, encoding="utf-8")
    sheet = sheet_in(tmp_path / "a.txt")
    assert sheet is not None
    found = [sheet.get(key) for key in ("rated_current_a", "inertia_kg_m2", "breakdown_torque_nm")]
    assert found == pytest.approx([14.7, 0.032, 152.6])
