"""Where a current is heading: levels held too briefly to settle, extrapolated with one common time constant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.records import Signal

SPREAD = 0.5
"""Standard deviation of the logarithm of the expected time constant."""
TRIED = np.geomspace(0.25, 4.0, 33)
POINTS = 24
REFINEMENTS = 4
"""The grid of time constants is narrowed this often at most, until it resolves what the data can tell."""


@dataclass(frozen=True)
class Approach:
    """Time since the voltage of a level was set, and the current, `(n,)` each; what the fast mode does is left out."""

    time_s: Signal
    current_a: Signal


@dataclass(frozen=True)
class Settled:
    """The current each level would have settled at, and its standard error, `(levels,)`; the common time constant."""

    current_a: Signal
    std_a: Signal
    time_constant_s: float


def settle(approaches: Sequence[Approach], expected_s: float) -> Settled:
    """Least squares of i = i_inf + a exp(-t/T), own i_inf and a per level, T common and log-normal about `expected_s`.

    Linear in i_inf and a for each T tried (variable projection, G. H. Golub & V. Pereyra, SIAM J. Numer. Anal. 10,
    1973). Levels that have settled give a = 0, whatever T.
    """
    thinned = [_thinned(a) for a in approaches]
    freedom = max(sum(a.time_s.size for a in thinned) - 2 * len(thinned) - 1, 1)
    tried = expected_s * TRIED
    for _ in range(REFINEMENTS):
        fits = [[_level(a, t) for a in thinned] for t in tried]
        misfit = np.array([sum(f[2] for f in levels) for levels in fits])
        noise = max(float(np.min(misfit)) / freedom, 1e-18)
        cost = misfit + noise * np.square(np.log(tried / expected_s) / SPREAD)
        best = int(np.argmin(cost))
        found, neighbours = tried, (tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)])
        likely = np.exp(-0.5 * (cost - cost[best]) / noise)
        if likely.sum() > 4.0:
            break
        tried = np.geomspace(*neighbours, TRIED.size)
    current, variance, _ = (np.array(column) for column in zip(*fits[best], strict=True))
    others = np.array([[f[0] for f in levels] for levels in fits])
    doubt = likely / likely.sum() @ np.square(others - current)
    return Settled(current, np.sqrt(noise * variance + doubt), float(found[best]))


def _thinned(approach: Approach) -> Approach:
    """Means over at most `POINTS` stretches of equal length."""
    size = max(1, approach.time_s.size // POINTS)
    whole = approach.time_s.size // size * size
    time, current = (s[-whole:].reshape(-1, size).mean(axis=1) for s in (approach.time_s, approach.current_a))
    return Approach(time, current)


def _level(approach: Approach, time_constant_s: float) -> tuple[float, float, float]:
    """(i_inf, its variance for unit noise, sum of squares) of one level."""
    decay = np.exp(-(approach.time_s - approach.time_s[0]) / time_constant_s)
    design = np.column_stack([np.ones_like(decay), decay])
    information = design.T @ design + 1e-9 * np.eye(2)
    covariance = np.linalg.inv(information)
    fit = covariance @ (design.T @ approach.current_a)
    rest = approach.current_a - design @ fit
    return float(fit[0]), float(covariance[0, 0]), float(rest @ rest)
