"""Where the numbers of a text begin, what separates them, and which rows above them are names and units."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import MAX_COLUMNS
from commissioner.recordings.names import meaning_of, meanings_of
from commissioner.recordings.reading.cells import is_number, is_numeric, ungrouped
from commissioner.recordings.reading.preface import SIGNS
from commissioner.recordings.sheet_names import sheet_columns
from commissioner.recordings.units import IN_NAME, is_unit, read_unit, unit_in

MAX_PREFACE_LINES = 400
LONGEST_LINE = 1 << 16
MARKS = (";", "\t", ",")
"""Between the cells of a table, the surest first."""
SEPARATORS = (*MARKS, " ")
MOST_BETWEEN = 4
"""Rows between the names and those next to the numbers: of channels, types, ranges."""
HEAD_ROWS = 3
"""Rows of numbers in a row, alike, that begin the data; fewer where the file ends."""

LEAST_WITH_TEXT = 8
"""Rows alike that begin with a text; fewer where the file ends."""
LABELS = frozenset({"label", "labels", "tracename", "channelname", "channellabel", "signalname", "name", "source"})
UNITS = frozenset({"verticalunits", "verticalunit", "vunit", "vunits", "yunit", "yunitlabel", "unit", "units"})
"""Keys of rows in a preface that hold a name or a unit of every column."""

_COUNT = re.compile(r"^[\d.,]+\s*(?=\D)")
"""Of a unit that is so many others (`100 ns`, `0.1 ms`)."""

_MARKED = re.compile(r"^(?:[# ]+|%[% ]*(?=[^\W\d_\[(]))+")
"""What marks a line above the numbers as no row of them: `# t ia`, `% t[s] ia[A]`."""

Row = list[str]


@dataclass(frozen=True)
class Layout:
    """`start`: where in the text the first row of numbers begins. `skip`: cells of each row before the first column
    (a preface that stands beside the numbers). `preface`: rows above the names, as cells."""

    separator: str
    start: int
    names: tuple[str, ...]
    units: tuple[str, ...]
    preface: tuple[Row, ...]
    skip: int = 0
    is_split: bool = False
    """Each number fills two cells: a decimal comma between commas."""


@dataclass(frozen=True)
class _Line:
    text: str
    start: int


def head_lines(text: str) -> list[_Line]:
    """The first lines with where each begins; a longer line than any instrument writes ends them."""
    lines: list[_Line] = []
    at = 0
    while at < len(text) and len(lines) < MAX_PREFACE_LINES + 60:
        end = _line_end(text, at)
        if end < 0:
            break
        lines.append(_Line(text[at:end], at))
        at = end + (2 if text[end : end + 2] == "\r\n" else 1)
    return lines


def _line_end(text: str, at: int) -> int:
    """Of the line at `at`; -1 where it is too long."""
    limit = min(len(text), at + LONGEST_LINE)
    ends = [e for e in (text.find("\n", at, limit), text.find("\r", at, limit)) if e >= 0]
    return min(ends) if ends else (limit if limit == len(text) else -1)


def split(line: str, separator: str) -> Row:
    """The cells of a line; none where a cell is longer than any number or name."""
    if separator == " ":
        return line.split()
    try:
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    except csv.Error:
        return []
    return cells if separator == "," else [ungrouped(cell) for cell in cells]


def _said(line: str, separator: str) -> Row:
    """The cells of a line above the numbers; a number behind its key whole that its comma would cut (`# rated_current_a: 4,86`)."""
    cells = split(_MARKED.sub("", line), separator)
    if separator != ",":
        return cells
    out = cells[:1]
    for cell in cells[1:]:
        is_cut = SIGNS.match(out[-1]) and out[-1][-1].isdigit() and cell[:1].isdigit() and not SIGNS.match(cell)
        out = [*out[:-1], f"{out[-1]},{cell}"] if is_cut else [*out, cell]
    return out


def layout_of(text: str, source: str) -> Layout:
    """The layout; DataRefused where no rows of numbers are found."""
    lines = head_lines(text)
    for k, line in enumerate(lines[:MAX_PREFACE_LINES]):
        if not line.text.strip() or line.text.lstrip().startswith("#"):
            continue
        for separator in SEPARATORS:
            rows = _rows(lines[k:], separator)
            skip = _beside(rows)
            if len(rows) == 1 and k > 0 and _are_numbers(_rows(lines[k - 1 : k], separator)):
                continue  # the last row of a table with a spoilt one
            if _are_numbers([row[skip:] for row in rows]) and _go_on(rows[0], lines[k:], separator):
                rows = [row[skip:] for row in rows]
                return _layout(lines, k if skip else _begun(lines, k, separator, rows), separator, skip, rows, source)
    raise _without_rows([line.text for line in lines], source)


def empty(source: str) -> DataRefused:
    """Of a file in which nothing stands."""
    return DataRefused(
        f"{source}: the file is empty", step="read recording", value="nothing", limit="names of columns and rows of numbers",
        remedy="export the recording again, and see that the export ends before the file is copied",
    )  # fmt: skip


def _without_rows(lines: Sequence[str], source: str) -> DataRefused:
    """Of a text without rows of numbers: it is empty, holds a header and nothing below it, or is no table."""
    filled = [line.strip("\ufeff \t;,") for line in lines]
    filled = [line for line in filled if line]
    if not filled:
        return empty(source)
    rows = [_said(line, mark) for line in filled for mark in SEPARATORS if mark in line]
    header = next((row for row in rows if len(row) > 1 and known(row) > 1), None)
    holds_numbers = any(sum(map(is_number, row)) > 1 for row in rows)
    what = (
        "the file holds a header and no row of numbers below it"
        if header and not holds_numbers
        else "no rows of numbers were found"
    )
    return DataRefused(
        f"{source}: {what}", step="read recording", value=", ".join(header)[:60] if header else filled[0][:60],
        limit="rows of numbers below the names" if header else "two or more columns of numbers",
        remedy="record again, or export the samples as well as their names" if header else "export time, three currents and three voltages as CSV",
    )  # fmt: skip


def _rows(lines: Sequence[_Line], separator: str) -> list[Row]:
    filled = [line.text for line in lines[: 3 * HEAD_ROWS] if line.text.strip()]
    return [split(text, separator) for text in filled[:HEAD_ROWS]]


def _beside(rows: Sequence[Row]) -> int:
    """Cells that hold a preface beside the numbers (Tektronix TDS: key, value, empty; then time and volts)."""
    is_so = (
        len(rows) == HEAD_ROWS and all(len(r) >= 5 and not r[2] for r in rows) and rows[0][0].lower() == "record length"
    )
    return 3 if is_so else 0


def _are_numbers(rows: Sequence[Row]) -> bool:
    """Rows alike, of two numbers at least, in which every other cell is empty or stands for no number."""
    if not rows or len({len(r) for r in rows}) != 1:
        return False
    return all(sum(map(is_number, r)) >= 2 and all(map(is_numeric, r)) for r in rows) or _with_text(rows)


def _with_text(rows: Sequence[Row]) -> bool:
    """Rows of numbers with a column of texts among them (a date, a state, a test's name), the same in all; fewer where the file
    ends with them."""
    kinds = [tuple(is_numeric(c) for c in r) for r in rows]
    numbers = sum(kinds[0])
    filled = max(sum(1 for c in r if is_number(c)) for r in rows)
    return len(set(kinds)) == 1 and filled >= 3 and len(rows[0]) - numbers <= max(2, len(rows[0]) // 4)


def _go_on(first: Row, lines: Sequence[_Line], separator: str) -> bool:
    """Whether rows that begin with a text go on for longer than a preface's keys do (`Vertical Offset,0,0,0`)."""
    if not first or is_numeric(first[0]):
        return True
    rows = [split(line.text, separator) for line in lines[:LEAST_WITH_TEXT] if line.text.strip()]
    return len({tuple(is_numeric(c) for c in row) for row in rows}) == 1


def _begun(lines: Sequence[_Line], first: int, separator: str, rows: Sequence[Row]) -> int:
    """Where a table with texts begins: the rows above the ones alike fit its columns, though a text stands in some of them only (a test
    named once for its points, a plate beside them)."""
    numbers = [any(map(is_number, cells)) for cells in zip(*rows, strict=True)]
    begins = first
    while not all(numbers) and begins > 0:
        row = split(lines[begins - 1].text, separator)
        kinds = list(zip(row, numbers, strict=False))
        is_fit = len(row) <= len(rows[0]) and sum(of_numbers and is_number(cell) for cell, of_numbers in kinds) > 1
        if not is_fit or any(of_numbers and not is_numeric(cell) for cell, of_numbers in kinds):
            break
        begins -= 1
    above = [split(line.text, separator) for line in lines[max(begins - 2, 0) : begins]]
    return begins if any(known(row) > 1 for row in above) else first


def _require_one_table(above: Sequence[Row], source: str) -> None:
    """DataRefused: rows of numbers stand below names above the last names: they would be lost, or read under the others'."""
    numbers = [
        k
        for k, row in enumerate(above)
        if row and is_number(row[0]) and sum(map(is_number, row)) > 1 and all(map(is_numeric, row))
    ]
    named = next((k for k, row in enumerate(above[: numbers[-1]]) if known(row) > 1), None) if numbers else None
    lost = next((above[k] for k in numbers if named is not None and k > named), None)
    if lost is not None:
        raise DataRefused(
            f"{source}: rows of numbers stand above the table that begins behind them, as {', '.join(lost)[:60]}", step="read recording",
            value=f"{len(numbers)} rows", limit="one table, its names above all its rows",
            remedy="give each table as a file of its own, or all rows below one line of names (with a column `test`)",
        )  # fmt: skip


def _layout(lines: Sequence[_Line], first: int, separator: str, skip: int, rows: Sequence[Row], source: str) -> Layout:
    width = len(rows[0])
    if width > MAX_COLUMNS:
        raise DataRefused(
            f"{source}: the file unpacks to too much", step="read recording", value=f"{width} columns", limit=MAX_COLUMNS,
            remedy="export fewer columns",
        )  # fmt: skip
    above = [_cells_above(line.text, separator, width) for line in lines[:first] if line.text.strip()]
    if skip:
        preface = [split(line.text, separator)[:2] for line in lines[first : first + 30]]
        channel = next((row[1] for row in preface if len(row) > 1 and row[0].lower() == "source"), "CH1")
        beside = {row[0].lower(): row[1] for row in preface if len(row) > 1}
        named = ("Time", channel, *("",) * (width - 2))
        return Layout(
            separator, lines[first].start, named[:width],
            (beside.get("horizontal units", "s"), beside.get("vertical units", ""), *("",) * (width - 2)), tuple(preface), skip,
        )  # fmt: skip
    _require_one_table(above, source)
    names, units, used, is_split = _names(above, width)
    if not is_split:
        _require_columns(above[len(above) - used :], rows, source)
    names, units, used = _by_keys(above, width, names, units, used)
    names, units, used, between = _further_up([_stripped(row, width) for row in above], names, units, used)
    said = (*above[: len(above) - used], *between, *_beyond(above[len(above) - used :], width))
    return Layout(separator, lines[first].start, names, units, said, 0, is_split and separator == ",")


def _cells_above(text: str, separator: str, width: int) -> Row:
    """The cells of a line above the numbers; by another separator where that gives one for each column and theirs does not."""
    bare = text.lstrip("\ufeff")
    if separator == " " and bare.startswith("#") and SIGNS.match(bare.lstrip("# ")):
        return [bare.lstrip("# ").strip()]  # its spaces separate nothing
    ways = [_said(bare, mark) for mark in dict.fromkeys((separator, ";", "\t", ","))]
    return next((row for row in ways if len(row) == width), ways[0])


def _require_columns(header: Sequence[Row], rows: Sequence[Row], source: str) -> None:
    """DataRefused: channels are named beyond the last number of the rows, or numbers stand beyond the last name, so that it is
    open which name is which column's."""
    width = len(rows[0])
    for names in header:
        more, fewer = names[width:], [row[len(names) :] for row in rows]
        is_open = any(map(meaning_of, more)) or (any(map(meaning_of, names)) and any(any(cells) for cells in fewer))
        if is_open and not _is_units(names):
            raise DataRefused(
                f"{source}: its rows hold {'fewer' if more else 'more'} columns than are named", step="recognise columns",
                value=f"{len(names)} names over {width} numbers", limit="a name for each column, in their order",
                remedy="export the column that is missing, or name those that have no name (`column_1,time_s,...`)",
            )  # fmt: skip


def _beyond(header: Sequence[Row], width: int) -> list[Row]:
    """Names beyond the numbers over values in the row of units: keys with values (Rigol: `Start` and `Increment`)."""
    return [list(pair) for pair in zip(*(row[width:] for row in header), strict=False)] if len(header) == 2 else []


def _by_keys(
    above: Sequence[Row], width: int, names: tuple[str, ...], units: tuple[str, ...], used: int
) -> tuple[tuple[str, ...], tuple[str, ...], int]:
    """Names of channels that a row of labels has, and units of those without one; where the last row above is no row of names
    (Yokogawa: date and time of every trace), the labels alone."""
    labels, said = (_keyed(above, width, keys) for keys in (LABELS, UNITS))
    last = [c for c in (above[-1] if above else []) if c]
    if labels and len(last) > 2 and all(is_numeric(c) for c in last[1:]):
        names, units, used = labels, ("",) * width, 0
    elif labels and (not last or _key(last[0]) not in LABELS):
        names = tuple(label or name for label, name in zip(labels, names, strict=True))
    if said:
        units = tuple(unit or of_key for unit, of_key in zip(units, said, strict=True))
    return names, units, used


def _keyed(above: Sequence[Row], width: int, keys: frozenset[str]) -> tuple[str, ...]:
    """The cells behind the key of the last such row, one a column: nothing for the first, which stands below the key, unless the
    row names one channel more."""
    for row in map(_with_its_key, reversed(above)):
        is_before = len(row) == width + 1 and row[-1]
        cells = [*([] if is_before else [""]), *row[1:], *[""] * width][:width]
        if row and _key(row[0]) in keys and len(row) >= width - 1 and any(cells) and not any(":" in c for c in cells):
            return tuple(cells)
    return ()


def _with_its_key(row: Row) -> Row:
    """The row with the key of its first cell in a cell of its own: `Units: s,mA,mA` as `Units,s,mA,mA`."""
    key, mark, rest = row[0].partition(":") if row else ("", "", "")
    return [key, rest.strip(), *row[1:]] if mark and rest.strip() else row


def _key(cell: str) -> str:
    return "".join(c for c in cell.lower() if c.isalnum())


def _names(above: Sequence[Row], width: int) -> tuple[tuple[str, ...], tuple[str, ...], int, bool]:
    """(names, units, rows used, whether each number fills two cells)."""
    rows = [_stripped(row, width) for row in above]
    if not rows or not any(rows[-1]):
        return tuple(f"column_{k}" for k in range(width)), ("",) * width, 0, False
    last, before = rows[-1], rows[-2] if len(rows) > 1 else []
    if _is_units(last) and before and len(before) >= 2 and not _is_units(before):
        return _padded(before, width), _padded(last, width), 2, width >= 2 * len(before)
    if before and _is_units(before) and len(before) >= 2 and not _is_units(last):
        return _padded(last, width), _padded(before, width), 2, width >= 2 * len(last)
    return _padded(last, width), tuple(unit_in(n) for n in _padded(last, width)), 1, width >= 2 * len(last) >= 4


def _further_up(
    rows: Sequence[Row], names: tuple[str, ...], units: tuple[str, ...], used: int
) -> tuple[tuple[str, ...], tuple[str, ...], int, list[Row]]:
    """The names of a row above, or of groups over phases (`Current,,` over `U,V,W`), where these mean more columns than the names next
    to the numbers (a channel's number, its type, a phase alone); the units below them; the rows between, whose keys may say a scale."""
    width, best, rest = len(names), (names, units, used), list[Row]()
    for count in range(used + 1, min(len(rows), used + MOST_BETWEEN) + 1) if used else ():
        row, below = rows[-count], rows[len(rows) - count + 1 :]
        for found in (_grouped(row, names), _padded(row, width)) if len(row) <= width else ():
            if known(found) > max(known(best[0]), 1):
                of_row = next((r for r in below if _is_units(r)), [])
                said = zip(_padded(of_row, width), map(unit_in, found), strict=True)
                best = found, tuple(own or of_name for own, of_name in said), count
                rest = [r for r in below if r is not of_row]
    return *best, rest


def known(names: Sequence[str]) -> int:
    """How many names mean a column of a recording or of a test sheet."""
    return len(meanings_of(names).keys() | sheet_columns(names).keys())


def _grouped(row: Row, names: Sequence[str]) -> tuple[str, ...]:
    """Each name behind that of its group, which stands over the first of them (cells that were one) or over each."""
    group, out = "", []
    for over, name in zip(_padded(row, len(names)), names, strict=True):
        group = over or group
        unit = unit_in(group)
        out.append(f"{IN_NAME.sub('', group)} {name}" + f" [{unit}]" * bool(unit) if group and name else group or name)
    return tuple(out)


def _stripped(row: Row, width: int) -> Row:
    """The row without empty cells at its end that go beyond the numbers."""
    row = list(row)
    while row and not row[-1] and len(row) > width:
        row.pop()
    return row if len(row) <= width + 8 else row[:width]


def _is_units(row: Row) -> bool:
    """A row of units: cells that are one, and none that is something else but a number, unless a time's or a frequency's unit begins
    it and half are known: one that is not known is asked for where its column is needed."""
    said = [cell for cell in row if cell]
    others = [cell for cell in said if not (is_unit(cell) or is_number(cell))]
    begins = (
        len(said) > 2
        and (unit := read_unit(_COUNT.sub("", said[0]))) is not None
        and unit.measures in {"time", "frequency"}
    )
    are_few = 2 * len(others) <= len(said) or any("%" in cell for cell in others)
    return (
        len(said) >= 1
        and (not others or (begins and are_few and all(len(cell) > 1 for cell in others)))
        and sum(read_unit(cell) is not None or cell.strip("[]() ").lower() in {"%", "pu"} for cell in said) >= 1
        and not all(len(cell) == 1 and cell.isupper() and cell in "UVW" for cell in said)
    )


def _padded(row: Row, width: int) -> tuple[str, ...]:
    return tuple((row + [""] * width)[:width])
