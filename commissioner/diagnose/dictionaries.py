"""Dictionaries that follow the fitted machine: ranges, knots and time constants where its fluxes and paths are."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose import kinds
from commissioner.diagnose.effects import CATALOGUE, Setting
from commissioner.diagnose.fit import Fit, fit
from commissioner.diagnose.model import Layout, Model, even_vectors, odd_vectors, with_halved_intervals
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.nominal import BRANCH_TIME_S, largest_fluxes, leak_ratio, with_ranges
from commissioner.diagnose.screen import required_chi2
from commissioner.diagnose.settle import closer_branches, without_curves

Array = NDArray[np.float64]
CURVES = {
    kinds.IRON_CURVE: ("iron_vectors", even_vectors), kinds.LEAKAGE_CURVE: ("leak_vectors", even_vectors),
    kinds.LEGS_LINK: ("legs_vectors", odd_vectors), kinds.LEGS: ("legs_vectors", odd_vectors),
}
MOST_KNOTS = 25
"""A curve of more knots than this is not refined again."""
FINER_SHARE = 2e-3
"""Of what is not explained, so much must go with finer knots: beside a cause that lacks, no curve need be right to the last digit."""
SAME_RATIO = 0.05
"""L_sigma over L_M is taken anew where it has moved by more than this part of itself."""


def following(current: Fit, setting: Setting, noise: Noise) -> tuple[Fit, Setting]:
    """New dictionary ranges where the improved model reaches other fluxes (curves start again from zero), closer time

    constants where a second path acts, and the ratio of the inductances as it is now.
    """
    layout, record, model = setting.layout, setting.record, current.model
    flux, _ = largest_fluxes(record, model, layout)
    fresh = with_ranges(layout, flux, setting.facts.current_peak_a * model.nominal[2])
    iron, leak = fresh.iron_top_wb / layout.iron_top_wb, fresh.leak_top_wb / layout.leak_top_wb
    if 0.85 < iron < 1.06 and 0.8 < leak < 1.15:
        fresh, flux = layout, setting.iron_flux_wb
    else:
        model = without_curves(model)
    ratio = leak_ratio(model)
    if abs(ratio - layout.leak_ratio) > SAME_RATIO * ratio:
        fresh = replace(fresh, leak_ratio=ratio)
    if layout.branch_time_s is BRANCH_TIME_S and model.has_kind(kinds.BRANCH):
        fresh = replace(fresh, branch_time_s=closer_branches(model, layout.branch_time_s))
    if fresh is layout:
        return current, setting
    there = replace(setting, layout=fresh, iron_flux_wb=flux)
    for name in sorted({t.effect for t in model.terms if t.kind == kinds.BRANCH}):
        terms = CATALOGUE[name].terms(there)
        model = model.with_terms([t for t in terms if t.symbol not in model.of(name)])
    again = fit(model, record, fresh, noise)
    return (again, there) if np.isfinite(again.chi2) else (current, setting)


def with_finer_curves(
    current: Fit, setting: Setting, noise: Noise, report: Callable[[str], None], of: Collection[int] = tuple(CURVES)
) -> tuple[Fit, Setting]:
    """Curves of the kinds `of` with a knot between every two, as long as that gains what its numbers cost: iron with a sharp

    knee leaves 1e-3 of its gain on ten intervals.
    """
    for kind, (name, make) in CURVES.items():
        while kind in of and current.model.has_kind(kind) and len(getattr(setting.layout, name)) <= MOST_KNOTS:
            finer = make(2 * (getattr(setting.layout, name).shape[1] - 3))
            layout: Layout = replace(setting.layout, **{name: finer})  # type: ignore[arg-type]
            there = replace(setting, layout=layout)
            model = _on_finer(current.model, kind, getattr(setting.layout, name), finer, there)
            unexplained = current.chi2 - float(current.normal.count.sum())
            least = max(required_chi2(len(model.terms) - len(current.model.terms)), FINER_SHARE * unexplained)
            wanted = current.chi2 - least
            trial = fit(model, setting.record, layout, noise, wanted_chi2=wanted)
            report(f"  {name} on twice the knots: gained {current.chi2 - trial.chi2:.4g}")
            if trial.chi2 > wanted:
                break
            current, setting = trial, there
    return current, setting


def _on_finer(model: Model, kind: int, vectors: Array, finer: Array, setting: Setting) -> Model:
    """The same curves of one kind, with the numbers that they have in the finer dictionary, which is `setting`'s."""
    for effect in sorted({t.effect for t in model.terms if t.kind == kind}):
        known = model.of(effect)
        pairs = zip(model.terms, model.values, strict=True)
        halved = with_halved_intervals(vectors, np.array([v for t, v in pairs if (t.effect, t.kind) == (effect, kind)]), finer)
        fresh = [
            replace(t, start=float(np.clip(halved[t.index], t.lower, t.upper)) if t.kind == kind else known[t.symbol])
            for t in CATALOGUE[effect].terms(setting)
        ]
        model = model.without(effect).with_terms(fresh)
    return model
