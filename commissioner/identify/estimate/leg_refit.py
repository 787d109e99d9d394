"""The inverter's loss as a known law, fitted to the samples themselves.

Drawn to a fitted curve, a law inherits what the curve leaves open, and that passes for resistance. Fitted to the samples
in the curve's place it leaves a few hundredths of a per cent, if it describes them as well as the free curve does;
where none does, the curve stands with its doubt. Of laws that describe them alike the mean is taken, and what they
disagree about stays in the covariance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from commissioner.errors import DataRefused
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.model import Matrix
from commissioner.identify.batch.segments import BatchFit, Segment
from commissioner.identify.batch.slow_noise import widened
from commissioner.identify.estimate.leg_family import WORST_CHANCE, Pair, minima_of
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.leg_pair import PairLaw
from commissioner.identify.inverter.mixture import chances_of, mixture
from commissioner.records import Signal

WORTH = 0.003
"""Relative standard error of R_s above which the law is looked for."""
MOST_KNEE = 0.17
"""Of the largest current, where the free curve has 63 % of its loss, from where on no law is told from another by the samples: a motor of a tenth of its drive,
0.25, was given R_s 16 % off as of 0.9 %; at 0.13 (a fifth) it is right to 0.2 %."""
LIKELY, MOST_TRIED, MOST_KEPT = 25.0, 9, 4
"""Pairs tried on the samples: those whose curves are this near the best in chi-square, and how many; then, how many of
them on every test."""
ROUNDS, STEPS, TOLERANCE = 3, 8, 0.03
HOPELESS, NO_WEIGHT = 1000.0, 100.0
"""Chi-square beyond the best on the first test: no other knees make it up; it would count for exp(-25) in the mean."""
TEMPER = 0.25
"""Weight of a pair: exp(-TEMPER times chi-square beyond the best), half of what a likelihood gives: laws are near, not exact."""


@dataclass(frozen=True)
class _Refit:
    """A pair fitted to every test, one loss for all."""

    fits: tuple[BatchFit, ...]
    misfit: float


def with_known_law(
    fits: Sequence[BatchFit], tests: Sequence[Sequence[Segment]], drawn: Sequence[BatchFit], pairs: Sequence[Pair]
) -> list[BatchFit]:
    """`drawn` with what a law that describes the samples says instead, where R_s is not sure without it.

    `fits` are the tests' fits with a free curve, `tests` their segments, in the same order; `pairs` the laws drawn to the curves, the best first.
    """
    if all(math.sqrt(f.covariance[0, 0]) < WORTH * f.theta[0] for f in drawn):
        return list(drawn)
    if any(_knee_share(f) > MOST_KNEE for f in fits):
        return list(drawn)
    if not pairs:
        return list(drawn)
    minima = minima_of(fits, pairs)
    likely = [m for m in minima if m.misfit < minima[0].misfit + LIKELY][:MOST_TRIED]
    begun = _on_first_test(fits[0], tests[0], likely)
    refits = [r for f in begun[:MOST_KEPT] if (r := _fit_all(fits, tests, f)) is not None]
    free = sum(f.sum_of_squares / f.noise_a**2 for f in fits)
    spare = sum(f.model.leg_size for f in fits) - 4
    if not refits or chdtrc(spare, max(min(r.misfit for r in refits) - free, 0.0)) < WORST_CHANCE:
        return list(drawn)
    return _mean(refits, fits)


def _knee_share(fit: BatchFit) -> float:
    """Where the fit's free curve has its knee, of its largest current."""
    leg = fit.model.leg
    if leg is None:
        return 0.0
    values = fit.theta[fit.model.leg_slice]
    return leg.table(values, np.zeros((values.size, values.size))).knee_a / leg.largest_a


def _on_first_test(fit: BatchFit, segments: Sequence[Segment], likely: Sequence[Pair]) -> list[BatchFit]:
    """The first test with each pair that describes it about as well as any, at its lowest minimum, the best first."""
    found: dict[tuple[str, str], BatchFit] = {}
    for pair in likely:
        best = min((f.sum_of_squares for f in found.values()), default=math.inf)
        one = _fit_one(fit, segments, pair.law, pair.plateaus, best + HOPELESS * fit.noise_a**2)
        names = pair.law.dead_time, pair.law.threshold
        if one is not None and (names not in found or one.sum_of_squares < found[names].sum_of_squares):
            found[names] = one
    begun = sorted(found.values(), key=lambda f: f.sum_of_squares)
    return [f for f in begun if f.sum_of_squares < begun[0].sum_of_squares + NO_WEIGHT * fit.noise_a**2]


def _fit_one(fit: BatchFit, segments: Sequence[Segment], law: PairLaw, values: Signal, most: float) -> BatchFit | None:
    """One test with the law in the curve's place; its knees are laid down anew until they stay. None where the sum of squares
    stays above `most`."""
    begun = fit
    for _ in range(ROUNDS):
        try:
            begun = _fitted(begun, segments, law, values, is_coarse=True)
        except DataRefused:
            return None
        if begun.sum_of_squares > most:
            return None
        law, values = law.moved(law.admissible(begun.theta[begun.model.leg_slice]))
    return begun


def _fitted(begun: BatchFit, segments: Sequence[Segment], law: PairLaw, values: Signal, *, is_coarse: bool) -> BatchFit:
    model = replace(begun.model, leg=law)
    theta = np.zeros(model.size)
    theta[: model.leg_slice.start] = begun.theta[: begun.model.leg_slice.start]
    theta[model.leg_slice] = law.admissible(values)
    start = begun.gamma.as_inverse_gamma()
    fit = fit_segments(
        segments, begun.sample_period_s, start, model, theta, STEPS, TOLERANCE, begun.own, is_coarse=is_coarse
    )
    return fit if is_coarse else widened(fit, segments)


def _fit_all(fits: Sequence[BatchFit], tests: Sequence[Sequence[Segment]], first: BatchFit) -> _Refit | None:
    """The law of `first` on every test with knees in common; each fit then given what all say of the loss."""
    assert isinstance(first.model.leg, PairLaw)
    law, values = first.model.leg.moved(first.theta[first.model.leg_slice])
    begun = [first, *fits[1:]]
    for is_coarse in (True, False):
        try:
            begun = [_fitted(f, test, law, values, is_coarse=is_coarse) for f, test in zip(begun, tests, strict=True)]
        except DataRefused:
            return None
        mean, covariance, apart = _in_common(begun)
        law, values = law.moved(law.admissible(mean))
    noise = [f.noise_a**2 for f in fits]
    misfit = apart + sum(f.sum_of_squares / n for f, n in zip(begun, noise, strict=True))
    return _Refit(tuple(_given(f, mean, covariance) for f in begun), misfit)


def _in_common(fits: Sequence[BatchFit]) -> tuple[Signal, Matrix, float]:
    """The loss's values by all tests, their covariance, and chi-square of the tests' differences."""
    values = [f.theta[f.model.leg_slice] for f in fits]
    weights = [np.linalg.inv(f.covariance[f.model.leg_slice, f.model.leg_slice]) for f in fits]
    covariance = np.linalg.inv(np.sum(weights, axis=0))
    mean = covariance @ np.sum([w @ v for w, v in zip(weights, values, strict=True)], axis=0)
    apart = sum(float((v - mean) @ w @ (v - mean)) for w, v in zip(weights, values, strict=True))
    return mean, covariance, apart


def _given(fit: BatchFit, values: Signal, covariance: Matrix) -> BatchFit:
    """The fit where the loss is known to be `values` +- `covariance`, in the curve's layout."""
    part = fit.model.leg_slice
    gain = fit.covariance[:, part] @ np.linalg.inv(fit.covariance[part, part])
    theta = fit.theta + gain @ (values - fit.theta[part])
    known = fit.covariance - gain @ fit.covariance[part, :] + gain @ covariance @ gain.T
    assert fit.model.leg is not None
    law = LegLaw(fit.model.leg.largest_a, form_is_known=True)
    model = replace(fit.model, leg=law)
    into = np.zeros((model.size, fit.model.size))
    into[: part.start, : part.start] = np.eye(part.start)
    into[model.leg_slice, part] = fit.model.leg.basis(law.knots_a)
    return replace(fit, model=model, theta=into @ theta, covariance=into @ known @ into.T)


def _mean(refits: Sequence[_Refit], fits: Sequence[BatchFit]) -> list[BatchFit]:
    """Of all laws, by how well they describe the samples; every test's fit keeps the residuals of the best."""
    best = min(refits, key=lambda r: r.misfit)
    chances = chances_of([r.misfit for r in refits], TEMPER)
    means = []
    for k in range(len(fits)):
        of_test = [r.fits[k] for r in refits]
        theta, covariance = mixture(chances, [f.theta for f in of_test], [f.covariance for f in of_test])
        means.append(replace(best.fits[k], theta=theta, covariance=covariance))
    return means
