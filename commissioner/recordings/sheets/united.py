"""Cells that repeat the unit behind every number (`4.52 A`, `12,5ms`, `-320 mA` below `1.2 A`) as numbers under a name with the unit."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

from commissioner.errors import DataRefused
from commissioner.recordings.reading.cells import NUMBER, is_number, is_numeric
from commissioner.recordings.reading.layout import HEAD_ROWS, LONGEST_LINE, MARKS, head_lines, known, split
from commissioner.recordings.units import Unit, is_unit, read_unit, unit_in

LEAST_UNITED = 2
"""Cells of a row that are a number and its unit: fewer may be a remark."""
SI = {"time": "s", "current": "A", "voltage": "V", "power": "W", "frequency": "Hz", "resistance": "ohm", "torque": "Nm", "speed": "rad/s",
      "angle": "deg", "apparent": "VA"}  # fmt: skip
"""The unit of a column whose cells have several prefixes and whose name has none."""
_CELL = re.compile(rf"({NUMBER.pattern})\s*([^\d\s.,+-].*)")
_NUMBER_AND_WORD = re.compile(r"\d\s*(?![eEdD][+-]?\d)[^\W\d_]|\d\s*[%°(/\[]")
"""What a line without any such cell lacks: nearly every line of nearly every file, and to look at its cells takes a hundred times as long."""
WHOLE_POWER = 1e-9
"""By which a factor's logarithm may miss a whole number: digits stay as they stand, for these tell how well a value is known."""


@dataclass(frozen=True)
class _Column:
    """What every cell of a column is given in; nothing where its cells are bare."""

    text: str = ""
    unit: Unit | None = None


def parts(cell: str) -> tuple[str, str, Unit] | None:
    """(number, unit's text, unit) of a cell that is a number and a unit; None of any other."""
    found = _CELL.fullmatch(cell.strip())
    unit = read_unit(found[2]) if found else None
    return (found[1], found[2].strip(), unit) if found and unit else None


def is_quantity(cell: str) -> bool:
    """A number, or one with its unit."""
    return is_number(cell) or parts(cell) is not None


def united(text: str, source: str) -> str:
    """The text with numbers alone below names with their units; any other text as it is. DataRefused: a cell's unit measures something
    else than its column's."""
    lines = [line for line in head_lines(text) if line.text.strip()]
    may_be = [_NUMBER_AND_WORD.search(line.text) is not None for line in lines]
    for k, line in enumerate(lines):
        for mark in MARKS if any(may_be[k : k + HEAD_ROWS]) and not line.text.startswith("#") else ():
            rows = [split(one.text, mark) for one in lines[k : k + HEAD_ROWS]]
            above = split(lines[k - 1].text.lstrip("# "), mark) if k else []
            if _are_united(rows, above):
                columns = [_column(cells, above) for cells in enumerate(zip(*rows, strict=True))]
                return _head(text[: line.start], above, columns, mark) + _bare(
                    text[line.start :], columns, mark, source
                )
    return text


def _are_united(rows: Sequence[Sequence[str]], above: Sequence[str]) -> bool:
    """Rows of one width whose columns are numbers, or one unit's; below names that are known, texts among them (a test's name)."""
    if len(rows) < HEAD_ROWS or len({len(row) for row in rows}) != 1:
        return False
    columns = list(zip(*rows, strict=True))
    measured = [{found[2].measures for cell in cells if (found := parts(cell))} for cells in columns]
    if sum(map(bool, measured)) < LEAST_UNITED or any(len(one) > 1 for one in measured):
        return False
    others = [cells for cells in columns if not all(is_numeric(cell) or parts(cell) for cell in cells)]
    return not others or (known(above) > 1 and not any(map(is_quantity, chain(*others))))


def _column(placed: tuple[int, Sequence[str]], above: Sequence[str]) -> _Column:
    """The unit of a column: that of its name or row of units, else its cells' own, in SI where their prefixes differ."""
    place, cells = placed
    found = [one for one in map(parts, cells) if one]
    if not found:
        return _Column()
    name = above[place] if place < len(above) else ""
    said = name if is_unit(name) and read_unit(name) else unit_in(name)
    if (own := read_unit(said)) and own.measures == found[0][2].measures:
        return _Column("", own)
    said = found[0][1] if len({unit.scale for _, _, unit in found}) == 1 else SI.get(found[0][2].measures, found[0][1])
    return _Column(said, read_unit(said))


def _head(text: str, above: Sequence[str], columns: Sequence[_Column], mark: str) -> str:
    """What stands above the numbers, the units that its last line lacks behind its names."""
    if not above or not any(column.text for column in columns) or any(map(is_number, above)):
        return text
    names = [f"{n} [{c.text}]" if n and c.text else n for n, c in zip(above, columns, strict=False)]
    before = text.rstrip("\r\n").rpartition("\n")[0]
    return f"{before}\n{_line([*names, *above[len(columns) :]], mark)}" if before else _line(names, mark)


def _bare(text: str, columns: Sequence[_Column], mark: str, source: str) -> str:
    rows = csv.reader(io.StringIO(text), delimiter=mark, skipinitialspace=True)
    if any(len(line) > LONGEST_LINE for line in text.splitlines()):
        return text
    return "".join(_line([*map(_in, row, columns, [source] * len(row)), *row[len(columns) :]], mark) for row in rows)


def _in(cell: str, column: _Column, source: str) -> str:
    """The cell's number in the unit of its column, digits as they stand where that is its own."""
    found = parts(cell) if column.unit else None
    if found is None or column.unit is None:
        return cell
    number, text, unit = found
    if unit.measures != column.unit.measures or unit.is_ambiguous:
        raise _apart(cell, text, column.unit, source)
    power = math.log10(unit.scale / column.unit.scale)
    if abs(power - round(power)) > WHOLE_POWER:
        raise _apart(cell, text, column.unit, source)
    digits, _, exponent = number.lower().replace("d", "e").partition("e")
    shifted = round(power) + int(exponent or 0)
    return f"{digits}e{shifted}" if shifted else digits


def _apart(cell: str, unit: str, column: Unit, source: str) -> DataRefused:
    return DataRefused(
        f"{source}: the cell {cell.strip()[:40]} is in another unit than its column", step="read numbers", value=unit,
        limit=f"{column.measures} in every cell, in units of powers of ten", remedy="export again with one unit for each column",
    )  # fmt: skip


def _line(cells: Sequence[str], mark: str) -> str:
    out = io.StringIO()
    csv.writer(out, delimiter=mark, lineterminator="\n").writerow(cells)
    return out.getvalue()
