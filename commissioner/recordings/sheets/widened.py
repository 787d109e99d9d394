"""A long table, a row for each time and channel (`time,channel,value`), as the table of a column for each channel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pa_csv

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import MAX_COLUMNS
from commissioner.recordings.names import key_of, meaning_of
from commissioner.recordings.reading.arrow import arrow_owned
from commissioner.recordings.reading.cells import is_number
from commissioner.recordings.reading.layout import MARKS, head_lines, split
from commissioner.recordings.sheets.listed import QUANTITIES, UNITS, VALUES
from commissioner.recordings.units import unit_in
from commissioner.recordings.words import translated

CHANNEL = frozenset(
    f"{QUANTITIES} channel channelname channelid signal signalname variablename sensor tag tagname measurement metric series field kanal "
    "kanalname messkanal voie canal canale segnale senal variabile".split()
)
VALUE = frozenset(f"{VALUES} val data y".split())
UNIT = frozenset(UNITS.split())
POINT = frozenset(
    ("point", "row", "sample", "index", "no", "nr", "punkt", "messpunkt", "zeile", "test", "versuch", "prueba", "essai", "prova")
)  # fmt: skip
"""What the columns are called, as `key_of` their names; the rows' key is a time, or a point's number."""
FEWEST_CELLS, MOST_CELLS = 3, 8
MOST_NUMBERS = 10
"""Rows of numbers above the names of a long table: more are the numbers of another."""


@dataclass(frozen=True)
class _Head:
    """The line of names: its place in the text, what separates its cells, and the places of key, channel, value and unit in it."""

    start: int
    mark: str
    cells: tuple[str, ...]
    key: int
    channel: int
    value: int
    unit: int | None


def widened(text: str, source: str) -> str | None:
    """The text with a column for each channel; None where it is no long table. DataRefused: channels that were not sampled together,
    or one in two units."""
    head = _head(text)
    table = None if head is None else _cells(text, head, source)
    if head is None or table is None:
        return None
    channels = table[head.channel].dictionary_encode()
    names, of_row = [str(name) for name in channels.dictionary.to_pylist()], channels.indices.to_numpy()
    if len(names) > MAX_COLUMNS or not all(names):
        return None
    rows = [pa.array(np.flatnonzero(of_row == k)) for k in range(len(names))]
    keys = [table[head.key].take(of) for of in rows]
    _require_together(keys, names, source)
    titles = [_title(name, head, table, of, source) for name, of in zip(names, rows, strict=True)]
    columns = [keys[0].to_pylist(), *(table[head.value].take(of).to_pylist() for of in rows)]
    body = [_line(cells, head.mark) for cells in zip(*columns, strict=True)]
    above = text[: head.start].rstrip("\r\n")
    return "\n".join([above, _line((head.cells[head.key], *titles), head.mark), *body]).lstrip("\n") + "\n"


def is_long(cells: Sequence[str]) -> bool:
    """Whether names are those of a long table: a time or a point's number, a channel, a value."""
    return _placed(0, ",", tuple(cells)) is not None


def _head(text: str) -> _Head | None:
    """The line of names, which holds no number; sought no further than a few rows of numbers, for every file is asked."""
    of_numbers = 0
    for line in head_lines(text):
        if line.text.startswith("#") or not line.text.strip():
            continue
        for mark in MARKS:
            cells = tuple(cell.strip('" \ufeff') for cell in split(line.text, mark))
            numbers = sum(map(is_number, cells))
            of_numbers += numbers > 1
            if not numbers and FEWEST_CELLS <= len(cells) <= MOST_CELLS and (found := _placed(line.start, mark, cells)):
                return found
        if of_numbers > MOST_NUMBERS:
            return None
    return None


def _placed(start: int, mark: str, cells: tuple[str, ...]) -> _Head | None:
    said = [key_of(translated(cell)) for cell in cells]
    of = {role: [k for k, key in enumerate(said) if key in words] for role, words in
          (("channel", CHANNEL), ("value", VALUE), ("unit", UNIT), ("point", POINT))}  # fmt: skip
    if len(of["channel"]) != 1 or len(of["value"]) != 1 or len(of["unit"]) > 1:
        return None
    keys = [k for k, cell in enumerate(cells) if meaning_of(cell) == "time_s"] or of["point"]
    if len(keys) != 1:
        return None
    return _Head(start, mark, cells, keys[0], of["channel"][0], of["value"][0], next(iter(of["unit"]), None))


def _cells(text: str, head: _Head, source: str) -> list[pa.StringArray] | None:
    """The columns as texts; None of rows of other widths. DataRefused: rows of one channel differ in another column too (a quality)."""
    names = [f"c{k}" for k in range(len(head.cells))]
    try:
        table = pa_csv.read_csv(
            arrow_owned(text[head.start :].encode("utf-8", errors="replace")),
            read_options=pa_csv.ReadOptions(column_names=names, skip_rows=1, use_threads=False),
            parse_options=pa_csv.ParseOptions(delimiter=head.mark),
            convert_options=pa_csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
        )
    except (pa.ArrowInvalid, pa.ArrowTypeError):
        return None
    columns = [pc.utf8_trim_whitespace(column.combine_chunks()) for column in table.columns]
    used = {head.key, head.channel, head.value, head.unit}
    changing = [k for k, column in enumerate(columns) if k not in used and len(column.unique()) > 1]
    if changing and not any(map(is_number, columns[head.channel].unique().to_pylist())):
        raise DataRefused(
            f"{source}: beside time, channel and value its rows differ in {head.cells[changing[0]]}", step="read recording",
            value=", ".join(columns[changing[0]].unique().to_pylist()[:4])[:60], limit="one value of each channel at each time",
            remedy=f"leave {head.cells[changing[0]]} out where it says nothing of the values, else export the rows that are meant",
        )  # fmt: skip
    return columns if len(columns[0]) and not changing else None


def _require_together(keys: Sequence[pa.StringArray], names: Sequence[str], source: str) -> None:
    for name, of in zip(names[1:], keys[1:], strict=True):
        if not of.equals(keys[0]):
            raise DataRefused(
                f"{source}: its channels do not stand at the same times: {names[0]} has {len(keys[0])} values, {name} {len(of)}",
                step="read recording", value=f"{names[0]}, {name}", limit="a value of each channel at each time",
                remedy="export a column for each channel, at common times; leave out channels that were sampled otherwise",
            )  # fmt: skip


def _title(name: str, head: _Head, table: Sequence[pa.StringArray], rows: pa.Array, source: str) -> str:
    """A channel's name with its unit: of the column of units, or that of all values."""
    said = table[head.unit].take(rows).unique().to_pylist() if head.unit is not None else [head.cells[head.value]]
    units = said if head.unit is not None else [unit_in(said[0])]
    name = f"CH{name}" if name.isdigit() else name
    if len(units) > 1:
        raise DataRefused(
            f"{source}: {name} stands in two units", step="read recording", value=", ".join(units)[:60],
            limit="one unit for each channel", remedy="export each channel in one unit",
        )  # fmt: skip
    return f"{name} [{units[0]}]" if units[0] and not unit_in(name) else name


def _line(cells: Iterable[str], mark: str) -> str:
    return mark.join(f'"{cell}"' if mark in cell else cell for cell in cells)
