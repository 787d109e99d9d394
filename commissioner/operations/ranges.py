"""What the numbers and files of a command line may be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused, UsageError
from commissioner.recordings.table import Table

IN_A_ROW, MOST_SHARED = 32, 0.5
ODD = np.uint64(0x9E3779B97F4A7C15)
"""Samples of the currents that are alike in a row only in copies; the part of the shorter recording that may be."""


def require_range(option: str, value: float, low: float, high: float) -> None:
    """UsageError where an option of the command line is not within `low` ... `high`, or no number."""
    if not low <= value <= high:
        raise UsageError(
            f"{option} {value:g} is out of range",
            step="command line",
            value=value,
            limit=f"{low:g} ... {high:g}",
            remedy=f"give {option} a value in this range",
        )


def require_distinct(files: Sequence[Path]) -> None:
    """UsageError where a file is named twice: its data would count as two measurements and halve the squares of every error."""
    seen: set[Path] = set()
    for file in files:
        if file.resolve() in seen:
            raise UsageError(
                f"{file} is given twice", step="command line", value=str(file), limit="every recording once",
                remedy="name it once",
            )  # fmt: skip
        seen.add(file.resolve())


def require_independent(tables: Sequence[Table]) -> None:
    """DataRefused where most of a recording stands in another one too: a copy or an excerpt under another name is no second measurement."""
    known: list[tuple[str, NDArray[np.uint64]]] = []
    for table in tables if len(tables) > 1 else ():
        own = _rows(table)
        for source, theirs in known:
            shared = np.intersect1d(own, theirs, assume_unique=True).size / max(min(own.size, theirs.size), 1)
            if shared > MOST_SHARED:
                raise DataRefused(
                    f"{table.source} holds the same measured samples as {source}", step="read recordings", value=f"{100 * shared:.0f} % of the samples",
                    limit="every measurement once: a copy would narrow the errors and measure nothing", remedy="leave one of the two out",
                )  # fmt: skip
        known.append((table.source, own))


def _rows(table: Table) -> NDArray[np.uint64]:
    """A number for every row of `IN_A_ROW` samples of the currents in which one flows, each once."""
    currents = [np.nan_to_num(x) for name, x in sorted(table.columns.items()) if name.startswith("current_")]
    if not currents or currents[0].size < IN_A_ROW:
        return np.zeros(0, np.uint64)
    out, flows = np.zeros(currents[0].size, np.uint64), np.zeros(currents[0].size, bool)
    for x in currents:
        out = (out * ODD) ^ np.ascontiguousarray(x + 0.0).view(np.uint64)
        flows |= x != 0.0
    reach = 1
    while reach < IN_A_ROW:
        out ^= out >> np.uint64(29)
        out, reach = out[:-reach] * ODD + out[reach:], 2 * reach
    return np.unique(out[flows[: out.size]])
