"""Compiled cost of a set of tones: the worst relative standard error that their information leaves."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit

Array = NDArray[np.float64]
FEWEST_SHARE = 0.06
"""Of the limits: what every tone has at least, so that it can be measured."""
APART, CROWDED = 0.4, 5.0
"""Tones nearer than this, in logarithms, cost so much each."""


@njit()
def minimax_cost(point: Array, bounds: Array, machine: Array, limits: Array) -> float:
    """Logarithm of the worst variance of (R_s, R_R, L_sigma, L_M), relative, and what tones too near each other cost.

    `point` (2 n,): logarithms of n frequencies, then of their shares of the limits; `bounds` the lowest and the highest
    frequency; `limits` (4,): peak current, peak stator flux, peak voltage, rms current. Infinite where nothing is told.
    An unknown delay is carried along and eliminated, as in `tones._information`.
    """
    n = point.size // 2
    r_s, r_r, l_s, l_m = machine[0], machine[1], machine[2], machine[3]
    f, shares = np.empty(n), np.empty(n)
    top = np.max(point[n:])
    for k in range(n):
        f[k] = min(max(math.exp(point[k]), bounds[0]), bounds[1])
        shares[k] = math.exp(point[n + k] - top)
    shares /= np.sum(shares)
    shares = np.maximum(shares, FEWEST_SHARE)
    shares /= np.sum(shares)

    volts, by = np.empty(n), np.empty((n, 5), dtype=np.complex128)
    current, flux, voltage, power = 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        omega = 2j * math.pi * f[k]
        branch = 1.0 / (1.0 / r_r + 1.0 / (omega * l_m))
        y = 1.0 / (r_s + omega * l_s + branch)
        per_a, per_wb = abs(y), abs((1.0 - r_s * y) / omega)
        volts[k] = shares[k] / max(per_a / limits[0], per_wb / limits[1])
        current += volts[k] * per_a
        flux += volts[k] * per_wb
        voltage += volts[k]
        power += 0.5 * (volts[k] * per_a) ** 2
        by[k, 0], by[k, 1] = y * y * r_s, y * y * branch * branch / r_r
        by[k, 2], by[k, 3] = y * y * omega * l_s, y * y * branch * branch / (omega * l_m)
        by[k, 4] = omega * y
    use = max(current / limits[0], flux / limits[1], voltage / limits[2], math.sqrt(power) / limits[3])

    seen = np.zeros((5, 5))
    for k in range(n):
        weight = (volts[k] / use) ** 2
        for a in range(5):
            for b in range(5):
                seen[a, b] += weight * (by[k, a].real * by[k, b].real + by[k, a].imag * by[k, b].imag)
    information = np.empty((4, 4))
    for a in range(4):
        for b in range(4):
            information[a, b] = seen[a, b] - seen[a, 4] * seen[b, 4] / seen[4, 4]
    worst = _largest_variance(information)
    if not worst < math.inf:
        return math.inf
    f.sort()
    crowding = 0.0
    for k in range(n - 1):
        crowding += max(0.0, APART - math.log(f[k + 1] / f[k]))
    return math.log(worst) + CROWDED * crowding


@njit()
def _largest_variance(information: Array) -> float:
    """The largest diagonal element of the inverse, (4, 4), by Cholesky's factor; infinite where there is none."""
    n = information.shape[0]
    level = 1e-12 * np.trace(information)
    low, back = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            left = information[i, j] + (level if i == j else 0.0)
            for k in range(j):
                left -= low[i, k] * low[j, k]
            if i != j:
                low[i, j] = left / low[j, j]
            elif left > 0.0:
                low[i, i] = math.sqrt(left)
            else:
                return math.inf
    worst = 0.0
    for j in range(n):
        variance = 0.0
        for i in range(j, n):
            left = 1.0 if i == j else 0.0
            for k in range(j, i):
                left -= low[i, k] * back[k, j]
            back[i, j] = left / low[i, i]
            variance += back[i, j] ** 2
        worst = max(worst, variance)
    return worst
