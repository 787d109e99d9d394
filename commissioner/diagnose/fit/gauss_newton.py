"""Output-error fits: Gauss-Newton with bounds and damping on the normal equations of a record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from commissioner.diagnose.fit.normal_equations import Normal, NormalEquations
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout, Model

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
    """Bounds of theta: the four within a factor 3 per step and within their box, the terms as physics says; numbers of several
    causes that say where one iron lies share what is left to either side.
    """
    box = np.log(np.maximum(np.array(layout.nominal_box), 1e-12))
    four = np.log(np.array(model.nominal))
    low = np.array(
        [*np.maximum(four - np.log(3.0), np.minimum(box[:, 0], four)), *(t.lower / t.step for t in model.terms)]
    )
    high = np.array(
        [*np.minimum(four + np.log(3.0), np.maximum(box[:, 1], four)), *(t.upper / t.step for t in model.terms)]
    )
    sides = [k for k, t in enumerate(model.terms) if t.kind == kinds.NU]
    for k in sides if len(sides) > 1 else ():
        term, here = model.terms[k], 4 + k
        low[here], high[here] = (
            model.theta[here] + (end - model.total(kinds.NU)) / len(sides) / term.step
            for end in (term.lower, term.upper)
        )
    return low, high


def fit(
    model: Model,
    record: Record,
    layout: Layout,
    noise: Noise,
    rounds: int = 12,
    tolerance: float = 0.3,
    report: Callable[[str], None] | None = None,
    wanted_chi2: float = np.inf,
) -> Fit:
    """Gauss-Newton with bounds; damping grows while a step does not lower chi2. Stops when a step gains < tolerance (or a
    share of what the numbers would take from noise alone), or less than a trifle of what the noise does not explain: a model
    that lacks a cause need not fit to the last digit. Gives up where `wanted_chi2` is out of reach. A start that runs away on
    this record comes back with an infinite chi2.
    """
    damping = 1e-9
    tolerance = max(tolerance, TOLERANCE_OF_A_NUMBER * (4 + len(model.terms)))
    normal = NormalEquations(model, record, layout, model.terms, noise).normal()
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
            moved = model.moved(theta + step)
            trial = NormalEquations(moved, record, layout, moved.terms, noise)
            if trial.chi2 < normal.total_chi2:
                there = trial.normal()
                improved = bool(np.isfinite(there.total_gram).all())
            if improved:
                break
            damping, was_shortened = max(10.0 * damping, 1e-4), True
        if not improved:
            return Fit(model, normal, False, done)
        gained = normal.total_chi2 - there.total_chi2
        model, normal = moved, there
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
