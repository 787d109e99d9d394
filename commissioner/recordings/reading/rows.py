"""Rows of a text that are no samples: the header's lines again among the numbers, a last row that was torn off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from commissioner.recordings.reading.layout import Layout, split
from commissioner.records import ReadingNote


@dataclass(frozen=True)
class WrongRow:
    """A row of another width than the table's: its number from 1 among the rows, how many cells it holds, its text."""

    number: int | None
    cells: int
    text: str


def without_headers(table: pa.Table, wrong: list[WrongRow], layout: Layout) -> tuple[pa.Table, list[ReadingNote]]:
    """The table without the lines of names and units that stand again among its rows; those of another width leave `wrong`."""
    headers = [row for row in (layout.names, layout.units) if any(row)]
    again = np.zeros(table.num_rows, dtype=np.bool_)
    for header in headers:
        again |= _repeats(table, header)
    bare = [_trimmed(header) for header in headers]
    shorter = [row for row in wrong if _trimmed(_cells(row.text, layout.separator)) in bare]
    count = int(again.sum()) + len(shorter)
    if not count:
        return table, []
    wrong[:] = [row for row in wrong if row not in shorter]
    note = ReadingNote("header_again", f"{count} rows repeat the names or units above the columns: they were left out")
    return table.filter(pa.array(~again)), [note]


def without_torn_row(wrong: list[WrongRow], body: str, width: int) -> list[ReadingNote]:
    """A note where the text ends inside its last row, which leaves `wrong`."""
    if not wrong or wrong[-1].cells >= width or wrong[-1].text.split() != body.rstrip().rpartition("\n")[2].split():
        return []
    torn = wrong.pop()
    return [
        ReadingNote("torn_row", f"the last row breaks off in column {torn.cells} of {width}: it was left out; what followed is lost")
    ]  # fmt: skip


def _repeats(table: pa.Table, header: Sequence[str]) -> NDArray[np.bool_]:
    same = np.ones(table.num_rows, dtype=np.bool_)
    for name, column in zip(header, table.columns, strict=True):
        same &= pc.equal(pc.utf8_trim(column, characters="# \t\ufeff"), name).to_numpy(zero_copy_only=False)
    return same


def _cells(line: str, separator: str) -> list[str]:
    return split(line.lstrip("# \ufeff"), separator)


def _trimmed(row: Sequence[str]) -> list[str]:
    """The cells without empty ones at the end."""
    filled = [k for k, cell in enumerate(row) if cell]
    return list(row[: filled[-1] + 1]) if filled else []
