"""How far the accepted causes can be trusted: what is left, the hold-out, the alternatives, the confidence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.causes import CATALOGUE, Setting
from commissioner.diagnose.causes.setting import Sizes
from commissioner.diagnose.fit.gauss_newton import Fit, bounded_step, fit, limits
from commissioner.diagnose.fit.spread import covariance_of
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record, each_segment
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.acceptance import is_plausible, loss_without
from commissioner.diagnose.search.exchanges import with_closer_paths
from commissioner.diagnose.search.screening import screen
from commissioner.diagnose.verdict.lack_of_fit import LackOfFit

Array = NDArray[np.float64]
UNKNOWN, INSTANTS_PER_NUMBER = 1e-9, 4
"""Information, of the best known number of a course, that any has; and instants at which a course is read, per number."""
MEASURED_MARGIN = 2.0
"""Power of a measured noise over what is left, beyond which it is none: its slowest part is extrapolated with a margin of 1.6."""
ROUGHLY, NEARLY_A_TIE = 0.01, 0.03
"""Of a cause's gain: so well is a model without it fitted, and a rival that cannot lose less is not fitted to the last digit."""


SHORTER_STEPS = 12
"""Halvings after which a border between two ways to say a size counts as reached."""


@dataclass(frozen=True)
class HeldOut:
    """Error on segments the fit did not see, and noise, rms over phases and samples, A; `share` of the structured error power
    removed there. `is_measured` False with a single segment: then these are in-sample figures. `noise_a` None: it would be more than
    all that is left, as where slow parts of the test itself count as noise at quiet frequencies.
    """

    rmse_before_a: float
    rmse_after_a: float
    noise_a: float | None
    share: float
    is_measured: bool


def hold_out(before: Fit, after: Fit, record: Record, layout: Layout, noise: Noise) -> HeldOut:
    """Every segment predicted by the model fitted to all others (numbers bound to one segment keep their value)."""
    many = len(record.segments) > 1

    def of_segment(k: int) -> tuple[float, float, int]:
        segment, left = record.segments[k], []
        for one in (before, after):
            model = _without_segment(one, k, layout) if many else one.model
            residual = segment.currents_a - predict(model, record, k, layout).currents_a
            left.append(float((residual[:, segment.is_good] ** 2).sum()))
        return left[0], left[1], segment.good_count * record.facts.phases

    table = np.array(each_segment(of_segment, record))
    period = record.facts.sample_period_s
    floor = np.array([noise.rms_a(s.count, period) ** 2 for s in record.segments]) * table[:, 2]
    is_contradicted = floor.sum() > (MEASURED_MARGIN if noise.is_known else 1.0) * table[:, 1].sum()
    floor = np.minimum(floor, table[:, 1]) if is_contradicted else floor
    removed = table[:, 0] - table[:, 1]
    mean = table.sum(axis=0)
    return HeldOut(
        float(np.sqrt(mean[0] / mean[2])),
        float(np.sqrt(mean[1] / mean[2])),
        None if is_contradicted else float(np.sqrt(floor.sum() / mean[2])),
        float(np.clip(removed.sum() / max(float((table[:, 0] - floor).sum()), 1e-3 * float(floor.sum())), -1.0, 1.0)),
        many,
    )


def _without_segment(one: Fit, k: int, layout: Layout) -> Model:
    """The estimate without segment k, from the normal equations (one Gauss-Newton step at the optimum)."""
    gram = one.normal.total_gram - one.normal.gram[k]
    slope = one.normal.total_slope - one.normal.slope[k]
    free = np.array([t.segment < 0 for t in one.model.terms], dtype=bool)
    keep = np.r_[np.ones(4, dtype=bool), free]
    theta = one.model.theta
    low, high = limits(one.model, layout)
    step = np.zeros(theta.shape[0])
    inside = np.ix_(keep, keep)
    step[keep] = bounded_step(gram[inside], slope[keep], (low - theta)[keep], (high - theta)[keep], 1e-9)
    return one.model.moved(theta + step)


@dataclass(frozen=True)
class Rival:
    """What takes a cause's place: the loss in chi2, scaled to the whole recording, and by how much it moves the others' sizes."""

    loss: float
    moved: Mapping[str, Mapping[str, float]]


@dataclass(frozen=True)
class Dropped:
    """A fit without one cause: the loss in chi2, scaled to the whole recording, and what of the rest takes its place; `forms`: the
    cause's own other ones that do.
    """

    loss: float
    rivals: Mapping[str, Rival]
    forms: tuple[Rival, ...] = ()


def alternatives(
    found: Fit,
    accepted: Sequence[str],
    record: Record,
    layout: Layout,
    setting: Setting,
    noise: Noise,
    whole: int,
    excluded: Sequence[str],
    asked: Sequence[str],
) -> dict[str, Dropped]:
    """For every accepted cause that is `asked` about: the fit without it, and with one of the rest (but for `excluded`) in its place."""
    scale = whole / record.samples
    out: dict[str, Dropped] = {}
    for name in asked:
        enough = max(ROUGHLY * loss_without(found, name), 1.0)
        without = fit(found.model.without(name), record, layout, noise, rounds=6, tolerance=enough)
        gain = without.chi2 - found.chi2
        wanted = found.chi2 + max(NEARLY_A_TIE * gain, RULES.tie_chi2)
        absent = [n for n in CATALOGUE if n not in accepted and n not in excluded]
        screening = screen(without.model, record, layout, noise, setting, [*absent, name])
        # where the way to a cause bends, its own promise falls short as its rivals' do
        own = screening.scores[name].delta_chi2 if name in screening.scores else gain
        rivals: dict[str, Rival] = {}
        for score in [s for s in screening.ranked() if s.name != name][:3]:
            if score.delta_chi2 < RULES.alternative_share * min(gain, own):
                continue
            model = without.model.with_terms(score.form)
            trial, there = fit(model, record, layout, noise, wanted_chi2=wanted), replace(setting, layout=layout)
            if trial.chi2 - found.chi2 > RULES.tie_chi2:
                trial, there = with_closer_paths(trial, there, noise, wanted)
            if is_plausible(trial.model, score.name, there):
                rivals[score.name] = Rival(
                    (trial.chi2 - found.chi2) * scale,
                    _moved(found.model, trial.model, [n for n in accepted if n != name], there),
                )
        for rival, model in CATALOGUE[name].rivals(found.model, absent):
            other = fit(model, record, layout, noise, wanted_chi2=wanted)
            moved = _moved(found.model, other.model, [n for n in accepted if n != name], setting)
            rivals[rival] = Rival((other.chi2 - found.chi2) * scale, moved)
        out[name] = Dropped(gain * scale, rivals, _other_forms(found, without, name, setting, noise, scale))
    return out


def _other_forms(
    found: Fit, without: Fit, name: str, setting: Setting, noise: Noise, scale: float
) -> tuple[Rival, ...]:
    """The other forms of a cause that lose no more than a tie."""
    entry, out = CATALOGUE[name], []
    for form in entry.other_forms(found.model.of(name), entry.terms(setting)):
        wanted = found.chi2 + RULES.tie_chi2 / scale
        trial = fit(without.model.with_terms(form), setting.record, setting.layout, noise, wanted_chi2=wanted)
        if trial.chi2 < wanted and is_plausible(trial.model, name, setting):
            out.append(Rival((trial.chi2 - found.chi2) * scale, _moved(found.model, trial.model, [name], setting)))
    return tuple(out)


def _moved(here: Model, there: Model, names: Sequence[str], setting: Setting) -> dict[str, dict[str, float]]:
    out = {}
    for name in names:
        old, new = (_sizes(one, name, setting) for one in (here, there))
        out[name] = {key: new[key][0] - old[key][0] for key in old if key in new}
    return out


def _sizes(model: Model, name: str, setting: Setting) -> Sizes:
    return CATALOGUE[name].sizes(replace(setting, nominal=model.nominal), model.of(name))


def sizes_with_spread(found: Fit, name: str, setting: Setting) -> dict[str, tuple[float, float, str]]:
    """Engineering sizes with standard deviation (linear propagation of the covariance of the numbers that can move) and unit."""
    terms = found.model.terms
    free = np.flatnonzero(found.model.is_free)
    covariance = covariance_of(found, setting.layout, found.model.is_free)
    # some sizes are relative to the machine's own numbers
    rows = np.array([0, 1, 2, 3, *(4 + k for k, t in enumerate(terms) if t.effect == name and 4 + k in free)])
    sizes = _sizes(found.model, name, setting)
    out = {}
    slopes: dict[str, list[float]] = {key: [] for key in sizes}
    for row in rows:
        h = 0.5 * float(np.sqrt(max(covariance[row, row], 1e-20)))
        for key, slope in slopes_of(sizes, partial(_sizes_at, found.model, name, setting, row), h).items():
            slopes[key].append(slope)
    for key, (value, unit) in sizes.items():
        gradient = np.array(slopes[key])
        variance = float(gradient @ covariance[np.ix_(rows, rows)] @ gradient)
        out[key] = (float(value), float(np.sqrt(max(variance, 0.0))), unit)
    for key, more in CATALOGUE[name].unknown_form(found.model, setting.layout).items():
        value, spread, unit = out[key]
        out[key] = (value, float(np.hypot(spread, more)), unit)
    if CATALOGUE[name].course:
        first = next(iter(sizes))
        out[first] = (*_rms_of_course(found, name, setting), sizes[first][1])
    return out


def _sizes_at(model: Model, name: str, setting: Setting, row: int, step: float) -> Sizes:
    theta = model.theta.copy()
    theta[row] += step
    return _sizes(model.moved(theta), name, setting)


def slopes_of(sizes: Sizes, sizes_at: Callable[[float], Sizes], h: float) -> dict[str, float]:
    """How fast each size moves. Some causes say another size on the other side of a border: then a step that does not cross it,
    backward or shorter; none where even the shortest does."""
    for step in (h, -h, *(sign * h / 2**k for k in range(1, SHORTER_STEPS) for sign in (1, -1))):
        moved = sizes_at(step)
        if sizes.keys() <= moved.keys():
            return {key: (moved[key][0] - sizes[key][0]) / step for key in sizes}
    return dict.fromkeys(sizes, 0.0)


def _rms_of_course(found: Fit, name: str, setting: Setting) -> tuple[float, float]:
    """Root mean square of the effect's course over time and its standard deviation, each instant weighed by how surely it is known.

    What the noise alone adds to a square, the variance of the course there, is taken off.
    """
    mine, information = found.information_of(name, CATALOGUE[name].course)
    terms = [found.model.terms[k - 4] for k in mine]
    steps = np.array([t.step for t in terms])
    known = information / np.outer(steps, steps)
    covariance = np.linalg.inv(known + UNKNOWN * float(np.diag(known).max()) * np.eye(mine.size))
    shapes = []
    for segment, channels in zip(setting.record.segments, setting.record.channels, strict=True):
        here = [k for k, t in enumerate(terms) if t.segment == segment.uid]
        at = np.linspace(0, segment.count - 1, INSTANTS_PER_NUMBER * len(here)).astype(int)
        shape = np.zeros((at.size, mine.size))
        shape[:, here] = channels[np.ix_(at, [terms[k].index for k in here])]
        shapes.append(shape)
    course = np.concatenate(shapes)
    certainty = 1.0 / np.einsum("tk,kl,tl->t", course, covariance, course)
    weight = (course * (certainty / certainty.sum())[:, None]).T @ course
    values = steps * found.model.theta[mine]
    power = float(values @ weight @ values - np.trace(weight @ covariance))
    spread = weight @ covariance
    by_chance = 2.0 * float(np.sum(spread * spread.T))
    # the values carry their noise themselves
    variance_of_power = max(4.0 * float(values @ spread @ weight @ values) - by_chance, by_chance)
    rms = float(np.sqrt(max(power, 0.0)))
    return rms, float(np.sqrt(variance_of_power) / (2.0 * max(rms, variance_of_power**0.25)))


def confidence(features: Sequence[float], weights: Sequence[float]) -> float:
    """Logistic of the weighted features (first weight is the constant)."""
    z = weights[0] + float(np.dot(weights[1:], features))
    return float(1.0 / (1.0 + np.exp(-np.clip(z, -30.0, 30.0))))


def claim_features(found: Fit, accepted: Sequence[str], name: str, lack: LackOfFit, total_gain: float) -> list[float]:
    """Log strength in sigma, log of what is left, log ratio of the two, log gain over the strongest other cause's,
    share of all gain. How near the best alternative comes was tried as well and told nothing more (such are ties)."""
    count = float(found.normal.count.sum())
    gain = max(loss_without(found, name), 1.0)
    others = max((loss_without(found, n) for n in accepted if n != name), default=0.0)
    strength = float(np.sqrt(gain / count))
    left = max(lack.sigma, 0.03)
    return [
        float(np.log10(strength)),
        float(np.log10(left)),
        float(np.log10(max(strength / left, 1e-3))),
        float(np.log10(min(gain / max(others, 1.0), 1e4)) if others else 4.0),
        float(min(gain / max(total_gain, 1.0), 1.0)),
    ]


def setting_for(setting: Setting, record: Record) -> Setting:
    return replace(setting, record=record)
