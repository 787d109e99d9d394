"""From the nominal model to the accepted causes: on a part of the record, on the whole, and again where lost samples are mended."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from commissioner.diagnose.causes import CATALOGUE, MENDED, Setting
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.fit.lost_samples import Loss, mend
from commissioner.diagnose.fit.normal_equations import NormalEquations
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record, Segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout, Model, Term
from commissioner.diagnose.search.acceptance import LINES_OF_THEIR_OWN, guard_of_lost_samples, losses_of
from commissioner.diagnose.search.dictionaries import begun, carried_over, respread
from commissioner.diagnose.search.nominal import (
    bare_layout,
    from_segment_to_segment,
    largest_fluxes,
    nominal_fit,
    set_up,
)
from commissioner.diagnose.search.refinement import refined
from commissioner.diagnose.search.screening import Screening
from commissioner.diagnose.search.stepwise import Report, RuledOut, Steps, surely_left

EXPLORED = (45_000, 180_000)
"""Parts on which causes are sought before the whole: a cause tried on a million samples costs twenty seconds."""
MENDING_ROUNDS = 3
"""Of putting lost samples right and fitting again."""
MENDED_AT_ONCE = 0.5
"""A round that leaves more of the misfit than this is the last: what remains is not made by lost samples."""
MENDED_SHARE, MENDED_LEAST_SHARE = 0.7, 0.3
"""Of the misfit that the noise's own uncertainty cannot make, and at the least of all of it, so much must be gone with them."""
UNKNOWN_SIGMA, UNKNOWN_SHARE = 0.1, 0.05
"""Where so much of the noise's rms is left, and of the error there was to explain, no cause makes it: settling the others gains nothing."""
HOPELESS_SIGMA = 0.3
"""Where a part's search ends with so much, and that share, the whole finds no more."""


@dataclass(frozen=True)
class Found:
    """Accepted effects in order, the fit with them, and what was seen on the way."""

    nominal: Fit
    fit: Fit
    accepted: tuple[str, ...]
    record: Record
    layout: Layout
    setting: Setting
    screening: Screening
    first_screening: Screening
    below_materiality: dict[str, float] = field(default_factory=dict)
    """Causes that would gain, but too little to matter: what they gain in chi2."""
    gains: dict[str, float] = field(default_factory=dict)
    losses: tuple[Loss, ...] = ()
    spikes: tuple[Loss, ...] = ()
    """Samples that stand out alone: masked as well, and no loss."""
    material_chi2: float = 0.0
    """A cause that gains less is too small to matter."""
    ruled_out: RuledOut = field(default_factory=RuledOut)
    is_complete: bool = True
    """False: the time allowed was over before nothing more passed the rules."""


def search(
    record: Record,
    noise: Noise,
    *,
    excluded: Sequence[str] = (),
    report: Report = lambda _: None,
    check: Callable[[Fit, Record], None] | None = None,
    go_on: Callable[[], bool] = lambda: True,
) -> Found:
    """Accepted causes of the whole record. Where lost samples were put right first and much is left, another cause may have looked

    like them: sought again in the data as they came.

    `check` sees the nominal fit first and may raise to spare the search; where `go_on` says no, no further cause is tried.
    """
    found = _searched(record, noise, excluded, report, check, go_on)
    if not found.losses or not _leaves(UNKNOWN_SIGMA, found.fit, found.nominal, noise):
        return found
    report("much is left beside lost samples: sought again in the data as they came")
    other = _searched(record, noise, (*excluded, *MENDED), report, None, go_on)
    return other if other.fit.normal.unexplained < found.fit.normal.unexplained else found


def _searched(
    record: Record,
    noise: Noise,
    excluded: Sequence[str],
    report: Report,
    check: Callable[[Fit, Record], None] | None,
    go_on: Callable[[], bool],
) -> Found:
    """Explored on a part, confirmed and completed on all of the record."""
    part, bare = record.beginning(EXPLORED[0]), bare_layout(record)
    record, nominal = from_segment_to_segment(record, nominal_fit(part, noise).model, bare, noise)
    raw = record.segments
    losses: tuple[Loss, ...] = ()
    if not set(excluded) >= MENDED:
        record, nominal, losses = _mended(record, nominal, bare, noise, report)
    if check is not None:
        check(nominal, record)
    report(f"nominal fit: {np.sqrt(nominal.chi2 / nominal.normal.count.sum()):.3g} times the noise")
    record, _, setting = set_up(record, noise, nominal)
    names = [name for name in CATALOGUE if name not in excluded]
    reached, first = _explored(nominal, Steps(setting, noise, names, report, record, go_on))
    leakage_side = reached.steps.leakage_side
    if reached.accepted and losses:
        reached, losses = _losses_doubted(reached, raw, losses)
    if reached.accepted and not set(excluded) >= MENDED:
        reached, losses = _losses_completed(reached, losses)
    return _refined(reached, nominal, first, losses, has_leakage_side=_has_leakage_side(leakage_side, reached.accepted))


@dataclass(frozen=True)
class _Reached:
    """Where a search stands: its record and dictionaries (in `steps`), the fit, the accepted causes, the last screening."""

    steps: Steps
    fit: Fit
    accepted: tuple[str, ...]
    screening: Screening

    def again_on(self, record: Record, start: Fit) -> _Reached:
        """Searched once more on the whole of another record, from these causes."""
        steps = self.steps.on(record)
        return _Reached(steps, *steps.run(start, self.accepted))


def _explored(nominal: Fit, steps: Steps) -> tuple[_Reached, Screening]:
    """Searched on growing parts of the record and on all of it; with the first screening. `steps`: nothing tried yet."""
    base, noise, whole = steps.setting, steps.noise, steps.full.samples
    reached: _Reached | None = None
    first: Screening | None = None
    for samples in (*(n for n in EXPLORED if n < 0.7 * whole), whole):
        part = steps.full if samples == whole else steps.full.beginning(samples)
        base = replace(base, record=part, lines_hz=steps.setting.lines_hz)
        start, here, accepted = _start_on(base, reached, nominal, noise)
        steps = steps.continued(here)
        if accepted or samples == whole:
            start = steps.with_new_flux_before(steps.with_new_dictionaries(start))
        is_hopeless = reached is not None and _leaves(HOPELESS_SIGMA, reached.fit, nominal, noise)
        reached = _Reached(steps, *steps.run(start, accepted, adds=not is_hopeless))
        first = first or steps.first
    assert reached is not None and first is not None, "the whole record is the last part"
    return reached, first


def _start_on(
    base: Setting, reached: _Reached | None, nominal: Fit, noise: Noise
) -> tuple[Fit, Setting, tuple[str, ...]]:
    """The fit on more of the record from which a search goes on, with its dictionaries and the causes it keeps."""
    part, layout = base.record, base.layout
    if reached is None or not reached.accepted:
        return fit((reached.fit if reached else nominal).model, part, layout, noise), base, ()
    start, here = _on_more(reached, base, noise)
    if start.chi2 < NormalEquations(nominal.model, part, layout, (), noise).chi2:
        return start, here, reached.accepted
    # what fitted the smaller part runs away beyond it
    start = fit(nominal.model, part, layout, noise)
    again = fit(_completed(nominal.model, reached.accepted, base), part, layout, noise)
    return (again, base, reached.accepted) if again.chi2 < start.chi2 else (start, base, ())


def _losses_doubted(
    reached: _Reached, raw: Sequence[Segment], losses: tuple[Loss, ...]
) -> tuple[_Reached, tuple[Loss, ...]]:
    """Searched again in the data as they came, where the causes named since explain what looked like lost samples."""
    steps = reached.steps
    unmended = _with_the_losses(steps.record, raw, reached.fit, steps.layout, steps.noise)
    if unmended is None:
        return reached, losses
    steps.report("what looked like lost samples were the causes named since")
    return reached.again_on(*unmended), ()


def _losses_completed(reached: _Reached, losses: tuple[Loss, ...]) -> tuple[_Reached, tuple[Loss, ...]]:
    """Searched again where the named causes make further lost samples visible."""
    steps, least = reached.steps, guard_of_lost_samples(reached.fit)
    mended, better, more = _mended(steps.record, reached.fit, steps.layout, steps.noise, steps.report, least)
    return (reached.again_on(mended, better), losses + more) if more else (reached, losses)


def _refined(
    reached: _Reached, nominal: Fit, first: Screening, losses: tuple[Loss, ...], *, has_leakage_side: bool
) -> Found:
    """The last fit's sides and loops refined, unless too much is left; with all that was seen on the way."""
    steps, fitted, noise, layout = reached.steps, reached.fit, reached.steps.noise, reached.steps.layout
    ruled_out = steps.ruled_out
    much_is_ruled_out = ruled_out.chi2 > UNKNOWN_SHARE * (nominal.chi2 - fitted.chi2 + ruled_out.chi2)
    if not (much_is_ruled_out or _leaves(UNKNOWN_SIGMA, fitted, nominal, noise)):
        fitted, layout = refined(fitted, steps.record, layout, noise, has_leakage_side=has_leakage_side)
    iron_wb, leakage_wb = largest_fluxes(steps.record, fitted.model, layout)
    setting = replace(
        steps.setting, layout=layout, iron_flux_wb=iron_wb, leakage_flux_wb=leakage_wb, nominal=fitted.model.nominal
    )
    # no cause gains more than all together: where numbers have run far, a loss to first order says so
    most = max(nominal.chi2 - fitted.chi2, 0.0)
    gains = {name: min(loss, most) for name, loss in losses_of(fitted, reached.accepted).items()}
    # what settling gained may be the same
    ruled_out = (
        replace(ruled_out, chi2=max(ruled_out.chi2 - (reached.fit.chi2 - fitted.chi2), 0.0))
        if ruled_out.chi2
        else ruled_out
    )
    return Found(
        nominal,
        fitted,
        reached.accepted,
        steps.record,
        layout,
        setting,
        reached.screening,
        first,
        steps.below,
        gains,
        tuple(x for x in losses if not x.is_spike),
        tuple(x for x in losses if x.is_spike),
        steps.material_chi2,
        ruled_out,
        steps.go_on(),
    )


def _has_leakage_side(leakage_side: frozenset[str], accepted: Sequence[str]) -> bool:
    """Whether the iron's side was sought beside these causes already, but for some that act at lines of their own."""
    return (
        bool(leakage_side)
        and leakage_side <= set(accepted)
        and all(CATALOGUE[n].family in LINES_OF_THEIR_OWN for n in set(accepted) - leakage_side)
    )


def _leaves(sigma: float, fitted: Fit, nominal: Fit, noise: Noise) -> bool:
    """Whether more than so many `sigma` of the noise, and more than a right model leaves, is surely not explained."""
    return surely_left(fitted, noise) > max(sigma**2, UNKNOWN_SHARE * surely_left(nominal, noise))


def _mended(
    record: Record, current: Fit, layout: Layout, noise: Noise, report: Report, least: float = 0.0
) -> tuple[Record, Fit, tuple[Loss, ...]]:
    """Unmarked losses put right, and spikes left out, until a better fit shows no more; none where most of the misfit stays, or where they

    gain less than `least`. A cause that is not in the model yet, like the kinks of a dead time, can look like many small losses.
    """
    losses: tuple[Loss, ...] = ()
    mended, better = record, current
    for _ in range(MENDING_ROUNDS):
        # from the data as they came: the better model places what the worse one misplaced
        again, seen = mend(record, better.model, layout, noise, is_first=not losses)
        if not seen:
            break
        trial = fit(better.model, again, layout, noise, rounds=6, tolerance=1.0)
        if trial.chi2 >= better.chi2:
            break
        is_slow = trial.normal.unexplained > MENDED_AT_ONCE * better.normal.unexplained
        mended, better, losses = again, trial, seen
        if is_slow:
            break
    excess, left = current.normal.unexplained, better.normal.unexplained
    # what a noise measured too low adds to both
    by_the_noise = noise.uncertainty * float(current.normal.count.sum())
    stays = max(left - by_the_noise, 0.0) > (1.0 - MENDED_SHARE) * max(excess - by_the_noise, 0.0)
    if not losses or stays or excess - left < max(least, MENDED_LEAST_SHARE * excess):
        return record, current, ()
    spikes = sum(x.is_spike for x in losses)
    report(f"{sum(x.samples for x in losses) - spikes} unmarked lost samples put right, {spikes} spikes left out")
    return mended, better, losses


def _with_the_losses(
    mended: Record, raw: Sequence[Segment], fitted: Fit, layout: Layout, noise: Noise
) -> tuple[Record, Fit] | None:
    """The data as they came and the fit of all accepted causes to them, where that is hardly worse: then nothing was lost."""
    segments = tuple(replace(r, flux_before_wb=m.flux_before_wb) for r, m in zip(raw, mended.segments, strict=True))
    record = replace(mended, segments=segments)
    trial = fit(fitted.model, record, layout, noise)
    masked = float(trial.normal.count.sum() - fitted.normal.count.sum())
    gain = trial.chi2 - fitted.chi2 - 3.0 * max(masked, 0.0)
    return (record, trial) if gain < guard_of_lost_samples(fitted) else None


def _on_more(reached: _Reached, setting: Setting, noise: Noise) -> tuple[Fit, Setting]:
    """The accepted causes of a part fitted to more of the record, in dictionaries spread over the fluxes reached there."""
    seen, model = reached.steps, reached.fit.model
    there = replace(setting, layout=seen.layout, iron_flux_wb=seen.setting.iron_flux_wb)
    fluxes = largest_fluxes(seen.record, model, seen.layout)
    completed = _without_unseen_speed(_completed(model, reached.accepted, there), seen.record, setting.record)
    wider, there = respread(carried_over(completed, seen.layout, fluxes, seen.layout), there)
    return begun(wider, there, noise), there


def _without_unseen_speed(model: Model, part: Record, record: Record) -> Model:
    """The model with splines of the speed at zero that lie for the most part beyond the part it was fitted to: the part's last samples

    held them, at anything.
    """
    uids = [s.uid for s in record.segments]

    def is_seen(term: Term) -> bool:
        at = uids.index(term.segment)
        seen, whole = (
            float(np.square(r.channels[at][: r.segments[at].count, r.channel(term.channel)]).sum())
            for r in (part, record)
        )
        return seen > 0.5 * whole

    values = tuple(
        0.0 if t.kind == kinds.OMEGA and not is_seen(t) else v for t, v in zip(model.terms, model.values, strict=True)
    )
    return replace(model, values=values)


def _completed(model: Model, accepted: Sequence[str], setting: Setting) -> Model:
    """The model with every number of its effects (in the form they have): on a part of the data some were invisible."""
    nuisance = tuple(t for t in model.terms if not t.effect)
    terms = nuisance + tuple(
        t for name in accepted for t in CATALOGUE[name].form_of(model.of(name), CATALOGUE[name].terms(setting))
    )
    known = {(t.effect, t.symbol): v for t, v in zip(model.terms, model.values, strict=True)}
    return Model(model.nominal, terms, tuple(known.get((t.effect, t.symbol), t.start) for t in terms))
