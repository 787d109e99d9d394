"""Channels that were sampled one after another: by how much each of three lines is late against the others, from their sum.

What is left of three lines that sum to zero is `-sum(late_k di_k/dt)`, beside `sum(gain_k i_k)` and a constant. A delay that all share and a gain
that all share leave nothing; of a sine delays and gains are the same, so a start, a load step, an unbalance or harmonics have to tell them
apart, and the errors of the fit say whether they do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.motor.channels.spikes import noise_of
from commissioner.records import Signal

Array = NDArray[np.float64]
BLOCK_S = 4e-4
"""Over which samples are averaged first: noise in a derivative makes it look smaller than it is; of samples further apart the derivative of a
harmonic is not known."""
SURE, LEAST_S, LEAST_GAIN = 8.0, 4e-6, 0.25
"""Standard deviations and seconds from which a delay is one, and the part of what is left that delays must take off beside gains alone."""
LEAST_SUM, CANCELS = 3e-4, 3.0
"""Of the three's size, that their sum holds at least; how many times it delays may make, of which gains then take most away: of a sine the two
are one, and what tells them apart is what its digits left."""
UNLIKE = 4.0
"""Standard deviations from which gains differ as well: beside them a delay is known several times worse."""
MOST_S, MOST_GAIN = 5e-3, 0.4
"""A delay beyond it is another recording's; a gain beyond it another fault."""
EXPLAINS, NOISY = 0.9, 1.3
"""Of what the sum holds beyond noise: the part that gains and delays have to explain together; over the noise, what is left of it where that is all."""
ALONE, WHOLE = 0.2, 0.05
"""Of the largest delay, by which two channels may differ that are on time together; of a sample, by which a delay may miss a whole number of them
to be one."""
JUMPS, MOSTLY_USUAL = 10.0, 0.98
"""Of what is left in the median, from which a block holds a jump; of the blocks, the part that do not, or what is left is another kind of fault."""
FADES, REPLY, PARTS = 10.0, 400, 8
"""Time constants of a low pass that its beginning takes; samples of its reply to one; parts of a recording that are left out in turn."""
CLEAR, TOLD_TO, UNDECIDED = 1.5, 0.15, 0.2
"""Over the noise, the power of what a low pass and a delay differ by; how well the share of it in a channel must be known, and how far from a half."""
PASSES = 6
LEAST_BLOCKS = 100
APART = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / np.sqrt([[2.0], [6.0]])
"""Two ways in which three channels may differ whose mean says nothing."""
TAPS, DEGREE = np.arange(-4, 5), 5
SMOOTH = np.linalg.pinv(np.vander(TAPS, DEGREE + 1, increasing=True))
"""Coefficients of the curve through nine samples: 0.02 % off at 300 Hz of 5 kHz; noise 1.02 of what it was for half a sample."""


@dataclass(frozen=True)
class Late:
    """`late_s[k]`: by how much channel k is behind the first, or behind the two that agree (below zero: before them); its largest
    standard deviation. `is_filtered`: one passes a low pass of that time constant, or is a delay; None where nothing tells."""

    late_s: tuple[float, float, float]
    std_s: float
    is_filtered: bool | None = None

    def said(self, kind: str, names: Sequence[str]) -> str:
        """`current w is 200 us behind the others`."""
        error = f"+- {2e6 * self.std_s:.2g} us"
        if self.is_filtered:
            k = int(np.argmax(self.late_s))
            return f"{kind} {names[k]} passes a low pass of {self.late_s[k] * 1e6:.4g} us ({error}), what is fast in it stays smaller"
        off = [
            f"{kind} {n} is {abs(s) * 1e6:.4g} us {'behind' if s > 0.0 else 'before'}"
            for n, s in zip(names, self.late_s, strict=True)
            if s != 0.0
        ]
        whom = "the two others" if len(off) == 1 else f"{kind} {names[self.late_s.index(0.0)]}"
        why = "taken one after another" + ("" if self.is_filtered is False else ", or a low pass")
        return f"{' and '.join(off)} {whom} ({error}; {why})"


def late(group: Sequence[Signal], period_s: float) -> Late | None:
    """None where the three are on time together, or where their sum does not tell a delay from a gain."""
    if not 0.0 < period_s <= BLOCK_S or not np.isfinite(group).any(axis=1).all():
        return None
    x, total = np.array(group), np.zeros(3)
    size = max(round(BLOCK_S / period_s), 1)
    std = 0.0
    for k in range(PASSES):
        found = _fitted(x, size, size * period_s, is_first=k == 0)
        if found is None:
            return None
        step, std = found
        total += step
        if np.ptp(total) > MOST_S:
            return None
        if np.ptp(step) < 0.1 * std:
            break
        x = np.array([shifted(own, s / period_s) for own, s in zip(group, total, strict=True)])
    told = _against_the_others(total)
    if np.ptp(told) < max(LEAST_S, SURE * std):
        return None
    u, v, w = (_whole(s, std, period_s) for s in told)
    return Late((u, v, w), std, _is_filtered(group, (u, v, w), period_s))


def _is_filtered(group: Sequence[Signal], late_s: tuple[float, float, float], period_s: float) -> bool | None:
    """Whether the one late channel is what a low pass of first order makes of the two others' sum, or what a delay does: of the difference of these two
    it holds all or nothing. None where noise makes most of that difference."""
    k, late = int(np.argmax(late_s)), max(late_s)
    if sorted(late_s)[:2] != [0.0, 0.0] or not late > 0.0:
        return None
    x = np.array(group)
    there = np.isfinite(x).all(axis=0)
    others = np.where(there, x[k] - x.sum(axis=0), 0.0)
    delayed, passed = shifted(others, -late / period_s), _low_pass(others, late, period_s)
    there &= np.isfinite(delayed)
    there[: round(FADES * late / period_s)] = False
    beside = np.stack([np.ones(int(there.sum())), delayed[there], x[(k + 1) % 3][there]], axis=1)
    apart, left = (
        z - beside @ np.linalg.lstsq(beside, z, rcond=None)[0]
        for z in ((passed - delayed)[there], (x[k] - delayed)[there])
    )
    pulse = np.zeros(REPLY)
    pulse[REPLY // 2] = 1.0
    late_pulse = np.nan_to_num(shifted(pulse, -late / period_s))
    reply = _low_pass(pulse, late, period_s) - late_pulse
    noise = noise_of(others) ** 2
    of_noise, shared = noise * float(reply @ reply), -noise * float(reply @ late_pulse)
    if float(apart.var()) < CLEAR * of_noise:
        return None
    products, squares = (
        np.array([part.sum() for part in np.array_split(z, PARTS)])
        for z in (apart * left - shared, apart**2 - of_noise)
    )
    without = (products.sum() - products) / (squares.sum() - squares)
    share, std = float(products.sum() / squares.sum()), float(np.sqrt((PARTS - 1) * without.var()))
    if not std < TOLD_TO or 0.5 - UNDECIDED < share < 0.5 + UNDECIDED:
        return None
    return share > 0.5


def _low_pass(x: Signal, time_s: float, period_s: float) -> Signal:
    """First order, of a signal that is straight from sample to sample."""
    from scipy.signal import lfilter

    a = float(np.exp(-period_s / time_s))
    slope = time_s / period_s * (1.0 - a)
    return np.asarray(lfilter([1.0 - slope, slope - a], [1.0, -a], x))


def _fitted(x: Array, size: int, step_s: float, *, is_first: bool) -> tuple[Array, float] | None:
    """(delay of each of the three against their mean, its standard deviation); None where there are none to be told."""
    count = x.shape[1] // size
    if count < LEAST_BLOCKS:
        return None
    means = x[:, : count * size].reshape(3, count, size).mean(axis=2)
    slope = (8.0 * (means[:, 3:-1] - means[:, 1:-3]) - (means[:, 4:] - means[:, :-4])) / (12.0 * step_s)
    good = np.isfinite(slope).all(axis=0) & np.isfinite(means[:, 2:-2]).all(axis=0)
    if good.sum() < LEAST_BLOCKS:
        return None
    own, slope = means[:, 2:-2][:, good], slope[:, good]
    own = own - own.mean(axis=1, keepdims=True)
    total, one = own.sum(axis=0), np.ones(own.shape[1])
    unit = np.sqrt(np.mean(own**2)), np.sqrt(np.mean(slope**2))
    if not min(unit) > 0.0:
        return None
    plain = np.stack([one, *(APART @ own / unit[0])], axis=1)
    full = np.concatenate([plain, -(APART @ slope).T / unit[1]], axis=1)
    _, left = _solved(full, total)
    usual = np.abs(left) < JUMPS * float(np.median(np.abs(left)))
    if np.mean(usual) > MOSTLY_USUAL:  # a contactor's closing between two samples
        plain, full, total = plain[usual], full[usual], total[usual]
    _, left_plain = _solved(plain, total)
    told, left = _solved(full, total)
    if is_first and not _is_told(total, left_plain, left, told, unit[0]):
        return None
    if is_first and np.mean((full[:, 3:] @ told[3:]) ** 2) > CANCELS**2 * np.mean(total**2):
        return None
    timed = np.concatenate([plain[:, :1], full[:, 3:]], axis=1)
    of_time, left_timed = _solved(timed, total)
    if float(left_timed @ left_timed - left @ left) * total.size < UNLIKE**2 * float(left @ left):
        full, told, left = timed, of_time, left_timed  # no gain is needed beside them
    covariance = np.linalg.pinv(full.T @ full) * float(left @ left) / max(left.size - told.size, 1)
    std = float(np.sqrt(np.trace(covariance[-2:, -2:]) / 2.0)) / unit[1]
    return (APART.T @ told[-2:] / unit[1]).astype(np.float64), std


def _solved(columns: Array, total: Array) -> tuple[Array, Array]:
    told = np.linalg.lstsq(columns, total, rcond=None)[0].astype(np.float64)
    return told, total - columns @ told


def _is_told(total: Array, left_plain: Array, left: Array, told: Array, unit: float) -> bool:
    """Whether gains and delays explain the sum, and delays what gains alone do not."""
    noise = noise_of(total) ** 2
    all_of_it, rest, rest_plain = (float(np.mean(y**2)) for y in (total, left, left_plain))
    if all_of_it < (LEAST_SUM * unit) ** 2:
        return False
    if (rest_plain - rest) * total.size < SURE**2 * rest or float(np.max(np.abs(told[1:3]))) > MOST_GAIN * unit:
        return False
    if rest < NOISY * noise:
        return True
    return rest - noise < (1.0 - EXPLAINS) * (all_of_it - noise) and rest_plain - rest > LEAST_GAIN * (rest - noise)


def _against_the_others(total: Array) -> Array:
    """The delays against two that agree, else against the first in time."""
    order = np.argsort(total)
    low, middle, high = total[order]
    if middle - low < ALONE * (high - low):
        on_time = 0.5 * (low + middle)
        return np.where(np.arange(3) == order[2], total - on_time, 0.0)
    if high - middle < ALONE * (high - low):
        on_time = 0.5 * (middle + high)
        return np.where(np.arange(3) == order[0], total - on_time, 0.0)
    return np.asarray(total - low)


def _whole(late_s: float, std_s: float, period_s: float) -> float:
    """A delay of whole samples where it is that to its error."""
    whole = round(late_s / period_s) * period_s
    return whole if abs(late_s - whole) < min(WHOLE * period_s, max(4.0 * std_s, 1e-3 * period_s)) else late_s


def shifted(x: Signal, samples: float) -> Signal:
    """The channel so many samples later than it stands there; NaN where it does not reach.

    A part of a sample is added as what a smooth curve through nine samples gains over it: an interpolation takes noise away, the more the
    nearer it is to half a sample, and a fit would weigh the three channels by a noise that one of them has not.
    """
    whole = round(samples)
    if abs(samples - whole) < 1e-9:
        return _moved(x, whole)
    part = samples - whole
    gained = (part ** np.arange(DEGREE + 1) - 0.0 ** np.arange(DEGREE + 1)) @ SMOOTH
    out = _moved(x, whole)
    for j, weight in zip(TAPS, gained, strict=True):
        out += weight * _moved(x, whole + int(j))
    return out


def _moved(x: Signal, by: int) -> Signal:
    out = np.full(x.size, np.nan)
    if abs(by) < x.size:
        out[max(-by, 0) : x.size - max(by, 0)] = x[max(by, 0) : x.size + min(by, 0)]
    return out
