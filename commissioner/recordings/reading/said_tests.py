"""The column of a test sheet that names each row's test: `no load`, `Leerlauf`, `locked rotor`, `dc`, as codes."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from commissioner.recordings.names import folded
from commissioner.records import DIRECT_TEST, IDLE_TEST, LOCKED_TEST, Signal

TITLES = frozenset({"test", "testtype", "kind", "versuch", "prufung", "pruefung", "versuchsart", "typeoftest", "essai"})
WORDS = {
    DIRECT_TEST: r"dc(?:test)?|directcurrent|gleichstrom|courantcontinu|winding(?:resistance)?|resistance|wicklungswiderstand|widerstand",
    IDLE_TEST: r"noload(?:test)?|idle|idling|leerlauf(?:versuch)?|unloaded|(?:essai)?avide",
    LOCKED_TEST: r"(?:locked|blocked)(?:rotor)?(?:test)?|lockedrotor|shortcircuit(?:test)?|kurzschlu(?:ss|ß)(?:versuch)?|festgebremst|(?:essaia?)?rotorbloque|(?:essai)?encourtcircuit|standstill",
}  # fmt: skip


def is_title(name: str) -> bool:
    """Whether a column's name says that it names tests."""
    return _letters(name) in TITLES


def codes(cells: Sequence[str]) -> Signal | None:
    """`(n,)` of `records.DIRECT_TEST` ...; not a number where a cell says nothing known, None where no cell does."""
    out = np.array([next((c for c, w in WORDS.items() if re.fullmatch(w, _letters(cell))), np.nan) for cell in cells])
    return out if np.isfinite(out).any() else None


def _letters(text: str) -> str:
    return re.sub(r"[\W_\d]", "", folded(text).lower())
