"""Output-error fits: normal equations gathered segment by segment, Gauss-Newton with bounds and damping.

Only Gram matrices leave a segment, so memory does not grow with the recording and leave-one-segment-out estimates
are a subtraction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from commissioner.diagnose.model import Layout, Model, Term
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.plant import predict
from commissioner.diagnose.record import Record, each_segment

Array = NDArray[np.float64]
TRIFLE = 1e-4
DULL, DULL_ROUNDS = 5e-4, 3
"""A fit that gained less than this share of what the noise does not explain, so often in a row, creeps along a valley: enough."""
PATIENCE = 10.0
"""A fit that must gain so much goes on while this many times its next step's promise would get it there."""
TOLERANCE_OF_A_NUMBER = 0.02
"""Chi2 per number that a fit may leave: each takes 1 from noise alone, so that it lies a seventh of its spread from the optimum."""
LEAST_EIGENVALUE = 1e-11
"""Of the largest: below it is rounding."""
SLICE = 12 * 1024
"""Samples whitened at once in white noise: a multiple of every block a screening averages over."""


@dataclass(frozen=True)
class Normal:
    """Whitened normal equations per segment: `gram` (s, P, P), `slope` (s, P), `chi2` (s,), `count` (s,) samples."""

    gram: Array
    slope: Array
    chi2: Array
    count: Array

    @property
    def total_gram(self) -> Array:
        total: Array = self.gram.sum(axis=0)
        return total

    @property
    def total_slope(self) -> Array:
        total: Array = self.slope.sum(axis=0)
        return total

    @property
    def total_chi2(self) -> float:
        return float(self.chi2.sum())

    @property
    def unexplained(self) -> float:
        """Chi2 above what the noise makes, which is 1 for every sample."""
        return self.total_chi2 - float(self.count.sum())


@dataclass(frozen=True)
class Fit:
    """A fitted model with the normal equations at (or one small step before) the optimum."""

    model: Model
    normal: Normal
    has_converged: bool
    rounds: int

    @property
    def chi2(self) -> float:
        return self.normal.total_chi2

    def set_apart(self, effect: str, prefix: str = "") -> tuple[Array, NDArray[np.intp], NDArray[np.intp], Array]:
        """Information of all numbers, the rows of one effect's (whose names begin so), the rows of the others that can move,

        and their inverse.
        """
        is_mine = np.array([False] * 4 + [t.effect == effect and t.symbol.startswith(prefix) for t in self.model.terms])
        mine, others = np.flatnonzero(is_mine), np.flatnonzero(~is_mine & self.model.is_free)
        gram = self.normal.total_gram
        return gram, mine, others, inverse(gram[np.ix_(others, others)])

    def information_of(self, effect: str, prefix: str = "") -> tuple[NDArray[np.intp], Array]:
        """Rows of the effect's numbers (whose names begin so), and what the data tell of them while the others re-adjust."""
        gram, mine, others, inner = self.set_apart(effect, prefix)
        cross = gram[np.ix_(others, mine)]
        return mine, gram[np.ix_(mine, mine)] - cross.T @ inner @ cross


def inverse(information: Array) -> Array:
    """Covariance of numbers in units of their own: each scaled to unit information first, what nothing tells left out."""
    scale = np.sqrt(np.diag(information))
    scale = np.maximum(scale, 1e-9 * max(float(scale.max(initial=0.0)), 1e-150))
    unit = np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(information / unit, rcond=1e-12, hermitian=True) / unit, dtype=np.float64)


def whiten(signal: Array, is_good: NDArray[np.bool_], noise: Noise, period_s: float) -> Array:
    """`(..., phases, n)` residual or sensitivities -> `(..., m)` with unit noise variance; masked samples drop out."""
    if noise.is_white:
        scaled = signal / noise.sigma_a[:, None]
        if not is_good.all():
            scaled = scaled[..., is_good]
        return np.ascontiguousarray(scaled.reshape(*signal.shape[:-2], -1))
    n = signal.shape[-1]
    weights = noise.weights(n, period_s)
    masked = np.where(is_good, signal, 0.0) if not is_good.all() else signal
    spectrum = np.fft.rfft(masked, axis=-1)
    scale = np.full(weights.shape[1], np.sqrt(2.0 / n))
    scale[0] = np.sqrt(1.0 / n)
    if n % 2 == 0:
        scale[-1] = np.sqrt(1.0 / n)
    spectrum *= scale / weights
    # real and imaginary parts side by side
    return spectrum.view(np.float64).reshape(*signal.shape[:-2], -1)


def normal_equations(
    model: Model, record: Record, layout: Layout, wanted: Sequence[Term], noise: Noise, block: int = 1
) -> Normal:
    """Gram matrix and slope of the whitened residual for the four and `wanted`, one block per segment.

    `block` > 1 averages so many neighbouring samples first (white noise only): a screening needs no more bandwidth
    than the excitation has.
    """
    size = 4 + len(wanted)

    def _sensitivities(k: int, here: Sequence[Term]) -> tuple[Array, Array]:
        prediction = predict(model, record, k, layout, here)
        return prediction.jacobian, record.segments[k].currents_a - prediction.currents_a

    def _product(jacobian: Array, residual: Array, good: NDArray[np.bool_]) -> Array:
        """Whitened Gram matrix of all directions and, last, the residual: in slices where noise is white, never copied whole."""
        size = jacobian.shape[0] + 1
        total = np.zeros((size, size))
        length = SLICE if noise.is_white else max(residual.shape[1], 1)
        for start in range(0, residual.shape[1], length):
            part = slice(start, start + length)
            kept = good[part]
            both = [jacobian[..., part], residual[None, :, part]]
            if block > 1 and noise.is_white:
                both, kept = [_averaged(x, block) for x in both], _whole(kept, block)
            directions, left = (whiten(x, kept, noise, record.facts.sample_period_s) for x in both)
            total[:-1, :-1] += directions @ directions.T
            total[:-1, -1] += directions @ left[0]
            total[-1, -1] += left[0] @ left[0]
        return total

    def of_segment(k: int) -> tuple[Array, Array, float, int]:
        # a trial step may be far too long, and the setting of the caller's thread does not hold in another
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            return _of_segment(k)

    def _of_segment(k: int) -> tuple[Array, Array, float, int]:
        segment = record.segments[k]
        here = [c for c, term in enumerate(wanted) if term.segment in (-1, segment.uid)]
        rows = np.array([0, 1, 2, 3, *(4 + c for c in here)])
        product = _product(*_sensitivities(k, [wanted[c] for c in here]), segment.is_good)
        gram, slope = np.zeros((size, size)), np.zeros(size)
        gram[np.ix_(rows, rows)] = product[:-1, :-1]
        slope[rows] = product[:-1, -1]
        return gram, slope, float(product[-1, -1]), int(segment.is_good.sum()) * record.facts.phases

    grams, slopes, chi2, counts = (list(column) for column in zip(*each_segment(of_segment, record), strict=True))
    prior = layout.penalty(wanted)
    if prior.any():
        theta = np.zeros(size)
        known = {(t.effect, t.symbol): x for t, x in zip(model.terms, model.theta[4:], strict=True)}
        theta[4:] = [known.get((t.effect, t.symbol), 0.0) for t in wanted]
        grams.append(prior)
        slopes.append(-prior @ theta)
        chi2.append(float(theta @ prior @ theta))
        counts.append(0)
    return Normal(np.array(grams), np.array(slopes), np.array(chi2), np.array(counts))


def _averaged(signal: Array, block: int) -> Array:
    """Sums of `block` neighbours over sqrt(block): the noise variance stays one sample's."""
    n = signal.shape[-1] // block * block
    summed: Array = signal[..., :n].reshape(*signal.shape[:-1], -1, block).sum(axis=-1) / np.sqrt(block)
    return summed


def _whole(good: NDArray[np.bool_], block: int) -> NDArray[np.bool_]:
    """Blocks whose every sample is good."""
    whole: NDArray[np.bool_] = np.asarray(good[: good.size // block * block].reshape(-1, block).all(axis=1))
    return whole


def bounded_step(gram: Array, slope: Array, lower: Array, upper: Array, damping: float) -> Array:
    """Minimise |r - J d|^2 + damping |diag J'J d|^2 within bounds, from the normal equations.

    Numbers without bounds are eliminated first: an active set is sought among the few that have some.
    """
    scale = np.sqrt(np.diag(gram))
    scale = np.maximum(scale, 1e-6 * max(float(scale.max()), 1e-150))
    scaled = gram / np.outer(scale, scale) + damping * np.eye(scale.shape[0])
    target, low, high = slope / scale, lower * scale, upper * scale
    root, wanted = _square_root(scaled, target)
    step: Array = root.T @ (wanted / (root * root).sum(axis=1))
    if np.all(step >= low) and np.all(step <= high):
        return step / scale
    has_bounds = np.isfinite(low) | np.isfinite(high)
    held, loose = np.flatnonzero(has_bounds), np.flatnonzero(~has_bounds)
    onto = np.linalg.pinv(scaled[np.ix_(loose, loose)], rcond=LEAST_EIGENVALUE, hermitian=True)
    cross = scaled[np.ix_(loose, held)]
    root, wanted = _square_root(
        scaled[np.ix_(held, held)] - cross.T @ onto @ cross, target[held] - cross.T @ (onto @ target[loose])
    )
    low, high = np.minimum(low[held], 0.0), np.maximum(high[held], 0.0)
    high = np.where(high - low < 1e-12, low + 1e-9, high)
    step[held] = lsq_linear(root, wanted, (low, high), method="bvls", max_iter=200).x
    step[loose] = onto @ (target[loose] - cross @ step[held])
    return step / scale


def _square_root(gram: Array, slope: Array) -> tuple[Array, Array]:
    """Rows, orthogonal to one another, and what they should give: |rows d - wanted|^2 is d' gram d - 2 d' slope but for a constant.

    What the data do not tell is left out.
    """
    values, vectors = np.linalg.eigh(gram)
    keep = values > LEAST_EIGENVALUE * values[-1]
    root = np.sqrt(values[keep])
    return root[:, None] * vectors[:, keep].T, (vectors[:, keep].T @ slope) / root


def limits(model: Model, layout: Layout) -> tuple[Array, Array]:
    """Bounds of theta: the four within a factor 3 per step and within their box, the terms as physics says."""
    box = np.log(np.maximum(np.array(layout.nominal_box), 1e-12))
    four = np.log(np.array(model.nominal))
    low = np.array([*np.maximum(four - np.log(3.0), np.minimum(box[:, 0], four)), *(t.lower / t.step for t in model.terms)])
    high = np.array([*np.minimum(four + np.log(3.0), np.maximum(box[:, 1], four)), *(t.upper / t.step for t in model.terms)])
    return low, high


def fit(
    model: Model, record: Record, layout: Layout, noise: Noise, rounds: int = 12, tolerance: float = 0.3,
    report: Callable[[str], None] | None = None, wanted_chi2: float = np.inf,
) -> Fit:
    """Gauss-Newton with bounds; damping grows while a step does not lower chi2. Stops when a step gains < tolerance (or a

    share of what the numbers would take from noise alone), or less than a trifle of what the noise does not explain: a model
    that lacks a cause need not fit to the last digit. Gives up where `wanted_chi2` is out of reach. A start that runs away on
    this record comes back with an infinite chi2.
    """
    damping = 1e-9
    tolerance = max(tolerance, TOLERANCE_OF_A_NUMBER * (4 + len(model.terms)))
    normal = normal_equations(model, record, layout, model.terms, noise)
    if not np.isfinite(normal.total_gram).all():
        return Fit(model, replace(normal, chi2=np.full_like(normal.chi2, np.inf)), False, 0)
    dull = 0
    for done in range(rounds):
        unexplained = normal.unexplained
        enough = max(tolerance, TRIFLE * unexplained)
        low, high = limits(model, layout)
        theta = model.theta
        improved = was_shortened = False
        for _ in range(8):
            step = bounded_step(normal.total_gram, normal.total_slope, low - theta, high - theta, damping)
            promised = 2.0 * step @ normal.total_slope - step @ normal.total_gram @ step
            if promised < enough:
                return Fit(model, normal, True, done)
            if normal.total_chi2 - PATIENCE * promised > wanted_chi2:
                return Fit(model, normal, False, done)
            trial = model.moved(theta + step)
            # the tangent costs little beside the trajectory: not worth looking at chi2 first
            there = normal_equations(trial, record, layout, trial.terms, noise)
            if np.isfinite(there.total_gram).all() and there.total_chi2 < normal.total_chi2:
                improved = True
                break
            damping, was_shortened = max(10.0 * damping, 1e-4), True
        if not improved:
            return Fit(model, normal, False, done)
        gained = normal.total_chi2 - there.total_chi2
        model, normal = trial, there
        if gained <= 0.5 * promised:
            damping *= 3.0
        elif not was_shortened:
            # a step shortened just now would be too long again with less
            damping *= 0.1
        damping = max(damping, 1e-9)
        if report:
            report(f"round {done}: chi2 {normal.total_chi2:.1f}")
        dull = dull + 1 if gained < DULL * unexplained else 0
        if gained < enough or dull == DULL_ROUNDS:
            return Fit(model, normal, True, done)
    return Fit(model, normal, False, rounds)


def on_part(fitted: Fit, record: Record, layout: Layout, noise: Noise, samples: int) -> tuple[Fit, Record]:
    """The fit repeated on the first samples of every segment."""
    if record.samples <= 1.4 * record.share_of(samples) * len(record.segments):
        return fitted, record
    part = record.beginning(samples)
    return fit(fitted.model, part, layout, noise, rounds=5), part
