"""What a descent alone does not settle of an accepted cause: on which side of the leakage its path lies, and which loops are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.diagnose import kinds
from commissioner.diagnose.fit import Fit, bounded_step, fit, limits
from commissioner.diagnose.model import Layout, Model
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.record import Record

SIDES = (0.0, 0.5, 1.0)
"""Places of the iron between the rotor's (0) and the stator's (1) side of the leakage from which a fit begins."""
FAR = 0.25


def placed(current: Fit, record: Record, layout: Layout, noise: Noise) -> Fit:
    """The best fit of those that begin with the iron on the rotor's side of the leakage, between, and on the stator's.

    Small tones ride on the flux of one side and hardly on the other's, so that memory loops lie behind a hill.
    """
    best = current
    for side in SIDES:
        if abs(_side(best.model) - side) > FAR:
            trial = fit(_on(best.model, side), record, layout, noise, wanted_chi2=best.chi2)
            if trial.chi2 < best.chi2:
                best = trial
    return best


def _side(model: Model) -> float:
    return float(np.clip(0.5 + model.total(kinds.NU), 0.0, 1.0))


def _on(model: Model, side: float) -> Model:
    """The model with the iron there; the splits of several causes are added, so that all but one are zero."""
    splits = [k for k, t in enumerate(model.terms) if t.kind == kinds.NU]
    values = list(model.values)
    for k in splits:
        values[k] = side - 0.5 if k == splits[0] else 0.0
    return replace(model, values=tuple(values))


def without_idle_loops(current: Fit, record: Record, layout: Layout, noise: Noise) -> Fit:
    """The fit with those memory operators only that each gain ln(samples) (G. Schwarz, Ann. Statist. 6(2), 1978).

    They cannot be negative, so that noise in the idle ones would add up to a coercive current that is not there.
    """
    low, high = limits(current.model, layout)
    gram, slope, theta = current.normal.total_gram, current.normal.total_slope, current.model.theta
    loops = [4 + k for k, t in enumerate(current.model.terms) if t.kind == kinds.STOP]
    price = float(np.log(current.normal.count.sum()))

    def loss_without(idle: list[int]) -> float:
        """Chi2 above the present one with the loops `idle` at zero and everything else free, linear about the fit."""
        kept = np.array([k not in idle for k in range(theta.size)])
        step = np.where(kept, 0.0, -theta)
        step[kept] = bounded_step(
            gram[np.ix_(kept, kept)], (slope - gram @ step)[kept], (low - theta)[kept], (high - theta)[kept], 0.0
        )
        return float(step @ gram @ step - 2.0 * step @ slope)

    idle = [k for k in loops if theta[k] <= 0.0]
    loss = loss_without(idle)
    while len(idle) < len(loops) - 1:
        least, weakest = min((loss_without([*idle, k]), k) for k in loops if k not in idle)
        if least - loss > price:
            break
        idle, loss = [*idle, weakest], least
    if not idle:
        return current
    kept = [k for k in range(len(current.model.terms)) if 4 + k not in idle]
    model = current.model
    sparse = Model(model.nominal, tuple(model.terms[k] for k in kept), tuple(model.values[k] for k in kept))
    return fit(sparse, record, layout, noise)
