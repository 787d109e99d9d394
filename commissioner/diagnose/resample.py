"""Reading a sampled trajectory at other instants: exact at kinks of the slope, where a held voltage steps."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True, nogil=True)
def _hermite(values, after, before, late, period, out, slope):
    rows, n = values.shape
    for k in range(n):
        at = k - late[k]
        j = int(np.floor(at))
        u = at - j
        if u == 0.0:
            j -= 1
            u = 1.0
        if j < 0:
            for c in range(rows):
                out[c, k] = values[c, 0]
                slope[c, k] = 0.0
            continue
        if j > n - 2:
            # past the last sample the current goes on as it begins to
            for c in range(rows):
                out[c, k] = values[c, n - 1] + after[c, n - 1] * period * min(at - (n - 1), 1.0)
                slope[c, k] = after[c, n - 1]
            continue
        for c in range(rows):
            y0, y1 = values[c, j], values[c, j + 1]
            m0, m1 = after[c, j] * period, before[c, j + 1] * period
            a = 2.0 * y0 - 2.0 * y1 + m0 + m1
            b = -3.0 * y0 + 3.0 * y1 - 2.0 * m0 - m1
            out[c, k] = ((a * u + b) * u + m0) * u + y0
            slope[c, k] = ((3.0 * a * u + 2.0 * b) * u + m0) / period


def resample_hermite(values: Array, after: Array, before: Array, late: Array, period: float) -> tuple[Array, Array]:
    """Values and slopes (rows, n) at `k - late[k]` samples, cubic between samples with one-sided slopes at them."""
    out, slope = np.empty_like(values), np.empty_like(values)
    late = np.ascontiguousarray(late, dtype=np.float64)
    _hermite(*(np.ascontiguousarray(x) for x in (values, after, before)), late, period, out, slope)
    return out, slope


@njit(cache=True, nogil=True)
def _lagrange(values, late, out):
    rows, n = values.shape
    for k in range(n):
        at = min(max(k - late[k], 0.0), n - 1.0)
        j = min(max(int(np.floor(at)) - 1, 0), n - 4)
        u = at - j
        w0 = -(u - 1.0) * (u - 2.0) * (u - 3.0) / 6.0
        w1 = u * (u - 2.0) * (u - 3.0) / 2.0
        w2 = -u * (u - 1.0) * (u - 3.0) / 2.0
        w3 = u * (u - 1.0) * (u - 2.0) / 6.0
        for c in range(rows):
            out[c, k] = w0 * values[c, j] + w1 * values[c, j + 1] + w2 * values[c, j + 2] + w3 * values[c, j + 3]


def resample(values: Array, late: Array) -> Array:
    """Rows (rows, n) at `k - late[k]` samples by four-point Lagrange interpolation."""
    out = np.empty_like(values)
    _lagrange(np.ascontiguousarray(values), np.ascontiguousarray(late, dtype=np.float64), out)
    return out


def held_at(steps: Array, late: Array) -> Array:
    """Rows (rows, n) that are held from each sample on, at `k - late[k]` samples; at a sample, what was held until there."""
    at = np.ceil(np.arange(steps.shape[1]) - late).astype(np.intp) - 1
    return np.where(at < 0, 0.0, steps[:, np.clip(at, 0, steps.shape[1] - 1)])
