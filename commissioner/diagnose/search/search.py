"""From the nominal model to the accepted causes: on a part of the record, on the whole, and again where lost samples are mended."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from commissioner.diagnose.causes import CATALOGUE, LINEAR, MENDED, Setting
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.fit.lost_samples import Loss, mend
from commissioner.diagnose.fit.normal_equations import NormalEquations
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record, Segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout, Model, Term
from commissioner.diagnose.rules import RULES, Rules
from commissioner.diagnose.search.acceptance import LINES_OF_THEIR_OWN, guard_of_lost_samples, losses_of
from commissioner.diagnose.search.adjust import with_new_dictionaries
from commissioner.diagnose.search.dictionaries import begun_with, carried_over, respread
from commissioner.diagnose.search.journal import Began, Nominal, RuledOut, Said, Step
from commissioner.diagnose.search.nominal import (
    bare_layout,
    from_segment_to_segment,
    largest_fluxes,
    nominal_fit,
    set_up,
)
from commissioner.diagnose.search.refinement import refined
from commissioner.diagnose.search.screening import Screening
from commissioner.diagnose.search.state import (
    Problem,
    State,
    Steps,
    begun,
    material_chi2,
    surely_left,
    with_new_flux_before,
)
from commissioner.diagnose.search.stepwise import stepwise

EXPLORED = (45_000, 180_000)
"""Parts on which causes are sought before the whole: a cause tried on a million samples costs twenty seconds."""
MENDING_ROUNDS = 3
"""Of putting lost samples right and fitting again."""


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


Search = Generator[Step, None, Found]


def not_told_apart(lines: int) -> tuple[str, ...]:
    """Two lines fit the four parameters exactly: what only shifts them, or jumps in delay, cannot be named then. (A sweep has none.)"""
    if lines not in (1, 2):
        return ()
    late = [name for name, cause in CATALOGUE.items() if cause.moves_the_clock]
    return LINEAR if lines == 2 else (*LINEAR, *late)


def search(
    record: Record,
    noise: Noise,
    *,
    excluded: Sequence[str] = (),
    check: Callable[[Fit, Record], None] | None = None,
    rules: Rules = RULES,
) -> Search:
    """Accepted causes of the whole record. Where lost samples were put right first and much is left, another cause may have looked
    like them: sought again in the data as they came.

    `check` sees the nominal fit first and may raise to spare the search.
    """
    problem = Problem(noise, tuple(name for name in CATALOGUE if name not in excluded), rules)
    found = yield from _searched(record, problem, check)
    if not found.losses or not _leaves(rules.unknown_sigma, found.fit, found.nominal, problem):
        return found
    yield Said("much is left beside lost samples: sought again in the data as they came")
    as_it_came = replace(problem, names=tuple(n for n in problem.names if n not in MENDED))
    other = yield from _searched(record, as_it_came, None)
    if other.fit.normal.unexplained < found.fit.normal.unexplained:
        return other
    yield Began(found.accepted, found.record.samples)
    return found


def _searched(record: Record, problem: Problem, check: Callable[[Fit, Record], None] | None) -> Search:
    """Explored on a part, confirmed and completed on all of the record."""
    noise, mends = problem.noise, not MENDED.isdisjoint(problem.names)
    part, bare = record.beginning(EXPLORED[0]), bare_layout(record)
    record, nominal = from_segment_to_segment(record, nominal_fit(part, noise).model, bare, noise)
    raw = record.segments
    losses: tuple[Loss, ...] = ()
    if mends:
        record, nominal, losses = yield from _mended(record, nominal, bare, problem)
    if check is not None:
        check(nominal, record)
    yield Nominal(float(np.sqrt(nominal.chi2 / nominal.normal.count.sum())))
    record, _, setting = set_up(record, noise, nominal)
    state = yield from _explored(nominal, begun(setting, record, nominal), problem)
    first, leakage_side = state.first, state.leakage_side
    if state.accepted and losses:
        state, losses = yield from _losses_doubted(state, problem, raw, losses)
    if state.accepted and mends:
        state, losses = yield from _losses_completed(state, problem, losses)
    has_side = _has_leakage_side(leakage_side, state.accepted)
    return _refined(replace(state, first=first), problem, nominal, losses, has_leakage_side=has_side)


def _explored(nominal: Fit, state: State, problem: Problem) -> Steps:
    """Searched on growing parts of the record and on all of it; with the first screening. `state`: nothing tried yet."""
    base, whole, first, is_begun = state.setting, state.full.samples, None, False
    for samples in (*(n for n in EXPLORED if n < 0.7 * whole), whole):
        part = state.full if samples == whole else state.full.beginning(samples)
        base = replace(base, record=part, lines_hz=state.setting.lines_hz)
        is_hopeless = is_begun and _leaves(problem.rules.hopeless_sigma, state.fit, nominal, problem)
        start, here, accepted = _start_on(base, state if is_begun else None, nominal, problem.noise)
        state = replace(state.on_more(here), fit=start, accepted=accepted)
        if accepted or samples == whole:
            state = with_new_flux_before(with_new_dictionaries(state, problem), problem)
        state = yield from stepwise(state, problem, adds=not is_hopeless)
        first, is_begun = first or state.first, True
    return replace(state, first=first)


def _start_on(base: Setting, reached: State | None, nominal: Fit, noise: Noise) -> tuple[Fit, Setting, tuple[str, ...]]:
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


Losses = tuple[Loss, ...]


def _losses_doubted(
    state: State, problem: Problem, raw: Sequence[Segment], losses: Losses
) -> Generator[Step, None, tuple[State, Losses]]:
    """Searched again in the data as they came, where the causes named since explain what looked like lost samples."""
    unmended = _with_the_losses(state, problem, raw)
    if unmended is None:
        return state, losses
    yield Said("what looked like lost samples were the causes named since")
    return (yield from _again_on(*unmended, state, problem)), ()


def _losses_completed(state: State, problem: Problem, losses: Losses) -> Generator[Step, None, tuple[State, Losses]]:
    """Searched again where the named causes make further lost samples visible."""
    least = guard_of_lost_samples(state.fit, problem.rules)
    mended, better, more = yield from _mended(state.record, state.fit, state.layout, problem, least)
    return ((yield from _again_on(mended, better, state, problem)), losses + more) if more else (state, losses)


def _again_on(record: Record, start: Fit, state: State, problem: Problem) -> Steps:
    """Searched once more on the whole of another record, from these causes, with what is known of the machine so far."""
    fresh = begun(replace(state.setting, record=record), record, start, state.accepted)
    return (yield from stepwise(fresh, problem))


def _refined(state: State, problem: Problem, nominal: Fit, losses: Losses, *, has_leakage_side: bool) -> Found:
    """The last fit's sides and loops refined, unless too much is left; with all that was seen on the way."""
    fitted, layout, ruled_out, rules = state.fit, state.layout, state.ruled_out, problem.rules
    much_is_ruled_out = ruled_out.chi2 > rules.unknown_share * (nominal.chi2 - fitted.chi2 + ruled_out.chi2)
    if not (much_is_ruled_out or _leaves(rules.unknown_sigma, fitted, nominal, problem)):
        fitted, layout = refined(fitted, state.record, layout, problem.noise, has_leakage_side=has_leakage_side)
    iron_wb, leakage_wb = largest_fluxes(state.record, fitted.model, layout)
    setting = replace(
        state.setting, layout=layout, iron_flux_wb=iron_wb, leakage_flux_wb=leakage_wb, nominal=fitted.model.nominal
    )
    # no cause gains more than all together: where numbers have run far, a loss to first order says so
    most = max(nominal.chi2 - fitted.chi2, 0.0)
    if ruled_out.chi2:
        # what refining gained may be the same
        ruled_out = ruled_out._replace(chi2=max(ruled_out.chi2 - (state.fit.chi2 - fitted.chi2), 0.0))
    assert state.screening is not None and state.first is not None, "the whole record is the last part"
    return Found(
        nominal,
        fitted,
        state.accepted,
        state.record,
        layout,
        setting,
        state.screening,
        state.first,
        dict(state.below),
        {name: min(loss, most) for name, loss in losses_of(fitted, state.accepted).items()},
        tuple(x for x in losses if not x.is_spike),
        tuple(x for x in losses if x.is_spike),
        material_chi2(state, problem),
        ruled_out,
    )


def _has_leakage_side(leakage_side: frozenset[str], accepted: Sequence[str]) -> bool:
    """Whether the iron's side was sought beside these causes already, but for some that act at lines of their own."""
    return (
        bool(leakage_side)
        and leakage_side <= set(accepted)
        and all(CATALOGUE[n].family in LINES_OF_THEIR_OWN for n in set(accepted) - leakage_side)
    )


def _leaves(sigma: float, fitted: Fit, nominal: Fit, problem: Problem) -> bool:
    """Whether more than so many `sigma` of the noise, and more than a right model leaves, is surely not explained."""
    noise, rules = problem.noise, problem.rules
    share = rules.unknown_share * surely_left(nominal, noise, rules)
    return surely_left(fitted, noise, rules) > max(sigma**2, share)


def _mended(
    record: Record, current: Fit, layout: Layout, problem: Problem, least: float = 0.0
) -> Generator[Step, None, tuple[Record, Fit, Losses]]:
    """Unmarked losses put right, and spikes left out, until a better fit shows no more; none where most of the misfit stays, or where they
    gain less than `least`. A cause that is not in the model yet, like the kinks of a dead time, can look like many small losses.
    """
    losses: Losses = ()
    mended, better, noise, rules = record, current, problem.noise, problem.rules
    for _ in range(MENDING_ROUNDS):
        # from the data as they came: the better model places what the worse one misplaced
        again, seen = mend(record, better.model, layout, noise, is_first=not losses)
        if not seen:
            break
        trial = fit(better.model, again, layout, noise, rounds=6, tolerance=1.0)
        if trial.chi2 >= better.chi2:
            break
        is_slow = trial.normal.unexplained > rules.mended_at_once * better.normal.unexplained
        mended, better, losses = again, trial, seen
        if is_slow:
            break
    excess, left = current.normal.unexplained, better.normal.unexplained
    # what a noise measured too low adds to both
    by_the_noise = noise.uncertainty * float(current.normal.count.sum())
    stays = max(left - by_the_noise, 0.0) > (1.0 - rules.mended_share) * max(excess - by_the_noise, 0.0)
    if not losses or stays or excess - left < max(least, rules.mended_least_share * excess):
        return record, current, ()
    spikes = sum(x.is_spike for x in losses)
    lost = sum(x.samples for x in losses) - spikes
    yield Said(f"{lost} unmarked lost samples put right, {spikes} spikes left out")
    return mended, better, losses


def _with_the_losses(state: State, problem: Problem, raw: Sequence[Segment]) -> tuple[Record, Fit] | None:
    """The data as they came and the fit of all accepted causes to them, where that is hardly worse: then nothing was lost."""
    mended, fitted = state.record, state.fit
    segments = tuple(replace(r, flux_before_wb=m.flux_before_wb) for r, m in zip(raw, mended.segments, strict=True))
    record = replace(mended, segments=segments)
    trial = fit(fitted.model, record, state.layout, problem.noise)
    masked = float(trial.normal.count.sum() - fitted.normal.count.sum())
    gain = trial.chi2 - fitted.chi2 - 3.0 * max(masked, 0.0)
    return (record, trial) if gain < guard_of_lost_samples(fitted, problem.rules) else None


def _on_more(reached: State, setting: Setting, noise: Noise) -> tuple[Fit, Setting]:
    """The accepted causes of a part fitted to more of the record, in dictionaries spread over the fluxes reached there."""
    seen, model = reached.layout, reached.model
    there = replace(setting, layout=seen, iron_flux_wb=reached.setting.iron_flux_wb)
    fluxes = largest_fluxes(reached.record, model, seen)
    completed = _without_unseen_speed(_completed(model, reached.accepted, there), reached.record, setting.record)
    wider, there = respread(carried_over(completed, seen, fluxes, seen), there)
    return begun_with(wider, there, noise), there


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
