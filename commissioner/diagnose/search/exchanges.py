"""What single steps forward do not find: causes in other forms, or others in place of those that had stood for them."""

from __future__ import annotations

import itertools
from collections.abc import Generator, Iterable, Sequence
from dataclasses import replace

from commissioner.diagnose.causes import CATALOGUE, FROM_THE_SAMPLE, LINEAR, Setting, between
from commissioner.diagnose.causes.cause import Proposal
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.search.acceptance import is_plausible, loss_without
from commissioner.diagnose.search.dictionaries import with_closer_branches
from commissioner.diagnose.search.journal import Exchanged, Step, is_taken
from commissioner.diagnose.search.screening import Screening, joint_net, screen
from commissioner.diagnose.search.state import Problem, State, Steps, material_chi2, refitted, standing

Exchange = Generator[Step, None, State | None]


def exchange(state: State, problem: Problem) -> Steps:
    """The first exchange that fits clearly better; each set of causes is looked at once."""
    every = frozenset(state.accepted)
    if ("forms", every) not in state.looked_at:
        state = state.looked("forms", every)
        other = yield from _in_other_forms(state, problem)
        if other.fit is not state.fit:
            return other
    there = [CATALOGUE[n] for n in state.accepted]
    for cause in FROM_THE_SAMPLE:
        at = cause.occasion(there, problem.names)
        if at is None or (cause.name, at) in state.looked_at:
            continue
        state = state.looked(cause.name, at)
        found = yield from exchanged(cause.proposals(standing(state, problem)), state, problem)
        if found is not None:
            return found
    mine = frozenset(n for n in state.accepted if n in LINEAR)
    if not 1 <= len(mine) <= 2 or ("", mine) in state.looked_at:
        return state
    state = state.looked("", mine)
    return (yield from _regrouped(state, problem)) or state


def exchanged(groups: Iterable[Sequence[Proposal]], state: State, problem: Problem) -> Exchange:
    """The first of the groups of which one is worth it: the best of that group, by the misfit and what numbers are worth."""
    present = state.fit.chi2
    for group in groups:
        best: tuple[Fit, Proposal] | None = None
        for proposal in group:
            beaten = present if best is None else best[0].chi2 - best[1].most_chi2
            wanted = beaten + proposal.most_chi2
            trial = refitted(state, problem, proposal.model, wanted)
            is_sound = trial.chi2 < wanted and _is_sound(proposal, trial, state.setting)
            step = _step(proposal.says, proposal.gone, proposal.come, present - trial.chi2, present - wanted, is_sound)
            yield step
            if step.is_taken:
                best = trial, proposal
        if best is not None:
            trial, proposal = best
            kept = (n for n in state.accepted if n not in proposal.gone)
            return state.at(trial, accepted=(*kept, *proposal.come))
    return None


def _step(
    says: str, gone: Sequence[str], come: Sequence[str], gained: float, wanted: float, is_sound: bool
) -> Exchanged:
    step = Exchanged(says, tuple(gone), tuple(come), gained, wanted, is_sound, is_taken=False)
    return replace(step, is_taken=is_taken(step))


def _is_sound(proposal: Proposal, trial: Fit, setting: Setting) -> bool:
    if proposal.is_sound is not None:
        return proposal.is_sound(trial)
    return all(is_plausible(trial.model, n, setting) for n in proposal.come)


def _in_other_forms(state: State, problem: Problem) -> Steps:
    """Causes in other forms that fit clearly better: each was chosen beside others that the model lacked."""
    rules, symbols = problem.rules, {n: state.model.of(n) for n in state.accepted}
    for name in state.accepted:
        cause = CATALOGUE[name]
        for form in cause.other_forms(symbols[name], cause.terms(state.setting)):
            present = state.fit.chi2
            least = rules.floor_chi2 + rules.price(len(form)) - rules.price(len(state.model.of(name)))
            trial = refitted(state, problem, state.model.without(name).with_terms(form), present - least)
            gained = present - trial.chi2
            is_sound = gained > least and is_plausible(trial.model, name, state.setting)
            step = _step(f"{name} in another form", (), (), gained, least, is_sound)
            yield step
            if step.is_taken:
                state = state.at(trial)
    return state


def _regrouped(state: State, problem: Problem) -> Exchange:
    """The accepted linear causes exchanged for another one or two of them, where that fits clearly better: one by one they
    are taken in the order of their gain, and the first may have stood for two others.
    """
    rules, noise, setting, current = problem.rules, problem.noise, state.setting, state.fit
    mine = tuple(n for n in state.accepted if n in LINEAR)
    bare = state.model
    for name in mine:
        bare = bare.without(name)
    without = fit(bare, state.record, state.layout, noise, tolerance=1.0)
    linear = [n for n in LINEAR if n in problem.names]
    screening = screen(without.model, state.record, state.layout, noise, setting, linear)
    price = {n: rules.price(s.numbers) for n, s in screening.scores.items()}
    material = material_chi2(state, problem)
    explained = without.chi2 - current.chi2
    wanted = current.chi2 + sum(price[n] for n in mine if n in price) - rules.floor_chi2
    for net, group in _promised(screening, mine)[: rules.regrouped]:
        # one cause more has to gain what it would have to beside the others
        least = rules.rigid_guard * explained if len(group) > len(mine) else 0.0
        if without.chi2 - rules.hopeful * net > wanted - least:
            continue
        terms = [t for n in group for t in screening.scores[n].form]
        to_beat = wanted - least - sum(price[n] for n in group)
        trial, there = refitted(state, problem, without.model.with_terms(terms), to_beat), setting
        if to_beat < trial.chi2 < to_beat + rules.nearly_share * explained:
            trial, there = with_closer_paths(trial, setting, noise, to_beat)
        is_sound = all(
            is_plausible(trial.model, n, there)
            and loss_without(trial, n) > max(rules.required_chi2(screening.scores[n].numbers), material)
            for n in group
        )
        says = f"instead of {'+'.join(mine)} {'+'.join(group)}"
        step = _step(says, mine, group, current.chi2 - trial.chi2, current.chi2 - to_beat, is_sound)
        yield step
        if step.is_taken:
            kept = (n for n in state.accepted if n not in mine)
            return state.at(trial, accepted=(*kept, *group), setting=there)
    return None


def _promised(screening: Screening, mine: Sequence[str]) -> list[tuple[float, tuple[str, ...]]]:
    """Groups of one or two linear causes by what they promise. What merely joins the accepted ones was tried, and guarded, on the way."""
    groups = [
        g
        for size in (1, 2)
        for g in itertools.combinations(screening.scores, size)
        if not set(mine) <= set(g) and not (size == 2 and between(*g).is_same_order)
    ]
    return sorted(((joint_net(screening, g), g) for g in groups), key=lambda x: -x[0])


def with_closer_paths(trial: Fit, setting: Setting, noise: Noise, wanted_chi2: float) -> tuple[Fit, Setting]:
    """The fit with closer time constants where second paths act, and its dictionaries: on the first ones a bar, or a sheet of iron,
    leaves some thousandths of its gain.
    """
    model, there = with_closer_branches(trial.model, setting)
    if there is setting:
        return trial, setting
    closer = fit(model, setting.record, there.layout, noise, wanted_chi2=wanted_chi2)
    return (closer, there) if closer.chi2 < trial.chi2 else (trial, setting)
