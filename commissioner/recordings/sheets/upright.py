"""A test sheet whose quantities stand down the rows and whose points stand beside each other, turned upright."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from commissioner.recordings.reading.cells import is_number
from commissioner.recordings.reading.layout import head_lines, split
from commissioner.recordings.reading.preface import SIGNS
from commissioner.recordings.reading.said_tests import codes
from commissioner.recordings.sheet_names import is_sheet, resistance_meaning, sheet_columns
from commissioner.recordings.sheets.indexed import is_symbol, symbol_of, tests_in
from commissioner.recordings.sheets.listed import MARKS as LISTED
from commissioner.recordings.sheets.listed import listed
from commissioner.recordings.units import FOREIGN, read_unit, unit_in

MOST_BYTES, MOST_LINES = 20_000, 80
MARKS = (";", "\t", ",", ":", "=")
_CERTAIN = re.compile(r"[-+]?(?:0[.,]\d+|\d+(?:[.,](?!\d{3}$)\d+)?)")
"""A number whose mark can only be a decimal one."""
_CELL = re.compile(r"([-+]?[\d.,' ]*\d(?:[eE][-+]?\d+)?)\s*(\D*)")


@dataclass(frozen=True)
class _Line:
    """A quantity: its name, its unit, its value at each point."""

    name: str
    unit: str
    values: tuple[str, ...]


def upright(text: str) -> str | None:
    """The text with a row for each point; None where it is no such sheet. A list of one point is one only where its names say which
    test it is (`U0`, `Uk`): bare names (`U`, `I`, `P`) may be a plate's."""
    if len(text) > MOST_BYTES:
        return None
    lines = [line.text.strip().lstrip("\ufeff") for line in head_lines(text) if line.text.strip()]
    if not 3 <= len(lines) <= MOST_LINES:
        return None
    return next((found for mark in MARKS if (found := _turned(lines, mark))), None) or _turned(_spelt(lines), ";")


def _turned(lines: Sequence[str], mark: str) -> str | None:
    rows = [_cells(line, mark) for line in lines if not line.startswith("#")]
    said = [line for line in lines if line.startswith("#")] + [
        f"# {row[0]}" for row in rows if len(row) == 1 and SIGNS.match(row[0])
    ]
    every = [one for row in rows if (one := _quantity(row))]
    names = [one.name for one in every]
    taken = {k for of in tests_in(names).values() for k in of.values()}
    aside = [one for k, one in enumerate(every) if taken and k not in taken and len(one.values) == 1]
    quantities = [one for one in every if one not in aside]
    points = max((len(one.values) for one in quantities), default=0)
    is_certain = len(tests_in(names)) > 0 or (points > 1 and is_sheet(names))
    if not is_certain or any(len(one.values) != points for one in quantities):
        return None
    if any(is_sheet(row) or len(tests_in(row)) > 0 for row in rows):
        return None
    titles = next((title for row in rows if (title := _titles(row, points))), ())
    head = [
        f"{one.name} [{one.unit}]" if one.unit and read_unit(unit_in(one.name)) is None else one.name
        for one in quantities
    ]
    columns = [one.values for one in quantities]
    if titles:
        head, columns = ["test", *head], [titles, *columns]
    between = mark if mark in ";\t" else "\t"
    body = [between.join(cells) for cells in (head, *zip(*columns, strict=True))]
    others = [f"# {row[0]}: {' '.join(row[1:])}" for row in rows if _is_beside(row, points)]
    others += [f"# {one.name}: {one.values[0]} {one.unit}".rstrip() for one in aside]
    return "\n".join([*said, *others, *body]) + "\n"


def _spelt(lines: Sequence[str]) -> list[str]:
    """A list with columns of symbols, units and values, or with titles between its values, as `name;unit;values`: those of a test by its
    symbol, which their own, their words or the title above say. Lines above it as they are; nothing of other forms."""
    found = listed(lines, _is_unit, (*LISTED, ":", "="))
    if not found:
        return []
    said = [line for line in lines if line.startswith("#")]
    above = next((one.above for one in found if any(one.above)), ())
    out = [*said, *([";".join(["", "", *above])] if above else [])]
    titled = float("nan")
    for one in found:
        if one.values:
            out.append(";".join((_called(one.names, titled), *filter(None, [one.unit]), *one.values)))
        else:
            out += [f"# {name}" for name in one.names if SIGNS.match(name)]
            code = codes(one.names[:1])
            titled = float("nan") if code is None else float(code[0])
    return out


def _called(names: Sequence[str], titled: float) -> str:
    """Of a quantity's names the symbol of a test, or the one that a test sheet knows."""
    symbol = next((name for name in names if is_symbol(name)), "")
    spelt = (spelt for name in names if (spelt := symbol_of(name, titled)))
    together = " ".join(names)
    if symbol or (symbol := next(spelt, "")):
        return symbol
    return together if resistance_meaning(together) else next((n for n in names if sheet_columns([n])), names[0])


def _cells(line: str, mark: str) -> list[str]:
    cells = split(line, mark) if mark in ";\t," else [cell.strip() for cell in line.split(mark, 1)]
    while cells and not cells[-1]:
        cells.pop()
    return cells


def _quantity(row: Sequence[str]) -> _Line | None:
    """A row of a name, of its unit where that has a cell of its own, and of numbers, with their unit or without."""
    if len(row) < 2 or not row[0] or is_number(row[0]):
        return None
    has_unit = len(row) > 2 and bool(row[1]) and not is_number(row[1]) and _is_unit(row[1])
    matched = [_CELL.fullmatch(cell) if cell else None for cell in row[2 if has_unit else 1 :]]
    if not any(matched) or any(
        cell and one is None for cell, one in zip(row[2 if has_unit else 1 :], matched, strict=True)
    ):
        return None
    found = _in_one_unit(matched)
    behind = {one[1] for one in found if one}
    if len(behind) > 1 or not (behind == {""} or (not has_unit and all(map(_is_unit, behind)))):
        return None
    unit = row[1].strip("[]() ") if has_unit else behind.pop()
    return _Line(row[0], unit, tuple(one[0] if one else "" for one in found))


def _in_one_unit(cells: Sequence[re.Match[str] | None]) -> list[tuple[str, str] | None]:
    """(number, unit) of each cell, all in the unit of the first where their own measure the same (`0.42 kW` beside `920 W`)."""
    said = [(one[1].strip(), one[2].strip()) if one else None for one in cells]
    units = [read_unit(one[1]) if one else None for one in said]
    known = [unit for unit in units if unit]
    if not all(_CERTAIN.fullmatch(one[0]) for one in said if one):
        return said
    if len({one[1] for one in said if one}) < 2 or len(known) != sum(one is not None for one in said):
        return said
    if len({(unit.measures, unit.is_ambiguous, unit.offset) for unit in known}) > 1:
        return said
    first = next(one[1] for one in said if one)
    return [
        (f"{float(one[0].replace(',', '.')) * unit.scale / known[0].scale:.12g}", first) if one and unit else None
        for one, unit in zip(said, units, strict=True)
    ]


def _is_unit(text: str) -> bool:
    return read_unit(text) is not None or text.strip("[]() ").lower() in FOREIGN | {"-", "", "1"}


def _titles(row: Sequence[str], points: int) -> tuple[str, ...]:
    """What the points are called, where a row names their tests."""
    cells = tuple(row[-points:]) if len(row) > points else ()
    return cells if cells and not any(map(is_number, cells)) and codes(cells) is not None else ()


def _is_beside(row: Sequence[str], points: int) -> bool:
    """A key with its value that is no quantity of the points."""
    return len(row) > 1 and _quantity(row) is None and not _titles(row, points) and not sheet_columns(row[:1])
