"""Forward steps, backward deletion and exchanges, on one record: from no cause to the accepted ones.

Each accepted effect enters with its full shape dictionary (splines, stop operators, rotor branches), so a later step
never has to mend the shape of an earlier one.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from commissioner.diagnose import kinds
from commissioner.diagnose.channels import with_clearer_lines
from commissioner.diagnose.effects import CATALOGUE, Setting
from commissioner.diagnose.fit import Fit, fit
from commissioner.diagnose.guards import (
    LINEAR,
    SAME_ORDER,
    effects_of,
    guard,
    is_plausible,
    loss_without,
    losses_of,
    meets_tones,
)
from commissioner.diagnose.model import Layout, Model, even_vectors, odd_vectors, with_halved_intervals
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.nominal import (
    BRANCH_TIME_S,
    impedance_starts,
    largest_fluxes,
    leak_ratio,
    with_flux_before,
    with_ranges,
)
from commissioner.diagnose.record import Record
from commissioner.diagnose.screen import STATISTICAL_FLOOR, Screening, joint_net, price, required_chi2, screen
from commissioner.diagnose.settle import closer_branches, placed, without_curves

MOST_CAUSES = 6
MATERIAL_SHARE = 1e-4
"""A cause must move the current by this share of its rms (-80 dB), else it is listed as below materiality."""
REFITTED = 4
IMPLAUSIBLE = 2
"""A candidate whose refit came out implausible so often is not refitted again."""
RIVAL = 2.5
"""A candidate is refitted only if this multiple of its promise reaches the best gain so far."""
HOPELESS = 0.4
"""A candidate that promises less than this share of what its guard wants is not refitted."""
CURVES = {
    kinds.IRON_CURVE: ("iron_vectors", even_vectors), kinds.LEAKAGE_CURVE: ("leak_vectors", even_vectors),
    kinds.LEGS_LINK: ("legs_vectors", odd_vectors), kinds.LEGS: ("legs_vectors", odd_vectors),
}
MOST_KNOTS = 25
LINES = {"ripple": "dc_link_ripple", "mains": "mains_pickup"}
LATE = ("sampling_delay", "sensor_lag", "cable_capacitance")
REGROUPED, HOPEFUL = 4, 1.3
"""Groups refitted at most; and the factor by which a refit may gain more than promised."""
LARGE_MISFIT, LARGE_DELAYS = 9.0, (0.7, 1.5, 2.5)
SAME_RATIO = 0.05
"""L_sigma over L_M is taken anew where it has moved by more than this part of itself."""
STEPS_GUARD = 2e-2
"""As GUARD, of the power of coarse converter steps, which repeat with the signal and look a little like anything."""
LARGE_REST, CRUMB = 0.3, 0.08
"""A rest above this multiple of the noise of which the best candidate takes less than this share is left as it is."""

Report = Callable[[str], None]


class Steps:
    """One record (the first part of every segment of `full`, or all of it), one dictionary; remembers what was tried."""

    def __init__(
        self, record: Record, layout: Layout, setting: Setting, noise: Noise, names: Sequence[str], report: Report,
        full: Record, go_on: Callable[[], bool],
    ) -> None:
        self.record, self.layout, self.setting, self.noise = record, layout, setting, noise
        self.names, self.report, self.full, self.go_on = names, report, full, go_on
        self.below: list[str] = []
        self.implausible: list[str] = []
        self.regrouped: set[frozenset[str]] = set()
        self.lagging: set[frozenset[str]] = set()
        self.ripple_meets_tones = meets_tones(full, setting)
        self.first: Screening | None = None
        self.rms_a = float(np.sqrt(np.mean(np.concatenate([s.currents_a.ravel() for s in record.segments]) ** 2)))

    def on(self, record: Record) -> Steps:
        """A new search of the whole of another record, with what is known of the machine so far."""
        setting = replace(self.setting, record=record)
        return Steps(record, self.layout, setting, self.noise, self.names, self.report, record, self.go_on)

    @property
    def material_chi2(self) -> float:
        """Delta chi2 of a contribution of MATERIAL_SHARE of the current's rms, or of what coarse steps may imitate."""
        count = sum(s.count for s in self.record.segments) * self.record.facts.phases
        material = (MATERIAL_SHARE * self.rms_a) ** 2 * float(np.mean(self.noise.sigma_a**-2.0))
        return float(count * max(material, STEPS_GUARD * self.noise.rounding_share))

    def _guard(self, losses: Mapping[str, float], name: str) -> float:
        return guard(losses, name, ripple_meets_tones=self.ripple_meets_tones)

    def threshold(self, numbers: int) -> float:
        return max(required_chi2(numbers), self.material_chi2)

    def run(self, start: Fit, accepted: tuple[str, ...]) -> tuple[Fit, tuple[str, ...], Screening]:
        current = self._with_finer_curves(start)
        refused: set[str] = set()
        while True:
            absent = [n for n in self.names if n not in accepted]
            screening = screen(current.model, self.record, self.layout, self.noise, self.setting, absent)
            self.first = self.first or screening
            is_over = len(accepted) >= MOST_CAUSES or not self.go_on()
            step = None if is_over else self._forward(current, screening, refused)
            if step is None:
                current, accepted, _ = self._backward(current, accepted, accepted)
                other = None if is_over else self._regrouped(current, accepted)
                if other is None and not is_over and accepted and self._shows_clearer_lines(current, accepted):
                    continue
                if other is None:
                    return current, accepted, screening
                current, accepted = other
                continue
            name, current = step
            accepted = (*accepted, name)
            self.report(f"accepted {name}: {np.sqrt(current.chi2 / current.normal.count.sum()):.4g} times the noise")
            if any(t.effect == name and t.kind == kinds.NU for t in current.model.terms):
                current = placed(current, self.record, self.layout, self.noise)
            current = self.relayout(self.with_new_flux_before(current))
            current = self._with_finer_curves(current, {t.kind for t in CATALOGUE[name].terms(self.setting)})
            current, accepted, dropped = self._backward(current, accepted, accepted[:-1])
            refused = set(dropped)

    def _shows_clearer_lines(self, current: Fit, accepted: Sequence[str]) -> bool:
        """Whether the model with the accepted causes shows ripple or mains at frequencies that were not looked at yet."""
        kept = [kind for kind, name in LINES.items() if name in accepted]
        full, lines = with_clearer_lines(self.full, current.model, self.layout, self.noise, self.setting.lines_hz, kept)
        if lines == self.setting.lines_hz:
            return False
        self.report(f"  looking at {', '.join(f'{name} ({hz:.2f} Hz)' for name, hz in lines.items())}")
        whole = self.record is self.full
        self.full = full
        self.record = full if whole else full.subset(tuple(range(len(full.segments))), max(s.count for s in self.record.segments))
        self.setting = replace(self.setting, record=self.record, lines_hz=lines)
        self.ripple_meets_tones = meets_tones(full, self.setting)
        return True

    def _forward(self, current: Fit, screening: Screening, refused: set[str]) -> tuple[str, Fit] | None:
        """The candidate whose refit gains most, if it passes the rule."""
        ranked = [
            s for s in screening.ranked() if s.name not in refused and self.implausible.count(s.name) < IMPLAUSIBLE
        ]
        losses = losses_of(current, effects_of(current.model))
        promising = [
            s for s in ranked if s.delta_chi2 > max(0.7 * s.threshold, HOPELESS * self._guard(losses, s.name))
        ]
        best = self._large_delay(current, refused)
        for score in promising[:REFITTED]:
            if best is not None and RIVAL * score.net < best[0]:
                break
            # every number of the effect: how a curve splits between stator and rotor shows only once it bends
            wanted = max(self._guard(losses, score.name), self.threshold(score.numbers))
            to_beat = wanted if best is None else max(wanted, best[0] + price(score.numbers))
            trial = fit(
                current.model.with_terms(CATALOGUE[score.name].terms(self.setting)), self.record, self.layout, self.noise,
                wanted_chi2=current.chi2 - to_beat,
            )
            gain = current.chi2 - trial.chi2
            self.report(f"  try {score.name}: promised {score.delta_chi2:.4g}, gained {gain:.4g}")
            is_plausible = self._is_plausible(trial.model, score.name)
            if not is_plausible:
                self.implausible.append(score.name)
            if gain < wanted or not is_plausible:
                if required_chi2(score.numbers) < gain:
                    self.below.append(score.name)
                continue
            net = gain - price(score.numbers)
            if best is None or net > best[0]:
                best = (net, score.name, trial)
        return None if best is None or self._is_crumb(current, best[2]) else (best[1], best[2])

    def _is_crumb(self, current: Fit, trial: Fit) -> bool:
        """Whether the best candidate takes but a crumb of a large rest: then no cause makes it, and six crumbs name nothing."""
        rest = current.chi2 - float(current.normal.count.sum())
        is_large = rest > LARGE_REST**2 * float(current.normal.count.sum())
        return is_large and current.chi2 - trial.chi2 < CRUMB * rest

    def _regrouped(self, current: Fit, accepted: tuple[str, ...]) -> tuple[Fit, tuple[str, ...]] | None:
        """The accepted linear causes exchanged for another one or two of them, where that fits clearly better: one by one

        they are taken in the order of their gain, and the first may have stood for two others.
        """
        lagging = self._as_a_lag(current, accepted)
        if lagging is not None:
            return lagging
        mine = tuple(n for n in accepted if n in LINEAR)
        if not 1 <= len(mine) <= 2 or frozenset(mine) in self.regrouped:
            return None
        self.regrouped.add(frozenset(mine))
        bare = current.model
        for name in mine:
            bare = bare.without(name)
        without = fit(bare, self.record, self.layout, self.noise, tolerance=1.0)
        pool = [n for n in LINEAR if n in self.names]
        screening = screen(without.model, self.record, self.layout, self.noise, self.setting, pool)
        # what merely joins the accepted ones has been tried, and guarded, on the way forward
        groups = [
            g for size in (1, 2) for g in itertools.combinations(screening.scores, size)
            if not set(mine) <= set(g) and set(g) != SAME_ORDER
        ]
        promised = sorted(((joint_net(screening, g), g) for g in groups), key=lambda x: -x[0])
        wanted = current.chi2 + sum(price(screening.scores[n].numbers) for n in mine if n in screening.scores) - STATISTICAL_FLOOR
        for net, group in promised[:REGROUPED]:
            if without.chi2 - HOPEFUL * net > wanted:
                break
            numbers = sum(price(screening.scores[n].numbers) for n in group)
            terms = [t for n in group for t in CATALOGUE[n].terms(self.setting)]
            trial = fit(
                without.model.with_terms(terms), self.record, self.layout, self.noise, wanted_chi2=wanted - numbers
            )
            is_sound = all(
                self._is_plausible(trial.model, n) and loss_without(trial, n) > self.threshold(screening.scores[n].numbers)
                for n in group
            )
            self.report(f"  instead of {'+'.join(mine)} {'+'.join(group)}: gained {current.chi2 - trial.chi2:.4g} more")
            if trial.chi2 + numbers < wanted and is_sound:
                return trial, (*(n for n in accepted if n not in mine), *group)
        return None

    def _as_a_lag(self, current: Fit, accepted: tuple[str, ...]) -> tuple[Fit, tuple[str, ...]] | None:
        """A lag, alone or with a delay, in place of the delay and the cable that imitate it.

        At zero a lag is a delay: that it takes amplitude as well shows in second order only, which nothing promises.
        """
        mine = tuple(n for n in accepted if n in LATE)
        if "cable_capacitance" not in mine or "sensor_lag" not in self.names or frozenset(mine) in self.lagging:
            return None
        self.lagging.add(frozenset(mine))
        model = current.model
        late = sum(model.sum_kind(kind, size)[:count].sum() for kind, size, count in ((kinds.DELAY, 2, 1), (kinds.LAG, 2, 2)))
        late = late or 0.5 * self.record.facts.sample_period_s
        for name in mine:
            model = model.without(name)
        cost = sum(required_chi2(sum(t.effect == n for t in current.model.terms)) for n in mine)
        for group in (("sensor_lag",), ("sampling_delay", "sensor_lag")):
            if not set(group) <= set(self.names):
                continue
            terms = [t for n in group for t in CATALOGUE[n].terms(self.setting)]
            share = {"lag": 0.7 if len(group) > 1 else 1.0, "delay": 0.3}
            started = model.with_terms([replace(t, start=share[t.symbol] * late) if t.symbol in share else t for t in terms])
            wanted = current.chi2 + cost - sum(required_chi2(sum(t.effect == n for t in terms)) for n in group)
            wanted -= STATISTICAL_FLOOR if len(group) == len(mine) else 0.0
            trial = fit(started, self.record, self.layout, self.noise, wanted_chi2=wanted)
            self.report(f"  instead of {'+'.join(mine)} {'+'.join(group)}: gained {current.chi2 - trial.chi2:.4g} more")
            is_sound = all(self._is_plausible(trial.model, n) for n in group)
            if trial.chi2 < wanted and is_sound:
                return trial, (*(n for n in accepted if n not in mine), *group)
        return None

    def _with_finer_curves(self, current: Fit, of: Collection[int] = tuple(CURVES)) -> Fit:
        """Curves of the kinds `of` with a knot between every two, as long as that gains what its numbers cost: iron with a

        sharp knee leaves 1e-3 of its gain on ten intervals.
        """
        for kind, (name, make) in CURVES.items():
            while kind in of and current.model.has_kind(kind) and len(getattr(self.layout, name)) <= MOST_KNOTS:
                vectors = getattr(self.layout, name)
                finer = make(2 * (vectors.shape[1] - 3))
                layout = replace(self.layout, **{name: finer})  # type: ignore[arg-type]
                setting = replace(self.setting, layout=layout)
                model = current.model
                for effect in sorted({t.effect for t in model.terms if t.kind == kind}):
                    known = model.of(effect)
                    weights = np.array([v for t, v in zip(model.terms, model.values, strict=True) if t.effect == effect and t.kind == kind])
                    halved = with_halved_intervals(vectors, weights, finer)
                    fresh = [
                        replace(t, start=float(np.clip(halved[t.index], t.lower, t.upper)) if t.kind == kind else known[t.symbol])
                        for t in CATALOGUE[effect].terms(setting)
                    ]
                    model = model.without(effect).with_terms(fresh)
                wanted = current.chi2 - required_chi2(len(model.terms) - len(current.model.terms))
                trial = fit(model, self.record, layout, self.noise, wanted_chi2=wanted)
                self.report(f"  {name} on twice the knots: gained {current.chi2 - trial.chi2:.4g}")
                if trial.chi2 > wanted:
                    break
                current, self.layout, self.setting = trial, layout, setting
        return current

    def _large_delay(self, current: Fit, refused: set[str]) -> tuple[float, str, Fit] | None:
        """A delay of a sample and more turns the phases so far that no first-order promise shows it: tried outright."""
        terms = CATALOGUE["sampling_delay"].terms(self.setting) if "sampling_delay" in self.names else ()
        misfit = current.chi2 / float(current.normal.count.sum())
        if any(t.effect for t in current.model.terms) or not terms or misfit < LARGE_MISFIT or "sampling_delay" in refused:
            return None
        nuisance = [t for t in current.model.terms if not t.effect]
        trials = []
        for periods in LARGE_DELAYS:
            late = periods * self.record.facts.sample_period_s
            delay = replace(terms[0], start=late)
            for start in impedance_starts(self.record, late):
                model = Model(start).with_terms([*nuisance, delay, *terms[1:]])
                trials.append(fit(model, self.record, self.layout, self.noise, tolerance=1.0))
        best = min(trials, key=lambda f: f.chi2)
        gain = current.chi2 - best.chi2
        self.report(f"  try a large sampling_delay: gained {gain:.4g}")
        if gain < self.threshold(len(terms)) or not self._is_plausible(best.model, "sampling_delay"):
            return None
        return gain - price(len(terms)), "sampling_delay", best

    def _is_plausible(self, model: Model, name: str) -> bool:
        entry = CATALOGUE[name]
        return is_plausible(name, entry.sizes(self.setting, model.of(name)), self.record.facts.current_peak_a)

    def _backward(
        self, current: Fit, accepted: tuple[str, ...], doubted: Sequence[str]
    ) -> tuple[Fit, tuple[str, ...], list[str]]:
        """Drops accepted effects that the later ones have made idle, or a trifle beside them (or turned to the wrong sign)."""
        dropped: list[str] = []
        every = losses_of(current, accepted)
        for name in doubted:
            loss, losses = every[name], {n: x for n, x in every.items() if n != name}
            numbers = sum(1 for t in current.model.terms if t.effect == name)
            wanted = max(self._guard(losses, name), self.threshold(numbers))
            # starts that came before the carried flux was right hold its place: only a fit without them tells
            holds_place = name == "remanence" and current.model.has_kind(kinds.CARRY)
            if holds_place or loss < 10.0 * wanted or not self._is_plausible(current.model, name):
                trial = fit(current.model.without(name), self.record, self.layout, self.noise)
                if trial.chi2 - current.chi2 < wanted or not self._is_plausible(current.model, name):
                    self.report(f"  dropped {name}")
                    current, accepted = trial, tuple(n for n in accepted if n != name)
                    every = losses_of(current, accepted)
                    dropped.append(name)
        return current, accepted, dropped

    def with_new_flux_before(self, current: Fit) -> Fit:
        """The flux each segment inherits, by the improved model: a wrong one would pass for remanence."""
        if not current.model.has_kind(kinds.CARRY):
            return current
        full = with_flux_before(self.full, current.model, self.layout)
        record = full.subset(tuple(range(len(full.segments))), max(s.count for s in self.record.segments))
        old = np.array([s.flux_before_wb for s in self.record.segments])
        new = np.array([s.flux_before_wb for s in record.segments])
        if not np.isfinite(new).all() or np.abs(new - old).max() < 1e-3 * np.abs(new).max():
            return current
        self.full, self.record, self.setting = full, record, replace(self.setting, record=record)
        return fit(current.model, record, self.layout, self.noise)

    def relayout(self, current: Fit) -> Fit:
        """New dictionary ranges where the improved model reaches other fluxes (curves start again from zero), closer time

        constants where a second path acts, and the ratio of the inductances as it is now.
        """
        flux, _ = largest_fluxes(self.record, current.model, self.layout)
        fresh = with_ranges(self.layout, flux, self.record.facts.current_peak_a * current.model.nominal[2])
        iron, leak = fresh.iron_top_wb / self.layout.iron_top_wb, fresh.leak_top_wb / self.layout.leak_top_wb
        fits_range, model = 0.85 < iron < 1.06 and 0.8 < leak < 1.15, current.model
        if fits_range:
            fresh, flux = self.layout, self.setting.iron_flux_wb
        else:
            model = without_curves(model)
        ratio = leak_ratio(model)
        if abs(ratio - self.layout.leak_ratio) > SAME_RATIO * ratio:
            fresh = replace(fresh, leak_ratio=ratio)
        if self.layout.branch_time_s is BRANCH_TIME_S and model.has_kind(kinds.BRANCH):
            fresh = replace(fresh, branch_time_s=closer_branches(model, self.layout.branch_time_s))
        if fresh is self.layout:
            return current
        setting = replace(self.setting, layout=fresh, iron_flux_wb=flux)
        for name in sorted({t.effect for t in model.terms if t.kind == kinds.BRANCH}):
            terms = CATALOGUE[name].terms(setting)
            model = model.with_terms([t for t in terms if t.symbol not in model.of(name)])
        again = fit(model, self.record, fresh, self.noise)
        if not np.isfinite(again.chi2):
            return current
        self.layout, self.setting = fresh, setting
        return again
