"""Tables below each other that hold other channels at the same times (currents, then voltages) as one table."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, takewhile

from commissioner.recordings.names import meaning_of, meanings_of
from commissioner.recordings.reading.cells import is_number, is_numeric
from commissioner.recordings.reading.layout import LONGEST_LINE, MARKS, split
from commissioner.recordings.units import is_unit

MOST_LINES = 60
"""That begin with a letter: a table whose rows do has more."""
MOST_TABLES = 6
_WORDS = re.compile(r'\n([#"\'\[(% ]*[^\W\d_][^\n]*)')
"""A line that begins with a word, behind the one before it: looked for by its line feed, seven times as fast as by MULTILINE."""


@dataclass(frozen=True)
class _Table:
    """The cells of its line of names, of its line of units (none without one), and of its rows."""

    names: list[str]
    units: list[str]
    rows: list[list[str]]


def joined(text: str) -> str | None:
    """The text with the columns of the tables below beside those of the first; None where there is one table, or where their times or
    channels are not such."""
    lines = [found for found, _ in zip(_WORDS.finditer(f"\n{text}"), range(MOST_LINES + 1), strict=False)]
    if len(lines) > MOST_LINES or any(len(line[1]) > LONGEST_LINE for line in lines):
        return None
    for mark in MARKS:
        heads = [line for line in lines if mark in line[1] and _is_head(split(line[1].lstrip("# "), mark))]
        if 1 < len(heads) <= MOST_TABLES:
            ends = [*(line.start() for line in heads[1:]), len(text)]
            tables = [_table(text[head.start() : end], mark) for head, end in zip(heads, ends, strict=True)]
            if all(_go_together(one, other) for one, other in pairwise(tables)) and _are_others(tables):
                return text[: heads[0].start()] + _beside(tables, mark)
    return None


def _is_head(cells: Sequence[str]) -> bool:
    """A time, and a channel at least."""
    return len(cells) > 1 and meaning_of(cells[0]) == "time_s" and len(meanings_of(cells)) > 1


def _table(text: str, mark: str) -> _Table:
    rows = [split(line, mark) for line in text.splitlines() if line.strip(f"{mark} ")]
    names, below = [cell for cell in rows[0] if cell], rows[1:]
    names[0] = names[0].lstrip("# ")
    units = below[0] if below and not any(map(is_number, below[0])) and all(map(is_unit, below[0])) else []
    numbers = takewhile(lambda row: is_number(row[0]) and all(map(is_numeric, row)), below[bool(units) :])
    width = len(names)
    return _Table(names, units[:width], [row[:width] for row in numbers])


def _go_together(one: _Table, other: _Table) -> bool:
    """Whether both stand at the same times, in one unit, to the last digit."""
    return (
        len(one.rows) > 1
        and [row[0] for row in one.rows] == [row[0] for row in other.rows]
        and one.names[0] == other.names[0]
        and one.units[:1] == other.units[:1]
        and all(len(row) == len(table.names) for table in (one, other) for row in table.rows)
    )


def _are_others(tables: Sequence[_Table]) -> bool:
    """Whether no channel stands in two tables: these would be recordings behind each other."""
    names = [name for table in tables for name in table.names[1:]]
    return len(set(names)) == len(names)


def _beside(tables: Sequence[_Table], mark: str) -> str:
    first = tables[0]
    lines = [[first.names[0], *(name for table in tables for name in table.names[1:])]]
    if first.units:
        lines.append([first.units[0], *(unit for table in tables for unit in table.units[1:])])
    rows = zip(*(table.rows for table in tables), strict=True)
    lines += [[of[0][0], *(cell for row in of for cell in row[1:])] for of in rows]
    return "\n".join(mark.join(cells) for cells in lines) + "\n"
