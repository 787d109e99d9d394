"""Time stamps that wander: whether the samples were taken at them, or at even steps, the supply's own turning tells.

A voltage that was sampled off its time is turned by as much; where its angle goes with what the stamps leave a straight line by, they are true and the
channels are brought to even steps; where it does not, the stamps are wrong and a straight line is right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.motor.channels.late import DEGREE, SMOOTH, TAPS
from commissioner.motor.computed import printed_step
from commissioner.records import ReadingNote, RunningRecording, Signal

Array = NDArray[np.float64]
Vector = NDArray[np.complex128]
STAMPS = "wandering_stamps"
LEAST = 0.05
"""Of a sample period, rms, by which stamps leave a straight line."""
MOST_BREAKS, LARGEST_STEP = 20, 4.0
"""Steps of more than half a period off, up to which they are lost rows; sample periods of one that is no jitter."""
FED = 0.3
"""Of the largest voltage."""
WINDOW_PERIODS, PARTS, LEAST_ROWS = 4.0, 8, 2000
SURE, NEAR = 0.1, 0.3
"""Standard deviation of the share of the stamps' wandering that the voltage shows; how near to none or all of it."""


OF_SLOPE, SLOPE_KNOWN = 3.5, 2e-5
"""Of a straight line's slope, whose points move together (sqrt 12); its relative error, with which the sample period of wrong stamps is known."""
SAME_PERIOD = 0.01
"""By which one that the recording names may differ from it."""
SLOW, PASSES = 0.02, 4
"""Change from stamp to stamp, rms of a sample period, of a clock that wanders; more is jitter."""
REACH, STAYS = 8, 0.6
"""Rows beside a step, and sample periods by which it moves them where rows are lost."""


@dataclass(frozen=True)
class _Share:
    """Of the stamps' wandering that the voltage's angle shows: 1 of true stamps, 0 of samples at even steps."""

    value: float
    std: float


def with_even_time(one: RunningRecording, vector: Vector) -> RunningRecording:
    """The recording at even steps and a note, where its stamps wander and the voltage (`vector`) tells how; else as it is."""
    time, rows = one.time_s, one.time_s.size
    if rows < LEAST_ROWS or not np.isfinite(time).all() or not time[-1] > time[0]:
        return one
    steps = np.diff(time) / one.sample_period_s
    if float(np.max(np.abs(steps))) > LARGEST_STEP or _has_lost_rows(steps):
        return one
    period, first = (float(c) for c in np.polyfit(np.arange(rows), time - time[0], 1))
    even = time[0] + first + period * np.arange(rows)
    off = (time - even) / period
    digits = float(printed_step(time).max()) / period
    rms = float(off.std())
    if rms < LEAST or np.ptp(off) < 1.1 * digits + 1e-6:
        return one
    share = _shown(vector, off, period)
    if share is None or share.std > SURE or min(abs(share.value), abs(share.value - 1.0)) > max(NEAR, 3.0 * share.std):
        return one
    wander = f"the time stamps wander by {rms:.2g} sample periods rms"
    if share.value < 0.5:
        named = one.metadata.get("sample_period_s")
        if isinstance(named, float) and abs(named / period - 1.0) < SAME_PERIOD:
            even, period = time[0] + first + named * np.arange(rows), named
        elif _slow_rms(off) * OF_SLOPE / rows > SLOPE_KNOWN:
            return one
        what = f"{wander}, the samples do not (the voltage turns evenly from one to the next): taken at even steps of {period:.6g} s"
        return replace(one, time_s=even, sample_period_s=period, notes=(*one.notes, ReadingNote(STAMPS, what)))
    at = _places(off)
    there = np.flatnonzero((at > -0.5) & (at < rows - 0.5))
    part = slice(int(there[0]), int(there[-1]) + 1)
    moved = _at if float(np.std(np.diff(off))) < SLOW else _off_its_time
    groups = [tuple(moved(x, at)[part] for x in group) for group in (one.currents_a, one.voltages_v)]
    (u, v, w), (a, b, c) = groups
    speed = None if one.speed_rad_per_s is None else np.interp(at, np.arange(rows), one.speed_rad_per_s)[part]
    what = f"{wander}, and the samples with them (the voltage turns with the stamps): brought to even steps of {period:.6g} s"
    return replace(
        one, time_s=even[part], sample_period_s=period, currents_a=(u, v, w), voltages_v=(a, b, c), speed_rad_per_s=speed,
        notes=(*one.notes, ReadingNote(STAMPS, what)),
    )  # fmt: skip


def _shown(vector: Vector, off: Array, period_s: float) -> _Share | None:
    """By what differs from sample to sample, or from some supply periods to the next, whichever tells it better."""
    there = np.nan_to_num(vector)
    size = np.abs(there)
    fed = size > FED * float(size.max(initial=0.0))
    turn = np.where(fed[1:] & fed[:-1], np.angle(np.conj(there[:-1]) * there[1:]), np.nan)
    usual = float(np.nanmedian(turn)) if np.isfinite(turn).any() else 0.0
    if not 1e-4 < abs(usual) < 1.0:
        return None
    turn, moved = turn / usual, np.diff(off)
    width = max(round(WINDOW_PERIODS * 2.0 * np.pi / abs(usual)), 2)
    whole = turn.size // width * width
    slow = [x[:whole].reshape(-1, width).mean(axis=1) for x in (turn, moved)]
    found = [_slope(*pair) for pair in ((np.diff(turn), np.diff(moved)), slow)]
    told = [f for f in found if f is not None]
    return min(told, key=lambda f: f.std) if told else None


def _slope(turn: Array, moved: Array) -> _Share | None:
    """Least squares beside a straight line, its error by leaving out parts of the recording (jackknife)."""
    good = np.isfinite(turn)
    if good.sum() < 4 * PARTS:
        return None
    y, x = turn[good], moved[good]
    place = np.linspace(-1.0, 1.0, x.size)
    y, x = (z - np.polyval(np.polyfit(place, z, 1), place) for z in (y, x))
    products, squares = (np.array([part.sum() for part in np.array_split(z, PARTS)]) for z in (x * y, x * x))
    if not squares.sum() > 0.0:
        return None
    without = (products.sum() - products) / np.maximum(squares.sum() - squares, 1e-300)
    return _Share(float(products.sum() / squares.sum()), float(np.sqrt((PARTS - 1) * without.var())))


def _slow_rms(off: Array) -> float:
    """Of what the stamps are off by over a thirtieth of the recording."""
    return float(np.std([part.mean() for part in np.array_split(off, 30)]))


def _has_lost_rows(steps: Array) -> bool:
    """Whether a step stays in what follows; of stamps that jitter the next one takes it back."""
    breaks = np.flatnonzero(~((steps > 0.5) & (steps < 1.5)))
    off = np.concatenate([[0.0], np.cumsum(steps - 1.0)])
    sides = [(off[max(k - REACH, 0) : k + 1], off[k + 1 : k + 1 + REACH]) for k in breaks[: MOST_BREAKS + 1].tolist()]
    return breaks.size <= MOST_BREAKS and any(abs(float(np.median(b) - np.median(a))) > STAYS for a, b in sides)


def _places(off: Array) -> Array:
    """(n,): where among the samples the even instants lie."""
    rows = np.arange(off.size)
    if float(np.std(np.diff(off))) >= SLOW:
        return rows - off
    at = rows - off
    for _ in range(3):
        at = rows - off[np.clip(np.round(at), 0, off.size - 1).astype(np.int64)]
    return np.asarray(at)


def _at(x: Signal, at: Array) -> Signal:
    """The channel at these places between its samples; as `late.shifted` does, so that its noise stays as it is."""
    if not np.isfinite(x).any():
        return x
    whole = np.round(at).astype(np.int64)
    return x[np.clip(whole, 0, x.size - 1)] + _gained(x, whole, at - whole)


def _off_its_time(x: Signal, at: Array) -> Signal:
    """The channel whose every sample was taken off its own time: less what the curve through its neighbours, themselves put right, gains by that."""
    if not np.isfinite(x).any():
        return x
    rows, out = np.arange(x.size), x
    for _ in range(PASSES):
        out = x - _gained(out, rows, rows - at)
    return out


def _gained(x: Signal, whole: NDArray[np.int64], part: Array) -> Signal:
    """What the smooth curve through nine samples gains from the middle one by part of a sample."""
    powers = np.arange(DEGREE + 1)
    weights = (part[:, None] ** powers - 0.0**powers) @ SMOOTH
    return np.asarray(sum(w * x[np.clip(whole + int(j), 0, x.size - 1)] for j, w in zip(TAPS, weights.T, strict=True)))
