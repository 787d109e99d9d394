"""One number over the years: slope, steps, and whether the newest value is an alarm, each at a stated chance of being wrong.

A point's noise is what its run claims, repeatability included. Where the points scatter more than they claim around the levels
between the steps, the noise of all is widened; four claimed points' worth of belief stand beside them, so that three points do
not pretend to know what thirty would (as `monitor.trend`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from commissioner.monitor.trend.trend import PRIOR_WEIGHT

Array = NDArray[np.float64]
FALSE_ALARM = 1e-3
"""Chance that a motor without any change gets a step, a slope or an alarm: over all its parameters and all places of a step
together (Bonferroni). It holds where runs claim their noise as it is; where points scatter 1.5 times as much as they claim, it is
at most twice as often (tests/unit/history measures both)."""
LEAST = 3
"""Points for a step or an alarm; a slope takes one more."""


@dataclass(frozen=True)
class Step:
    """The level changes between point `at - 1` and point `at` by `change` +- `std`; `probability`: by chance, at most."""

    at: int
    change: float
    std: float
    probability: float


@dataclass(frozen=True)
class Slope:
    """Per unit of time, since the last step; `probability`: of so steep a one by chance; `rest`: chi-square that it leaves."""

    value: float
    std: float
    probability: float
    is_significant: bool
    rest: float


@dataclass(frozen=True)
class Alarm:
    """The newest point against those since the last step before it: `distance` and `threshold` in standard errors."""

    distance: float
    threshold: float

    @property
    def is_raised(self) -> bool:
        return abs(self.distance) > self.threshold


@dataclass(frozen=True)
class Judged:
    """`level` +- `level_std` since the last step; `widening`: actual over claimed scatter, at least 1; None: too few points."""

    level: float
    level_std: float
    widening: float
    steps: tuple[Step, ...]
    slope: Slope | None
    alarm: Alarm | None


def judge(
    time: Array, value: Array, std: Array, *, tests: int = 1, false_alarm: float = FALSE_ALARM, least_span: float = 0.0
) -> Judged:
    """`(n,)` each, in order of time, n >= 1. `tests`: how many series are looked at together. Steps, slope and alarm share
    `false_alarm` in equal parts. No slope is told over less than `least_span`."""
    each = false_alarm / (3 * tests)
    slope, steps = _slope(time, value, std, each, least_span), _steps(value, std, each)
    if steps and slope is not None and slope.rest <= _rest(value, std, [step.at for step in steps]):
        steps = []  # the line leaves no more, and has less to be fitted: it drifts
    widening = _scatter(value, std, [step.at for step in steps])[0]
    begin = steps[-1].at if steps else 0
    level, level_std = _mean(value, std * widening, begin, value.size)
    return Judged(
        level,
        level_std,
        widening,
        tuple(steps),
        _slope(time[begin:], value[begin:], std[begin:], each, least_span),
        _alarm(value, std, steps, each),
    )


def _scatter(value: Array, std: Array, places: Sequence[int], *, fitted: int = 1) -> tuple[float, float]:
    """(actual over claimed noise, at least 1; degrees of freedom) around the levels between `places`."""
    freedom = PRIOR_WEIGHT + max(value.size - fitted * (len(places) + 1), 0)
    return float(np.sqrt(max(1.0, (PRIOR_WEIGHT + _rest(value, std, places)) / freedom))), freedom


def _rest(value: Array, std: Array, places: Sequence[int]) -> float:
    """Chi-square around the levels between `places`."""
    parts = pairwise([0, *places, value.size])
    return sum(float(np.sum(((value[a:b] - _mean(value, std, a, b)[0]) / std[a:b]) ** 2)) for a, b in parts)


def _first_scatter(value: Array, std: Array) -> tuple[float, float]:
    """As `_scatter`, before any step is known: by successive differences, the largest of which are left out: they may be steps.
    What it finds too much, `_scatter` takes back."""
    squares = np.sort(np.diff(value) ** 2 / (std[1:] ** 2 + std[:-1] ** 2))
    kept = squares[: squares.size - squares.size // 4]
    return float(
        np.sqrt(max(1.0, (PRIOR_WEIGHT + np.sum(kept)) / (PRIOR_WEIGHT + kept.size)))
    ), PRIOR_WEIGHT + 2.0 * kept.size / 3.0


def _steps(value: Array, std: Array, chance: float) -> list[Step]:
    """Binary segmentation: the best place first, then each side by itself, all places paid for together. Then each step is judged
    again, against its neighbours alone and with the scatter that all of them leave; the least sure one goes until all hold."""
    number = max(value.size - 1, 1)
    widening, freedom = _first_scatter(value, std)
    found: list[int] = []
    parts = [(0, value.size)]
    while parts:
        begin, end = parts.pop()
        step = _best(value, std * widening, begin, end, freedom, number)
        if end - begin >= LEAST and step is not None and step.probability <= chance:
            found.append(step.at)
            parts += [(begin, step.at), (step.at, end)]
    while found:
        edges = [0, *sorted(found), value.size]
        widening, freedom = _scatter(value, std, edges[1:-1])
        noise = std * widening
        steps = [
            _step(value, noise, edges[k - 1], edges[k], edges[k + 1], freedom, number) for k in range(1, len(edges) - 1)
        ]
        worst = max(steps, key=lambda step: step.probability)
        if worst.probability <= chance:
            return steps
        found.remove(worst.at)
    return []


def _best(value: Array, noise: Array, begin: int, end: int, freedom: float, places: int) -> Step | None:
    steps = [_step(value, noise, begin, at, end, freedom, places) for at in range(begin + 1, end)]
    return min(steps, key=lambda step: (step.probability, -abs(step.change / step.std)), default=None)


def _step(value: Array, noise: Array, begin: int, at: int, end: int, freedom: float, places: int) -> Step:
    (before, before_std), (after, after_std) = _mean(value, noise, begin, at), _mean(value, noise, at, end)
    std = float(np.hypot(before_std, after_std))
    chance = 2.0 * float(stdtr(freedom, -abs(after - before) / std))
    return Step(at, after - before, std, min(1.0, places * chance))


def _mean(value: Array, noise: Array, begin: int, end: int) -> tuple[float, float]:
    weight = 1.0 / noise[begin:end] ** 2
    return float(np.sum(weight * value[begin:end]) / np.sum(weight)), float(np.sum(weight) ** -0.5)


def _slope(time: Array, value: Array, std: Array, chance: float, least_span: float) -> Slope | None:
    """Weighted least squares; None for fewer than four points or no time between them, or less than `least_span`."""
    if value.size <= LEAST or np.ptp(time) <= 0.0 or np.ptp(time) < least_span:
        return None
    weight = 1.0 / std**2
    from_middle = time - np.sum(weight * time) / np.sum(weight)
    spread = float(np.sum(weight * from_middle**2))
    slope = float(np.sum(weight * from_middle * value) / spread)
    around = value - slope * from_middle
    widening, freedom = _scatter(around, std, (), fitted=2)
    error = widening * spread**-0.5
    probability = 2.0 * float(stdtr(freedom, -abs(slope) / error))
    return Slope(slope, error, probability, probability <= chance, _rest(around, std, ()))


def _alarm(value: Array, std: Array, steps: Sequence[Step], chance: float) -> Alarm | None:
    """A newest point that begins a level of its own is an alarm, too: it is judged against the level before it, and by the scatter
    without it."""
    last = value.size - 1
    places = [step.at for step in steps if step.at < last]
    begin = places[-1] if places else 0
    if last - begin < LEAST - 1:
        return None
    widening, freedom = _scatter(value[:last], std[:last], places)
    mean, error = _mean(value, std * widening, begin, last)
    distance = (value[last] - mean) / np.hypot(error, widening * std[last])
    return Alarm(float(distance), -float(stdtrit(freedom, 0.5 * chance)))
