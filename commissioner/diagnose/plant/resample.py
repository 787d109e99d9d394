"""Reading a sampled trajectory at other instants: exact at kinks of the slope, where a held voltage steps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit

Array = NDArray[np.float64]
GRAZING = 2e-3
"""Of a sample: what comes no further over the edge of a held step does not cross it (0.4 us at 5 kHz; samplers jitter by as much)."""


@njit(nogil=True)
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


@njit(nogil=True)
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


def step_shown(late: Array) -> NDArray[np.intp]:
    """(n,) which held step is at work at `k - late[k]` samples, -1 before the first; at a sample, what was held until there.

    An instant that only grazes an edge stays on the side on which it was before, as a clock that comes back to where it began: which
    one is a matter of the last digits of its rate, and the whole step hangs on it.
    """
    edge = np.round(late)
    is_before = late >= edge
    runs = np.flatnonzero(np.r_[True, (np.diff(edge) != 0.0) | (np.diff(is_before) != 0)])
    firm = np.flatnonzero(np.maximum.reduceat(np.abs(late - edge), runs) >= GRAZING)
    if 0 < firm.size < runs.size:
        taken = firm[np.maximum(np.searchsorted(firm, np.arange(runs.size), "right") - 1, 0)]
        sides = np.where(edge[runs[taken]] == edge[runs], is_before[runs[taken]], is_before[runs])
        is_before = np.repeat(sides, np.diff(np.r_[runs, late.size]))
    return (np.arange(late.size) - edge - is_before).astype(np.intp)


def held_at(steps: Array, shown: NDArray[np.intp]) -> Array:
    """Rows (rows, n) that are held from each sample on, `shown` as `step_shown` says."""
    return np.where(shown < 0, 0.0, steps[:, np.clip(shown, 0, steps.shape[1] - 1)])
