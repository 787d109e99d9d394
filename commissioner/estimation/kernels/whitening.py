"""Currents and their sensitivities in units of what chance does to them."""

from __future__ import annotations

import numpy as np

from commissioner.compiled import njit

LARGEST = 1e8
"""Of a whitened residual or sensitivity: a run that flies away counts as enormous, and can still be squared."""
FINITE = 1e100
"""Before whitening, which sums."""
NO_ROW = -1
"""In place of a row that does not move anything: zero."""
AT_ONCE, TAPS = 1024, 4
"""Numbers, and taps, that are taken together: they stay in the nearest cache."""


@njit(inline="always", error_model="numpy")
def _within(x, most):
    """Nothing where it is no number."""
    return x if abs(x) <= most else (most if x > most else (-most if x < -most else 0.0))


@njit(error_model="numpy", fastmath={"reassoc", "contract"}, nogil=True)
def whiten(x, rows, taps, per_zero, out):
    """`rows` of x (C, n, 3) into `out` (rows, n, 2 or 3): alpha and beta through the moving average `taps`, the zero sequence by its own scale."""
    n, channels = out.shape[1], out.shape[2]
    groups = (taps.size + TAPS - 1) // TAPS
    before = 2 * (groups * TAPS - 1)
    padded = np.zeros(groups * TAPS)
    padded[: taps.size] = taps
    line, summed = np.zeros(before + 2 * n), np.empty(AT_ONCE)
    for c in range(rows.size):
        if rows[c] == NO_ROW:
            out[c] = 0.0
            continue
        row = x[rows[c]]
        for q in range(n):
            for e in range(2):
                line[before + 2 * q + e] = _within(row[q, e], FINITE)
            if channels == 3:
                out[c, q, 2] = _within(_within(row[q, 2], FINITE) * per_zero, LARGEST)
        for first in range(0, 2 * n, AT_ONCE):
            size = min(AT_ONCE, 2 * n - first)
            summed[:] = 0.0
            for g in range(groups):
                a, b, d, e = padded[4 * g], padded[4 * g + 1], padded[4 * g + 2], padded[4 * g + 3]
                at = first + before - 2 * TAPS * g
                now, last, older, oldest = line[at:], line[at - 2 :], line[at - 4 :], line[at - 6 :]
                for k in range(size):
                    summed[k] += a * now[k] + b * last[k] + d * older[k] + e * oldest[k]
            for k in range(size // 2):
                out[c, first // 2 + k, 0] = _within(summed[2 * k], LARGEST)
                out[c, first // 2 + k, 1] = _within(summed[2 * k + 1], LARGEST)
