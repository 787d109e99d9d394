"""Currents and their sensitivities in units of what chance does to them."""

from __future__ import annotations

import numpy as np

from commissioner.compiled import njit

LARGEST = 1e8
"""Of a whitened residual or sensitivity: a run that flies away counts as enormous, and can still be squared."""
FINITE = 1e100
"""Before whitening, which sums."""
AT_ONCE, TAPS = 1024, 4
"""Numbers, and taps, that are taken together: they stay in the nearest cache."""


@njit(inline="always", error_model="numpy")
def _within(x, most):
    """Nothing where it is no number."""
    return x if abs(x) <= most else (most if x > most else (-most if x < -most else 0.0))


@njit(error_model="numpy", fastmath={"reassoc", "contract"}, nogil=True)
def whiten(x, taps, per_zero):
    """x (C, n, 2 or 3) in place: alpha and beta through the moving average `taps`, the zero sequence by its own scale."""
    n, channels = x.shape[1], x.shape[2]
    groups = (taps.size + TAPS - 1) // TAPS
    before = 2 * (groups * TAPS - 1)
    padded = np.zeros(groups * TAPS)
    for g in range(taps.size):
        padded[g] = taps[g]
    line, summed = np.zeros(before + 2 * n), np.empty(AT_ONCE)
    for c in range(x.shape[0]):
        row, begin = x[c], 0
        while begin < n and row[begin, 0] == 0.0 and row[begin, 1] == 0.0 and row[begin, channels - 1] == 0.0:
            begin += 1  # a knot of the load that has not begun moves nothing
        for q in range(begin, n):
            for e in range(2):
                line[before + 2 * q + e] = _within(row[q, e], FINITE)
            if channels == 3:
                row[q, 2] = _within(_within(row[q, 2], FINITE) * per_zero, LARGEST)
        for k in range(before + 2 * begin):
            line[k] = 0.0
        for first in range(2 * begin, 2 * n, AT_ONCE):
            size = min(AT_ONCE, 2 * n - first)
            for k in range(size):
                summed[k] = 0.0
            for g in range(groups):
                a, b, d, e = padded[4 * g], padded[4 * g + 1], padded[4 * g + 2], padded[4 * g + 3]
                at = first + before - 2 * TAPS * g
                for k in range(size):
                    summed[k] += a * line[at + k] + b * line[at + k - 2] + d * line[at + k - 4] + e * line[at + k - 6]
            for k in range(size // 2):
                row[first // 2 + k, 0] = _within(summed[2 * k], LARGEST)
                row[first // 2 + k, 1] = _within(summed[2 * k + 1], LARGEST)
