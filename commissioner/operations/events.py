"""Progress as records, beside those of a run (`procedure.findings`) and of a search for causes (`diagnose.search.journal`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Began:
    """Something that takes longer than a moment has begun."""

    doing: str


Observe = Callable[[object], None]
"""Is called with every record; what it raises ends the operation."""
GoOn = Callable[[], bool]
"""Is asked between two parts of the work; a no ends it with what was found so far."""


def nobody(_record: object) -> None:
    """Observes nothing."""


def always() -> bool:
    """Cancels nothing."""
    return True
