"""One inverter for all tests: their leg curves put together, and drawn to what inverters are known to lose.

The batch fit leaves a leg's loss almost free, and a free curve and a resistance are hard to tell apart. But a leg's loss
is a dead time (its output capacitance charged by the load current, or one of the smooth signs by which it is usually
described) and a device threshold. All pairs of such laws are fitted to the curves, weighed by their information; what
the pairs that fit disagree about stays in the covariance. Where none fits the free curves stand.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc

from commissioner.identify.batch.segments import BatchFit
from commissioner.identify.inverter.leg_law import TAIL, LegLaw
from commissioner.identify.inverter.leg_pair import (
    DEAD_TIME,
    FORM,
    KNEE_SPREAD,
    SHARE_SPREAD,
    THRESHOLD,
    TYPICAL_KNEE,
    TYPICAL_SHARE,
    PairLaw,
    law_of_knee,
)
from commissioner.identify.inverter.mixture import chances_of, mixture
from commissioner.records import Signal, peak

Matrix = NDArray[np.float64]
WORST_CHANCE = 1e-4
"""A pair of laws is believed where curves this far from it would be at least this likely."""
RESOLUTION = 5e-4
"""What a curve point may be off sideways although the fit is sure of it, of the largest current: a steep loss moves much
within one sample. In height: `FORM`."""
_STARTS = (0.25, 1.0, 4.0)
OTHER_KNEES = [knees for knees in itertools.product(_STARTS, _STARTS) if knees != (1.0, 1.0)]
"""Of the dead time's and the threshold's typical ones, from which other minima are looked for."""
SAME_KNEE = 0.1
"""Knees whose logarithms differ by no more are of one minimum."""


@dataclass(frozen=True)
class Pair:
    """A pair of laws drawn to the curves: the loss at the knots, its covariance, chi-square of what is left; the law and
    its values."""

    values: Signal
    covariance: Matrix
    misfit: float
    law: PairLaw
    plateaus: Signal


def one_inverter(fits: Sequence[BatchFit], pairs: Sequence[Pair]) -> list[BatchFit]:
    """The fits with the leg curve they agree on by their `pairs`. Unchanged where a leg was not fitted, or no known law describes it."""
    if not pairs or chdtrc(pairs[0].values.size - 4, pairs[0].misfit) < WORST_CHANCE:
        return list(fits)
    chances = chances_of([p.misfit for p in pairs])
    values, covariance = mixture(chances, [p.values for p in pairs], [p.covariance for p in pairs])
    return [_given(f, values, covariance) for f in fits]


@dataclass(frozen=True)
class _Curve:
    """What all fits say of a leg's loss at the knots, A and V, `(n,)`; `root` (n, n) whitens what is missed of it."""

    current: Signal
    largest_a: float
    mean: Signal
    root: Matrix


def pairs_of(fits: Sequence[BatchFit]) -> list[Pair]:
    """Every pair of laws drawn to the curves of the fits together, the best first; none where a leg was not fitted."""
    curve = _curve_of(fits)
    if curve is None:
        return []
    pairs = [_fit_pair((dead, drop), curve) for dead, drop in itertools.product(DEAD_TIME, THRESHOLD)]
    return sorted(pairs, key=lambda p: p.misfit)


def minima_of(fits: Sequence[BatchFit], pairs: Sequence[Pair]) -> list[Pair]:
    """The `pairs` of these fits drawn to the curves from other knees, too: one for every minimum, the best first. Of a narrow and a wide
    knee curves leave open which is whose, samples do not."""
    curve = _curve_of(fits)
    if curve is None:
        return []
    minima: list[Pair] = []
    for pair in pairs:
        known = [pair]
        for begun in OTHER_KNEES:
            other = _fit_pair((pair.law.dead_time, pair.law.threshold), curve, begun)
            if all(_is_apart(other, one) for one in known):
                known.append(other)
        minima += known
    return sorted(minima, key=lambda m: m.misfit)


def _is_apart(a: Pair, b: Pair) -> bool:
    """Whether these are two minima of one pair of laws."""
    knees = (a.law.dead_time_knee_a / b.law.dead_time_knee_a, a.law.threshold_knee_a / b.law.threshold_knee_a)
    return max(abs(math.log(k)) for k in knees) > SAME_KNEE


def _curve_of(fits: Sequence[BatchFit]) -> _Curve | None:
    law = fits[0].model.leg
    if not isinstance(law, LegLaw) or any(f.model.leg != law for f in fits):
        return None
    parts = [f.model.leg_slice for f in fits]
    weights = [np.linalg.pinv(f.covariance[p, p]) for f, p in zip(fits, parts, strict=True)]
    information = np.sum(weights, axis=0)
    mean = np.linalg.solve(
        information, np.sum([w @ f.theta[p] for w, f, p in zip(weights, fits, parts, strict=True)], axis=0)
    )
    current = law.knots_a
    steepness = np.gradient(np.append(0.0, mean), np.append(0.0, current))[1:]
    blur = np.square(steepness * RESOLUTION * law.largest_a) + (FORM * np.max(np.abs(mean))) ** 2
    root = np.linalg.cholesky(np.linalg.inv(np.linalg.inv(information) + np.diag(blur))).T
    return _Curve(current, law.largest_a, mean, root)


def _fit_pair(names: tuple[str, str], drawn: _Curve, begun: tuple[float, float] = (1.0, 1.0)) -> Pair:
    """Plateau, threshold's share and both knees (logarithms) by weighted least squares; knees are `begun` at so many typical ones."""
    from scipy.optimize import least_squares

    current, largest_a, mean, root = drawn.current, drawn.largest_a, drawn.mean, drawn.root
    dead, drop = DEAD_TIME[names[0]], THRESHOLD[names[1]]
    plateau = max(peak(mean), 1e-6)
    typical = math.log(TYPICAL_KNEE * largest_a)

    def curve(p: Signal) -> Signal:
        total, ratio, k1, k2 = np.exp(np.clip(p, -30.0, 30.0))
        share = ratio / (1.0 + ratio)
        return np.asarray(total * ((1.0 - share) * dead(current / k1) + share * drop(current / k2)))

    def misfit(p: Signal) -> Signal:
        prior = [
            (p[1] - math.log(TYPICAL_SHARE)) / SHARE_SPREAD,
            (p[2] - typical) / KNEE_SPREAD,
            (p[3] - typical) / KNEE_SPREAD,
        ]
        return np.concatenate([root @ (curve(p) - mean), prior])

    def jacobian(p: Signal) -> Matrix:
        total, ratio, k1, k2 = np.exp(np.clip(p, -30.0, 30.0))
        share = ratio / (1.0 + ratio)
        of_dead, of_drop = (1.0 - share) * law_of_knee(dead, current / k1), share * law_of_knee(drop, current / k2)
        by_ratio = (1.0 - share) * of_drop[:, 0] - share * of_dead[:, 0]
        rows = total * np.column_stack([of_dead[:, 0] + of_drop[:, 0], by_ratio, of_dead[:, 1], of_drop[:, 1]])
        return np.vstack([root @ rows, np.diag([0.0, 1.0 / SHARE_SPREAD, 1.0 / KNEE_SPREAD, 1.0 / KNEE_SPREAD])[1:]])

    start = [math.log(plateau), math.log(TYPICAL_SHARE), *(typical + math.log(knee) for knee in begun)]
    fit = least_squares(misfit, start, jacobian, method="lm", max_nfev=300)
    spread = np.linalg.pinv(fit.jac.T @ fit.jac)
    moves = np.linalg.solve(root, fit.jac[: mean.size])
    total, ratio, knee_1, knee_2 = map(float, np.exp(np.clip(fit.x, -30.0, 30.0)))
    return Pair(
        values=curve(fit.x),
        covariance=moves @ spread @ moves.T,
        misfit=2.0 * float(fit.cost),
        law=PairLaw(*names, knee_1, knee_2, largest_a),
        plateaus=np.array([total / (1.0 + ratio), total * ratio / (1.0 + ratio), 0.0, 0.0]),
    )


def _given(fit: BatchFit, values: Signal, covariance: Matrix) -> BatchFit:
    """The fit when the tail of its leg curve, which passes for resistance, is known to be `values` +- `covariance`."""
    part = slice(fit.model.leg_slice.start + TAIL, fit.model.leg_slice.stop)
    gain = fit.covariance[:, part] @ np.linalg.pinv(fit.covariance[part, part])
    theta = fit.theta + gain @ (values[TAIL:] - fit.theta[part])
    rest = fit.covariance - gain @ fit.covariance[part, :]
    return replace(fit, theta=theta, covariance=rest + gain @ covariance[TAIL:, TAIL:] @ gain.T)
