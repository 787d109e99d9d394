"""What single steps forward do not find: causes begun outright, in other forms, or in place of others that had stood for them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence

from commissioner.diagnose.causes import CATALOGUE, FROM_THE_SAMPLE, LINEAR, Setting, between
from commissioner.diagnose.causes.cause import Cause, Proposal, Standing
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.rules import RULES, Rules
from commissioner.diagnose.search.acceptance import is_plausible, loss_without
from commissioner.diagnose.search.dictionaries import with_closer_branches
from commissioner.diagnose.search.screening import joint_net, screen

Exchanged = tuple[Fit, tuple[str, ...], Setting]
Report = Callable[[str], None]


def begun_outright(cause: Cause, current: Fit, setting: Setting, noise: Noise, report: Report) -> Fit | None:
    """The fit with a cause that no promise shows, from where it says; beside the nominal model only."""
    misfit = current.chi2 / float(current.normal.count.sum())
    if any(t.effect for t in current.model.terms):
        return None
    trials = [
        fit(
            Model(start).with_terms([*current.model.terms, *terms]),
            setting.record,
            setting.layout,
            noise,
            tolerance=1.0,
        )
        for start, terms in cause.outright(misfit, setting)
    ]
    if not trials:
        return None
    best = min(trials, key=lambda f: f.chi2)
    report(f"  try a large {cause.name}: gained {current.chi2 - best.chi2:.4g}")
    return best if is_plausible(best.model, cause.name, setting) else None


def proposed(
    groups: Iterable[Sequence[Proposal]],
    current: Fit,
    here: Standing,
    noise: Noise,
    report: Report,
    more: str = " more",
) -> Exchanged | None:
    """The first of the groups of which one is worth it: the best of that group."""
    setting = here.setting
    for group in groups:
        best: tuple[Fit, Proposal] | None = None
        for proposal in group:
            wanted = current.chi2 + proposal.most_chi2 if best is None else best[0].chi2 - here.rules.floor_chi2
            trial = fit(proposal.model, setting.record, setting.layout, noise, wanted_chi2=wanted)
            report(f"  {proposal.says}: gained {current.chi2 - trial.chi2:.4g}{more}")
            if trial.chi2 < wanted and _is_sound(proposal, trial, setting):
                best = trial, proposal
        if best is not None:
            trial, proposal = best
            return trial, (*(n for n in here.accepted if n not in proposal.gone), *proposal.come), setting
    return None


def _is_sound(proposal: Proposal, trial: Fit, setting: Setting) -> bool:
    if proposal.is_sound is not None:
        return proposal.is_sound(trial)
    return all(is_plausible(trial.model, n, setting) for n in proposal.come)


def proposers(accepted: Sequence[str], names: Sequence[str]) -> list[tuple[Cause, frozenset[str]]]:
    """Causes that may propose others beside these, each with the set that it looks at once."""
    there = [CATALOGUE[n] for n in accepted]
    return [(c, at) for c in FROM_THE_SAMPLE if (at := c.occasion(there, names)) is not None]


def in_other_forms(
    current: Fit, accepted: Sequence[str], setting: Setting, noise: Noise, report: Report, rules: Rules = RULES
) -> Fit | None:
    """The fit with causes in other forms of theirs that fit clearly better: each was chosen beside others that the model lacked."""
    best = current
    for name in accepted:
        symbols = current.model.of(name)
        for form in CATALOGUE[name].other_forms(symbols, CATALOGUE[name].terms(setting)):
            wanted = best.chi2 - rules.floor_chi2 - rules.price(len(form)) + rules.price(len(best.model.of(name)))
            trial = fit(
                best.model.without(name).with_terms(form), setting.record, setting.layout, noise, wanted_chi2=wanted
            )
            report(f"  {name} in another form: gained {best.chi2 - trial.chi2:.4g}")
            if trial.chi2 <= wanted and is_plausible(trial.model, name, setting):
                best = trial
    return None if best is current else best


def regrouped(
    current: Fit,
    accepted: tuple[str, ...],
    setting: Setting,
    noise: Noise,
    names: Sequence[str],
    report: Report,
    threshold: Callable[[int], float],
    rules: Rules = RULES,
) -> Exchanged | None:
    """The accepted linear causes exchanged for another one or two of them, where that fits clearly better: one by one they

    are taken in the order of their gain, and the first may have stood for two others.
    """
    mine = tuple(n for n in accepted if n in LINEAR)
    record, layout = setting.record, setting.layout
    bare = current.model
    for name in mine:
        bare = bare.without(name)
    without = fit(bare, record, layout, noise, tolerance=1.0)
    screening = screen(without.model, record, layout, noise, setting, [n for n in LINEAR if n in names])
    # what merely joins the accepted ones has been tried, and guarded, on the way forward
    groups = [
        g
        for size in (1, 2)
        for g in itertools.combinations(screening.scores, size)
        if not set(mine) <= set(g) and not (size == 2 and between(*g).is_same_order)
    ]
    promised = sorted(((joint_net(screening, g), g) for g in groups), key=lambda x: -x[0])
    price = {n: rules.price(s.numbers) for n, s in screening.scores.items()}
    wanted = current.chi2 + sum(price[n] for n in mine if n in price) - rules.floor_chi2
    for net, group in promised[: rules.regrouped]:
        # one cause more has to gain what it would have to beside the others
        least = rules.rigid_guard * (without.chi2 - current.chi2) if len(group) > len(mine) else 0.0
        if without.chi2 - rules.hopeful * net > wanted - least:
            continue
        terms = [t for n in group for t in screening.scores[n].form]
        to_beat = wanted - least - sum(price[n] for n in group)
        trial, there = fit(without.model.with_terms(terms), record, layout, noise, wanted_chi2=to_beat), setting
        if to_beat < trial.chi2 < to_beat + rules.nearly_share * (without.chi2 - current.chi2):
            trial, there = with_closer_paths(trial, setting, noise, to_beat)
        is_sound = all(
            is_plausible(trial.model, n, there) and loss_without(trial, n) > threshold(screening.scores[n].numbers)
            for n in group
        )
        report(f"  instead of {'+'.join(mine)} {'+'.join(group)}: gained {current.chi2 - trial.chi2:.4g} more")
        if trial.chi2 < to_beat and is_sound:
            return trial, (*(n for n in accepted if n not in mine), *group), there
    return None


def with_closer_paths(trial: Fit, setting: Setting, noise: Noise, wanted_chi2: float) -> tuple[Fit, Setting]:
    """The fit with closer time constants where second paths act, and its dictionaries: on the first ones a bar, or a sheet of iron,

    leaves some thousandths of its gain.
    """
    model, there = with_closer_branches(trial.model, setting)
    if there is setting:
        return trial, setting
    closer = fit(model, setting.record, there.layout, noise, wanted_chi2=wanted_chi2)
    return (closer, there) if closer.chi2 < trial.chi2 else (trial, setting)
