"""What the numbers and files of a command line may be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from commissioner.errors import UsageError


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
