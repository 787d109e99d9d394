"""Uniform cubic B-splines on [0, top], compiled: the shapes every nonlinear cause is made of."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def spline_weights(y, top, intervals, weights, row):
    """Uniform cubic B-spline weights on [0, top], linear beyond. `weights[row, 0:4]` values, `[4:8]` slopes; first index."""
    h = top / intervals
    beyond = 0.0
    if y > top:
        beyond = y - top
        y = top
    j = int(y / h)
    j = min(j, intervals - 1)
    u = y / h - j
    m = 1.0 - u
    weights[row, 0] = m * m * m / 6.0
    weights[row, 1] = (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0
    weights[row, 2] = (-3.0 * u * u * u + 3.0 * u * u + 3.0 * u + 1.0) / 6.0
    weights[row, 3] = u * u * u / 6.0
    weights[row, 4] = -0.5 * m * m / h
    weights[row, 5] = (1.5 * u * u - 2.0 * u) / h
    weights[row, 6] = (-1.5 * u * u + u + 0.5) / h
    weights[row, 7] = 0.5 * u * u / h
    if beyond > 0.0:
        for k in range(4):
            weights[row, k] += weights[row, 4 + k] * beyond
    return j


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def curve(coefficients, j, weights, row, offset):
    return (
        coefficients[j] * weights[row, offset]
        + coefficients[j + 1] * weights[row, offset + 1]
        + coefficients[j + 2] * weights[row, offset + 2]
        + coefficients[j + 3] * weights[row, offset + 3]
    )


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def saturating(a, b, coefficients, top, weights, row):
    """Current S(|f|) f of a path with flux f = (a, b): interval found, the current, and its derivative's aa, ab, bb."""
    size = np.sqrt(a * a + b * b) + 1e-12
    j = spline_weights(size, top, coefficients.shape[0] - 3, weights, row)
    big = curve(coefficients, j, weights, row, 0)
    steep = curve(coefficients, j, weights, row, 4) / size
    return j, big * a, big * b, big + steep * a * a, steep * a * b, big + steep * b * b
