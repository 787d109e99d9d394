"""Forward steps, backward deletion and exchanges, on one record: from no cause to the accepted ones.

Each accepted effect enters with its full shape dictionary (splines, stop operators, rotor branches), so a later step
never has to mend the shape of an earlier one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from commissioner.diagnose.causes import CATALOGUE, FROM_THE_SAMPLE, LINEAR, LINES, Setting
from commissioner.diagnose.causes.cause import Standing
from commissioner.diagnose.causes.mains_lines import with_clearer_lines
from commissioner.diagnose.causes.regressors import FINE_SPEED_SPLINE
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.impedance import impedance_starts
from commissioner.diagnose.plant.model import Layout
from commissioner.diagnose.rules import RULES
from commissioner.diagnose.search.acceptance import effects_of, guard, is_plausible, losses_of, meets_tones
from commissioner.diagnose.search.dictionaries import following, with_closer_radii, with_faster_speed, with_finer_curves
from commissioner.diagnose.search.exchanges import (
    Exchanged,
    begun_outright,
    in_other_forms,
    proposed,
    proposers,
    regrouped,
)
from commissioner.diagnose.search.nominal import is_outside_the_box, with_flux_before
from commissioner.diagnose.search.refinement import leakage_side
from commissioner.diagnose.search.screening import Score, Screening, screen

CARRIED_ROUNDS = 3
"""Times that what the iron remembers is told anew by a better model."""

Report = Callable[[str], None]


def surely_left(fitted: Fit, noise: Noise) -> float:
    """Power that is not explained, over the noise's, of which a noise measured too low makes none."""
    return fitted.chi2 / float(fitted.normal.count.sum()) - 1.0 - RULES.noise_doubt * noise.uncertainty


@dataclass(frozen=True)
class RuledOut:
    """A cause that was ruled out by what was measured, and the chi2 it would take: so much is real, and it is not that cause's."""

    name: str = ""
    chi2: float = 0.0


class Steps:
    """One record (the first part of every segment of `full`, or all of it), one dictionary; remembers what was tried."""

    def __init__(
        self,
        setting: Setting,
        noise: Noise,
        names: Sequence[str],
        report: Report,
        full: Record,
        go_on: Callable[[], bool],
    ) -> None:
        self.setting, self.noise = setting, noise
        self.names, self.report, self.full, self.go_on = names, report, full, go_on
        self.below: dict[str, float] = {}
        self.implausible: list[str] = []
        self.kept_of_ruled_out: dict[str, float] = {}
        self.ruled_out = RuledOut()
        self.regrouped: set[frozenset[str]] = set()
        self.reformed: set[frozenset[str]] = set()
        self.proposed: set[tuple[str, frozenset[str]]] = set()
        self.looks = 0
        self.leakage_side: frozenset[str] = frozenset()
        self.tried: tuple[Fit | None, dict[str, tuple[Fit, float]]] = (None, {})
        self.ripple_meets_tones = meets_tones(full, setting)
        self.first: Screening | None = None
        self.rms_a = float(np.sqrt(np.mean(np.concatenate([s.currents_a.ravel() for s in self.record.segments]) ** 2)))

    @property
    def record(self) -> Record:
        return self.setting.record

    @property
    def layout(self) -> Layout:
        return self.setting.layout

    def on(self, record: Record) -> Steps:
        """A new search of the whole of another record, with what is known of the machine so far."""
        return Steps(replace(self.setting, record=record), self.noise, self.names, self.report, record, self.go_on)

    def continued(self, setting: Setting) -> Steps:
        """A search of more of the same record: sets of causes that were looked at as a whole are not looked at again."""
        steps = Steps(setting, self.noise, self.names, self.report, self.full, self.go_on)
        steps.regrouped, steps.reformed, steps.leakage_side = self.regrouped, self.reformed, self.leakage_side
        return steps

    @property
    def count(self) -> float:
        """Good samples of all phases."""
        return float(sum(s.good_count for s in self.record.segments) * self.record.facts.phases)

    @property
    def material_chi2(self) -> float:
        """Delta chi2 of a contribution of RULES.material_share of the current's rms, or of what coarse steps may imitate."""
        material = (RULES.material_share * self.rms_a) ** 2 * float(np.mean(self.noise.sigma_a**-2.0))
        return self.count * max(material, RULES.steps_share * self.noise.rounding_share)

    def _guard(self, losses: Mapping[str, float], name: str, unexplained_chi2: float) -> float:
        """What a cause must gain beside others that have these losses, where without it `unexplained_chi2` is left: no more than

        nearly all of that where it is large, for what the form of another cause leaves behind no simple cause takes entirely.
        """
        left = guard(losses, name, ripple_meets_tones=self.ripple_meets_tones)
        return min(left, RULES.entirely_share * unexplained_chi2) if self._is_large(unexplained_chi2) else left

    def _unexplained_chi2(self, fitted: Fit) -> float:
        """Chi2 that is surely not explained."""
        return max(surely_left(fitted, self.noise), 0.0) * self.count

    def _is_large(self, unexplained_chi2: float) -> bool:
        return unexplained_chi2 > RULES.large_rest_sigma**2 * self.count

    def threshold(self, numbers: int) -> float:
        return max(RULES.required_chi2(numbers), self.material_chi2)

    def run(
        self, start: Fit, accepted: tuple[str, ...], *, adds: bool = True
    ) -> tuple[Fit, tuple[str, ...], Screening]:
        """The fit, the accepted causes and the last screening from a start that has some; `adds` False: none is added."""
        current, self.setting = with_finer_curves(start, self.setting, self.noise, self.report)
        refused: set[str] = set()
        idle: set[str] = set()
        while True:
            absent = [n for n in self.names if n not in accepted]
            screening = screen(current.model, self.record, self.layout, self.noise, self.setting, absent)
            self.first = self.first or screening
            is_over = not adds or len(accepted) >= RULES.most_causes or not self.go_on()
            step = None if is_over else self._forward(current, screening, refused)
            if step is None:
                current, accepted, dropped = self._backward(current, accepted, accepted)
                if dropped and not is_over:
                    # what it stood for may have another name
                    idle |= set(dropped)
                    refused |= idle
                    continue
                other = None if is_over else self._exchanged(current, accepted)
                if other is None and not is_over and accepted:
                    clearer = self._with_clearer_lines(current, accepted)
                    faster = clearer or self._with_faster_speed(current, accepted)
                    other = None if faster is None else (faster, accepted, self.setting)
                if other is None:
                    return current, accepted, screening
                current, accepted, self.setting = other
                continue
            name, current = step
            accepted = (*accepted, name)
            self.report(f"accepted {name}: {np.sqrt(current.chi2 / current.normal.count.sum()):.4g} times the noise")
            if (
                len(accepted) == 1 and self._unexplained_chi2(current) > RULES.wrong_valley_sigma**2 * self.count
            ) or is_outside_the_box(current.model, self.layout):
                current = self._from_other_starts(current)
            if any(t.effect == name and t.kind == kinds.NU for t in current.model.terms):
                current, self.leakage_side = (
                    leakage_side(current, self.record, self.layout, self.noise),
                    frozenset(accepted),
                )
            rippled = self._proposed_beside(current, name, accepted)
            if rippled is not None:
                current, accepted, self.setting = rippled
            current = self._with_unequal_legs(current, accepted[:-1])
            current = self.with_new_dictionaries(self.with_new_flux_before(current))
            of = {t.kind for t in CATALOGUE[name].terms(self.setting)}
            current, self.setting = with_finer_curves(current, self.setting, self.noise, self.report, of)
            if kinds.STOP in of:
                current = self._with_carried_memory(current)
                current, self.setting = with_closer_radii(current, self.setting, self.noise, self.report)
                current = self.with_new_flux_before(current)
            current, accepted, dropped = self._backward(current, accepted, accepted[:-1])
            refused = idle | set(dropped)

    def _from_other_starts(self, current: Fit) -> Fit:
        """The best fit of the same causes beside what the impedance at the tones says of the four: dead times of 3.5 and of thirty times

        the noise had left them in a valley without a magnetizing inductance.
        """
        starts = [replace(current.model, nominal=start) for start in impedance_starts(self.record)]
        best = min((current, *(fit(m, self.record, self.layout, self.noise) for m in starts)), key=lambda f: f.chi2)
        if best is not current:
            self.report(f"  the four parameters from another start: gained {current.chi2 - best.chi2:.4g}")
        return best

    def _with_clearer_lines(self, current: Fit, accepted: Sequence[str]) -> Fit | None:
        """The fit where ripple or mains lie at other frequencies than were looked at so far, once the causes are in the model."""
        kept = {kind: name for kind, name in LINES.items() if name in accepted}
        full, lines = with_clearer_lines(self.full, current.model, self.layout, self.noise, self.setting.lines_hz, kept)
        if lines == self.setting.lines_hz or self.looks == RULES.most_looks:
            return None
        self.looks += 1
        self.report(f"  looking at {', '.join(f'{name} ({hz:.2f} Hz)' for name, hz in lines.items())}")
        setting = replace(self.setting, record=self._part_of(full), lines_hz=lines)
        again = fit(current.model, setting.record, self.layout, self.noise) if kept else current
        if not np.isfinite(again.chi2):
            return None
        self.full, self.setting, self.ripple_meets_tones = full, setting, meets_tones(full, setting)
        return again

    def _with_faster_speed(self, current: Fit, accepted: Sequence[str]) -> Fit | None:
        """The fit in which a shaft swings faster, where it does; tried once something is left beside all other causes."""
        is_left = self._unexplained_chi2(current) > self.threshold(1)
        if (
            not current.model.has_kind(kinds.OMEGA)
            or not is_left
            or any(n.startswith(FINE_SPEED_SPLINE) for n in self.record.channel_names)
        ):
            return None
        again, self.full, self.setting = with_faster_speed(current, self.full, self.setting, self.noise, self.report)
        return again if again is not current else None

    def _forward(self, current: Fit, screening: Screening, refused: set[str]) -> tuple[str, Fit] | None:
        """The candidate whose refit gains most, if it passes the rule."""
        ranked = [
            s
            for s in screening.ranked()
            if s.name not in refused and self.implausible.count(s.name) < RULES.most_implausible
        ]
        losses = losses_of(current, effects_of(current.model))
        unexplained_chi2 = self._unexplained_chi2(current)
        guards = {name: self._guard(losses, name, unexplained_chi2) for name in screening.scores}
        least = {name: max(guards[name], self.threshold(score.numbers)) for name, score in screening.scores.items()}
        promising = [
            s
            for s in ranked
            if s.delta_chi2 > max(RULES.promised_share * s.threshold, RULES.hopeless_share * guards[s.name])
        ]
        best = self._outright(current, refused)
        for score in promising[: RULES.refitted]:
            if best is not None and RULES.rival_promise * score.net < best[0]:
                break
            # every number of the effect: how a curve splits between stator and rotor shows only once it bends
            wanted = least[score.name]
            to_beat = wanted if best is None else max(wanted, best[0] + RULES.price(score.numbers))
            trial = self._tried(current, score, current.chi2 - to_beat)
            gain = current.chi2 - trial.chi2
            self.report(f"  try {score.name}: promised {score.delta_chi2:.4g}, gained {gain:.4g}")
            is_sound = is_plausible(trial.model, score.name, self.setting)
            if not is_sound and gain >= wanted:
                equal = self._with_equal_legs(current, score, current.chi2 - to_beat)
                if equal is not None:
                    trial, gain, is_sound = equal, current.chi2 - equal.chi2, True
            if not is_sound:
                self.implausible.append(score.name)
                if CATALOGUE[score.name].is_ruled_out(trial.model, self.record):
                    self.kept_of_ruled_out[score.name] = min(gain / score.delta_chi2, 1.0)
            if gain < wanted or not is_sound:
                if RULES.required_chi2(score.numbers) < gain:
                    self.below[score.name] = gain
                continue
            net = gain - RULES.price(score.numbers)
            if best is None or net > best[0]:
                best = (net, score.name, trial)
        self.ruled_out = self._most_ruled_out(screening, least)
        return (
            None
            if best is None or current.chi2 - best[2].chi2 < self._least_chi2_of_rest(unexplained_chi2)
            else (best[1], best[2])
        )

    def _tried(self, current: Fit, score: Score, wanted_chi2: float) -> Fit:
        """The refit with one more cause; lines looked for meanwhile concern only their own causes. One that was given up is begun again

        only where less is wanted of it.
        """
        known, name = self._known(current), score.name
        last, out_of_reach = known.get(name, (None, -np.inf))
        if last is None or name in LINES.values() or (not last.has_converged and wanted_chi2 > out_of_reach):
            model = current.model.with_terms(score.form)
            last = fit(model, self.record, self.layout, self.noise, wanted_chi2=wanted_chi2)
            known[name] = last, wanted_chi2
        return last

    def _with_equal_legs(self, current: Fit, score: Score, wanted_chi2: float) -> Fit | None:
        """A leg error of the same size in all legs, where that is plausible and unequal ones are not: what legs differ by may be the phases'

        resistances, and makes a curve that bends late.
        """
        form = [t for t in score.form if t.kind != kinds.LEG_SHARE]
        if len(form) == len(score.form):
            return None
        trial = fit(current.model.with_terms(form), self.record, self.layout, self.noise, wanted_chi2=wanted_chi2)
        self.report(f"  {score.name} with equal legs: gained {current.chi2 - trial.chi2:.4g}")
        return trial if trial.chi2 <= wanted_chi2 and is_plausible(trial.model, score.name, self.setting) else None

    def _with_unequal_legs(self, current: Fit, accepted: Sequence[str]) -> Fit:
        """The fit with legs that differ, where they were alike so far and that is plausible beside what was accepted since."""
        for name in accepted:
            shares = [t for t in CATALOGUE[name].terms(self.setting) if t.kind == kinds.LEG_SHARE]
            if shares and not current.model.has_kind(kinds.LEG_SHARE):
                wanted = current.chi2 - RULES.required_chi2(len(shares))
                trial = fit(current.model.with_terms(shares), self.record, self.layout, self.noise, wanted_chi2=wanted)
                if trial.chi2 <= wanted and is_plausible(trial.model, name, self.setting):
                    current = trial
        return current

    def _without(self, current: Fit, name: str, wanted_chi2: float) -> Fit:
        """The refit with one cause less; given up where it cannot reach `wanted_chi2`."""
        known = self._known(current)
        if f"without {name}" not in known:
            less = current.model.without(name)
            known[f"without {name}"] = (
                fit(less, self.record, self.layout, self.noise, wanted_chi2=wanted_chi2),
                wanted_chi2,
            )
        return known[f"without {name}"][0]

    def _known(self, current: Fit) -> dict[str, tuple[Fit, float]]:
        """What was fitted from here already, and the chi2 that was wanted of it: a search that looks again begins where it was."""
        if self.tried[0] is not current:
            self.tried = (current, {})
        return self.tried[1]

    def _most_ruled_out(self, screening: Screening, least: Mapping[str, float]) -> RuledOut:
        """What of the causes that were ruled out would take most, and more than the `least` that it must gain."""
        promised = (
            RuledOut(name, kept * screening.scores[name].delta_chi2)
            for name, kept in self.kept_of_ruled_out.items()
            if name in screening.scores
        )
        beyond = (a for a in promised if a.chi2 > least[a.name])
        return max(beyond, key=lambda a: a.chi2, default=RuledOut())

    def _least_chi2_of_rest(self, unexplained_chi2: float) -> float:
        """What the best candidate must take where much is left: else no cause makes it, and six small causes name nothing."""
        return RULES.least_share_of_rest * max(
            unexplained_chi2 if self._is_large(unexplained_chi2) else 0.0, self.ruled_out.chi2
        )

    def _outright(self, current: Fit, refused: set[str]) -> tuple[float, str, Fit] | None:
        """The best of the causes that no promise shows."""
        found = []
        for cause in (CATALOGUE[n] for n in self.names if n not in refused):
            trial = begun_outright(cause, current, self.setting, self.noise, self.report)
            if trial is not None:
                numbers, gain = len(trial.model.of(cause.name)), current.chi2 - trial.chi2
                if gain >= self.threshold(numbers):
                    found.append((gain - RULES.price(numbers), cause.name, trial))
        return max(found, key=lambda x: x[0], default=None)

    def _standing(self, current: Fit, accepted: tuple[str, ...]) -> Standing:
        samples = float(current.normal.count.sum())
        return Standing(current.model, accepted, self.names, self.setting, samples, RULES)

    def _proposed_beside(self, current: Fit, name: str, accepted: tuple[str, ...]) -> Exchanged | None:
        """What a cause proposes in place of the one that was accepted just now."""
        here = self._standing(current, accepted)
        groups = (group for cause in FROM_THE_SAMPLE for group in cause.in_place_of(name, here))
        return proposed(groups, current, here, self.noise, self.report, more="")

    def _exchanged(self, current: Fit, accepted: tuple[str, ...]) -> Exchanged | None:
        """Causes in other forms, and linear ones for others, that fit clearly better; each set tried once."""
        if frozenset(accepted) not in self.reformed:
            self.reformed.add(frozenset(accepted))
            other_form = in_other_forms(current, accepted, self.setting, self.noise, self.report)
            if other_form is not None:
                return other_form, accepted, self.setting
        for cause, at in proposers(accepted, self.names):
            if (cause.name, at) in self.proposed:
                continue
            self.proposed.add((cause.name, at))
            here = self._standing(current, accepted)
            other = proposed(cause.proposals(here), current, here, self.noise, self.report)
            if other is not None:
                return other
        mine = frozenset(n for n in accepted if n in LINEAR)
        if not 1 <= len(mine) <= 2 or mine in self.regrouped:
            return None
        self.regrouped.add(mine)
        return regrouped(current, accepted, self.setting, self.noise, self.names, self.report, self.threshold)

    def _backward(
        self, current: Fit, accepted: tuple[str, ...], doubted: Sequence[str]
    ) -> tuple[Fit, tuple[str, ...], list[str]]:
        """Drops accepted effects that the later ones have made idle, or a trifle beside them (or turned to the wrong sign)."""
        dropped: list[str] = []
        every = losses_of(current, accepted)
        for name in doubted:
            loss, losses = every[name], {n: x for n, x in every.items() if n != name}
            numbers = sum(1 for t in current.model.terms if t.effect == name)
            wanted = max(self._guard(losses, name, self._unexplained_chi2(current) + loss), self.threshold(numbers))
            # starts that came before the carried flux was right hold its place: only a fit without them tells
            begins = any(t.effect == name and t.kind == kinds.INITIAL_FLUX for t in current.model.terms)
            holds_place = begins and current.model.has_kind(kinds.CARRY)
            is_sound = is_plausible(current.model, name, self.setting)
            if holds_place or loss < RULES.doubted_loss * wanted or not is_sound:
                trial = self._without(current, name, current.chi2 + wanted if is_sound else np.inf)
                is_idle = trial.chi2 - current.chi2 < wanted or not is_sound
                # what was left runs away alone: better an implausible cause than no model
                if is_idle and np.isfinite(trial.chi2):
                    self.report(f"  dropped {name}")
                    current, accepted = trial, tuple(n for n in accepted if n != name)
                    every = losses_of(current, accepted)
                    dropped.append(name)
        return current, accepted, dropped

    def _part_of(self, full: Record) -> Record:
        return full.first(self.record.commanded)

    def with_new_flux_before(self, current: Fit) -> Fit:
        """The flux each segment inherits, by the improved model: a wrong one would pass for remanence."""
        if not current.model.has_kind(kinds.CARRY):
            return current
        full = with_flux_before(self.full, current.model, self.layout)
        record = self._part_of(full)
        old, new = (np.array([s.left_before_wb for s in r.segments]) for r in (self.record, record))
        if not np.isfinite(new).all() or np.abs(new - old).max() < 1e-3 * np.abs(new).max():
            return current
        again = fit(current.model, record, self.layout, self.noise)
        if not np.isfinite(again.chi2):
            return current
        self.full, self.setting = full, replace(self.setting, record=record)
        return again

    def _with_carried_memory(self, current: Fit) -> Fit:
        """The fit in which the iron goes into every segment with what it remembers of the one before, where that is better."""
        if current.model.has_kind(kinds.MEMORY) or not any(s.iron_before_wb is not None for s in self.record.segments):
            return current
        iron = (
            n
            for n in effects_of(current.model)
            if any(t.effect == n and t.kind == kinds.STOP for t in current.model.terms)
        )
        carried = [t for name in iron for t in CATALOGUE[name].exchanged if t.kind == kinds.MEMORY]
        best, full = current, self.full
        for _ in range(CARRIED_ROUNDS):
            model = best.model if best is not current else current.model.with_terms(carried)
            told = with_flux_before(full, model, self.layout)
            trial = fit(
                model, self._part_of(told), self.layout, self.noise, wanted_chi2=current.chi2 - RULES.required_chi2(1)
            )
            if trial.chi2 >= best.chi2:
                break
            best, full = trial, told
        self.report(f"  iron that remembers the segment before: gained {current.chi2 - best.chi2:.4g}")
        if current.chi2 - best.chi2 < RULES.required_chi2(1):
            return current
        self.full, self.setting = full, replace(self.setting, record=self._part_of(full))
        return best

    def with_new_dictionaries(self, current: Fit) -> Fit:
        current, self.setting = following(current, self.setting, self.noise)
        return current
