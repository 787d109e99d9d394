"""What a descent alone does not settle of an accepted cause: on which side of the leakage its path lies, and which loops are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.fit.gauss_newton import Fit, bounded_step, fit, limits, on_part
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.plant.sampling import SHAPE
from commissioner.diagnose.search.acceptance import loss_without, shows

Array = NDArray[np.float64]
SIDES = (0.0, 0.5, 1.0)
"""Places of the iron between the rotor's (0) and the stator's (1) side of the leakage from which a fit begins."""
NEAR = 0.1


REFINED_SAMPLES, LEAKAGE_SIDE_SAMPLES = 90_000, 45_000
"""On so many, loops are refined and sides of the leakage tried."""
CLOSER = (1.45, 1.2)
"""Ratios of neighbouring radii when loops are looked for between those that act."""
MOST_OF_THE_FLUX = 0.75
"""A stop whose radius is a larger share of the flux reached is a spring."""
REFINING = {kinds.CLOCK: (1, 2), kinds.DELAY: (1,), kinds.LAG: (SHAPE,), kinds.LEG_SHARE: (1, 2)}
"""Indices of the numbers that only refine a clock, a delay, a lag or the legs."""


def refined(
    current: Fit, record: Record, layout: Layout, noise: Noise, *, has_leakage_side: bool
) -> tuple[Fit, Layout]:
    """The last fit and its dictionaries: iron on its side (unless `has_leakage_side` beside the same causes already), loops of the radii
    they have, no idle numbers. All that is found on the first part of every segment, and fitted to the whole once.
    """
    started, part = on_part(current, record, layout, noise, REFINED_SAMPLES)
    if current.model.has_kind(kinds.NU) and not has_leakage_side:
        started = leakage_side(started, part, layout, noise)
    best, fine = without_idle_numbers(started, part, layout, noise), layout
    for ratio in CLOSER:
        if best.model.has_kind(kinds.STOP):
            model, closer = with_closer_loops(best.model, fine, ratio)
            trial = without_idle_numbers(fit(model, part, closer, noise), part, closer, noise)
            if _with_price(trial) < _with_price(best):
                best, fine = trial, closer
    if part is not record:
        best = fit(best.model, record, fine, noise)
    return (best, fine) if _with_price(best) < _with_price(current) else (current, layout)


def _with_price(one: Fit) -> float:
    """Chi2 and ln(samples) for every number: what Schwarz' criterion compares."""
    return one.chi2 + _price(one) * len(one.model.terms)


def _price(one: Fit) -> float:
    """What one number must gain: ln(samples)."""
    return float(np.log(one.normal.count.sum()))


def with_closer_loops(model: Model, layout: Layout, ratio: float) -> tuple[Model, Layout]:
    """The model with memory operators of `ratio` times smaller and larger radii beside each that acts, as far as the flux fills them."""
    loops = [(t, v) for t, v in zip(model.terms, model.values, strict=True) if t.kind == kinds.STOP]
    radii = [layout.stop_radius_wb[t.index] for t, _ in loops]
    for radius, rate in [layout.stop_radius_wb[t.index] for t, v in loops if v]:
        for wanted in (radius / ratio, radius * ratio):
            is_new = all(
                r != rate or wanted / x < 0.0 or abs(np.log(wanted / x)) > 0.5 * np.log(ratio) for x, r in radii
            )
            if is_new and abs(wanted) < widest_loop(layout.iron_top_wb):
                radii.append(np.array([wanted, rate]))
    values = [v for _, v in loops] + [0.0] * (len(radii) - len(loops))
    fresh = [replace(loops[0][0], symbol=f"loop_{k}", index=k) for k in range(len(radii))]
    others = [(t, v) for t, v in zip(model.terms, model.values, strict=True) if t.kind != kinds.STOP]
    terms, kept = zip(*others, *zip(fresh, values, strict=True), strict=True)
    return Model(model.nominal, terms, kept), replace(layout, stop_radius_wb=np.array(radii))


def without_springs(model: Model, layout: Layout, iron_flux_wb: float) -> tuple[Model, Layout]:
    """The model and its dictionary without memory operators that a flux of `iron_flux_wb` does not fill: they do not yield, and are part
    of 1 / L_M.
    """
    radii = layout.stop_radius_wb
    kept = np.flatnonzero(np.abs(radii[:, 0]) < widest_loop(iron_flux_wb))
    at = {int(old): new for new, old in enumerate(kept)}
    stiffness, terms, values = 1.0 / model.nominal[3], [], []
    for term, value in zip(model.terms, model.values, strict=True):
        if term.kind == kinds.STOP and term.index not in at:
            stiffness += value / abs(float(radii[term.index, 0]))
            continue
        terms.append(
            replace(term, symbol=f"loop_{at[term.index]}", index=at[term.index]) if term.kind == kinds.STOP else term
        )
        values.append(value)
    nominal = (*model.nominal[:3], 1.0 / stiffness)
    return Model(nominal, tuple(terms), tuple(values)), replace(layout, stop_radius_wb=radii[kept])


def widest_loop(iron_flux_wb: float) -> float:
    """Radius (Wb) beyond which a memory operator hardly yields within this flux."""
    return MOST_OF_THE_FLUX * iron_flux_wb


def leakage_side(current: Fit, record: Record, layout: Layout, noise: Noise) -> Fit:
    """The best fit of those that begin with the iron on the rotor's side of the leakage, between, and on the stator's.

    Small tones ride on the flux of one side and hardly on the other's: a descent that begins on the wrong one ends on a
    hill between them, or is long on its way. Curves begin from zero there. Tried on the first part of every segment where that
    shows the iron as well; a side must gain what one number costs.
    """
    started, part = on_part(current, record, layout, noise, LEAKAGE_SIDE_SAMPLES)
    share = part.samples / record.samples
    with_a_side = {t.effect for t in current.model.terms if t.kind == kinds.NU}
    if not all(shows(started, share, n, loss_without(current, n)) for n in with_a_side):
        started, part = current, record
    best = started if started.has_converged else fit(started.model, part, layout, noise)
    for side in SIDES:
        if abs(_side(best.model) - side) > NEAR:
            trial = fit(
                _on(without_curves(best.model), side), part, layout, noise, wanted_chi2=best.chi2 - _price(best)
            )
            if trial.chi2 < best.chi2:
                best = trial
    if part is record:
        return best
    if abs(_side(best.model) - _side(current.model)) <= NEAR:
        return current
    return min(current, fit(best.model, record, layout, noise, wanted_chi2=current.chi2), key=lambda f: f.chi2)


def without_curves(model: Model) -> Model:
    """Curves and loops set back to zero: spline coefficients beyond the flux reached so far mean nothing on other data."""
    curves = (kinds.IRON_CURVE, kinds.LEAKAGE_CURVE, kinds.STOP)
    values = tuple(0.0 if t.kind in curves else v for t, v in zip(model.terms, model.values, strict=True))
    return replace(model, values=values)


def _side(model: Model) -> float:
    return float(np.clip(0.5 + model.total(kinds.NU), 0.0, 1.0))


def _on(model: Model, side: float) -> Model:
    """The model with the iron there; the splits of several causes are added, so that all but one are zero."""
    splits = [k for k, t in enumerate(model.terms) if t.kind == kinds.NU]
    values = list(model.values)
    for k in splits:
        values[k] = side - 0.5 if k == splits[0] else 0.0
    return replace(model, values=tuple(values))


def without_idle_numbers(current: Fit, record: Record, layout: Layout, noise: Noise) -> Fit:
    """The fit with those spare numbers only that each gain ln(samples) (G. Schwarz, Ann. Statist. 6(2), 1978).

    Memory operators and second paths cannot be negative, so that noise in the idle ones would add up to a size that is not
    there; a wander that is none takes from the drift, an alternation from the delay.
    """
    spare = _spare(current.model, record)
    if not spare:
        return current
    low, high = limits(current.model, layout)
    gram, slope, theta = current.normal.total_gram, current.normal.total_slope, current.model.theta
    price = _price(current)

    def loss_without(idle: list[list[int]]) -> float:
        """Chi2 above the present one with the `idle` numbers at zero and everything else free, linear about the fit."""
        gone = {k for group in idle for k in group}
        kept = np.array([k not in gone for k in range(theta.size)])
        step = np.where(kept, 0.0, -theta)
        step[kept] = bounded_step(
            gram[np.ix_(kept, kept)], (slope - gram @ step)[kept], (low - theta)[kept], (high - theta)[kept], 0.0
        )
        return float(step @ gram @ step - 2.0 * step @ slope)

    idle = [group for group in spare if not theta[group].any()]
    loss = loss_without(idle)
    while len(idle) < len(spare):
        # of several that stand for one another the many go first
        _, least, weakest = min(
            (left - price * len(group), left, group)
            for group in spare
            if group not in idle
            for left in [loss_without([*idle, group])]
        )
        if least - loss > price * len(weakest):
            break
        idle, loss = [*idle, weakest], least
    if not idle:
        return current
    gone = {k for group in idle for k in group}
    pairs = zip(current.model.terms, current.model.values, strict=True)
    terms, values = zip(*(pair for k, pair in enumerate(pairs, 4) if k not in gone), strict=True)
    return fit(Model(current.model.nominal, terms, values), record, layout, noise)


def _spare(model: Model, record: Record) -> list[list[int]]:
    """Rows of theta that may as well be zero: each memory operator, second path and course of heat; what only refines a clock, a
    delay, a lag or the legs; and of what a segment may begin with, the flux that is left there anew, or what it inherits.
    """
    rows = list(enumerate(model.terms, 4))
    alone = [[k] for k, t in rows if t.effect and t.kind in CATALOGUE[t.effect].spare]
    groups = [[k for k, t in rows if t.kind == kind and t.index in refined] for kind, refined in REFINING.items()]
    inheriting = {s.uid for s in record.segments if np.any(s.flux_before_wb)}
    left_anew = [k for k, t in rows if t.effect and t.kind == kinds.INITIAL_FLUX and t.segment in inheriting]
    if left_anew:
        groups += [left_anew, [k for k, t in rows if t.kind == kinds.CARRY]]
    return alone + [group for group in groups if group]
