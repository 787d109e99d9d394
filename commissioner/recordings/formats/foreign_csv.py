"""Other people's CSV: any of comma, semicolon, tab, space; decimal commas; preface lines; a row of units; any encoding."""

from __future__ import annotations

import re
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import MAX_FOREIGN_BYTES, bounded_text
from commissioner.recordings.formats import workbook
from commissioner.recordings.formats.kinds import is_text
from commissioner.recordings.names import meaning_of
from commissioner.recordings.reading.arrow import arrow_owned
from commissioner.recordings.reading.cells import Marks, is_number, marks_of, plain, to_numbers
from commissioner.recordings.reading.encoding import decode
from commissioner.recordings.reading.layout import Layout, head_lines, layout_of, split
from commissioner.recordings.reading.preface import (
    Clock,
    UnitSaid,
    clock_in,
    factors_said,
    metadata_of,
    pairs,
    probes_in,
    units_said,
)
from commissioner.recordings.reading.rows import WrongRow, without_headers, without_torn_row
from commissioner.recordings.reading.said_tests import codes, in_runs, is_title, require_one_motor, unknown
from commissioner.recordings.sheet_names import is_sheet
from commissioner.recordings.sheets.barred import unbarred
from commissioner.recordings.sheets.indexed import in_rows
from commissioner.recordings.sheets.joined import joined
from commissioner.recordings.sheets.united import united
from commissioner.recordings.sheets.upright import upright
from commissioner.recordings.sheets.widened import widened
from commissioner.records import ReadingNote, Signal

MOST_FOOTER_ROWS = 20
SAMPLED_ROWS = 200
MOST_POINTS = 1000
"""Rows of a test sheet in which a second motor is looked for."""
_STATISTIC = re.compile(
    r"(?:mean|average|avg|mittelwert|mittel|moyenne|media|promedio|max(?:imum|imo|imal)?|min(?:imum|imo|imal)?|rms|std(?:dev)?|sum|summe)[.: ]*",
    re.IGNORECASE,
)
"""What a row below the values is called that holds none of them."""


@dataclass(frozen=True)
class RawTable:
    """A text's columns as numbers in the file's own units, by their place; `clock` is what its preface says of time."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: tuple[Signal, ...]
    metadata: dict[str, str]
    clock: Clock
    units_said: Mapping[str, UnitSaid]
    notes: tuple[ReadingNote, ...]


def read_text(path: Path) -> tuple[str, str]:
    """(text with plain numbers, encoding) of a file within its limits; DataRefused where it cannot be unpacked."""
    if path.suffix.lower() in workbook.ENDINGS and not is_text(path):
        return plain(workbook.text_of(path)), "UTF-8"
    try:
        data = bounded_text(path, MAX_FOREIGN_BYTES)
    except (OSError, EOFError, zlib.error) as error:
        raise _unreadable(path, str(error)) from error
    text, encoding = decode(data)
    return plain(text), encoding


def parse_csv(text: str, encoding: str, source: str) -> RawTable:
    """The columns of a text with what stands above them. DataRefused: no rows of numbers, or numbers that are ambiguous."""
    text, reshaped = _as_one_table(united(unbarred(text), source), source)
    layout = layout_of(text, source)
    if layout.is_split:
        raise DataRefused(
            f"{source}: its rows hold twice as many cells as names: decimal commas between commas", step="read numbers",
            value=f"{len(layout.names)} cells", limit="one cell for each name",
            remedy="export again with decimal points, or with semicolons between the columns",
        )  # fmt: skip
    body = text[layout.start :]
    marks = marks_of(_sample(body, layout), layout.separator, source)
    columns, notes = _columns(body, layout, marks, source)
    said = pairs(layout.preface)
    if encoding not in ("UTF-8", "Latin-1", "Windows-1252"):
        notes.append(ReadingNote("encoding", f"the text is in {encoding}"))
    if probes := probes_in(layout.preface):
        notes.append(ReadingNote("probes", f"probes of {probes} are named above the columns: numbers are taken as they are printed; "
                                 "where the instrument did not multiply them yet, map the channels with a factor"))  # fmt: skip
    notes += factors_said(layout.preface)
    names, units, clock = _start_and_increment(layout, clock_in(said, marks.decimal))
    notes += reshaped
    names, units, points, of_tests = in_rows(names, units, columns)
    notes += of_tests
    once = units_said(said, (" ; ".join(row) for row in layout.preface))
    return RawTable(names, units, points, _pointed(metadata_of(said), marks), clock, once, tuple(notes))


def _as_one_table(text: str, source: str) -> tuple[str, list[ReadingNote]]:
    """The text with a row for each time or point, and what it was made of; as it is where it was so."""
    notes = []
    if (beside := joined(text)) is not None:
        text = beside
        notes.append(
            ReadingNote(
                "tables", "tables below each other hold other channels at the same times: they were read as one"
            )
        )
    if (turned := upright(text)) is not None:
        said = "quantities stand down the rows: each column of numbers was taken as a point of the test"
        return turned, [*notes, ReadingNote("upright", said)]
    if (wide := widened(text, source)) is not None:
        said = "a row for each channel and time: each channel was taken as a column"
        return wide, [*notes, ReadingNote("long_table", said)]
    return text, notes


def _pointed(metadata: Mapping[str, str], marks: Marks) -> dict[str, str]:
    """Numbers above the columns by the decimal mark of the file."""
    is_comma = marks.decimal == ","
    return {k: v.replace(",", ".") if is_comma and re.fullmatch(r"[+-]?\d+,\d+", v) else v for k, v in metadata.items()}


def _sample(body: str, layout: Layout) -> list[str]:
    rows = [split(line.text, layout.separator) for line in head_lines(body[: 1 << 17])[:SAMPLED_ROWS]]
    return [cell for row in rows for cell in row[layout.skip :]]


def _columns(body: str, layout: Layout, marks: Marks, source: str) -> tuple[list[Signal], list[ReadingNote]]:
    wrong_rows: list[WrongRow] = []

    def keep(row: pa_csv.InvalidRow) -> str:
        wrong_rows.append(WrongRow(row.number, row.actual_columns, row.text or ""))
        return "skip"

    width = len(layout.names) + layout.skip
    table = _parsed(_even(body, layout), layout, width, keep, source)
    rows = table.num_rows
    table, notes = without_headers(table.select(range(layout.skip, width)), wrong_rows, layout)
    notes += without_torn_row(wrong_rows, body, width)
    if is_sheet(layout.names):
        for name, column in zip(layout.names, table.columns, strict=True):
            require_one_motor(name, [str(cell) for cell in column.slice(0, MOST_POINTS).to_pylist()], source)
    cells = [_cells(name, column, marks, source) for name, column in zip(layout.names, table.columns, strict=True)]
    notes += chain.from_iterable(one.notes for one in cells)
    filled = sum((np.isfinite(one.numbers) for one in cells), np.zeros(table.num_rows, dtype=np.int64))
    below = np.any([one.is_statistic for one in cells], axis=0)
    if below.any() and not np.any((filled > 0) & ~below & (np.cumsum(below) > 0)):
        filled[below] = 0
        notes.append(ReadingNote("footer", f"{int(below.sum())} rows of statistics below the values were left out"))
    if wrong_rows:
        _require_footer(wrong_rows, rows, source)
        notes.append(ReadingNote("footer", f"{len(wrong_rows)} rows that are no row of the table were left out"))
    last = int(np.flatnonzero(filled)[-1]) + 1 if filled.any() else 0
    if table.num_rows - last > MOST_FOOTER_ROWS:
        last = table.num_rows
    return [one.values[:last] for one in cells], notes


@dataclass(frozen=True)
class _Cells:
    """A column's numbers, NaN where a cell is none; its values, which count the names that cells of a test or a segment are; and in which
    rows it names a statistic of the rows above."""

    numbers: Signal
    values: Signal
    is_statistic: NDArray[np.bool_]
    notes: tuple[ReadingNote, ...]


def _cells(name: str, column: pa.ChunkedArray, marks: Marks, source: str) -> _Cells:
    numbers, wrong = to_numbers(column, marks, source)
    nowhere, is_empty = np.zeros(len(numbers), dtype=bool), not np.isfinite(numbers).any()
    if is_title(name):
        texts = [str(cell) for cell in column.to_pylist()]
        if (said := codes(texts)) is not None:
            return _Cells(numbers, said, nowhere, tuple(unknown(texts, said)))
    elif (
        meaning_of(name) == "segment"
        and is_empty
        and (said := in_runs([str(c) for c in column.to_pylist()])) is not None
    ):
        return _Cells(numbers, said, nowhere, ())
    if meaning_of(name) == "time_s" or not wrong:
        return _Cells(numbers, numbers, nowhere, ())
    is_statistic = nowhere
    if any(map(_STATISTIC.fullmatch, wrong)):
        is_statistic = np.array([_STATISTIC.fullmatch(str(cell).strip()) is not None for cell in column.to_pylist()])
    left_out = f"{len(wrong)} cells of {name} are no number, as {wrong[0][:40]!r}: they were left out"
    return _Cells(numbers, numbers, is_statistic, () if is_empty else (ReadingNote("no_number", left_out),))


def _even(body: str, layout: Layout) -> str:
    """Rows with as many cells as the widest: trailing separators come and go."""
    if layout.separator == " ":
        return "\n".join(" ".join(line.split()) for line in body.splitlines() if line.strip())
    return body


def _parsed(body: str, layout: Layout, width: int, keep: object, source: str) -> pa.Table:
    names = [f"c{k}" for k in range(width)]
    try:
        return pa_csv.read_csv(
            arrow_owned(body.encode("utf-8", errors="replace")),
            read_options=pa_csv.ReadOptions(column_names=names, use_threads=False),
            parse_options=pa_csv.ParseOptions(delimiter=layout.separator, invalid_row_handler=keep),
            convert_options=pa_csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
        )
    except (pa.ArrowInvalid, pa.ArrowTypeError, OSError) as error:
        raise DataRefused(
            f"{source}: the rows are no table", step="read recording", value=str(error).splitlines()[0][:120],
            limit=f"{width} cells in each row", remedy="export again, without footer lines",
        ) from error  # fmt: skip


def _require_footer(wrong: Sequence[WrongRow], rows: int, source: str) -> None:
    """Rows of another width may stand only behind the numbers: inside them they are lost samples or shifted cells."""
    numbers = [row.number for row in wrong if row.number is not None]
    holds_numbers = any(sum(map(is_number, row.text.replace(";", ",").split(","))) >= 2 for row in wrong)
    if len(wrong) > MOST_FOOTER_ROWS or holds_numbers or (numbers and min(numbers) <= rows):
        first = wrong[0]
        raise DataRefused(
            f"{source}: a row holds {first.cells} columns", step="read recording",
            value=f"row {first.number}" if first.number is not None else first.cells,
            limit="as many as the first row of numbers", remedy="export again, without footer lines",
        )  # fmt: skip


def _start_and_increment(layout: Layout, clock: Clock) -> tuple[tuple[str, ...], tuple[str, ...], Clock]:
    """Rigol's and its kind: `Start` and `Increment` are columns by name, their values stand in the row of units."""
    start, step = clock.start_s, clock.interval_s
    names = list(layout.names)
    for k, (name, unit) in enumerate(zip(layout.names, layout.units, strict=True)):
        cell = name.lower().replace(" ", "")
        value = unit if is_number(unit) else cell.partition("=")[2]
        if not is_number(value):
            continue
        if cell.partition("=")[0] in {"start", "t0"}:
            start, names[k] = float(value), ""
        elif cell.partition("=")[0] in {"increment", "tinc", "dt"}:
            step, names[k] = float(value), ""
    return tuple(names), layout.units, Clock(step, start, clock.said_by or ("Start and Increment" if step else ""))


def _unreadable(path: Path, reason: str) -> DataRefused:
    return DataRefused(
        f"{path}: the file cannot be read", step="read recording", value=reason, limit="CSV, CSV.gz, Parquet, MATLAB v5",
        remedy="export the recording again, as CSV or Parquet",
    )  # fmt: skip
