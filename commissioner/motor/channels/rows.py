"""Rows that were not measured in any channel: a block that stands still, a block that was written twice."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from commissioner.records import Signal

HELD_S, LEAST_HELD = 1.5e-3, 4
"""Time and rows for which no fed motor's channels all stand still: 27 degrees at 50 Hz, six steps of eight bits at 5 Hz."""
FED = 0.05
"""Of the largest voltage."""
LEAST_TURNING, STEADY, BESIDE, LIKE_SIZE = 64, 0.3, 8, 0.7
"""Rows that show a turning; of its largest, the voltage that turns; rows on either side of a jump, in which its size stays like this."""
JUMPS_ON, LEAST_TURNS, MOST_LOST = 0.35, 4.0, 20
"""rad, and usual steps, by which a voltage turns on at once where rows are lost; more such places are pulses."""
IN_A_ROW, MOST_REPEATED = 32, 0.5
"""Rows that are alike in all channels only in a copy; part of a recording from which it repeats itself by nature (computed, without noise)."""
PRINTED = 1e-4
"""Of a channel's largest value, by which numbers written with few digits differ."""
ODD = np.uint64(0x9E3779B97F4A7C15)
"""Spreads the bits of a sample over its word: 2^64 over the golden ratio."""


def held(channels: Sequence[Signal], voltages: Sequence[Signal], period_s: float) -> NDArray[np.bool_]:
    """Rows in which all channels repeat the row before them while the motor is fed, for too long to be so."""
    size = channels[0].size
    there = [x for x in channels if np.isfinite(x).any()]
    fed = np.nanmax(np.abs(np.nan_to_num(voltages)), axis=0, initial=0.0)
    same = np.zeros(size, dtype=bool)
    if len(there) >= 3 and size > LEAST_HELD and period_s > 0.0:
        same[1:] = np.all([np.diff(x) == 0.0 for x in there], axis=0) & (fed[1:] > FED * fed.max())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    least = max(LEAST_HELD, round(HELD_S / period_s)) if period_s > 0.0 else size
    rows = np.zeros(size, dtype=bool)
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        rows[a:b] = b - a >= least
    return rows


def lost(voltages: Sequence[Signal], period_s: float) -> dict[int, float]:
    """Of each row before which the voltages' vector jumps on by an angle at one size: by how many rows' turning, less whole periods."""
    u, v, w = (np.nan_to_num(x) for x in voltages)
    if not np.isfinite(voltages[2]).any():
        w = -(u + v)
    z = (2.0 * u - v - w) / 3.0 + 1j * (v - w) / np.sqrt(3.0)
    if z.size < LEAST_TURNING or not period_s > 0.0:
        return {}
    size, turn = np.abs(z), np.angle(z[1:] * np.conj(z[:-1]))
    steady = size > STEADY * size.max()
    usual = float(np.median(turn[steady[1:]])) if steady[1:].any() else 0.0
    off = np.where(steady[1:] & steady[:-1], np.angle(np.exp(1j * (turn - usual))), 0.0)
    at = np.flatnonzero(np.abs(off) > max(JUMPS_ON, LEAST_TURNS * abs(usual))) + 1
    if usual == 0.0 or not 0 < at.size <= MOST_LOST:
        return {}
    found = {}
    for k in at.tolist():
        around, steps = size[max(k - BESIDE, 0) : k + BESIDE], off[max(k - BESIDE, 0) : k + BESIDE]
        is_lone = np.count_nonzero(np.abs(steps) > 0.5 * JUMPS_ON) == 1
        if is_lone and around.size == 2 * BESIDE and around.min() > LIKE_SIZE * around.max():
            found[k] = float((off[k - 1] / usual) % (2.0 * np.pi / abs(usual)))
    return found


def written_twice(channels: Sequence[Signal], flows: NDArray[np.bool_]) -> tuple[int, int, int] | None:
    """(first row of a block, its end, first row of the block that it repeats), of the longest; None where no block repeats another."""
    marks = row_marks(channels)
    if marks.size == 0:
        return None
    order = np.argsort(marks, kind="stable")
    again = np.flatnonzero(np.diff(marks[order]) == 0) + 1
    if again.size == 0:
        return None
    first_of = np.full(marks.size, -1)
    first_of[order[again]] = order[again - 1]
    first_of[~flows[: marks.size]] = -1
    copies = np.flatnonzero(first_of >= 0)
    if copies.size == 0 or copies.size > MOST_REPEATED * marks.size:
        return None
    back = copies - first_of[copies]
    cuts = np.flatnonzero((np.diff(copies) != 1) | (np.diff(back) != 0)) + 1
    a, b = max(pairwise([0, *cuts.tolist(), copies.size]), key=lambda span: span[1] - span[0])
    begin, apart = int(copies[a]), int(back[a])
    return None if _repeats_itself(channels, apart) else (begin, int(copies[b - 1]) + IN_A_ROW, begin - apart)


def _repeats_itself(channels: Sequence[Signal], apart: int) -> bool:
    """Whether all of it stood so many rows before, but for the digits that were printed: computed, without noise."""
    off = ((np.abs(x[apart:] - x[:-apart]), PRINTED * np.abs(x).max()) for x in channels)
    return all(float(np.median(moved)) <= least for moved, least in off)


def row_marks(channels: Sequence[Signal]) -> NDArray[np.uint64]:
    """A number for every row, of it and the rows behind it up to `IN_A_ROW`: alike where these are alike in all channels."""
    if not channels or channels[0].size < IN_A_ROW:
        return np.zeros(0, np.uint64)
    out = np.zeros(channels[0].size, np.uint64)
    for x in channels:
        out ^= out >> np.uint64(31)  # or the signs of two channels that turn round together would cancel
        out = (out * ODD) ^ np.ascontiguousarray(x + 0.0).view(np.uint64)
    reach = 1
    while reach < IN_A_ROW:
        out ^= out >> np.uint64(29)
        out, reach = out[:-reach] * ODD + out[reach:], 2 * reach
    return out
