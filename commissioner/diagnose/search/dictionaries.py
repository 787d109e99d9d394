"""Dictionaries that follow the fitted machine: ranges, knots and time constants where its fluxes and paths are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import lsq_linear

from commissioner.diagnose.causes import CATALOGUE, Setting
from commissioner.diagnose.causes.regressors import with_fine_speed_splines
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.fit.normal_equations import NormalEquations, whiten
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import TO_PHASES, Record, each_segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout, Model, even_vectors, odd_vectors, with_halved_intervals
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.journal import Refined
from commissioner.diagnose.search.nominal import largest_fluxes, leak_ratio, legs_slack_v, with_ranges
from commissioner.diagnose.search.refinement import CLOSER, with_closer_loops, without_curves, without_springs

Array = NDArray[np.float64]
CURVES = {
    kinds.IRON_CURVE: ("iron_vectors", even_vectors),
    kinds.LEAKAGE_CURVE: ("leak_vectors", even_vectors),
    kinds.LEGS_LINK: ("legs_vectors", odd_vectors),
    kinds.LEGS: ("legs_vectors", odd_vectors),
}
RANGES = {kinds.IRON_CURVE: ("iron_vectors", "iron_top_wb"), kinds.LEAKAGE_CURVE: ("leak_vectors", "leak_top_wb")}
ACTING_SHARE = 1e-3
"""Of the strongest second path: a weaker one is idle."""
SHORTEST_BRANCH_S, LONGEST_BRANCH_S = 5e-5, 0.03
"""Second paths beyond 3 kHz and below 5 Hz are none."""
GRID = 200
"""Points at which a curve is read to be written in another dictionary."""
MOST_KNOTS = 25
"""A curve of more knots than this is not refined again."""
SAME_SLACK = 0.2
"""The slack of a leg's tail is taken anew where it has moved by more than this part of itself."""
SAME_RATIO = 0.05
"""L_sigma over L_M is taken anew where it has moved by more than this part of itself."""


def following(current: Fit, setting: Setting, noise: Noise) -> tuple[Fit, Setting]:
    """The fit in dictionaries that follow it."""
    model, there = respread(current.model, setting)
    if there is setting:
        return current, setting
    again = begun_with(model, there, noise)
    return (again, there) if np.isfinite(again.chi2) else (current, setting)


def respread(model: Model, setting: Setting) -> tuple[Model, Setting]:
    """The model in new dictionary ranges where it reaches other fluxes (closer radii that were found stay where the flux fills them), with closer time
    constants where a second path acts, and the ratio of the inductances and the slack of the legs as they are now; the same setting

    where nothing is new.
    """
    layout = setting.layout
    reached = largest_fluxes(setting.record, model, layout)
    fresh, flux = with_ranges(layout, reached[0], setting.facts.current_peak_a * model.nominal[2]), reached[0]
    iron, leak = fresh.iron_top_wb / layout.iron_top_wb, fresh.leak_top_wb / layout.leak_top_wb
    has_closer_loops = layout.stop_radius_wb.shape != fresh.stop_radius_wb.shape
    if 0.85 < iron < 1.06 and 0.8 < leak < 1.15:
        fresh, flux = layout, setting.iron_flux_wb
    else:
        model = carried_over(model, layout, reached, fresh)
        if has_closer_loops:
            model, filled = without_springs(model, layout, flux)
            fresh = replace(fresh, stop_radius_wb=filled.stop_radius_wb)
    ratio = leak_ratio(model)
    if abs(ratio - layout.leak_ratio) > SAME_RATIO * ratio:
        fresh = replace(fresh, leak_ratio=ratio)
    slack = legs_slack_v(model, fresh, setting.facts.current_peak_a)
    if abs(slack - layout.legs_slack_v) > SAME_SLACK * slack:
        fresh = replace(fresh, legs_slack_v=slack)
    there = setting if fresh is layout else replace(setting, layout=fresh, iron_flux_wb=flux)
    return with_closer_branches(model, there)


def with_closer_branches(model: Model, setting: Setting) -> tuple[Model, Setting]:
    """The model with more second paths, a third of an octave from each that acts, where none is yet."""
    times = setting.layout.branch_time_s
    weights = model.sum_kind(kinds.BRANCH, times.size)
    closer = list(times)
    for time in np.outer(
        times[weights > ACTING_SHARE * weights.max(initial=0.0)], 2.0 ** (np.array([-1.0, 1.0]) / 3.0)
    ).ravel():
        is_near = any(x / time > 0.0 and abs(np.log2(x / time)) <= 1.0 / 6.0 for x in closer)
        if not is_near and SHORTEST_BRANCH_S < abs(time) < LONGEST_BRANCH_S:
            closer.append(float(time))
    if len(closer) == times.size:
        return model, setting
    there = replace(setting, layout=replace(setting.layout, branch_time_s=np.array(closer)))
    for name in sorted({t.effect for t in model.terms if t.kind == kinds.BRANCH}):
        terms = CATALOGUE[name].terms(there)
        model = model.with_terms([t for t in terms if t.symbol not in model.of(name)])
    return model, there


def begun_with(model: Model, setting: Setting, noise: Noise) -> Fit:
    """The fit that begins with the model's curves and loops as they are or at zero, whichever is nearer."""
    starts = [model] if (flat := without_curves(model)).values == model.values else [model, flat]
    if len(starts) > 1:
        chi2 = [NormalEquations(m, setting.record, setting.layout, (), noise).chi2 for m in starts]
        if not chi2[0] <= chi2[1]:
            starts.reverse()
    return fit(starts[0], setting.record, setting.layout, noise)


def carried_over(model: Model, layout: Layout, reached: tuple[float, float], fresh: Layout) -> Model:
    """The model with its curves in the dictionaries of `fresh`: as they are up to the iron's and the leakage's fluxes `reached`

    (Wb) and straight on beyond, where no data said what a coefficient says.
    """
    values = np.array(model.values)
    for (kind, names), flux in zip(RANGES.items(), reached, strict=True):
        rows = [k for k, t in enumerate(model.terms) if t.kind == kind]
        if values[rows].any():
            (old, top), (new, fresh_top) = (
                _splines(*(getattr(one, name) for name in names)) for one in (layout, fresh)
            )
            end, grid = min(flux, top), np.linspace(0.0, fresh_top, GRID)
            curve = (old(np.minimum(grid, end)) + np.maximum(grid - end, 0.0)[:, None] * old(end, 1)) @ values[rows]
            bounds = np.array([(model.terms[k].lower, model.terms[k].upper) for k in rows]).T
            values[rows] = lsq_linear(new(grid), curve, bounds).x
    return replace(model, values=tuple(values.tolist()))


def _splines(vectors: Array, top: float) -> tuple[BSpline, float]:
    """The curves of a dictionary, one for each vector, of a flux from 0 to `top`."""
    intervals = vectors.shape[1] - 3
    return BSpline(top / intervals * np.arange(-3, intervals + 4), vectors.T, 3), top


def with_faster_speed(
    current: Fit, full: Record, setting: Setting, noise: Noise
) -> tuple[Fit, Record, Setting, Refined] | None:
    """A shaft's speed on closer knots, where that gains what its numbers cost: a load that swings at 2 Hz. Not tried where less than that
    is left across the axes, along which no speed moves anything to first order.
    """
    record = with_fine_speed_splines(full, setting.lines_hz)
    there = replace(setting, record=record.first(setting.record.commanded))
    turning = dict.fromkeys(t.effect for t in current.model.terms if t.kind == kinds.OMEGA)
    speed = [t for name in turning for t in CATALOGUE[name].terms(there) if t.kind == kinds.OMEGA]
    model = current.model.without_kind(kinds.OMEGA).on_channels(record.channel_names).with_terms(speed)
    least = max(
        RULES.required_chi2(len(model.terms) - len(current.model.terms)),
        RULES.faster_speed_share * current.normal.unexplained,
    )
    if left_across(current.model, setting, noise) < least:
        return None
    faster = fit(model, there.record, there.layout, noise, wanted_chi2=current.chi2 - least)
    gained = current.chi2 - faster.chi2
    return faster, record, there, Refined("a speed on closer knots", gained, least, is_taken=gained > least)


def left_across(model: Model, setting: Setting, noise: Noise) -> float:
    """Chi2, above the noise's, of what the model leaves across the axis of each segment."""
    record = setting.record

    def of_segment(k: int) -> float:
        segment = record.segments[k]
        angle = np.deg2rad(segment.axis_deg)
        along = TO_PHASES[: record.facts.phases] @ np.array([np.cos(angle), np.sin(angle)])
        left = segment.currents_a - predict(model, record, k, setting.layout).currents_a
        across = left - np.outer(along, along @ left) / float(along @ along)
        white = whiten(across, segment.is_good, noise, record.facts.sample_period_s)
        return float(white @ white) - segment.good_count * (record.facts.phases - 1)

    return sum(each_segment(of_segment, record))


def finer_curve(current: Fit, setting: Setting, noise: Noise, kind: int) -> tuple[Fit, Setting, Refined] | None:
    """Curves of a kind with a knot between every two, if that gains what its numbers cost: iron with a sharp knee leaves 1e-3 of its gain
    on ten intervals. None: there is no such curve, or it is fine already.
    """
    name, make = CURVES[kind]
    vectors = getattr(setting.layout, name)
    if not current.model.has_kind(kind) or len(vectors) > MOST_KNOTS:
        return None
    finer = make(2 * (vectors.shape[1] - 3))
    layout: Layout = replace(setting.layout, **{name: finer})  # type: ignore[arg-type]
    there = replace(setting, layout=layout)
    model = _on_finer(current.model, kind, vectors, finer, there)
    least = _least_gain(current, len(model.terms))
    trial = fit(model, setting.record, layout, noise, wanted_chi2=current.chi2 - least)
    gained = current.chi2 - trial.chi2
    return trial, there, Refined(f"{name} on twice the knots", gained, least, is_taken=gained > least)


def with_closer_radii(current: Fit, setting: Setting, noise: Noise) -> tuple[Fit, Setting, Refined]:
    """Loops of radii beside those that act, if they make most of what is left: iron of one radius between two of the
    dictionary's leaves a tenth of its gain. Loops that gain less only share the size among more of them.
    """
    model, layout = with_closer_loops(current.model, setting.layout, CLOSER[0])
    least = max(_least_gain(current, len(model.terms)), RULES.closer_loops_share * current.normal.unexplained)
    trial = fit(model, setting.record, layout, noise, wanted_chi2=current.chi2 - least)
    gained = current.chi2 - trial.chi2
    refined = Refined("loops of closer radii", gained, least, is_taken=gained > least)
    return (trial, replace(setting, layout=layout), refined) if refined.is_taken else (current, setting, refined)


def _least_gain(current: Fit, numbers: int) -> float:
    """What a model of so many numbers must gain over the present one."""
    return max(
        RULES.required_chi2(max(numbers - len(current.model.terms), 1)),
        RULES.finer_curve_share * current.normal.unexplained,
    )


def _on_finer(model: Model, kind: int, vectors: Array, finer: Array, setting: Setting) -> Model:
    """The same curves of one kind, with the numbers that they have in the finer dictionary, which is `setting`'s."""
    for effect in sorted({t.effect for t in model.terms if t.kind == kind}):
        known = model.of(effect)
        pairs = zip(model.terms, model.values, strict=True)
        halved = with_halved_intervals(
            vectors, np.array([v for t, v in pairs if (t.effect, t.kind) == (effect, kind)]), finer
        )
        fresh = [
            replace(t, start=float(np.clip(halved[t.index], t.lower, t.upper)) if t.kind == kind else known[t.symbol])
            for t in CATALOGUE[effect].terms(setting)
            if t.kind == kind or t.symbol in known
        ]
        model = model.without(effect).with_terms(fresh)
    return model
