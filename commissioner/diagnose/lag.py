"""What first-order lags make of a current that is linear between samples, read at other instants: exact for such a current."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

Array = NDArray[np.float64]
SHORT_LAG = 0.05
"""Of a sample: below it a lag is a delay (what else it does is below 1e-3 of that)."""
APART = 1e-3
"""Two equal lags are taken so far apart: their response is then a sum of exponentials, and moves by the square of it."""


def low_pass(signal: Array, lags: Array) -> Array:
    """`signal` (..., n) behind the `lags` (samples) in a row, at the samples (first-order hold)."""
    denominator = np.ones(1)
    for lag in lags[lags > 0.0]:
        denominator = np.convolve(denominator, [lag, 1.0])
    if denominator.size == 1:
        return signal
    forward, back, _ = cont2discrete((np.ones(1), denominator), 1.0, method="foh")
    return np.asarray(lfilter(forward.ravel(), back, signal, axis=-1))


def behind(current: Array, lags: Array, late: Array) -> tuple[Array, Array]:
    """Values and slopes per sample (rows, n) of `current` behind one or two `lags` (samples), at `k - late[k]` samples."""
    at_work = np.sort(lags[lags > 0.0])[::-1]
    first = at_work[0]
    second = min(at_work[1], (1.0 - APART) * first) if at_work.size > 1 else 0.0
    once = low_pass(current, np.array([first]))
    twice = low_pass(current, np.array([first, second])) if second else once
    value, slope = np.empty_like(current), np.empty_like(current)
    inputs = (np.ascontiguousarray(x, dtype=np.float64) for x in (current, once, twice, late))
    _behind(*inputs, first, second, value, slope)
    return value, slope


@njit(cache=True)
def _behind(current, once, twice, late, first, second, value, slope):
    rows, n = current.shape
    for k in range(n):
        at = k - late[k]
        j = min(max(int(np.floor(at)), 0), n - 2)
        u = min(max(at - j, 0.0), 2.0)
        fading = np.exp(-u / first)
        fading_too = np.exp(-u / second) if second > 0.0 else 0.0
        for c in range(rows):
            rise = current[c, j + 1] - current[c, j]
            off = once[c, j] - current[c, j] + rise * first
            if second == 0.0:
                value[c, k] = current[c, j] + rise * (u - first) + off * fading
                slope[c, k] = rise - off * fading / first
                continue
            slow = off * first / (first - second)
            quick = twice[c, j] - current[c, j] + rise * (first + second) - slow
            value[c, k] = current[c, j] + rise * (u - first - second) + slow * fading + quick * fading_too
            slope[c, k] = rise - slow * fading / first - quick * fading_too / second
