"""How data that carry no answer are refused: what, the value seen, the limit, the remedy."""

from __future__ import annotations

from commissioner.errors import DataRefused

ONE_BY_ONE = "diagnose them one by one"


def refused(what: str, value: object, limit: str, remedy: str) -> DataRefused:
    """What the data cannot carry, the value seen, what it should be, and what to do."""
    return DataRefused(what, step="diagnose", value=value, limit=limit, remedy=remedy)
