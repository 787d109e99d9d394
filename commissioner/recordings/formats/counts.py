"""Counts of a converter with what takes them to their unit beside them: `scale` and `offset`, by the CF conventions and their kin."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from commissioner.errors import DataRefused
from commissioner.records import ReadingNote, Signal

_SCALE = re.compile(r"scale|scale_?factor|scaling|factor|slope|lsb|resolution", re.IGNORECASE)
_OFFSET = re.compile(r"(?:add_?)?offset|intercept", re.IGNORECASE)
_UNSAID = re.compile(r"gain|sensitivity|ratio", re.IGNORECASE)
"""May multiply the counts or divide them."""


def is_said(key: str) -> bool:
    """Whether a key is one of a converter's numbers."""
    return any(kind.fullmatch(key) for kind in (_SCALE, _OFFSET, _UNSAID))


def in_unit(
    name: str, values: Signal, said: Mapping[str, float], source: str
) -> tuple[Signal, tuple[ReadingNote, ...]]:
    """Whole numbers in their unit, with a note; other numbers as they stand, with a note that they were. DataRefused: a gain
    of whole numbers, which may multiply or divide."""
    told = {key: value for key, value in said.items() if value != (0.0 if _OFFSET.fullmatch(key) else 1.0)}
    if not told:
        return values, ()
    words = ", ".join(f"{key} {value:g}" for key, value in told.items())
    there = values[np.isfinite(values)]
    if np.any(there != np.round(there)):
        return values, (
            ReadingNote("scale", f"{name}: {words} stands beside it and was not applied: it holds no counts"),
        )
    if any(_UNSAID.fullmatch(key) for key in told):
        raise DataRefused(
            f"{source}: {name} holds whole numbers and {words}, which may multiply or divide them", step="recognise columns",
            value=f"{name}: {words}", limit="numbers in their unit, or counts with scale and offset",
            remedy=f"multiply the counts of {name} yourself, or call what they are to be multiplied by scale",
        )  # fmt: skip
    scale = float(np.prod([value for key, value in told.items() if _SCALE.fullmatch(key)]))
    offset = sum(value for key, value in told.items() if _OFFSET.fullmatch(key))
    return scale * values + offset, (ReadingNote("scale", f"{name} holds counts: taken in its unit by {words}"),)
