"""What single steps forward do not find: large delays, and linear causes that had stood for others."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from commissioner.diagnose.catalogue import CATALOGUE, Setting
from commissioner.diagnose.catalogue.magnetics import EDGE
from commissioner.diagnose.catalogue.sensing import EARLY
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.search.acceptance import (
    LINEAR,
    RIGID_GUARD,
    SAME_ORDER,
    effects_of,
    is_plausible,
    loss_without,
)
from commissioner.diagnose.search.dictionaries import with_closer_branches
from commissioner.diagnose.search.nominal import impedance_starts
from commissioner.diagnose.search.screening import STATISTICAL_FLOOR, joint_net, price, required_chi2, screen

LATE = ("sampling_delay", "sensor_lag", "cable_capacitance")
REGROUPED, HOPEFUL = 4, 1.3
"""Groups refitted at most; and the factor by which a refit may gain more than promised."""
SAME_STEP = 0.03
"""Of conductance times period: a capacitance so near is the conductance's own."""
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
        terms = [t for n in group for t in CATALOGUE[n].forms(CATALOGUE[n].terms(setting))[0]]
        share = {"lag": 0.7 if len(group) > 1 else 1.0, "delay": 0.3}
        started = model.with_terms(
            [replace(t, start=share[t.symbol] * late) if t.symbol in share else t for t in terms]
        )
        wanted = current.chi2 + cost - sum(required_chi2(sum(t.effect == n for t in terms)) for n in group)
        wanted -= STATISTICAL_FLOOR if len(group) == len(mine) else 0.0
        trial = fit(started, setting.record, setting.layout, noise, wanted_chi2=wanted)
        report(f"  instead of {'+'.join(mine)} {'+'.join(group)}: gained {current.chi2 - trial.chi2:.4g} more")
        if trial.chi2 < wanted and all(is_plausible(trial.model, n, setting) for n in group):
            return trial, (*(n for n in accepted if n not in mine), *group), setting
    return None


def as_rippled(
    current: Fit,
    name: str,
    accepted: tuple[str, ...],
    setting: Setting,
    noise: Noise,
    names: Sequence[str],
    report: Report,
) -> Exchanged | None:
    """A lag that sees the switching's ripple in place of the delay or the smooth lag that imitates it: at zero nothing promises one."""
    if name not in LATE or "sensor_lag" not in names or (name != "sensor_lag" and "sensor_lag" in accepted):
        return None
    entry = CATALOGUE["sensor_lag"]
    form = entry.forms(entry.terms(setting))[-1]
    numbers = len(form) - sum(t.effect == name for t in current.model.terms)
    wanted = current.chi2 - required_chi2(max(numbers, 0))
    trial = fit(current.model.without(name).with_terms(form), setting.record, setting.layout, noise, wanted_chi2=wanted)
    report(f"  a lag that sees the ripple in place of {name}: gained {current.chi2 - trial.chi2:.4g}")
    if trial.chi2 > wanted:
        return None
    return trial, (*(n for n in accepted if n != name), "sensor_lag"), setting


def as_a_delay(
    current: Fit, accepted: tuple[str, ...], setting: Setting, noise: Noise, names: Sequence[str], report: Report
) -> Exchanged | None:
    """A delay, one number, in place of a lag and its shape where it is as good by Schwarz' criterion: in the end a filter of any order is one."""
    lag = current.model.of("sensor_lag")
    if not lag.get("shape") or lag.get("rippled") or "sampling_delay" in accepted or "sampling_delay" not in names:
        return None
    delay = replace(CATALOGUE["sampling_delay"].terms(setting)[0], start=lag["lag"])
    wanted = current.chi2 + float(np.log(current.normal.count.sum()))
    trial = fit(
        current.model.without("sensor_lag").with_terms([delay]),
        setting.record,
        setting.layout,
        noise,
        wanted_chi2=wanted,
    )
    report(f"  instead of sensor_lag and its shape sampling_delay: gained {current.chi2 - trial.chi2:.4g} more")
    if trial.chi2 > wanted:
        return None
    return trial, (*(n for n in accepted if n != "sensor_lag"), "sampling_delay"), setting


def as_read_late(
    current: Fit, accepted: tuple[str, ...], setting: Setting, noise: Noise, names: Sequence[str], report: Report
) -> Exchanged | None:
    """A current that is read after its instant, or a conductance's that shows the step of that instant, in place of what imitates it.

    After d seconds the current has taken d / L_sigma of the new voltage: a conductance g of that size and a capacitance g T, or a clock
    that makes up for some of it. A conductance whose current at an instant is that of the new voltage has the capacitance g T too.
    """
    loss = current.model.of("iron_loss")
    if loss.get("conductance", 0.0) <= 0.0 or EDGE.symbol in loss or "sampling_delay" in accepted:
        return None
    beside = [n for n in ("clock_drift", "cable_capacitance") if n in accepted]
    for gone in dict.fromkeys((tuple(beside), tuple(beside[1:]))):
        found = _read_late_without(gone, current, setting, noise, "sampling_delay" in names, report)
        if found is not None:
            kept = [n for n in accepted if n not in gone and n in effects_of(found.model)]
            late = ["sampling_delay"] if "sampling_delay" in effects_of(found.model) else []
            return found, (*kept, *late), setting
    return None


def _read_late_without(
    gone: Sequence[str], current: Fit, setting: Setting, noise: Noise, may_be_late: bool, report: Report
) -> Fit | None:
    """The better of both readings without the causes `gone`, if it loses no more than they would have to gain."""
    bare, record, layout = current.model, setting.record, setting.layout
    for name in gone:
        bare = bare.without(name)
    saved = len(current.model.terms) - len(bare.terms)
    wanted = current.chi2 + (required_chi2(saved) if gone else -STATISTICAL_FLOOR)
    best = None
    if gone:
        period = setting.facts.sample_period_s
        shown = bare.with_terms([replace(EDGE, start=bare.total(kinds.IRON_LOSS) * period)])
        trial = fit(shown, record, layout, noise, wanted_chi2=wanted)
        report(
            f"  iron_loss that shows its instant's voltage in place of {'+'.join(gone)}: gained {current.chi2 - trial.chi2:.4g} more"
        )
        best = trial if trial.chi2 < wanted and _is_its_own(trial, period) else None
    if may_be_late:
        to_beat = wanted if best is None else best.chi2 - STATISTICAL_FLOOR
        late = fit(read_late(bare, bare.nominal[2]), record, layout, noise, wanted_chi2=to_beat)
        report(
            f"  a current that is read late in place of {'+'.join(('iron_loss', *gone))}: gained {current.chi2 - late.chi2:.4g} more"
        )
        if late.chi2 < to_beat and late.model.of("sampling_delay")[EARLY.symbol] < 0.0:
            return late
    return best


def read_late(model: Model, l_sigma: float) -> Model:
    """The model that begins with a current read so late as makes what its iron loss does."""
    start = max(-model.total(kinds.IRON_LOSS) * l_sigma, EARLY.lower)
    return model.without("iron_loss").with_terms([replace(EARLY, start=start)])


def _is_its_own(fitted: Fit, period_s: float) -> bool:
    """Whether the charge per volt of a step is what the iron's conductance draws in a period, as far as the data tell."""
    edge = fitted.model.of("iron_loss")[EDGE.symbol]
    _, information = fitted.information_of("iron_loss", EDGE.symbol)
    spread = EDGE.step / float(np.sqrt(max(information[0, 0], 1e-300)))
    charge = fitted.model.total(kinds.IRON_LOSS) * period_s
    return abs(edge - charge) < SAME_STEP * charge + 3.0 * spread


def in_other_forms(current: Fit, accepted: Sequence[str], setting: Setting, noise: Noise, report: Report) -> Fit | None:
    """The fit with causes in other forms of theirs that fit clearly better: each was chosen beside others that the model lacked."""
    best = current
    for name in accepted:
        symbols = current.model.of(name)
        for form in CATALOGUE[name].other_forms(symbols, CATALOGUE[name].terms(setting)):
            wanted = best.chi2 - STATISTICAL_FLOOR - price(len(form)) + price(len(best.model.of(name)))
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
        if not set(mine) <= set(g) and set(g) != SAME_ORDER
    ]
    promised = sorted(((joint_net(screening, g), g) for g in groups), key=lambda x: -x[0])
    wanted = (
        current.chi2
        + sum(price(screening.scores[n].numbers) for n in mine if n in screening.scores)
        - STATISTICAL_FLOOR
    )
    for net, group in promised[:REGROUPED]:
        # one cause more has to gain what it would have to beside the others
        least = RIGID_GUARD * (without.chi2 - current.chi2) if len(group) > len(mine) else 0.0
        if without.chi2 - HOPEFUL * net > wanted - least:
            continue
        numbers = sum(price(screening.scores[n].numbers) for n in group)
        terms = [t for n in group for t in screening.scores[n].form]
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
