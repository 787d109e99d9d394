"""An offset that drifts: what a channel's mean over the supply's periods does while the motor runs, where a straight line or an exponential tells all of it.

Mains drive no direct current, and what a start leaves of one is over in a fraction of a second; a load's swing changes sizes, not means.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.motor.channels.clock import turn_a_row
from commissioner.motor.computed import is_negative_sum
from commissioner.records import Signal

Array = NDArray[np.float64]
PERIODS, HOP = 4, 2
"""Of the supply: of the (Hann) window of a mean, and from one to the next."""
CALM, STARTS, BEHIND = 0.05, 1.5, 8
"""By which the size may change from one window to the next; of its median, from which it is a start's; windows behind such a one that are not asked."""
LEAST_WINDOWS, LEAST_SPAN_S = 16, 1.0
SLOWEST, FASTEST, FASTEST_S = 2.0, 0.1, 0.35
"""Time constant of an exponential over the span: a slower one is a line; a faster one is what a start leaves."""
BEYOND = 4.0
"""Times what is seen of it, that a drift may be over the whole recording."""
IN_SUM = 0.3
"""Of an exponential, that the sum of three sensors shows: what decays in a motor sums to zero."""
TELLS_MORE = 0.7
"""Of what a straight line leaves, that an exponential may leave."""
TURNS_ALIKE = 0.03
"""By which the supply's frequency may differ from a tenth of the recording to another."""
LEAST, SURE, EXPLAINS = 0.003, 15.0, 0.9
"""Of the channel's peak, and standard deviations, by which it drifts at least; of the means' variance, the part that the curve tells."""
OUTLIER = 4.0
DRIVES = 3.0
"""Times its share of the voltage, that a current would have of its own peak where a direct voltage were there: ten times and more in any motor."""


@dataclass(frozen=True)
class Drift:
    """`by`: from the recording's begin to its end; `time_s`: of an exponential, 0 of a straight line; `curve` from 0 on; `share` of the channel's peak."""

    by: float
    time_s: float
    curve: Signal
    share: float

    def said(self, kind: str, name: str, unit: str) -> str:
        """`the offset of current v drifts by +2.1 A over the recording`."""
        how = f", exponentially in {self.time_s:.2g} s" if self.time_s else ""
        return f"the offset of {kind} {name} drifts by {self.by:+.3g} {unit} over the recording{how}"


@dataclass(frozen=True)
class _Fit:
    """Of a law: mean square left, its factor, the standard deviation of what it moves."""

    left: float
    factor: float
    std: float


def drifts_of(group: Sequence[Signal], time_s: Signal, hz: float) -> tuple[Drift | None, ...]:
    """Of each of three channels; of the third of three that were computed from two, what these leave."""
    means = _means(group, time_s, hz)
    if means is None:
        return (None, None, None)
    at, values, peak = means
    is_computed = is_negative_sum(*group)
    three = not is_computed and bool(np.isfinite(values).all())
    found = [_told(at, own, values.sum(axis=0) if three else None, peak, time_s) for own in values]
    if is_computed and any(found):
        first, second = (d.curve if d else np.zeros(time_s.size) for d in found[:2])
        rest = -(first + second)
        found[2] = Drift(float(rest[-1]), max(d.time_s for d in found if d), rest, abs(float(rest[-1])) / peak)
    return tuple(found)


def supply_hz(vector: NDArray[np.complex128], period_s: float) -> float:
    """Of all that turns; 0 where nothing does, or at a frequency that moves."""
    there = np.nan_to_num(vector)
    swept = np.conj(there[:-1]) * there[1:]
    turns = np.abs(np.angle([np.sum(part) for part in np.array_split(swept, 10) if np.any(part)]))
    if turns.size == 0 or np.ptp(turns) > TURNS_ALIKE * turns.max():
        return 0.0
    turn = abs(float(np.angle(np.sum(swept)))) / (2.0 * np.pi * period_s)
    if turn * period_s * there.size <= PERIODS * LEAST_WINDOWS:
        return 0.0
    return abs(turn_a_row(there)) / (2.0 * np.pi * period_s)


def _means(group: Sequence[Signal], time_s: Signal, hz: float) -> tuple[Array, Array, float] | None:
    """(instants of windows in which the size stays, means `(3, n)`, the channels' usual peak)."""
    period = float(np.median(np.diff(time_s)))
    if not period > 0.0:
        return None
    width = round(PERIODS / hz / period)
    hop = max(round(HOP / hz / period), 1)
    starts = np.arange(0, time_s.size - width + 1, hop)
    if starts.size < LEAST_WINDOWS or width < 4 * PERIODS:
        return None
    window = np.hanning(width + 2)[1:-1]
    window /= window.sum()
    rows = [np.lib.stride_tricks.sliding_window_view(x, width)[::hop] for x in group]
    values = np.array([np.einsum("ij,j->i", own, window) for own in rows])
    there = [own for own, x in zip(rows, group, strict=True) if np.isfinite(x).any()]
    if not there:
        return None
    size = np.sqrt(np.sum([np.einsum("ij,ij,j->i", own, own, window) for own in there], axis=0) * (3.0 / len(there)))
    if not np.isfinite(size).any():
        return None
    usual = float(np.nanmedian(size))
    moves = np.abs(np.diff(size, prepend=size[:1])) > CALM * usual
    jumps = np.diff(time_s[starts], prepend=time_s[starts[0]]) > 1.5 * hop * period
    is_start = np.nan_to_num(size, nan=np.inf) > STARTS * usual
    upset = moves | jumps | ~np.isfinite(size)
    upset |= np.append(upset[1:], False)
    for k in np.flatnonzero(is_start | (moves & np.append([False], is_start[:-1]))):
        upset[k : k + BEHIND] = True
    good = ~upset & np.isfinite(values).any(axis=0)
    at = time_s[starts] + 0.5 * width * period
    if good.sum() < LEAST_WINDOWS or np.ptp(at[good]) < LEAST_SPAN_S or not usual > 0.0:
        return None
    return at[good], values[:, good], usual * np.sqrt(2.0 / 3.0)


def _told(at: Array, means: Array, total: Array | None, peak: float, time_s: Signal) -> Drift | None:
    """A straight line or an exponential, where it tells the means; `total`: of three sensors."""
    if not np.isfinite(means).all() or np.ptp(means) < LEAST * peak:
        return None
    line = _fitted((at - at[0]) / np.ptp(at), means)
    best, curve, slow = line, line.factor * (time_s - at[0]) / np.ptp(at), 0.0
    curved = _exponential(at, means)
    if curved is not None and curved[1].left < TELLS_MORE * line.left:
        slow, best = curved
        curve = best.factor * np.exp(-(time_s - at[0]) / slow)
        in_sum = _fitted(np.exp(-(at - at[0]) / slow), total).factor if total is not None else 0.0
        if abs(in_sum) < IN_SUM * abs(best.factor) and slow < np.ptp(at) / 3.0:
            return None
    curve = curve - curve[0]
    seen = abs(float(np.diff(np.interp(at[[0, -1]], time_s, curve))[0]))
    by = float(curve[-1])
    if (
        seen < max(LEAST * peak, SURE * best.std)
        or best.left > (1.0 - EXPLAINS) * float(np.var(means))
        or abs(by) > BEYOND * seen
    ):
        return None
    return Drift(by, slow, np.asarray(curve), abs(by) / peak)


def _exponential(at: Array, means: Array) -> tuple[float, _Fit] | None:
    """(time constant, fit) of the best; None where a faster or a slower one would be better."""
    from scipy.optimize import minimize_scalar

    low, high = max(FASTEST * float(np.ptp(at)), FASTEST_S), SLOWEST * float(np.ptp(at))
    if not low < high:
        return None

    def left(log: float) -> float:
        return _fitted(np.exp(-(at - at[0]) / np.exp(log)), means).left

    log = float(minimize_scalar(left, bounds=(np.log(low), np.log(high)), method="bounded", options={"xatol": 1e-3}).x)
    slow = float(np.exp(log))
    if not 1.02 * low < slow:
        return None
    return slow, _fitted(np.exp(-(at - at[0]) / slow), means)


def _fitted(law: Array, means: Array) -> _Fit:
    """Without outliers."""
    design = np.stack([np.ones(law.size), law], axis=1)
    kept = np.ones(law.size, dtype=bool)
    for _ in range(2):
        x = np.linalg.lstsq(design[kept], means[kept], rcond=None)[0]
        rest = np.abs(means - design @ x)
        kept = rest <= OUTLIER * float(np.median(rest)) / 0.6745 + 1e-300
    left = float(np.mean(rest[kept] ** 2))
    spread = np.linalg.pinv(design[kept].T @ design[kept])[1, 1]
    return _Fit(left, float(x[1]), float(np.sqrt(left * spread) * np.ptp(law)))
