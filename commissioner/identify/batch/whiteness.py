"""Is what a model leaves unexplained just noise?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.records import Signal

LAGS = 8
LIMIT = 20.1
"""99 % point of chi-square with 8 degrees of freedom (Castaldi & Tilli 2005, Table II)."""
SAMPLES = 2000
LEAST_NOISE = 1e-3
"""Of a residual's rms, in the second differences of the batch fit's: a played recording without noise has 1e-12, one with 1e-5 of its
peak current has 0.2."""


@dataclass(frozen=True)
class Whiteness:
    """`statistic` = N sum r_k^2 over 8 lags of the decimated residual; white below `limit` in 99 of 100 cases."""

    statistic: float
    limit: float = LIMIT

    @property
    def is_white(self) -> bool:
        return self.statistic <= self.limit


def whiteness(residuals: Sequence[Signal]) -> Whiteness:
    """The portmanteau statistic of residuals decimated (every m-th sample) to about 2000."""
    total = sum(r.size for r in residuals)
    every = max(1, total // SAMPLES)
    parts = [r[::every] - np.mean(r) for r in residuals if r.size >= every * (LAGS + 2)]
    power = sum(float(p @ p) for p in parts)
    count = sum(p.size for p in parts)
    if power <= 0.0:
        return Whiteness(0.0)
    correlations = [sum(float(p[k:] @ p[:-k]) for p in parts) / power for k in range(1, LAGS + 1)]
    return Whiteness(float(count * np.sum(np.square(correlations))))


def holds_noise(residuals: Sequence[Signal], rms_a: float) -> bool:
    """Whether a fit's residuals change from sample to sample as a sensor's noise does, beside what an estimator left of the same samples."""
    parts = [r for r in residuals if r.size > 2]
    floor = float(np.median([np.var(np.diff(r, 2)) for r in parts])) / 6.0 if parts else 0.0
    return floor > (LEAST_NOISE * rms_a) ** 2
