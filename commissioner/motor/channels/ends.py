"""What a channel makes of a value beyond its range: it stands at the end of it, or begins again at the other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.records import Signal

LEAST_ON_LIMIT = 8
STEEPER = 1.5
"""By how much a channel may be steeper on its way into the end of its range than just before."""
FAR = 0.5
"""Of a channel's range, between two samples: a jump that no current of a motor makes from one to the next."""
WHOLE_SPREAD = 0.98
"""Of the distance between the channel's largest and smallest value, the range's size at least."""
OF_POWERS = 5e-3
"""By which a range's size may miss a power of two of the channel's steps."""
LEAST_JUMPS = 2
"""One way and back: a single one is lost rows."""
MOST_WRAPS, LIKE, MOSTLY_LIKE = 0.05, 0.1, 0.8
"""Of the samples, that are such jumps: more are pulses; by how much of it the sizes of the jumps may differ, and how many of them may not."""


def clipped(x: Signal) -> tuple[NDArray[np.bool_], float]:
    """(samples that sit on the channel's largest or smallest value, where more do than just inside of it; the share of all that this is
    beyond what the same signal puts there)."""
    rows, share = np.zeros(x.size, dtype=bool), 0.0
    there = x[np.isfinite(x)]
    if there.size == 0 or np.ptp(there) == 0:
        return rows, share
    for extreme, inward in ((there.max(), -1.0), (there.min(), 1.0)):
        within = inward * (there - extreme)
        on_limit = int(np.sum(within == 0.0))
        reach = np.min(within[within > 0.0])
        width = max(reach, 1e-3 * np.ptp(there))
        near = int(np.sum((within > 0.0) & (within <= 3.0 * width)))
        if on_limit > max(near, LEAST_ON_LIMIT):
            rows |= x == extreme
            share += (on_limit - near / 3.0) / x.size
    return rows, share


def piled_up(values: Signal) -> int | None:
    """How many samples of a channel at standstill sit at its largest value, if more than its neighbourhood makes plausible: there levels stand, so that
    only rows in which the voltage moves are asked."""
    if values.size < 100:
        return None
    top = float(np.max(values))
    if top <= 0.0:
        return None
    levels = np.unique(values)
    quantum = float(np.min(np.diff(levels))) if levels.size > 1 else top
    at_top = int(np.sum(values >= top - 0.01 * quantum - 1e-9 * top))
    near = int(np.sum(values >= top - max(0.05 * top, 10.0 * quantum)))
    return at_top if at_top >= 8 and at_top > 0.45 * near and near < values.size // 2 else None


def runs_into(x: Signal, rows: NDArray[np.bool_]) -> bool:
    """Whether the channel comes to these values as steeply as it moved before, as one that is cut off does; a step of a voltage jumps there."""
    first = np.flatnonzero(rows[2:] & ~rows[1:-1] & ~rows[:-2]) + 2
    into, before = np.abs(x[first] - x[first - 1]), np.abs(x[first - 1] - x[first - 2])
    return bool(first.size and np.nanmedian(into) <= STEEPER * np.nanmedian(before))


def unwrapped(x: Signal) -> tuple[Signal, float, int]:
    """(the channel with what ran over its range's end and began again at the other put back, that range, samples put back); as it is, and 0,
    where none did.

    Each jump has the range's size less what the channel moved meanwhile, which its neighbours tell; put back it goes on as before.
    """
    d = np.nan_to_num(np.diff(x))
    spread = float(np.nanmax(x) - np.nanmin(x)) if np.isfinite(x).any() else 0.0
    at = np.flatnonzero(np.abs(d) > FAR * spread)
    at = at[(at > 1) & (at < d.size - 2)]
    if spread == 0.0 or at.size < LEAST_JUMPS or at.size > MOST_WRAPS * x.size:
        return x, 0.0, 0
    usual = (4.0 * (d[at - 1] + d[at + 1]) - (d[at - 2] + d[at + 2])) / 6.0
    sizes = np.sign(d[at]) * (d[at] - usual)
    span = float(np.median(sizes))
    if not span > WHOLE_SPREAD * spread or np.mean(np.abs(sizes - span) < LIKE * span) < MOSTLY_LIKE:
        return x, 0.0, 0
    span = _of_powers(x, span)
    turns = np.zeros(x.size, dtype=np.int64)
    turns[at + 1] = -np.sign(d[at]).astype(np.int64)
    turns = np.cumsum(turns)
    values, counts = np.unique(turns, return_counts=True)
    turns -= values[np.argmax(counts)]
    out = x + span * turns
    if np.nanmax(np.abs(np.diff(out))) > FAR * span or np.nanmax(out) - np.nanmin(out) <= 1.01 * spread:
        return x, 0.0, 0
    return out, span, int(np.count_nonzero(turns))


def _of_powers(x: Signal, span: float) -> float:
    """The range as a power of two of the channel's steps, where it is one: what runs over is a whole number of bits."""
    levels = np.unique(np.round(x[np.isfinite(x)], 12))
    gaps = np.diff(levels)
    gaps = gaps[gaps > 1e-7 * span]
    if gaps.size < LEAST_ON_LIMIT:
        return span
    single = gaps[gaps < 1.5 * gaps.min()]
    step = float(single.mean())
    whole = step * 2.0 ** round(float(np.log2(span / step)))
    return whole if abs(whole / span - 1.0) < OF_POWERS else span
