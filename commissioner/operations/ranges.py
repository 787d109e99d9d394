"""What an option that is a number may be."""

from __future__ import annotations

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
