"""What a filter 1 / (1 + s S + s² q S²) makes of a current that is cubic or held between samples, read at any instant: exact.

S is the sum of its time constants, in samples. q is its shape: 0 one lag, a quarter two equal ones, a half Butterworth's. Sum
and shape, not two time constants: near equality those hardly differ, and their first-order changes imitate other causes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

from commissioner.compiled import njit

Array = NDArray[np.float64]
SHORT_LAG = 0.05
"""Of a sample: below it a lag is a delay (what else it does is below 1e-3 of that)."""
ALIKE = 1e-6
"""Relative squared difference of two time constants that are taken as one."""
QUICK = 1e-3
"""Of a sample: a second time constant below it does nothing."""
STEP, SHAPE_STEP = 1e-3, 5e-3
"""Of the sum, relative, and of the shape, for derivatives."""


def low_pass(signal: Array, lag: float, shape: float) -> Array:
    """`signal` (..., n) behind the filter, at the samples, taken as straight between them (first-order hold)."""
    return np.asarray(lfilter(*_discrete(lag, shape), signal, axis=-1))


@lru_cache(maxsize=16)
def _discrete(lag: float, shape: float) -> tuple[Array, Array]:
    denominator = (shape * lag**2, lag, 1.0)[0 if shape * lag > QUICK else 1 :]
    forward, back, _ = cont2discrete(((1.0,), denominator), 1.0, method="foh")
    return forward.ravel(), back


@dataclass(frozen=True)
class Between:
    """A current (rows, n) at the samples and between them: cubic with its slopes per sample `after` and `before` each, and a
    part `held` from each sample on.
    """

    values: Array
    after: Array
    before: Array
    held: Array

    @staticmethod
    def straight(values: Array, held: Array) -> Between:
        rise = np.diff(values, axis=1)
        none = np.zeros((values.shape[0], 1))
        return Between(values, np.hstack([rise, none]), np.hstack([none, rise]), held)


def behind(current: Between, lag: float, shape: float, late: Array) -> tuple[Array, Array]:
    """Values and slopes per sample (rows, n) of the current behind the filter, at `k - late[k]` samples."""
    value, slope = np.empty_like(current.values), np.empty_like(current.values)
    parts = (current.values, current.after, current.before, current.held, late)
    _behind(*(np.ascontiguousarray(x, dtype=np.float64) for x in parts), lag, shape, value, slope)
    return value, slope


def by_lag(current: Between, lag: float, shape: float, late: Array) -> Array:
    """Derivative (rows, n) of the value behind the filter by the lag, per sample."""
    h = STEP * lag
    more, less = (behind(current, moved, shape, late)[0] for moved in (lag + h, lag - h))
    return np.asarray((more - less) / (2.0 * h))


def by_shape(current: Between, lag: float, shape: float, late: Array) -> Array:
    """Derivative (rows, n) of the value behind the filter by its shape; to one side where the shape is none."""
    low = max(shape - SHAPE_STEP, 0.0)
    more, less = (behind(current, lag, moved, late)[0] for moved in (shape + SHAPE_STEP, low))
    return np.asarray((more - less) / (shape + SHAPE_STEP - low))


@njit(nogil=True)
def unforced(u, lag, shape, out):
    """The filter without input, `u` samples on: values from a value and from a slope of 1, then the slopes of both."""
    if shape == 0.0:
        out[0], out[1] = np.exp(-u / lag), 0.0
        out[2], out[3] = -out[0] / lag, 0.0
        return
    apart, mean = 1.0 - 4.0 * shape, -0.5 / (shape * lag)
    if apart > ALIKE:
        root = np.sqrt(apart)
        slow, quick = -2.0 / (lag * (1.0 + root)), -0.5 * (1.0 + root) / (shape * lag)
        slowly, quickly = np.exp(slow * u), np.exp(quick * u)
        out[0], out[1] = (quick * slowly - slow * quickly) / (quick - slow), (quickly - slowly) / (quick - slow)
    elif apart < -ALIKE:
        turn = -mean * np.sqrt(-apart)
        out[1] = np.exp(mean * u) * np.sin(turn * u) / turn
        out[0] = np.exp(mean * u) * np.cos(turn * u) - mean * out[1]
    else:
        out[1] = u * np.exp(mean * u)
        out[0] = np.exp(mean * u) - mean * out[1]
    out[2] = -out[1] / (shape * lag * lag)
    out[3] = out[0] - out[1] / (shape * lag)


@njit(nogil=True)
def _forced(y0, y1, m0, m1, u, lag, shape, out):
    """Value and slope, `u` samples after y0, of the filter's polynomial answer to the cubic from y0 to y1 with slopes m0, m1."""
    a, b = 2.0 * (y0 - y1) + m0 + m1, 3.0 * (y1 - y0) - 2.0 * m0 - m1
    rise, bend, twist = (3.0 * a * u + 2.0 * b) * u + m0, 6.0 * a * u + 2.0 * b, 6.0 * a
    second = lag * lag * (1.0 - shape)
    out[0] = ((a * u + b) * u + m0) * u + y0 - lag * rise + second * bend - lag**3 * (1.0 - 2.0 * shape) * twist
    out[1] = rise - lag * bend + second * twist


@njit(nogil=True)
def _behind(values, after, before, held, late, lag, shape, value, slope):
    rows, n = values.shape
    lagged, rate = np.zeros((rows, n)), np.zeros((rows, n))
    whole, part, at_start, there = np.zeros(4), np.zeros(4), np.zeros(2), np.zeros(2)
    unforced(1.0, lag, shape, whole)
    for c in range(rows):
        lagged[c, 0] = values[c, 0]
        for k in range(n - 1):
            y0, y1 = values[c, k] + held[c, k], values[c, k + 1] + held[c, k]
            _forced(y0, y1, after[c, k], before[c, k + 1], 0.0, lag, shape, at_start)
            _forced(y0, y1, after[c, k], before[c, k + 1], 1.0, lag, shape, there)
            off, off_slope = lagged[c, k] - at_start[0], rate[c, k] - at_start[1]
            lagged[c, k + 1] = there[0] + off * whole[0] + off_slope * whole[1]
            rate[c, k + 1] = there[1] + off * whole[2] + off_slope * whole[3]
    last = -1.0
    for k in range(n):
        at = k - late[k]
        j = min(max(int(np.floor(at)), 0), n - 2)
        u = min(max(at - j, 0.0), 2.0)
        if u != last:
            unforced(u, lag, shape, part)
            last = u
        for c in range(rows):
            y0, y1 = values[c, j] + held[c, j], values[c, j + 1] + held[c, j]
            _forced(y0, y1, after[c, j], before[c, j + 1], 0.0, lag, shape, at_start)
            _forced(y0, y1, after[c, j], before[c, j + 1], u, lag, shape, there)
            off, off_slope = lagged[c, j] - at_start[0], rate[c, j] - at_start[1]
            value[c, k] = there[0] + off * part[0] + off_slope * part[1]
            slope[c, k] = there[1] + off * part[2] + off_slope * part[3]
