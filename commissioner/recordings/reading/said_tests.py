"""The column of a test sheet that names each row's test: `no load`, `Leerlauf`, `locked rotor`, `dc`, as codes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from commissioner.errors import DataRefused
from commissioner.recordings.words import folded, translated
from commissioner.records import DIRECT_TEST, IDLE_TEST, LOAD_TEST, LOCKED_TEST, SINGLE_PHASE_TEST, ReadingNote, Signal

TITLES = frozenset({"test", "testtype", "typetest", "kind", "pruefung", "versuchsart", "typeoftest"})
MOTORS = frozenset(
    {
        "motor",
        "motorno",
        "motornr",
        "motorid",
        "machine",
        "maschine",
        "moteur",
        "motore",
        "serialno",
        "serialnumber",
        "serial",
        "sn",
    }
)
WORDS = {
    DIRECT_TEST: r"dc|cc|directcurrent|winding(?:resistance)?|resistance|resistancewinding|wicklungswiderstand",
    IDLE_TEST: r"noload|idle|idling|leerlaufversuch|unloaded",
    LOCKED_TEST: r"(?:locked|blocked)(?:rotor)?|(?:en|in|a)?shortcircuit|kurzschlu(?:ss|ß)(?:versuch)?|festgebremst|arotorlocked|a?lockedrotor|standstill",
    LOAD_TEST: r"(?:full|half|rated|nominal|part(?:ial)?)*(?:load(?:ed)?|operatingpoint)(?:nominal|rated)?|rated(?:point|values)?|nominal(?:point|values)?|(?:nenn|teil|voll)?(?:last|betrieb)(?:punkt|lauf|versuch)?"
    r"|belastungs?(?:versuch|lauf|punkt)?|(?:bemessungs|nenn)(?:punkt|werte)|(?:name|rating)?plate|typenschild",
}  # fmt: skip
SINGLE_PHASE = re.compile(
    r"single[\W_]*phase|\b1[\W_]*(?:ph(?:ase|asig)?\b|~)|einphasig\w*|mono(?:ph|f)as\w*", re.IGNORECASE
)


def is_title(name: str) -> bool:
    """Whether a column's name says that it names tests."""
    return _letters(name) in TITLES


def codes(cells: Sequence[str]) -> Signal | None:
    """`(n,)` of `records.DIRECT_TEST` ...; not a number where a cell says nothing known, None where no cell does. Beside no load and a
    locked rotor by name, what has another name is neither."""
    out = np.array([_code(cell) for cell in cells])
    if {IDLE_TEST, LOCKED_TEST} <= set(out.tolist()):
        named = np.array([bool(re.search(r"\w", cell)) for cell in cells])
        out[named & np.isnan(out)] = LOAD_TEST
    return out if np.isfinite(out).any() else None


def require_one_motor(name: str, cells: Sequence[str], source: str) -> None:
    """DataRefused: a column that names motors names several, whose tests would be taken together."""
    motors = dict.fromkeys(cell.strip() for cell in cells if cell.strip())
    if _letters(name) in MOTORS and len(motors) > 1:
        raise DataRefused(
            f"{source}: its rows are of {len(motors)} motors by the column {name}", step="read the sheet", value=", ".join(motors)[:80],
            limit="one motor", remedy="give the rows of each motor as a file of its own",
        )  # fmt: skip


def in_runs(cells: Sequence[str]) -> Signal | None:
    """`(n,)` from 0, one more wherever the text changes (`DC`, `step at 60`); None where a cell is empty, or there is none."""
    if not cells or not all(cell.strip() for cell in cells):
        return None
    return np.cumsum([0, *(a != b for a, b in pairwise(cells))]).astype(np.float64)


def _code(cell: str) -> float:
    """Single-phase is told of a locked rotor only: direct current flows between two terminals anyway."""
    words, is_single = SINGLE_PHASE.subn(" ", folded(cell))
    one = re.sub("^test|test$", "", _letters(words))
    code = next((c for c, w in WORDS.items() if re.fullmatch(w, one)), np.nan)
    code = next((c for c in (IDLE_TEST, LOCKED_TEST) if re.match(WORDS[c], one)), np.nan) if np.isnan(code) else code
    return SINGLE_PHASE_TEST if is_single and code not in (DIRECT_TEST, LOAD_TEST) else code


def unknown(cells: Sequence[str], said: Signal) -> tuple[ReadingNote, ...]:
    """That some rows name a test which is not known: what they are is told from their values."""
    names = sorted(
        {cell.strip() for cell, code in zip(cells, said, strict=True) if _letters(cell) and np.isnan(_code(cell))}
    )
    treated = "left out beside others" if np.any(said == LOAD_TEST) else "told from their values"
    return (
        (ReadingNote("unknown_test", f"no known test: {', '.join(names)[:80]}; such rows are {treated}"),)
        if names
        else ()
    )


def _letters(text: str) -> str:
    return re.sub(r"[\W_\d]", "", folded(translated(text)).lower())
