"""One cause more, and those that it makes idle: forward and backward steps, each a generator of records that returns the new state."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np

from commissioner.diagnose.causes import CATALOGUE, LINES, Cause
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.search.acceptance import effects_of, is_plausible
from commissioner.diagnose.search.journal import (
    Accepted,
    Dropped,
    Screened,
    Step,
    Tried,
    best_of,
    chosen,
    is_taken,
    next_candidate,
    ruled_out,
)
from commissioner.diagnose.search.screening import Score
from commissioner.diagnose.search.state import Problem, State, beside, refitted, rest_chi2

EQUAL_LEGS = "with equal legs"
Attempt = tuple[Tried, Fit]


def forward(state: State, problem: Problem, refused: frozenset[str]) -> Generator[Step, None, tuple[State, str | None]]:
    """The candidate whose refit gains most, if it passes the rule; else None."""
    assert state.screening is not None, "a step forward begins with a screening"
    often = [n for n, times in Counter(state.implausible).items() if times >= problem.rules.most_implausible]
    screened = Screened(
        {n: (s.delta_chi2, s.numbers) for n, s in state.screening.scores.items()},
        beside(state, problem, effects_of(state.model)),
        (*sorted(refused), *often),
        state.kept,
    )
    yield screened
    attempts = list(_outright(state, problem, refused, screened))
    for tried, _ in attempts:
        yield tried
    while name := next_candidate(screened, [t for t, _ in attempts], problem.rules):
        fresh = _attempts(state, problem, screened, state.screening.scores[name], [t for t, _ in attempts])
        yield from (tried for tried, _ in fresh)
        attempts += fresh
        state = _remembering(state, problem, [t for t, _ in fresh])
    every = [t for t, _ in attempts]
    state = replace(state, ruled_out=ruled_out(screened, every, problem.rules))
    if chosen(screened, every, problem.rules) is None:
        return state, None
    best = best_of(every, problem.rules)
    fitted = next(f for t, f in attempts if t is best)
    assert best is not None, "what is chosen was tried"
    yield Accepted(best.name, float(np.sqrt(fitted.chi2 / fitted.normal.count.sum())))
    return state.at(fitted, accepted=(*state.accepted, best.name)), best.name


def _remembering(state: State, problem: Problem, fresh: Sequence[Tried]) -> State:
    """The state that knows what came of a candidate: implausible, ruled out, or a gain that is not enough."""
    first, last = fresh[0], fresh[-1]
    if not last.is_sound:
        state = replace(state, implausible=(*state.implausible, first.name))
        if first.kept is not None:
            state = replace(state, kept={**state.kept, first.name: first.kept})
    best = last if last.is_sound else first
    if not best.is_enough and problem.rules.required_chi2(best.numbers) < best.gained_chi2:
        state = replace(state, below={**state.below, best.name: best.gained_chi2})
    return state


def _attempts(
    state: State, problem: Problem, screened: Screened, score: Score, before: Sequence[Tried]
) -> list[Attempt]:
    """A candidate refitted with every number of it: how a curve splits between stator and rotor shows only once it bends."""
    name, rules, current = score.name, problem.rules, state.fit
    wanted, by = screened.beside.wanted(name, score.numbers, rules)
    best = best_of(before, rules)
    to_beat = wanted
    if best is not None:
        to_beat = max(wanted, best.gained_chi2 - rules.price(best.numbers) + rules.price(score.numbers))
    trial = _tried(state, problem, score, current.chi2 - to_beat)
    gain = current.chi2 - trial.chi2
    is_sound = is_plausible(trial.model, name, state.setting)
    is_out = not is_sound and CATALOGUE[name].is_ruled_out(trial.model, state.record)
    kept = min(gain / score.delta_chi2, 1.0) if is_out else None
    first = Tried(name, score.delta_chi2, score.numbers, gain, wanted, by, is_sound, kept=kept)
    form = [t for t in score.form if t.kind != kinds.LEG_SHARE]
    if is_sound or gain < wanted or len(form) == len(score.form):
        return [(first, trial)]
    # what legs differ by may be the phases' resistances, and makes a curve that bends late
    equal = refitted(state, problem, state.model.with_terms(form), current.chi2 - to_beat)
    gain = current.chi2 - equal.chi2
    is_sound = gain >= to_beat and is_plausible(equal.model, name, state.setting)
    second = replace(first, gained_chi2=gain, is_sound=is_sound, how=EQUAL_LEGS, kept=None)
    return [(first, trial), (second, equal)]


def _tried(state: State, problem: Problem, score: Score, wanted_chi2: float) -> Fit:
    """The refit with one more cause; lines looked for meanwhile concern only their own causes. One that was given up is begun again
    only where less is wanted of it.
    """
    last, out_of_reach = state.known.get(score.name, (None, -np.inf))
    if last is None or score.name in LINES.values() or (not last.has_converged and wanted_chi2 > out_of_reach):
        last = refitted(state, problem, state.model.with_terms(score.form), wanted_chi2)
        state.known[score.name] = last, wanted_chi2
    return last


def _outright(
    state: State, problem: Problem, refused: frozenset[str], screened: Screened
) -> Generator[Attempt, None, None]:
    """Causes that no promise shows, begun from where they say; beside the nominal model only."""
    if state.accepted:
        return
    for cause in (CATALOGUE[n] for n in problem.names if n not in refused):
        trial = _begun_outright(cause, state, problem)
        if trial is not None:
            numbers, gain = len(trial.model.of(cause.name)), state.fit.chi2 - trial.chi2
            wanted = screened.beside.threshold(numbers, problem.rules)
            is_sound = is_plausible(trial.model, cause.name, state.setting)
            yield (
                Tried(cause.name, gain, numbers, gain, wanted, "the price of its numbers", is_sound, "outright"),
                trial,
            )


def _begun_outright(cause: Cause, state: State, problem: Problem) -> Fit | None:
    current, setting = state.fit, state.setting
    starts = cause.outright(current.chi2 / float(current.normal.count.sum()), setting)
    models = [Model(start).with_terms([*current.model.terms, *terms]) for start, terms in starts]
    trials = [fit(m, setting.record, setting.layout, problem.noise, tolerance=1.0) for m in models]
    return min(trials, key=lambda f: f.chi2, default=None)


def backward(
    state: State, problem: Problem, doubted: Sequence[str]
) -> Generator[Step, None, tuple[State, frozenset[str]]]:
    """Drops accepted causes that the later ones have made idle, or a trifle beside them (or turned to the wrong sign)."""
    dropped: set[str] = set()
    every = beside(state, problem, state.accepted)
    for name in doubted:
        loss, numbers = every.losses[name], len(state.model.of(name))
        others = {n: x for n, x in every.losses.items() if n != name}
        rest = rest_chi2(state, problem) + loss
        wanted, by = replace(every, losses=others, rest_chi2=rest).wanted(name, numbers, problem.rules)
        # starts that came before the carried flux was right hold its place: only a fit without them tells
        begins = any(t.effect == name and t.kind == kinds.INITIAL_FLUX for t in state.model.terms)
        holds_place = begins and state.model.has_kind(kinds.CARRY)
        is_sound = is_plausible(state.model, name, state.setting)
        if not (holds_place or loss < problem.rules.doubted_loss * wanted or not is_sound):
            continue
        trial = _without(state, problem, name, state.fit.chi2 + wanted if is_sound else np.inf)
        step = Dropped(name, trial.chi2 - state.fit.chi2, wanted, by, is_sound, is_taken=False)
        step = replace(step, is_taken=is_taken(step))
        yield step
        if step.is_taken:
            state = state.at(trial, accepted=tuple(n for n in state.accepted if n != name))
            every = beside(state, problem, state.accepted)
            dropped.add(name)
    return state, frozenset(dropped)


def _without(state: State, problem: Problem, name: str, wanted_chi2: float) -> Fit:
    """The refit with one cause less; given up where it cannot reach `wanted_chi2`."""
    key = f"without {name}"
    if key not in state.known:
        state.known[key] = refitted(state, problem, state.model.without(name), wanted_chi2), wanted_chi2
    return state.known[key][0]
