"""What single steps forward do not find: large delays, and linear causes that had stood for others."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

from commissioner.diagnose import kinds
from commissioner.diagnose.dictionaries import with_closer_branches
from commissioner.diagnose.effects import CATALOGUE, Setting
from commissioner.diagnose.fit import Fit, fit
from commissioner.diagnose.guards import LINEAR, RIGID_GUARD, SAME_ORDER, is_plausible, loss_without
from commissioner.diagnose.model import Model
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.nominal import impedance_starts
from commissioner.diagnose.screen import STATISTICAL_FLOOR, joint_net, price, required_chi2, screen

LATE = ("sampling_delay", "sensor_lag", "cable_capacitance")
REGROUPED, HOPEFUL = 4, 1.3
"""Groups refitted at most; and the factor by which a refit may gain more than promised."""
NEARLY = 0.05
"""Of the gain of those in the model: a group that lacks no more may get there with closer time constants."""
LARGE_MISFIT, LARGE_DELAYS = 9.0, (0.7, 1.5, 2.5)

Exchanged = tuple[Fit, tuple[str, ...], Setting]
Report = Callable[[str], None]


def large_delay(current: Fit, setting: Setting, noise: Noise, report: Report) -> Fit | None:
    """A delay of a sample and more turns the phases so far that no first-order promise shows it: tried outright."""
    record, layout = setting.record, setting.layout
    misfit = current.chi2 / float(current.normal.count.sum())
    if any(t.effect for t in current.model.terms) or misfit < LARGE_MISFIT:
        return None
    terms = CATALOGUE["sampling_delay"].terms(setting)
    nuisance = [t for t in current.model.terms if not t.effect]
    trials = []
    for periods in LARGE_DELAYS:
        late = periods * record.facts.sample_period_s
        delay = replace(terms[0], start=late)
        for start in impedance_starts(record, late):
            model = Model(start).with_terms([*nuisance, delay, *terms[1:]])
            trials.append(fit(model, record, layout, noise, tolerance=1.0))
    best = min(trials, key=lambda f: f.chi2)
    report(f"  try a large sampling_delay: gained {current.chi2 - best.chi2:.4g}")
    return best if is_plausible(best.model, "sampling_delay", setting) else None


def as_a_lag(
    current: Fit, accepted: tuple[str, ...], setting: Setting, noise: Noise, names: Sequence[str], report: Report
) -> Exchanged | None:
    """A lag, alone or with a delay, in place of the delay and the cable that imitate it.

    At zero a lag is a delay: that it takes amplitude as well shows in second order only, which nothing promises.
    """
    mine = tuple(n for n in accepted if n in LATE)
    model = current.model
    late = model.total(kinds.DELAY) + model.total(kinds.LAG) or 0.5 * setting.facts.sample_period_s
    for name in mine:
        model = model.without(name)
    cost = sum(required_chi2(sum(t.effect == n for t in current.model.terms)) for n in mine)
    for group in (("sensor_lag",), ("sampling_delay", "sensor_lag")):
        if not set(group) <= set(names):
            continue
        terms = [t for n in group for t in CATALOGUE[n].terms(setting)]
        share = {"lag": 0.7 if len(group) > 1 else 1.0, "delay": 0.3}
        started = model.with_terms([replace(t, start=share[t.symbol] * late) if t.symbol in share else t for t in terms])
        wanted = current.chi2 + cost - sum(required_chi2(sum(t.effect == n for t in terms)) for n in group)
        wanted -= STATISTICAL_FLOOR if len(group) == len(mine) else 0.0
        trial = fit(started, setting.record, setting.layout, noise, wanted_chi2=wanted)
        report(f"  instead of {'+'.join(mine)} {'+'.join(group)}: gained {current.chi2 - trial.chi2:.4g} more")
        if trial.chi2 < wanted and all(is_plausible(trial.model, n, setting) for n in group):
            return trial, (*(n for n in accepted if n not in mine), *group), setting
    return None


def regrouped(
    current: Fit, accepted: tuple[str, ...], setting: Setting, noise: Noise, names: Sequence[str], report: Report,
    threshold: Callable[[int], float],
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
        g for size in (1, 2) for g in itertools.combinations(screening.scores, size)
        if not set(mine) <= set(g) and set(g) != SAME_ORDER
    ]
    promised = sorted(((joint_net(screening, g), g) for g in groups), key=lambda x: -x[0])
    wanted = current.chi2 + sum(price(screening.scores[n].numbers) for n in mine if n in screening.scores) - STATISTICAL_FLOOR
    for net, group in promised[:REGROUPED]:
        # one cause more has to gain what it would have to beside the others
        least = RIGID_GUARD * (without.chi2 - current.chi2) if len(group) > len(mine) else 0.0
        if without.chi2 - HOPEFUL * net > wanted - least:
            continue
        numbers = sum(price(screening.scores[n].numbers) for n in group)
        terms = [t for n in group for t in CATALOGUE[n].terms(setting)]
        to_beat = wanted - least - numbers
        trial, there = fit(without.model.with_terms(terms), record, layout, noise, wanted_chi2=to_beat), setting
        if to_beat < trial.chi2 < to_beat + NEARLY * (without.chi2 - current.chi2):
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
