"""Uniform cubic splines on [0, top], compiled: the shapes every nonlinear cause is made of.

A dictionary's vectors are weights of B-splines; the kernels read cells: the four coefficients of a cubic in u = 0 ... 1
within each interval.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import borrowing

Array = NDArray[np.float64]
_TO_CELL = np.array([[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]]) / 6.0


def cells_of(weights: Array) -> Array:
    """B-spline weights (..., intervals + 3) as cells (..., intervals, 4), constant term first."""
    intervals = weights.shape[-1] - 3
    near = np.stack([weights[..., k : k + intervals] for k in range(4)], axis=-1)
    return np.ascontiguousarray(near @ _TO_CELL.T)


@borrowing
def place(y, top, intervals):
    """Interval of y >= 0, and where in it: 0 ... 1, more beyond `top`."""
    s = min(y * (intervals / top), 1e9)
    j = max(min(int(s), intervals - 1), 0)
    return j, s - j


@borrowing
def blend(cells, more, factor, out):
    """cells + factor more, `cells` none where empty."""
    for j in range(more.shape[0]):
        for c in range(4):
            out[j, c] = factor * more[j, c] + (cells[j, c] if cells.shape[0] > 0 else 0.0)


@borrowing
def curve(cells, j, u):
    """Value of the curve at its place, linear beyond the last interval."""
    beyond = max(u - 1.0, 0.0)
    u -= beyond
    value = ((cells[j, 3] * u + cells[j, 2]) * u + cells[j, 1]) * u + cells[j, 0]
    return value + beyond * rise(cells, j, u)


@borrowing
def rise(cells, j, u):
    """Slope of the curve at its place, per interval."""
    u = min(u, 1.0)
    return (3.0 * cells[j, 3] * u + 2.0 * cells[j, 2]) * u + cells[j, 1]


@borrowing
def saturating(a, b, cells, top):
    """Current S(|f|) f of a path with flux f = (a, b): its place, the current, and its derivative's aa, ab, bb."""
    size = np.sqrt(a * a + b * b) + 1e-12
    intervals = cells.shape[0]
    j, u = place(size, top, intervals)
    big = curve(cells, j, u)
    steep = rise(cells, j, u) * (intervals / top) / size
    return j, u, big * a, big * b, big + steep * a * a, steep * a * b, big + steep * b * b
