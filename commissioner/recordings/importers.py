"""One reader of recordings for every verb: the contract's own files, and other people's mapped into its table.

Oscilloscope and logger CSV: any of comma, semicolon, tab; decimal commas; preface lines; a row of units; start and
increment; UTF-8, UTF-16, GBK, Latin; column names such as `Ia`, `i_L1`, `Strom U`, `CH1 (mA)`. MATLAB v5: vectors or
columns of a matrix under such names, also inside structures. TDMS, MDF 4 and COMTRADE: channels by name and unit. A workbook's one
table: as its text.
What was changed or left unused stands in the table's notes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused
from commissioner.motor.nameplate import Nameplate
from commissioner.paths import no_file
from commissioner.recordings.catalogue.plate_said import plate_said
from commissioner.recordings.formats import comtrade, mdf4, structures, tdms, workbook
from commissioner.recordings.formats.foreign_csv import parse_csv, read_text
from commissioner.recordings.formats.kinds import is_text, require_kind
from commissioner.recordings.names import meaning_of
from commissioner.recordings.plate import has_no_plate, plate_of
from commissioner.recordings.reading.cells import is_number
from commissioner.recordings.reading.layout import empty, head_lines, split
from commissioner.recordings.reading.mapping import ChannelMap, mapping_in
from commissioner.recordings.reading.mend import (
    TIME_MADE,
    against_interval,
    from_days,
    from_epoch,
    require_one_block,
    require_seconds,
    require_stamps,
    through_midnight,
    with_running_time,
    with_time,
    with_whole_time,
    without_doubled_rows,
    without_empty_columns,
    without_infinite,
    without_untimed_rows,
)
from commissioner.recordings.reading.preface import Clock, clock_in, factors_said, units_said
from commissioner.recordings.reading.recognise import Recognised, quantity, recognise, windings_said
from commissioner.recordings.reading.unnamed import UNNAMED, told_by_signals
from commissioner.recordings.sheet_names import is_sheet, sheet_meaning
from commissioner.recordings.sheets.widened import is_long
from commissioner.recordings.standstill.components import along_axis, with_phases
from commissioner.recordings.table import (
    CONTRACT_COLUMNS,
    CURRENTS,
    HOW_TO_MAP,
    ColumnReading,
    Table,
    read_table,
    to_running,
    typed_metadata,
)
from commissioner.recordings.units import read_unit, unit_in
from commissioner.records import UNUSED_VOLTAGE, ReadingNote, RunningRecording, Signal

_BINARY: Mapping[str, Callable[[Path], tuple[dict[str, Signal], dict[str, float | str], tuple[ReadingNote, ...]]]] = {
    ".mat": structures.channels,
    ".tdms": tdms.channels,
    ".mf4": lambda path: (mdf4.channels(path), {}, ()),
    ".cfg": comtrade.channels,
    ".dat": comtrade.channels,
    ".cff": comtrade.channels,
}
PLATE_KEYS = frozenset((*(one.name for one in fields(Nameplate)), "sample_period_s", "switching_frequency_hz"))
"""Numbers of a recording that stand beside its columns."""
HEAD_BYTES = 65536
_WORD = re.compile(rb'(?:\xef\xbb\xbf)?[#%"\s]*[A-Za-z\x80-\xff]')
VECTOR = "three phase voltages or two line-to-line voltages"


def read_running(path: Path, mapping: ChannelMap | None = None, motor: str | None = None) -> RunningRecording:
    """The recording in `path`, whatever its format; DataRefused names the column that could not be found."""
    return to_running(import_table(path, mapping, motor))


def import_table(path: Path, mapping: ChannelMap | None = None, motor: str | None = None) -> Table:
    """As `contract_table`, of a running motor: DataRefused where time, currents or voltages of one are missing."""
    table = contract_table(path, mapping, motor)
    require_running(table)
    return table


def require_running(table: Table) -> None:
    """DataRefused where time, currents or voltages of a running motor are missing."""
    if "voltage_axis_v" not in table.columns and (missing := _missing(table.columns)):
        raise _lacks(table, missing)


def has_currents_only(table: Table) -> bool:
    """Whether time and currents are there, or one of them, and no voltage or too few for a vector."""
    there, missing = table.columns, _missing(table.columns)
    return (
        VECTOR in missing and "time_s" in there and "voltage_axis_v" not in there and any(n in there for n in CURRENTS)
    )


def with_few_voltages_said(table: Table) -> Table:
    """With a note of the voltages that are there but make no vector, where there are any."""
    few = [name for name in table.columns if name.startswith("voltage_")]
    note = ReadingNote(UNUSED_VOLTAGE, f"no voltage vector is made of {', '.join(few)} alone: it takes {VECTOR}")
    return replace(table, notes=(*table.notes, note)) if few else table


def contract_table(path: Path, mapping: ChannelMap | None = None, motor: str | None = None) -> Table:
    """The file's table under the contract's names, in SI, whatever its format; columns of other names under their own.
    With a plate, of the file or `motor` (a name or a file), six channels without names may be told by their signals.

    UsageError: no such file. DataRefused: no table, or one that can be read in two ways.
    """
    table = _read(path, mapping or ChannelMap())
    is_unnamed = any(note.code == UNNAMED for note in table.notes)
    if is_unnamed and not (motor is None and has_no_plate(table.metadata)):
        table = told_by_signals(table, plate_of(table.metadata, table.source, motor))
    return _without_voltages(table) if has_currents_only(table) else table


def _without_voltages(table: Table) -> Table:
    """With a note of the columns in volts that could not be used, where there are any."""
    volts = [r for r in table.readings if (unit := read_unit(r.unit)) and unit.measures == "voltage"]
    empty = [
        r.name for r in table.readings if (r.meaning or "").startswith("voltage_") and r.meaning not in table.columns
    ]
    unnamed = [r.name for r in volts if r.meaning is None]
    why = [f"{', '.join(empty)}: no numbers in the rows of the currents"] if empty else []
    why += [f"{', '.join(unnamed)}: not named by a phase, as Vu, Vv, Vw ({HOW_TO_MAP})"] if unnamed else []
    note = ReadingNote(UNUSED_VOLTAGE, f"no voltages could be read from {'; '.join(why)}")
    return replace(table, notes=(*table.notes, note)) if why else table


def _read(path: Path, mapping: ChannelMap) -> Table:
    if not path.is_file():
        raise no_file(path, "read recording")
    if path.stat().st_size == 0:
        raise empty(str(path))
    suffix = path.suffix.lower()
    require_kind(path, workbook.ENDINGS)
    if suffix in workbook.ENDINGS:
        return _of_text(path, mapping)
    if suffix in _BINARY and not _is_named_text(path):
        return _of_binary(path, mapping)
    if suffix == ".parquet":
        return _of_table(read_table(path), mapping)
    try:
        is_ours = not mapping.columns and _is_plain(path)
        return _of_table(read_table(path), mapping) if is_ours else _of_text(path, mapping)
    except DataRefused as refusal:
        return _another_way(path, mapping, refusal)


def _another_way(path: Path, mapping: ChannelMap, refusal: DataRefused) -> Table:
    """The text read the other way: as somebody else's, or, of one column, as a table; where that fails too, the refusal
    that says more."""
    if mapping.columns or not _is_contract_named(path):
        if "no rows of numbers" not in refusal.what or b"\n" not in _head(path):
            raise refusal
        try:
            return _of_table(read_table(path), mapping)
        except DataRefused:
            raise refusal from None
    try:
        return _of_text(path, mapping)
    except DataRefused as second:
        raise (second if second.step in {"read numbers", "recognise columns", "read the time"} else refusal) from None


def _head(path: Path) -> bytes:
    import gzip
    import zlib

    opener = gzip.open if path.suffix == ".gz" else open
    try:
        with opener(path, "rb") as file:
            return bytes(file.read(HEAD_BYTES))
    except (OSError, EOFError, zlib.error):
        return b""


def _first_lines(head: bytes) -> list[str]:
    """The first two lines below comments."""
    text = head.decode("utf-8", errors="replace")
    return [line.text for line in head_lines(text) if line.text.strip() and not line.text.startswith("#")][:2]


def _is_contract_named(path: Path) -> bool:
    lines = _first_lines(_head(path))
    return bool(lines) and any(cell in CONTRACT_COLUMNS for cell in split(lines[0], ","))


def _is_plain(path: Path) -> bool:
    """Whether the file is the contract's CSV: its names between commas, then a row of numbers without quotes. Bytes that
    are no text go the same way, to be named there."""
    head = _head(path)
    if b"\0" in head:
        return head[:2] not in (b"\xff\xfe", b"\xfe\xff") and max(head[k::2].count(0) for k in (0, 1)) < 0.35 * len(
            head
        )
    lines = _first_lines(head)
    if len(lines) < 2 or '"' in lines[1]:
        return False
    names, cells = (split(line, ",") for line in lines)
    if not any(name in CONTRACT_COLUMNS for name in names) or len(names) != len(cells):
        return False
    plain = not is_long(names) and all(name in CONTRACT_COLUMNS or not unit_in(name) for name in names)
    return plain and all(is_number(cell) or not cell for cell in cells)


def _is_named_text(path: Path) -> bool:
    """A `.dat` that a program wrote as text, its names above the numbers: those of COMTRADE begin with a number."""
    return path.suffix.lower() == ".dat" and is_text(path) and _WORD.match(_head(path)) is not None


def _of_binary(path: Path, mapping: ChannelMap) -> Table:
    columns, said_beside, notes = _BINARY[path.suffix.lower()](path)
    metadata = {k: float(v[0]) for k, v in columns.items() if v.size == 1 and k in PLATE_KEYS} | said_beside
    single = [(name.rpartition(".")[2], str(float(v[0])), unit_in(name)) for name, v in columns.items() if v.size == 1]
    said = clock_in([*single, *((k, str(v), "") for k, v in metadata.items())])
    period = metadata.get("sample_period_s")
    clock = replace(said, interval_s=float(period)) if isinstance(period, float) else said
    several = {name: v for name, v in columns.items() if v.size > 1}
    names = {name: _own_name(name) for name in several}
    found = recognise(
        list(names.values()), [unit_in(n) for n in several], list(several.values()),
        {**mapping_in({}, tuple(names.values())), **mapping.columns}, str(path),
        units_said([(k, str(v), "") for k, v in said_beside.items()], ()),
    )  # fmt: skip
    return _table(found, metadata, clock, mapping, str(path), notes)


def _own_name(name: str) -> str:
    """A channel's name without its group where that leaves the contract's name."""
    bare = name.rpartition(".")[2]
    return bare if bare.split(" [")[0] in CONTRACT_COLUMNS else name


def _of_table(table: Table, mapping: ChannelMap) -> Table:
    names = tuple(table.columns)
    targets = {**mapping_in(table.metadata, names), **mapping.columns}
    pairs = [(k, str(v), "") for k, v in table.metadata.items()]
    said = units_said(pairs, [*table.comments, *(f"{k}: {v}" for k, v, _ in pairs)])
    found = recognise(names, ["" for _ in names], list(table.columns.values()), targets, table.source, said)
    clock = clock_in(pairs)
    period = table.metadata.get("sample_period_s")
    clock = replace(clock, interval_s=period, said_by="sample_period_s") if isinstance(period, float) else clock
    notes = factors_said([[key, str(value)] for key, value in table.metadata.items()])
    return _table(found, table.metadata, clock, mapping, table.source, (*table.notes, *notes))


def _of_text(path: Path, mapping: ChannelMap) -> Table:
    text, encoding = read_text(path)
    raw = parse_csv(text, encoding, str(path))
    del text
    metadata = typed_metadata(path, raw.metadata)
    targets = {**mapping_in(metadata, raw.names), **mapping.columns}
    found = recognise(raw.names, raw.units, list(raw.values), targets, str(path), raw.units_said)
    return _table(found, metadata, raw.clock, mapping, str(path), raw.notes)


def _table(
    found: Recognised, metadata: Mapping[str, float | str], clock: Clock, mapping: ChannelMap, source: str,
    notes: tuple[ReadingNote, ...],
) -> Table:  # fmt: skip
    """What was recognised with a time, without doubled rows and rounded stamps."""
    said, of_plate = plate_said({**metadata, **mapping.metadata}, source)
    metadata = {**said, **metadata, **mapping.metadata}
    if is_sheet(r.name for r in found.readings):
        metadata = {**windings_said(metadata, source), **metadata}
    columns, shorter = _of_one_length(found.columns)
    columns, infinite = without_infinite(columns)
    period = metadata.get("sample_period_s")
    if clock.interval_s is None and isinstance(period, float):
        clock = replace(clock, interval_s=period, said_by="sample_period_s")
    columns, timed = _timed(columns, clock, found.readings, source)
    if clock.interval_s is not None and any(note.code == TIME_MADE for note in timed):
        metadata.setdefault("sample_period_s", clock.interval_s)
    _with_constants(columns, metadata, source)
    columns, phases = with_phases(columns)
    columns, along = along_axis(columns, source)
    unnamed = [ReadingNote(UNNAMED, f"{name}: its name does not say what it is") for name in found.unnamed]
    return Table(
        columns,
        metadata,
        source,
        (*notes, *of_plate, *found.notes, *shorter, *infinite, *timed, *phases, *along, *unnamed),
        found.readings,
    )


def _timed(
    columns: dict[str, Signal], clock: Clock, readings: Sequence[ColumnReading], source: str
) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns with a time that runs as the file says, without rows that have none or stand there twice."""
    notes = with_time(columns, clock)
    if not notes:
        require_seconds(columns, readings, source)
        require_stamps(columns, source)
        columns, untimed = without_untimed_rows(columns)
        columns, epoch = from_epoch(columns)
        columns, midnight = through_midnight(columns)
        columns, days = from_days(columns)
        notes = [*untimed, *epoch, *midnight, *days, *against_interval(columns, clock, readings, source)]
    if "time_s" not in columns or not any(name.startswith("current_") for name in columns):
        return columns, notes
    require_one_block(columns, source)
    columns, empty = without_empty_columns(columns, readings)
    columns, doubled = without_doubled_rows(columns)
    columns, whole = with_whole_time(columns)
    columns, running = with_running_time(columns, clock, source)
    return columns, [*notes, *empty, *doubled, *whole, *running]


def _of_one_length(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns as long as the longest of the contract's (all of them where there is none), and which of its were not."""
    ours = {name: v.size for name, v in columns.items() if name in CONTRACT_COLUMNS}
    longest = max(ours.values(), default=max((v.size for v in columns.values()), default=0))
    kept = {name: v for name, v in columns.items() if v.size == longest}
    if not (others := [f"{name} {size}" for name, size in ours.items() if size != longest]):
        return kept, []
    what = f"{max(ours, key=ours.__getitem__)} holds {longest} values, {', '.join(others)}: not used"
    return kept, [ReadingNote("length", what)]


def _with_constants(columns: dict[str, Signal], metadata: Mapping[str, float | str], source: str) -> None:
    """A standstill recording of one axis, or one segment, may say so once: `axis_deg: 60`, `Achse: 60 deg`, `axis_rad: 1.047`; so may
    a test sheet of one frequency (`f: 50 Hz`)."""
    if is_sheet(columns) and "frequency_hz" not in columns:
        hertz = [
            quantity(k, v, "frequency_hz", source) for k, v in metadata.items() if sheet_meaning(k) == "frequency_hz"
        ]
        if hertz and hertz[0] is not None:
            columns["frequency_hz"] = np.full(max(v.size for v in columns.values()), hertz[0])
    rows = max((v.size for v in columns.values()), default=0)
    for key, said in metadata.items() if any(n.startswith("voltage_") for n in columns) else ():
        name = meaning_of(key)
        if (
            name in ("axis_deg", "segment")
            and name not in columns
            and (value := quantity(key, said, name, source)) is not None
        ):
            columns[name] = np.full(rows, value)


def _lacks(table: Table, missing: list[str]) -> DataRefused:
    unnamed = [note for note in table.notes if note.code == UNNAMED]
    return DataRefused(
        f"{table.source}: the recording lacks {', '.join(missing)}: speed and torque cannot be reconstructed from it",
        step="recognise columns",
        value="; ".join([_some(table.columns), *(note.what for note in table.notes if note.code in {"no_number", "length"})]),
        limit="time_s, three line currents and three voltages, in SI units",
        remedy=f"{HOW_TO_MAP}; three currents and three voltages with units may be told by their signals where the plate is given (--motor)"
        if unnamed else "record all six channels against time, or rename the columns to the contract's (time_s, "
        "current_u_a, voltage_u_v or voltage_uv_v ...); without a time column give `# sample_period_s: 0.000125` as the "
        "first line; or " + HOW_TO_MAP,
    )  # fmt: skip


def _missing(kept: Mapping[str, Signal]) -> list[str]:
    """What of time, currents and voltages is not there, in words; a third current or line-to-line voltage follows from two."""
    out = [] if "time_s" in kept else ["time (a time column or a sample rate)"]
    phases = [phase for phase in "uvw" if f"current_{phase}_a" not in kept]
    if len(phases) > 1:
        out.append("the currents of phase " + ", ".join(phases))
    star = all(f"voltage_{phase}_v" in kept for phase in "uvw")
    if not star and sum(f"voltage_{pair}_v" in kept for pair in ("uv", "vw", "wu")) < 2:
        out.append(VECTOR)
    return out


def _some(columns: Mapping[str, Signal]) -> str:
    names = list(columns)
    return ", ".join(names[:8]) + (f" ... ({len(names)} columns)" if len(names) > 8 else "")
