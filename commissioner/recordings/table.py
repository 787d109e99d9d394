"""Read and write the recording table: SI columns at a fixed rate, `key: value` metadata.

CSV (`.csv`, `.csv.gz`): `# key: value` comment lines, one header line, then rows. Parquet: the same keys as schema
metadata. Nothing in a file is ever executed; size limits hold for files from strangers.
"""

from __future__ import annotations

import gzip
import io
import math
import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet
from numpy.typing import NDArray

from commissioner.errors import DataRefused, UsageError
from commissioner.monitor.intake.columns import from_one_current
from commissioner.motor.channels.faults import put_right, put_right_at_rest
from commissioner.motor.computed import COMPUTED, printed_step, without_computed_third
from commissioner.paths import no_file
from commissioner.recordings.bounds import MAX_BYTES, MAX_COLUMNS, bounded_text, too_large
from commissioner.recordings.formats.parquet import columns_of
from commissioner.recordings.reading.arrow import arrow_owned
from commissioner.recordings.reading.said_tests import codes, is_title, unknown
from commissioner.recordings.reading.slow_columns import currents_on_the_commands_clock, on_one_clock, stood_still
from commissioner.recordings.standstill.components import require_degrees, with_segment
from commissioner.recordings.units import without_brackets
from commissioner.recordings.whole import whole_file
from commissioner.records import (
    POINT_COLUMNS,
    POINT_FORMS,
    POINT_RESISTANCES,
    UNUSED_VOLTAGE,
    ReadingNote,
    RunningRecording,
    Signal,
    StandstillRecording,
)
from commissioner.text import visible

MAX_METADATA_LINES = 1000
MOST_AVERAGED = 1000
KEY_AND_VALUE = re.compile(r"([^:=]+)[:=](.*)")
"""Of a comment; `=` is not what we write, yet a value written so must not be lost without a word."""
COARSE_STEP = 1e-8
"""Of a median step, by which the mean differs where stamps are rounded; sums of doubles differ by 1e-12."""
STEP_TOLERANCE, MOST_ROUNDED, COARSEST_S = 0.02, 0.1, 1e-3
"""Of a period, by which time steps may differ; by how much more at most where the time stamps are rounded, and to what at the coarsest."""

TEXT_KEYS = frozenset(
    {"connection", "name", "drive", "source", "note", "motor", "scenario", "run", "kind", "resistance_measured"}
)


CURRENTS = ("current_u_a", "current_v_a", "current_w_a")
RUNNING_COLUMNS = ("voltage_u_v", "voltage_v_v", "voltage_uv_v", "voltage_vw_v", "speed_rad_per_s")


@dataclass(frozen=True)
class ColumnReading:
    """What a column of a file was taken for: `meaning` is the contract's name or None, `factor` goes to SI."""

    name: str
    meaning: str | None
    unit: str
    factor: float


@dataclass(frozen=True)
class Table:
    """Columns by name, `(n,)` float64 each, and the metadata as it stood in the file."""

    columns: Mapping[str, Signal]
    metadata: Mapping[str, float | str]
    source: str
    notes: tuple[ReadingNote, ...] = ()
    readings: tuple[ColumnReading, ...] = ()
    comments: tuple[str, ...] = ()
    """Lines above the columns that are no key with its value."""

    @property
    def is_running(self) -> bool:
        """Whether it is of a running motor: voltages of phases, or a speed, and no voltage along an axis."""
        return "voltage_axis_v" not in self.columns and any(c in self.columns for c in RUNNING_COLUMNS)


HOW_TO_MAP = (
    "say what each channel is: comment lines at the top of the file (`# CH1: current_u_a`), or --map MAP.toml with [columns] "
    'and lines like "CH1" = "current_u_a" ("-current_v_a * 10" turns and scales)'
)

READ = "CSV, CSV.gz, Parquet, MATLAB v5, TDMS, MDF 4, COMTRADE or a workbook (XLSX, XLS, ODS)"


def read_table(path: Path) -> Table:
    """The table in `path`. Raises UsageError where there is no such file, DataRefused where it is not a table."""
    if not path.is_file():
        raise no_file(path, "read recording")
    try:
        if path.suffix.lower() == ".parquet":
            return _read_parquet(path)
        if _is_binary(path):
            raise _refuse(
                path,
                "the file holds bytes, not text",
                path.suffix or "no ending",
                READ,
                "export the recording as CSV by the program that wrote it; a picture of it cannot be read",
            )
        return _read_csv(path)
    except (
        pa.ArrowInvalid,
        pa.ArrowTypeError,
        pa.ArrowNotImplementedError,
        OSError,
        UnicodeDecodeError,
        EOFError,
        zlib.error,
        KeyError,  # two columns of one name
    ) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise _refuse(
            path,
            "the file is not a readable table",
            reason,
            READ,
            "export the recording again; `commissioner simulate motor_2kw2 --out example.csv` writes one to compare with",
        ) from error


def _is_binary(path: Path) -> bool:
    """A zero byte in the first lines, unless it is half a character of UTF-16."""
    if path.suffix == ".gz":
        return False
    with path.open("rb") as file:
        head = file.read(4096)
    return b"\0" in head and head[:2] not in (b"\xff\xfe", b"\xfe\xff")


def check_ending(path: Path) -> None:
    """UsageError where the name does not say which kind of recording it is to be."""
    if not path.name.endswith((".csv", ".csv.gz", ".parquet", ".mat")):
        raise UsageError(
            f"{path.name} is not a recording's name", step="write recording", value=path.suffix,
            limit=".csv, .csv.gz, .parquet or .mat", remedy="choose one of these endings",
        )  # fmt: skip


def write_table(path: Path, columns: Mapping[str, Signal], metadata: Mapping[str, float | str]) -> None:
    """Write the table whole or not at all (a temporary file is renamed into place)."""
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    metadata = {k: visible(v) if isinstance(v, str) else v for k, v in metadata.items()}
    with whole_file(path) as temporary:
        if path.suffix == ".mat":
            _write_matlab(temporary, columns, metadata)
        elif path.suffix == ".parquet":
            schema = table.schema.with_metadata({k: str(v) for k, v in metadata.items()})
            # a time rises all along: no two of its values are the same, and most of their bytes are
            times = [name for name in columns if name == "time_s"]
            others = [name for name in columns if name != "time_s"]
            pa_parquet.write_table(
                table.cast(schema), temporary, compression="zstd", use_dictionary=others, use_byte_stream_split=times
            )
        else:
            opener = gzip.open if path.suffix == ".gz" else open
            with opener(temporary, "wb") as file:
                file.write("".join(f"# {k}: {v}\n" for k, v in metadata.items()).encode())
                pa_csv.write_csv(table, file, pa_csv.WriteOptions(quoting_style="none"))


def _write_matlab(path: Path, columns: Mapping[str, Signal], metadata: Mapping[str, float | str]) -> None:
    """MATLAB 5: a variable for each column and for each key, by the contract's names."""
    from scipy.io import savemat

    with path.open("wb") as file:
        savemat(file, {**metadata, **columns}, long_field_names=True, oned_as="column")


def to_standstill(table: Table) -> StandstillRecording:
    """The table as a standstill recording; refuses missing columns, NaN, and time that does not lie on a grid."""
    table = _with_third_current(table)
    with_one, said = with_segment(table.columns, table.source)
    table = replace(table, columns=with_one, notes=(*table.notes, *said))
    columns = table.columns
    needed = ("time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a")
    running = [name for name in ("voltage_u_v", "voltage_uv_v", "voltage_vw_v", "speed_rad_per_s") if name in columns]
    if running and "voltage_axis_v" not in columns:
        raise _refuse(
            Path(table.source),
            f"this is a recording of a running motor (column {running[0]})",
            ", ".join(columns),
            "a standstill recording",
            "use `commissioner monitor` for a running motor",
        )
    if not set(needed) & set(columns):
        raise _refuse(
            table.source,
            "no measurement is in this file: neither samples over time, nor test points, nor a maker's rated values",
            ", ".join([*columns, *table.metadata][:12]) or "no column",
            "time_s, currents and voltages; or a row for each test of frequency_hz, voltage_line_v, current_line_a, power_w; or rated values",
            "give what was measured, under these names (`commissioner docs formats`); a circuit's values alone are what `identify` would find",
        )
    if not any(name in ("segment", "axis_deg") or name.startswith("voltage_") for name in columns):
        raise _refuse(
            table.source,
            "this recording holds no voltages: what a motor is cannot be told from its currents",
            next((note.what for note in table.notes if note.code == UNUSED_VOLTAGE), ", ".join(columns)),
            "time_s, currents and voltages; at standstill segment, axis_deg and voltage_axis_v",
            "record the voltages as well, or name their columns (--map); `commissioner monitor` takes what currents alone tell",
        )
    _require(table, needed, "a standstill recording")
    optional = [name for name in ("current_w_a", "dc_link_v", "averaged_periods") if name in columns]
    _require_finite(table, [*needed, *optional])
    if "dc_link_v" in columns and np.any(columns["dc_link_v"] <= 0.0):
        bad = float(columns["dc_link_v"][columns["dc_link_v"] <= 0.0][0])
        raise _refuse(
            table.source, "dc_link_v is no DC link's voltage", bad, "> 0 V", "correct it, or leave the column out"
        )
    require_degrees(columns["axis_deg"], table.source)
    segment = columns["segment"]
    if np.any(segment != np.round(segment)):
        bad = float(segment[segment != np.round(segment)][0])
        raise _refuse(table.source, "segment is not a whole number", bad, "0, 1, 2, ...", "number the segments")
    begins = (0, *(np.flatnonzero(np.diff(segment)) + 1))
    clocked = currents_on_the_commands_clock(columns, CURRENTS, "voltage_axis_v", table.source, begins)
    table = _without_unmeasured(table, *clocked)
    columns, segment = table.columns, table.columns["segment"]
    _require_currents_to_the_end(table)
    period = sample_period(table, segment)
    recording = StandstillRecording(
        time_s=columns["time_s"],
        segment=segment.astype(np.int64),
        axis_deg=columns["axis_deg"],
        voltage_axis_v=columns["voltage_axis_v"],
        current_u_a=columns["current_u_a"],
        current_v_a=columns["current_v_a"],
        current_w_a=columns.get("current_w_a"),
        dc_link_v=columns.get("dc_link_v"),
        sample_period_s=period,
        metadata=table.metadata,
        source=table.source,
        notes=table.notes,
        averaged=_averaged(table, segment),
    )
    return put_right_at_rest(without_computed_third(recording))


def _without_unmeasured(table: Table, columns: Mapping[str, Signal], every: int, notes: Sequence[ReadingNote]) -> Table:
    period = table.metadata.get("sample_period_s")
    longer = {} if every == 1 or period in (None, "") else {"sample_period_s": every * float(period)}
    return replace(table, columns=columns, metadata={**table.metadata, **longer}, notes=(*table.notes, *notes))


def _averaged(table: Table, segment: Signal) -> NDArray[np.int64] | None:
    """Of how many sample periods each row is the mean; None where the column is not there, or every row is a sample."""
    column = table.columns.get("averaged_periods")
    if column is None or np.all(column == 1.0):
        return None
    of_segment = np.diff(column)[np.diff(segment) == 0]
    off = (column != np.round(column)) | (column < 1.0) | (column > MOST_AVERAGED)
    if np.any(off) or np.any(of_segment != 0.0):
        raise _refuse(
            table.source, "averaged_periods is no number of sample periods, or changes inside a segment",
            float(column[off][0]) if np.any(off) else "changes", f"1 ... {MOST_AVERAGED}, one number a segment",
            "give of how many control periods each row is the mean, or leave the column out",
        )  # fmt: skip
    return column.astype(np.int64)


def _with_third_current(table: Table) -> Table:
    """With the current of u or v that two others leave for it, where it is the one that is not there: no sensor, so w tells no more."""
    missing = [name for name in CURRENTS if name not in table.columns]
    if len(missing) != 1 or missing == ["current_w_a"]:
        return table
    a, b = (name for name in CURRENTS if name in table.columns)
    note = ReadingNote(COMPUTED, f"{missing[0]} is not there: taken as the negative sum of {a} and {b}")
    columns = {**table.columns, missing[0]: -(table.columns[a] + table.columns[b])}
    return replace(table, columns={k: v for k, v in columns.items() if k != "current_w_a"}, notes=(*table.notes, note))


STOPS_AT_ONCE = 0.2
"""Of its largest speed: no shaft that still turns so fast stands in the next row."""


def to_running(table: Table) -> RunningRecording:
    """The table as a running-motor recording. NaN, gaps and jitter are left for the audit, which names them.

    One current, or one line-to-line voltage, may be absent (NaN throughout): without a neutral it follows from the others.
    """
    columns = table.columns
    phase = ("voltage_u_v", "voltage_v_v", "voltage_w_v")
    line = ("voltage_uv_v", "voltage_vw_v", "voltage_wu_v")
    is_line = phase[0] not in columns
    voltages = line if is_line else phase
    if "voltage_axis_v" in columns and is_line and not any(name in columns for name in line):
        raise _refuse(
            Path(table.source),
            "this is a recording at standstill",
            "voltage_axis_v",
            "three voltages of a running motor",
            "`commissioner identify` or `commissioner diagnose` reads it",
        )
    _require(table, _all_but_one(CURRENTS, columns), "a running-motor recording")
    _require(table, ("time_s", *(_all_but_one(line, columns) if is_line else phase)), "a running-motor recording")
    table = _as_recorded(table, (*CURRENTS, *voltages))
    table = _without_unmeasured(table, *on_one_clock(table.columns, (*CURRENTS, *voltages), table.source))
    table = _without_still(_without_still(table, CURRENTS), voltages)
    columns = table.columns
    empty = np.full(columns["time_s"].size, np.nan)
    time = columns["time_s"]
    period = float(table.metadata.get("sample_period_s", 0.0) or _usual_step(time))
    i = [columns.get(name, empty) for name in CURRENTS]
    v = [columns.get(name, empty) for name in voltages]
    return put_right(RunningRecording(
        time_s=time,
        currents_a=(i[0], i[1], i[2]),
        voltages_v=(v[0], v[1], v[2]),
        voltages_are_line_to_line=is_line,
        speed_rad_per_s=columns.get("speed_rad_per_s"),
        sample_period_s=period,
        metadata=table.metadata,
        source=table.source,
        notes=table.notes,
    ))  # fmt: skip


def _as_recorded(table: Table, channels: Sequence[str]) -> Table:
    """Rows in the order of their time, where they stand the other way round; without those at the end in which every channel and a speed that
    has just been there are exactly zero: what a logger had reserved and did not fill."""
    columns, notes, time = dict(table.columns), list(table.notes), table.columns["time_s"]
    if time.size > 2 and np.all(np.diff(time) < 0.0):
        columns = {name: values[::-1] for name, values in columns.items()}
        notes.append(ReadingNote("backwards", "the rows run backwards in time: taken the other way round"))
    speed = columns.get("speed_rad_per_s")
    if speed is not None:
        filled = np.flatnonzero(
            np.any([columns[n] != 0.0 for n in (*channels, "speed_rad_per_s") if n in columns], axis=0)
        )
        last = int(filled[-1]) + 1 if filled.size else 0
        if 0 < last < time.size and abs(speed[last - 1]) > STOPS_AT_ONCE * np.nanmax(np.abs(speed)):
            columns = {name: values[:last] for name, values in columns.items()}
            notes.append(ReadingNote("unfilled", f"the last {time.size - last} rows hold nothing but zeros: left out"))
    return replace(table, columns=columns, notes=tuple(notes))


def _require_currents_to_the_end(table: Table) -> None:
    """DataRefused where a current stands still up to the last row while the others flow. (One that does so for a while is at its range's end.)"""
    here = [name for name in CURRENTS if name in table.columns]
    for name, rows in stood_still(table.columns, here, is_current=True).items():
        if rows[-1]:
            since = int(np.flatnonzero(~rows)[-1]) + 1 if not rows.all() else 0
            value = f"{table.columns[name][-1]:.4g} A"
            raise _refuse(
                table.source, f"{name} stands at {value} from {table.columns['time_s'][since]:.3g} s to the end while the others flow: it was not measured", value,
                "a current that moves as the others do", "look at its sensor, its lead and its export, and record again; two sound phases are enough, leave the third out",
            )  # fmt: skip


def _without_still(table: Table, channels: Sequence[str]) -> Table:
    """NaN where one of these channels stood still while the others went on. DataRefused: all along, and the others do not tell it."""
    here = [name for name in channels if name in table.columns]
    columns, notes, time = dict(table.columns), list(table.notes), table.columns["time_s"]
    for name, rows in stood_still(columns, here, is_current=channels == CURRENTS).items():
        value = f"{columns[name][rows][0]:.4g}"
        since, count = f"{time[rows][0]:.3g}", int(rows.sum())
        if rows.all() and (len(here) < len(channels) or name.removeprefix("voltage_") in {"u_v", "v_v", "w_v"}):
            raise _refuse(
                table.source, f"{name} stands at {value} from {since} s on, {count} rows in all, while the others move: it was not measured", value,
                "a channel that moves as the others do", "look at its probe and its export, and record again",
            )  # fmt: skip
        columns[name] = np.where(rows, np.nan, columns[name])
        what = f"{name} stands at {value} from {since} s on, {count} rows in all, while the others move: not used there"
        notes.append(ReadingNote("still_channel", what))
    return replace(table, columns=columns, notes=tuple(notes))


def to_currents(table: Table) -> RunningRecording:
    """The table as a running recording without voltages (NaN throughout). One current stands for three. DataRefused: no current, or no time."""
    _require(
        table,
        ("time_s", *(tuple(n for n in CURRENTS if n in table.columns) or CURRENTS)),
        "a recording of a motor's currents",
    )
    table = _without_unmeasured(table, *on_one_clock(table.columns, CURRENTS, table.source))
    time = table.columns["time_s"]
    empty = np.full(time.size, np.nan)
    u, v, w = (table.columns.get(name, empty) for name in CURRENTS)
    period = float(table.metadata.get("sample_period_s", 0.0) or _usual_step(time))
    return from_one_current(put_right(RunningRecording(
        time, (u, v, w), (empty, empty, empty), False, table.columns.get("speed_rad_per_s"), period, table.metadata,
        table.source, table.notes,
    )))  # fmt: skip


def _all_but_one(names: tuple[str, str, str], columns: Mapping[str, Signal]) -> tuple[str, ...]:
    """The names, without the one absent column where the other two are there."""
    present = tuple(name for name in names if name in columns)
    return present if len(present) == 2 else names


def sample_period(table: Table, segment: Signal) -> float:
    """The grid's period. Steps inside a segment must be whole multiples of it: larger ones are gaps."""
    time = table.columns["time_s"]
    if time.size < 2:
        raise _refuse(table.source, "the recording has too few samples", time.size, "at least 2", "record longer")
    steps = np.diff(time)[np.diff(segment) == 0]
    if steps.size == 0 or np.any(steps <= 0):
        raise _refuse(
            table.source,
            "time does not run forward inside a segment",
            float(steps.min()) if steps.size else None,
            "steps above 0 s",
            "sort the rows by time and number the segments",
        )
    named = table.metadata.get("sample_period_s")
    period = float(named) if named not in (None, "") else _mean_step(steps)
    multiple = steps / period
    deviation = np.abs(multiple - np.maximum(np.round(multiple), 1.0))
    printed = printed_step(time)[1:][np.diff(segment) == 0]
    tolerance = STEP_TOLERANCE + np.minimum(np.minimum(printed, COARSEST_S) / period, MOST_ROUNDED)
    worst = int(np.argmax(deviation - tolerance))
    if deviation[worst] > tolerance[worst]:
        raise _refuse(
            table.source,
            "the time steps are not equal",
            float(steps[worst]),
            f"multiples of {period:.6g} s within {tolerance[worst]:.0%}",
            "record at a fixed rate, or resample with known time stamps",
        )
    return period


def _usual_step(time: Signal) -> float:
    """The median step, or the mean where stamps are so coarse that it lies apart (seconds since 1970 have steps of 0.24 us)."""
    steps = np.diff(time)
    usual = float(np.median(steps)) if steps.size else float("nan")
    mean = _mean_step(steps) if usual > 0.0 else usual
    return mean if abs(mean - usual) > COARSE_STEP * usual else usual


def _mean_step(steps: Signal) -> float:
    """Of those over one period: time stamps are rounded, and the median is one of two values beside it."""
    return float(np.mean(steps[np.round(steps / np.median(steps)) <= 1.0]))


def _read_parquet(path: Path) -> Table:
    file = pa_parquet.ParquetFile(path)
    if path.stat().st_size > MAX_BYTES:
        raise too_large(path, path.stat().st_size, MAX_BYTES)
    columns, lost, notes = columns_of(path, file)
    read = {without_brackets(name) for name in columns.column_names}
    for name in file.schema_arrow.names:
        if name in lost or (name in CONTRACT_COLUMNS and name not in read):
            raise _not_numeric(path, name, file.schema_arrow.field(name).type)
    raw = file.schema_arrow.metadata or {}
    metadata = {k.decode(): v.decode() for k, v in raw.items() if not k.startswith((b"ARROW", b"pandas"))}
    table = _as_table(path, columns, typed_metadata(path, metadata))
    return replace(table, notes=(*table.notes, *notes))


def _read_csv(path: Path) -> Table:
    data = bounded_text(path)
    text = io.BytesIO(data)
    metadata: dict[str, str] = {}
    comments: list[str] = []
    start = 0
    for _ in range(MAX_METADATA_LINES):
        line = text.readline(65536)
        if not line.startswith(b"#"):
            break
        start = text.tell()
        if said := KEY_AND_VALUE.match(line[1:].decode("utf-8")):
            metadata[said[1].strip()] = said[2].strip()
        else:
            comments.append(line[1:].decode("utf-8").strip())
    text.seek(start)
    columns = text.readline().count(b",") + 1
    if columns > MAX_COLUMNS:
        raise too_large(path, f"{columns} columns", MAX_COLUMNS)
    rest = arrow_owned(memoryview(data)[start:])
    table = pa_csv.read_csv(
        rest,
        read_options=pa_csv.ReadOptions(use_threads=False),
        convert_options=pa_csv.ConvertOptions(null_values=["", "nan", "NaN", "NA"]),
    )
    return replace(_as_table(path, table, typed_metadata(path, metadata)), comments=tuple(comments))


def _as_table(path: Path, table: pa.Table, metadata: Mapping[str, float | str]) -> Table:
    if table.num_columns == 0:
        raise _refuse(
            path,
            "no column holds plain numbers",
            0,
            "a column of numbers for each signal",
            "unpack structures and lists",
        )
    if table.num_rows == 0:
        raise _refuse(path, "the file has no rows", 0, "at least 2 rows", "record again")
    columns: dict[str, Signal] = {}
    notes: tuple[ReadingNote, ...] = ()
    for name in table.column_names:
        column = table.column(name)
        if pa.types.is_integer(column.type) or pa.types.is_floating(column.type) or pa.types.is_null(column.type):
            values = column.cast(pa.float64()).to_numpy(zero_copy_only=False)
            columns[name] = np.ascontiguousarray(values, dtype=np.float64)
        elif name in CONTRACT_COLUMNS:
            raise _not_numeric(path, name, _first_text(column))
        elif is_title(name) and (said := codes(cells := [str(cell) for cell in column.to_pylist()])) is not None:
            columns[name], notes = said, (*notes, *unknown(cells, said))
    return Table(columns, metadata, str(path), notes)


def _first_text(column: pa.ChunkedArray) -> str:
    """The first cell that is no number, with its row below the header."""
    for row, cell in enumerate(column.to_pylist(), 1):
        try:
            float(str(cell))
        except ValueError:
            return f"{cell} in row {row}"
    return str(column[0])


def _not_numeric(path: Path, name: str, seen: object) -> DataRefused:
    return _refuse(
        path,
        f"column {name} is not numeric",
        str(seen),
        "numbers in SI units",
        "store it as numbers, with decimal points and without units; a time as seconds or time stamps",
    )


CONTRACT_COLUMNS = frozenset(
    {
        "time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a", "current_w_a", "dc_link_v",
        "averaged_periods", "current_alpha_a", "current_beta_a", "voltage_alpha_v", "voltage_beta_v",
        "voltage_u_v", "voltage_v_v", "voltage_w_v", "voltage_uv_v", "voltage_vw_v", "voltage_wu_v", "speed_rad_per_s",
        *POINT_COLUMNS, *POINT_FORMS, *POINT_RESISTANCES,
    }
)  # fmt: skip


def typed_metadata(path: Path, metadata: Mapping[str, str]) -> dict[str, float | str]:
    """Numbers as numbers; keys that are text stay text. A rated value that is no finite number is refused."""
    typed: dict[str, float | str] = {}
    for key, value in metadata.items():
        try:
            number = float(value)
        except ValueError:
            number = math.nan
        if key in TEXT_KEYS:
            typed[key] = value
        elif (
            key.startswith("rated_") or key in {"power_factor", "pole_pairs", "sample_period_s"}
        ) and not 0.0 < number < math.inf:
            raise _refuse(
                path,
                f"metadata {key} is no positive number",
                value,
                "a finite number above zero, in SI units",
                f"correct {key}",
            )
        elif math.isfinite(number):
            typed[key] = number
        else:
            typed[key] = value
    return typed


def _require(table: Table, names: Sequence[str], what: str) -> None:
    missing = [name for name in names if name not in table.columns]
    if missing:
        empty = next((r.name for r in table.readings if r.meaning == missing[0]), "")
        raise _refuse(
            table.source,
            f"{what} needs the column {missing[0]}" + f", and {empty} holds no numbers" * bool(empty),
            ", ".join(table.columns) or "no column of numbers",
            ", ".join(names),
            "rename or add the columns: "
            + ", ".join(missing)
            + (" (in electrical degrees)" * ("axis_deg" in missing))
            + _how_to_name(table),
        )


def _how_to_name(table: Table) -> str:
    """What to do where channels have no names that say what they are."""
    unnamed = any(note.code == "unnamed_channel" for note in table.notes)
    return "; or " + HOW_TO_MAP if unnamed else ""


def _require_finite(table: Table, names: Sequence[str]) -> None:
    for name in names:
        bad = ~np.isfinite(table.columns[name])
        if bad.any():
            row = int(np.argmax(bad))
            raise _refuse(
                table.source,
                f"column {name} holds {int(bad.sum())} values that are not numbers",
                f"row {row}",
                "finite numbers",
                "leave lost samples out as missing rows: gaps are honoured, filled values are not",
            )


def _refuse(source: object, what: str, value: object, limit: object, remedy: str) -> DataRefused:
    return DataRefused(f"{source}: {what}", step="read recording", value=value, limit=limit, remedy=remedy)
