"""The end of a current channel that bends before it stops: slope lost over the current that should be reported."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.record import Record

Array = NDArray[np.float64]
KNOTS = (0.25, 0.6, 0.8, 0.88, 0.94, 0.98, 1.03, 1.1, 1.3)
"""Of the largest current that the channel reported: from each to the next a share of its slope is lost, evenly, and stays
lost beyond."""
COUNT = len(KNOTS) - 1


def channel_ends(record: Record) -> Array:
    """(phases,) largest current that each channel reported: where its end, if it has one, is near (A)."""
    tops = [np.abs(np.where(s.is_good, s.currents_a, 0.0)).max(axis=1) for s in record.segments]
    return np.asarray(np.maximum(np.max(tops, axis=0), 1e-9))


def slope_lost(current_a: Array, end_a: Array) -> Array:
    """(COUNT, phases, n) per unit of each share, for currents (phases, n): 0 before its knot, 1 from the next one on."""
    x = np.abs(current_a) / end_a[:, None]
    return np.stack([np.clip((x - a) / (b - a), 0.0, 1.0) for a, b in itertools.pairwise(KNOTS)])


def current_lost(current_a: Array, end_a: Array) -> Array:
    """(COUNT, phases, n): what one unit of each share takes from the reported current, with the current's sign (A)."""
    x = np.abs(current_a) / end_a[:, None]
    rows = []
    for a, b in itertools.pairwise(KNOTS):
        inside = np.clip(x - a, 0.0, b - a)
        rows.append(0.5 * inside**2 / (b - a) + np.maximum(x - b, 0.0))
    return np.asarray(end_a[:, None] * np.sign(current_a) * np.stack(rows))


def in_all(shares: Array, of_each: Array) -> Array:
    """(phases, n): what the `shares` (phases, COUNT) make together of rows per unit of each (COUNT, phases, n)."""
    return np.asarray(np.einsum("pk,kpn->pn", shares, of_each))


def reported(current_a: Array, shares: Array, end_a: Array) -> Array:
    """Currents (phases, n) behind channel ends of the given `shares` (phases, COUNT)."""
    return current_a - in_all(shares, current_lost(current_a, end_a))
