"""What a filter 1 / (1 + s S + s² q S²) makes of a current that is straight or held between samples, read at other instants.

S is the sum of its time constants, in samples. q is its shape: 0 one lag, a quarter two equal ones, a half Butterworth's. Sum
and shape, not two time constants: near equality those hardly differ, and their first-order changes imitate other causes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

Array = NDArray[np.float64]
SHORT_LAG = 0.05
"""Of a sample: below it a lag is a delay (what else it does is below 1e-3 of that)."""
ALIKE = 1e-6
"""Relative squared difference of two time constants that are taken as one."""
STEP, SHAPE_STEP = 1e-3, 5e-3
"""Of the sum, relative, and of the shape, for derivatives."""


def low_pass(signal: Array, lag: float, shape: float) -> Array:
    """`signal` (..., n) behind the filter, at the samples (first-order hold)."""
    return _filtered(signal, lag, shape, (1.0,), "foh")


def _filtered(signal: Array, lag: float, shape: float, numerator: tuple[float, ...], hold: str) -> Array:
    return np.asarray(lfilter(*_discrete(lag, shape, numerator, hold), signal, axis=-1))


@lru_cache(maxsize=32)
def _discrete(lag: float, shape: float, numerator: tuple[float, ...], hold: str) -> tuple[Array, Array]:
    denominator = (shape * lag**2, lag, 1.0)[0 if shape > 0.0 else 1 :]
    forward, back, _ = cont2discrete((numerator, denominator), 1.0, method=hold)
    return forward.ravel(), back


def behind(straight: Array, held: Array, lag: float, shape: float, late: Array) -> tuple[Array, Array]:
    """Values and slopes per sample (rows, n) of a current behind the filter, at `k - late[k]` samples.

    The current is the sum of `straight`, which is so between samples, and `held`, which is constant from each sample on.
    """
    parts = ((straight, "foh"), (held, "zoh")) if held.any() else ((straight, "foh"),)
    lagged = sum(_filtered(x, lag, shape, (1.0,), hold) for x, hold in parts)
    if shape > 0.0:
        rate = sum(_filtered(x, lag, shape, (1.0, 0.0), hold) for x, hold in parts)
    else:
        rate = np.zeros_like(straight)
    value, slope = np.empty_like(straight), np.empty_like(straight)
    inputs = (np.ascontiguousarray(x, dtype=np.float64) for x in (straight, held, lagged, rate, late))
    _behind(*inputs, lag, shape, value, slope)
    return value, slope


def by_lag(straight: Array, held: Array, lag: float, shape: float, late: Array) -> Array:
    """Derivative (rows, n) of the value behind the filter by the lag, per sample."""
    h = STEP * lag
    more, less = (behind(straight, held, moved, shape, late)[0] for moved in (lag + h, lag - h))
    return np.asarray((more - less) / (2.0 * h))


def by_shape(straight: Array, held: Array, lag: float, shape: float, late: Array) -> Array:
    """Derivative (rows, n) of the value behind the filter by its shape; to one side where the shape is none."""
    low = max(shape - SHAPE_STEP, 0.0)
    more, less = (behind(straight, held, lag, moved, late)[0] for moved in (shape + SHAPE_STEP, low))
    return np.asarray((more - less) / (shape + SHAPE_STEP - low))


@njit(cache=True)
def _unforced(u, lag, shape):
    """Value `u` samples on of the filter without input that begins at value 1 and slope 0, and at value 0 and slope 1."""
    apart = 1.0 - 4.0 * shape
    mean = -0.5 / (shape * lag)
    if apart > ALIKE:
        root = np.sqrt(apart)
        slow, quick = -2.0 / (lag * (1.0 + root)), -0.5 * (1.0 + root) / (shape * lag)
        slowly, quickly = np.exp(slow * u), np.exp(quick * u)
        return (quick * slowly - slow * quickly) / (quick - slow), (quickly - slowly) / (quick - slow)
    if apart < -ALIKE:
        turn = -mean * np.sqrt(-apart)
        from_slope = np.exp(mean * u) * np.sin(turn * u) / turn
        return np.exp(mean * u) * np.cos(turn * u) - mean * from_slope, from_slope
    from_slope = u * np.exp(mean * u)
    return np.exp(mean * u) - mean * from_slope, from_slope


@njit(cache=True)
def _behind(straight, held, lagged, rate, late, lag, shape, value, slope):
    rows, n = straight.shape
    for k in range(n):
        at = k - late[k]
        j = min(max(int(np.floor(at)), 0), n - 2)
        u = min(max(at - j, 0.0), 2.0)
        if shape == 0.0:
            from_value, from_slope = np.exp(-u / lag), 0.0
            value_falls, slope_falls = -from_value / lag, 0.0
        else:
            from_value, from_slope = _unforced(u, lag, shape)
            value_falls = -from_slope / (shape * lag * lag)
            slope_falls = from_value - from_slope / (shape * lag)
        for c in range(rows):
            begin, rise = straight[c, j] + held[c, j], straight[c, j + 1] - straight[c, j]
            off = lagged[c, j] - begin + rise * lag
            off_slope = rate[c, j] - rise
            value[c, k] = begin + rise * (u - lag) + off * from_value + off_slope * from_slope
            slope[c, k] = rise + off * value_falls + off_slope * slope_falls
