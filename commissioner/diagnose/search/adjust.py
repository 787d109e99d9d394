"""What is made better of the causes that are accepted, one record each; where nothing is gained the state stays as it is."""

from __future__ import annotations

from collections.abc import Collection, Generator
from dataclasses import replace

import numpy as np

from commissioner.diagnose.causes import CATALOGUE, FROM_THE_SAMPLE, LINES
from commissioner.diagnose.causes.mains_lines import with_clearer_lines
from commissioner.diagnose.causes.regressors import FINE_SPEED_SPLINE
from commissioner.diagnose.fit.gauss_newton import fit
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.flux_before import with_flux_before
from commissioner.diagnose.plant.impedance import impedance_starts
from commissioner.diagnose.search.acceptance import effects_of, is_plausible, meets_tones
from commissioner.diagnose.search.dictionaries import (
    CURVES,
    finer_curve,
    following,
    with_closer_radii,
    with_faster_speed,
)
from commissioner.diagnose.search.exchanges import exchanged
from commissioner.diagnose.search.journal import Refined, Said, Step
from commissioner.diagnose.search.nominal import is_outside_the_box
from commissioner.diagnose.search.refinement import leakage_side
from commissioner.diagnose.search.state import (
    Problem,
    State,
    Steps,
    material_chi2,
    part_of,
    refitted,
    rest_chi2,
    standing,
    with_new_flux_before,
)

CARRIED_ROUNDS = 3
"""Times that what the iron remembers is told anew by a better model."""


def adjusted(state: State, problem: Problem, name: str) -> Steps:
    """The state with the cause that was accepted just now, with all that follows from it."""
    rest = problem.rules.wrong_valley_sigma**2 * state.samples
    if (len(state.accepted) == 1 and rest_chi2(state, problem) > rest) or is_outside_the_box(state.model, state.layout):
        state = yield from _from_other_starts(state, problem)
    if any(t.effect == name and t.kind == kinds.NU for t in state.model.terms):
        placed = leakage_side(state.fit, state.record, state.layout, problem.noise)
        state = state.at(placed, leakage_side=frozenset(state.accepted))
    here = standing(state, problem)
    groups = (group for cause in FROM_THE_SAMPLE for group in cause.in_place_of(name, here))
    state = (yield from exchanged(groups, state, problem)) or state
    state = _with_unequal_legs(state, problem)
    state = with_new_dictionaries(with_new_flux_before(state, problem), problem)
    of = {t.kind for t in CATALOGUE[name].terms(state.setting)}
    state = yield from with_finer_curves(state, problem, of)
    if kinds.STOP in of:
        state = yield from _with_carried_memory(state, problem)
        fitted, setting, refined = with_closer_radii(state.fit, state.setting, problem.noise)
        yield refined
        state = with_new_flux_before(state.at(fitted, setting=setting), problem)
    return state


def _from_other_starts(state: State, problem: Problem) -> Steps:
    """The best fit of the same causes beside what the impedance at the tones says of the four: dead times of 3.5 and of thirty times
    the noise had left them in a valley without a magnetizing inductance.
    """
    starts = [replace(state.model, nominal=start) for start in impedance_starts(state.record)]
    best = min((state.fit, *(refitted(state, problem, m) for m in starts)), key=lambda f: f.chi2)
    if best is not state.fit:
        yield Refined("the four parameters from another start", state.fit.chi2 - best.chi2, 0.0, is_taken=True)
    return state.at(best)


def _with_unequal_legs(state: State, problem: Problem) -> State:
    """Legs that differ, where they were alike so far and that is plausible beside what was accepted since."""
    for name in state.accepted[:-1]:
        shares = [t for t in CATALOGUE[name].terms(state.setting) if t.kind == kinds.LEG_SHARE]
        if shares and not state.model.has_kind(kinds.LEG_SHARE):
            wanted = state.fit.chi2 - problem.rules.required_chi2(len(shares))
            trial = refitted(state, problem, state.model.with_terms(shares), wanted)
            if trial.chi2 <= wanted and is_plausible(trial.model, name, state.setting):
                state = state.at(trial)
    return state


def with_new_dictionaries(state: State, problem: Problem) -> State:
    fitted, setting = following(state.fit, state.setting, problem.noise)
    return state.at(fitted, setting=setting)


def with_finer_curves(state: State, problem: Problem, of: Collection[int] = tuple(CURVES)) -> Steps:
    """Curves of the kinds `of` with a knot between every two, as long as that gains what its numbers cost."""
    for kind in CURVES:
        while kind in of and (found := finer_curve(state.fit, state.setting, problem.noise, kind)):
            fitted, setting, refined = found
            yield refined
            if not refined.is_taken:
                break
            state = state.at(fitted, setting=setting)
    return state


def _with_carried_memory(state: State, problem: Problem) -> Steps:
    """The iron goes into every segment with what it remembers of the one before, where that is better."""
    if state.model.has_kind(kinds.MEMORY) or not any(s.iron_before_wb is not None for s in state.record.segments):
        return state
    iron = {t.effect for t in state.model.terms if t.kind == kinds.STOP}
    names = [n for n in effects_of(state.model) if n in iron]
    carried = [t for name in names for t in CATALOGUE[name].exchanged if t.kind == kinds.MEMORY]
    least = problem.rules.required_chi2(1)
    best, full = state.fit, state.full
    for _ in range(CARRIED_ROUNDS):
        model = best.model if best is not state.fit else state.model.with_terms(carried)
        told = with_flux_before(full, model, state.layout)
        part = part_of(state, told)
        trial = fit(model, part, state.layout, problem.noise, wanted_chi2=state.fit.chi2 - least)
        if trial.chi2 >= best.chi2:
            break
        best, full = trial, told
    gained = state.fit.chi2 - best.chi2
    yield Refined("iron that remembers the segment before", gained, least, is_taken=gained >= least)
    if gained < least:
        return state
    return state.at(best, full=full, setting=replace(state.setting, record=part_of(state, full)))


def with_more_to_see(state: State, problem: Problem) -> Steps:
    """At the end of the steps: lines at other frequencies, or a faster speed; the same state where there is neither."""
    clearer = yield from _with_clearer_lines(state, problem)
    if clearer is not None:
        return clearer
    is_left = rest_chi2(state, problem) > max(problem.rules.required_chi2(1), material_chi2(state, problem))
    has_fine = any(n.startswith(FINE_SPEED_SPLINE) for n in state.record.channel_names)
    if not state.model.has_kind(kinds.OMEGA) or not is_left or has_fine:
        return state
    found = with_faster_speed(state.fit, state.full, state.setting, problem.noise)
    if found is None:
        return state
    fitted, full, setting, refined = found
    yield refined
    return state.at(fitted, full=full, setting=setting) if refined.is_taken else state


def _with_clearer_lines(state: State, problem: Problem) -> Generator[Step, None, State | None]:
    """Ripple or mains at other frequencies than were looked at so far, once the causes are in the model; None: none."""
    kept = {kind: name for kind, name in LINES.items() if name in state.accepted}
    known = state.setting.lines_hz
    full, lines = with_clearer_lines(state.full, state.model, state.layout, problem.noise, known, kept)
    if lines == known or state.looks == problem.rules.most_looks:
        return None
    yield Said(f"  looking at {', '.join(f'{name} ({hz:.2f} Hz)' for name, hz in lines.items())}")
    setting = replace(state.setting, record=part_of(state, full), lines_hz=lines)
    again = fit(state.model, setting.record, state.layout, problem.noise) if kept else state.fit
    looked = replace(state, looks=state.looks + 1)
    if not np.isfinite(again.chi2):
        return None
    return looked.at(again, full=full, setting=setting, ripple_meets_tones=meets_tones(full, setting))
