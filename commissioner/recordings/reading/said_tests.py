"""The column of a test sheet that names each row's test: `no load`, `Leerlauf`, `locked rotor`, `dc`, as codes."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from commissioner.recordings.words import folded, translated
from commissioner.records import DIRECT_TEST, IDLE_TEST, LOCKED_TEST, ReadingNote, Signal

TITLES = frozenset({"test", "testtype", "typetest", "kind", "pruefung", "versuchsart", "typeoftest"})
WORDS = {
    DIRECT_TEST: r"dc|cc|directcurrent|winding(?:resistance)?|resistance|resistancewinding|wicklungswiderstand",
    IDLE_TEST: r"noload|idle|idling|leerlaufversuch|unloaded",
    LOCKED_TEST: r"(?:locked|blocked)(?:rotor)?|(?:en|in|a)?shortcircuit|kurzschlu(?:ss|ß)(?:versuch)?|festgebremst|arotorlocked|a?lockedrotor|standstill",
}  # fmt: skip


def is_title(name: str) -> bool:
    """Whether a column's name says that it names tests."""
    return _letters(name) in TITLES


def codes(cells: Sequence[str]) -> Signal | None:
    """`(n,)` of `records.DIRECT_TEST` ...; not a number where a cell says nothing known, None where no cell does."""
    said = [re.sub("^test|test$", "", _letters(cell)) for cell in cells]
    out = np.array([next((c for c, w in WORDS.items() if re.fullmatch(w, one)), np.nan) for one in said])
    return out if np.isfinite(out).any() else None


def unknown(cells: Sequence[str], said: Signal) -> tuple[ReadingNote, ...]:
    """That some rows name a test which is not known: what they are is told from their values."""
    names = sorted({cell.strip() for cell, code in zip(cells, said, strict=True) if _letters(cell) and np.isnan(code)})
    return (
        (ReadingNote("unknown_test", f"no known test: {', '.join(names)[:80]}; such rows are told from their values"),)
        if names
        else ()
    )


def _letters(text: str) -> str:
    return re.sub(r"[\W_\d]", "", folded(translated(text)).lower())
