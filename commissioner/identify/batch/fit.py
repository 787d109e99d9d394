"""Batch nonlinear least squares over segments: shared machine, inverter and iron, each segment's own initial flux.

Levenberg-Marquardt on the output error. Covariance: inverse information times the residual variance, widened where
scores of stretches of the record scatter more than a white residual would make them (block sandwich; P. J. Huber 1967,
H. White, Econometrica 48, 1980).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from commissioner.errors import DataRefused
from commissioner.identify.batch.model import (
    CIRCUIT,
    DELAY,
    OWN,
    SPLIT,
    Matrix,
    ModelChoice,
    start_theta,
    stator_flux_of_current,
)
from commissioner.identify.batch.problem import Evaluation, Problem
from commissioner.identify.batch.segments import BatchFit, Segment
from commissioner.motor.circuit import InverseGamma

WIDEST = 50.0
"""A circuit value may move by this factor from its start: data that want more do not determine it."""
FIRST_DAMPING = 1e-8
"""Of the normal equations' diagonal. With 1e-4 the first three steps of a fit that begins next to its minimum crept along what is hard
to tell apart, a leg's tail and a resistance: five to seven evaluations, two or three now."""
SLIGHT_DAMPING = 1e-4
"""Up to here steps shrink by what the model bends, and what is left can be told from the last two."""
NEAR, SLOW = 0.03, 0.3
"""A step of no more than this share of the values keeps the sensitivities of where it began; they are computed anew where steps with
them shrink by less than the second."""
SAME = 1e-3
"""Of the values: from no farther away sensitivities are as good as new, and so are standard errors."""
ROUNDING, NEAR_RISE = 1e-13, 1e-6
"""By what share the sum of squares may rise in a step; the second while steps with kept sensitivities shrink, for these are not
quite downhill."""


def fit_segments(
    segments: Sequence[Segment],
    sample_period_s: float,
    start: InverseGamma,
    model: ModelChoice | None = None,
    theta_start: Matrix | None = None,
    max_iterations: int = 40,
    tolerance: float = 1e-4,
    own_start: Matrix | None = None,
    *,
    is_coarse: bool = False,
    known: float | None = None,
) -> BatchFit:
    """Fit all segments jointly. `theta_start` (in the model's layout) overrides `start`; `own_start` (segments, 3) is what
    each segment begins with where an earlier fit knows it, else zero. `is_coarse` as in `Problem`; `known` is the sum of
    squares of a minimum found before: the fit ends where it comes as low.

    Stops when what steps shrinking as the last two did would still add is below `tolerance` standard errors of every
    shared parameter (or the step below 1e-10 of its value); `has_converged` says whether that was reached.
    """
    choice = model or ModelChoice()
    problem = Problem(segments, sample_period_s, choice, is_coarse=is_coarse)
    low_enough = -math.inf if known is None else known * (1.0 + 1.0 / max(problem.samples, 1))
    theta = start_theta(start, choice) if theta_start is None else theta_start.copy()
    problem.bounds = (theta[:CIRCUIT] / WIDEST, theta[:CIRCUIT] * WIDEST)
    problem.expect_leg(theta)
    own = np.zeros((len(segments), OWN)) if own_start is None else own_start.copy()
    present = problem.evaluate(theta, own)
    if not present.is_finite:
        raise DataRefused(
            "the model cannot be simulated from this start", step="identify", value=start, limit="finite currents",
            remedy="check that the nameplate belongs to the motor",
        )  # fmt: skip
    damping, converged, last_size, moved = FIRST_DAMPING, False, 0.0, 0.0
    spare: Evaluation | None = None
    for _ in range(max_iterations):
        step = _step(problem, present, theta, damping)
        new_theta, new_own = _apply(problem, theta, own, step)
        share = _largest_share(problem, step, theta)
        near = present if share < NEAR else None
        trial = problem.evaluate(new_theta, new_own, over=spare, near=near)
        size = _size_in_std(problem, step, present, theta)
        may_rise = NEAR_RISE if trial.is_near and size < last_size else ROUNDING
        if trial.is_finite and trial.squares <= present.squares * (1.0 + may_rise):
            shrinks = min(size / last_size, 1.0) if last_size > 0.0 and damping <= SLIGHT_DAMPING else 1.0
            small = size * (shrinks if shrinks < 0.1 else 1.0) < tolerance
            is_slow = last_size > 0.0 and shrinks > SLOW
            last_size = size
            flat = abs(present.squares - trial.squares) <= 1e-12 * present.squares
            theta, own, present, spare = new_theta, new_own, trial, present
            moved = moved + share if trial.is_near else 0.0
            damping = max(damping * 0.1, 1e-12)
            if small or (flat and damping <= 1e-8) or trial.squares <= low_enough:
                converged = True
                break
            if present.is_near and is_slow:
                present, spare, moved = problem.evaluate(theta, own, over=spare), present, 0.0
        elif present.is_near:
            present, spare, moved = problem.evaluate(theta, own, over=trial), present, 0.0
        else:
            spare = trial
            if damping > 1e8:
                break
            damping = max(damping, 1e-8) * 20.0
            if size < tolerance:
                converged = True
                break
    if present.is_near and moved > SAME and not is_coarse:
        present = problem.evaluate(theta, own, over=spare)
    return _result(problem, theta, own, present, converged)


def _step(problem: Problem, at: Evaluation, theta: Matrix, damping: float) -> Matrix:
    """Levenberg-Marquardt step of all that is free and not held by its bound: a step cut off there would be the wrong one for
    the others, and the fit creep along the bound for hundreds of steps."""
    low, high = _bounds(problem)
    score = at.score[: theta.size]
    is_held = ((theta <= low) & (score < 0.0)) | ((theta >= high) & (score > 0.0))
    free = np.flatnonzero(problem.free & ~np.append(is_held, np.zeros(problem.total - theta.size, dtype=bool)))
    information = at.information[np.ix_(free, free)]
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    normal = information / np.outer(scale, scale)
    normal[np.diag_indices_from(normal)] += damping + 1e-12
    step = np.zeros(problem.total)
    step[free] = np.linalg.solve(normal, at.score[free] / scale) / scale
    return np.asarray(step * min(1.0, 0.5 / max(_largest_share(problem, step, theta), 1e-300)))


def _largest_share(problem: Problem, step: Matrix, theta: Matrix) -> float:
    """What the step is of the circuit's values and of the leg's loss, the largest."""
    relative = float(np.max(np.abs(step[:CIRCUIT]) / theta[:CIRCUIT]))
    if not problem.model.leg_size:
        return relative
    leg = problem.model.leg_slice
    return max(relative, float(np.max(np.abs(step[leg]))) / max(float(np.max(np.abs(theta[leg]))), 1e-2))


def _bounds(problem: Problem) -> tuple[Matrix, Matrix]:
    """Between which the shared parameters lie."""
    low, high = np.full(problem.model.size, -np.inf), np.full(problem.model.size, np.inf)
    low[:CIRCUIT], high[:CIRCUIT] = problem.bounds
    low[DELAY], high[DELAY] = -problem.period_s, 2.0 * problem.period_s
    low[SPLIT], high[SPLIT] = -1.0, 1.0
    return low, high


def _apply(problem: Problem, theta: Matrix, own: Matrix, step: Matrix) -> tuple[Matrix, Matrix]:
    new_theta = np.clip(theta + step[: problem.model.size], *_bounds(problem))
    if problem.model.leg is not None:
        part = problem.model.leg_slice
        new_theta[part] = problem.model.leg.admissible(new_theta[part])
    new_own = own + step[problem.model.size :].reshape(own.shape)
    if not problem.model.with_drift:
        new_own[:, 0] = new_own[0, 0]
    return new_theta, new_own


def _size_in_std(problem: Problem, step: Matrix, at: Evaluation, theta: Matrix) -> float:
    """The largest step of a shared parameter in its standard errors; steps below rounding count as none."""
    sigma2 = at.squares / max(problem.samples, 1)
    shared = np.flatnonzero(problem.model.free_shared)
    steps = np.abs(step[shared])
    in_std = steps * np.sqrt(np.diag(at.information)[shared] / max(sigma2, 1e-300))
    return float(np.max(in_std[steps >= 1e-10 * np.abs(theta[shared])], initial=0.0))


def _result(problem: Problem, theta: Matrix, own: Matrix, at: Evaluation, converged: bool) -> BatchFit:
    free = np.flatnonzero(problem.free)
    information = at.information[np.ix_(free, free)]
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    normal = information / np.outer(scale, scale)
    inverse = np.linalg.pinv(normal, rcond=1e-14) / np.outer(scale, scale)
    sigma2 = at.squares / max(problem.samples - free.size, 1)
    white = sigma2 * inverse
    scores = np.vstack(at.block_scores)[:, free]
    sandwich = inverse @ (scores.T @ scores) @ inverse
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        ratio = np.sqrt(np.maximum(np.nan_to_num(np.diag(sandwich) / np.diag(white), nan=1.0), 1.0))
    # With few blocks the sandwich itself scatters: only what a white residual would not show counts.
    blocks = max(int(np.sum(np.any(scores != 0.0, axis=1))), 1)
    doubt = 1.0 + 2.0 / math.sqrt(2.0 * blocks)
    widen = np.where(ratio > doubt, ratio, 1.0)
    covariance = np.zeros((problem.total, problem.total))
    with np.errstate(over="ignore", invalid="ignore"):
        covariance[np.ix_(free, free)] = white * np.outer(widen, widen)
    shared = problem.model.size
    fit = BatchFit(
        model=problem.model,
        theta=theta,
        covariance=covariance[:shared, :shared],
        sum_of_squares=at.squares,
        samples=problem.samples,
        free_parameters=int(free.size),
        residuals=tuple(s.measured(r) for s, r in zip(problem.segments, at.residuals, strict=True)),
        iron_flux_wb=tuple(at.flux),
        stator_flux_wb=tuple(
            stator_flux_of_current(theta, problem.model, flux, s.current_a - r - offset)
            for s, flux, r, offset in zip(problem.segments, at.flux, at.residuals, own[:, 0], strict=True)
        ),
        own=own,
        has_converged=converged,
        sample_period_s=problem.period_s,
    )
    fit.covariance[0, 0] += fit.leg_doubt_ohm**2
    return fit
