"""Forward steps, backward deletion and exchanges, on one record: from no cause to the accepted ones.

Each accepted effect enters with its full shape dictionary (splines, stop operators, rotor branches), so a later step
never has to mend the shape of an earlier one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from commissioner.diagnose.catalogue import CATALOGUE, Setting
from commissioner.diagnose.catalogue.magnetics import CARRIED
from commissioner.diagnose.catalogue.mains_lines import LINES, with_clearer_lines
from commissioner.diagnose.catalogue.regressors import FINE_SPEED_SPLINE
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout
from commissioner.diagnose.search.acceptance import (
    LINEAR,
    MATERIAL_SHARE,
    effects_of,
    guard,
    is_plausible,
    is_ruled_out,
    losses_of,
    meets_tones,
)
from commissioner.diagnose.search.dictionaries import following, with_closer_radii, with_faster_speed, with_finer_curves
from commissioner.diagnose.search.exchanges import (
    LATE,
    Exchanged,
    as_a_delay,
    as_a_lag,
    as_read_late,
    as_rippled,
    in_other_forms,
    large_delay,
    regrouped,
)
from commissioner.diagnose.search.nominal import impedance_starts, is_outside_the_box, with_flux_before
from commissioner.diagnose.search.refinement import leakage_side
from commissioner.diagnose.search.screening import Score, Screening, price, required_chi2, screen

MOST_CAUSES = 6
REFITTED = 4
IMPLAUSIBLE = 2
"""A candidate whose refit came out implausible so often is not refitted again."""
RIVAL = 2.5
"""A candidate is refitted only if this multiple of its promise reaches the best gain so far."""
HOPELESS = 0.4
"""A candidate that promises less than this share of what its guard wants is not refitted."""
CARRIED_ROUNDS = 3
"""Times that what the iron remembers is told anew by a better model."""
MOST_LOOKS = 3
"""Times that lines are looked for again: once they are, what was beside them is known better."""
STEPS_GUARD = 0.5
"""As GUARD, of the power of coarse converter steps that repeat with the signal: where currents creep or rest, most of it lies in
slow changes from segment to segment, as a shaft's motion or a drift does."""
LARGE_UNEXPLAINED, LEAST_SHARE_OF_REST, NOISE_DOUBT = 0.1, 0.15, 2.0
"""Unexplained chi2 above this multiple of the noise, beyond so many standard errors of its power, of which the best candidate takes less than

this share is left as it is; so is what a cause that was ruled out would take."""

WRONG_VALLEY = 1.0
"""Unexplained chi2 above this multiple of the noise, once the first cause is in the model: what it made of the currents may have led the four
parameters out of the box of a motor of this kind."""
ENTIRELY = 0.98
"""Of a large unexplained chi2: a cause that takes so much of it is no part of another's form."""

Report = Callable[[str], None]


def surely_left(fitted: Fit, noise: Noise) -> float:
    """Power that is not explained, over the noise's, of which a noise measured too low makes none."""
    return fitted.chi2 / float(fitted.normal.count.sum()) - 1.0 - NOISE_DOUBT * noise.uncertainty


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
        self.lagging: set[frozenset[str]] = set()
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
        """Delta chi2 of a contribution of MATERIAL_SHARE of the current's rms, or of what coarse steps may imitate."""
        material = (MATERIAL_SHARE * self.rms_a) ** 2 * float(np.mean(self.noise.sigma_a**-2.0))
        return self.count * max(material, STEPS_GUARD * self.noise.rounding_share)

    def _guard(self, losses: Mapping[str, float], name: str, unexplained_chi2: float) -> float:
        """What a cause must gain beside others that have these losses, where without it `unexplained_chi2` is left: no more than

        nearly all of that where it is large, for what the form of another cause leaves behind no simple cause takes entirely.
        """
        left = guard(losses, name, ripple_meets_tones=self.ripple_meets_tones)
        return min(left, ENTIRELY * unexplained_chi2) if self._is_large(unexplained_chi2) else left

    def _unexplained_chi2(self, fitted: Fit) -> float:
        """Chi2 that is surely not explained."""
        return max(surely_left(fitted, self.noise), 0.0) * self.count

    def _is_large(self, unexplained_chi2: float) -> bool:
        return unexplained_chi2 > LARGE_UNEXPLAINED**2 * self.count

    def threshold(self, numbers: int) -> float:
        return max(required_chi2(numbers), self.material_chi2)

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
            is_over = not adds or len(accepted) >= MOST_CAUSES or not self.go_on()
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
                len(accepted) == 1 and self._unexplained_chi2(current) > WRONG_VALLEY**2 * self.count
            ) or is_outside_the_box(current.model, self.layout):
                current = self._from_other_starts(current)
            if any(t.effect == name and t.kind == kinds.NU for t in current.model.terms):
                current, self.leakage_side = (
                    leakage_side(current, self.record, self.layout, self.noise),
                    frozenset(accepted),
                )
            rippled = as_rippled(current, name, accepted, self.setting, self.noise, self.names, self.report)
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
        kept = [kind for kind, name in LINES.items() if name in accepted]
        full, lines = with_clearer_lines(self.full, current.model, self.layout, self.noise, self.setting.lines_hz, kept)
        if lines == self.setting.lines_hz or self.looks == MOST_LOOKS:
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
            "shaft_motion" not in accepted
            or not is_left
            or any(n.startswith(FINE_SPEED_SPLINE) for n in self.record.channel_names)
        ):
            return None
        again, self.full, self.setting = with_faster_speed(current, self.full, self.setting, self.noise, self.report)
        return again if again is not current else None

    def _forward(self, current: Fit, screening: Screening, refused: set[str]) -> tuple[str, Fit] | None:
        """The candidate whose refit gains most, if it passes the rule."""
        ranked = [
            s for s in screening.ranked() if s.name not in refused and self.implausible.count(s.name) < IMPLAUSIBLE
        ]
        losses = losses_of(current, effects_of(current.model))
        unexplained_chi2 = self._unexplained_chi2(current)
        guards = {name: self._guard(losses, name, unexplained_chi2) for name in screening.scores}
        least = {name: max(guards[name], self.threshold(score.numbers)) for name, score in screening.scores.items()}
        promising = [s for s in ranked if s.delta_chi2 > max(0.7 * s.threshold, HOPELESS * guards[s.name])]
        best = None if "sampling_delay" in refused else self._large_delay(current)
        for score in promising[:REFITTED]:
            if best is not None and RIVAL * score.net < best[0]:
                break
            # every number of the effect: how a curve splits between stator and rotor shows only once it bends
            wanted = least[score.name]
            to_beat = wanted if best is None else max(wanted, best[0] + price(score.numbers))
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
                if is_ruled_out(trial.model, score.name, self.record):
                    self.kept_of_ruled_out[score.name] = min(gain / score.delta_chi2, 1.0)
            if gain < wanted or not is_sound:
                if required_chi2(score.numbers) < gain:
                    self.below[score.name] = gain
                continue
            net = gain - price(score.numbers)
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
                wanted = current.chi2 - required_chi2(len(shares))
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
        return LEAST_SHARE_OF_REST * max(
            unexplained_chi2 if self._is_large(unexplained_chi2) else 0.0, self.ruled_out.chi2
        )

    def _large_delay(self, current: Fit) -> tuple[float, str, Fit] | None:
        trial = large_delay(current, self.setting, self.noise, self.report) if "sampling_delay" in self.names else None
        if trial is None:
            return None
        numbers, gain = sum(t.effect == "sampling_delay" for t in trial.model.terms), current.chi2 - trial.chi2
        return (gain - price(numbers), "sampling_delay", trial) if gain >= self.threshold(numbers) else None

    def _exchanged(self, current: Fit, accepted: tuple[str, ...]) -> Exchanged | None:
        """Causes in other forms, and linear ones for others, that fit clearly better; each set tried once."""
        if frozenset(accepted) not in self.reformed:
            self.reformed.add(frozenset(accepted))
            other_form = in_other_forms(current, accepted, self.setting, self.noise, self.report)
            if other_form is not None:
                return other_form, accepted, self.setting
        mine, late = (frozenset(n for n in accepted if n in names) for names in (LINEAR, LATE))
        if "cable_capacitance" in late and "sensor_lag" in self.names and late not in self.lagging:
            self.lagging.add(late)
            other = as_a_lag(current, accepted, self.setting, self.noise, self.names, self.report)
            if other is not None:
                return other
        if late == {"sensor_lag"} and late not in self.lagging:
            self.lagging.add(late)
            other = as_a_delay(current, accepted, self.setting, self.noise, self.names, self.report)
            if other is not None:
                return other
        if "iron_loss" in mine and mine not in self.lagging:
            self.lagging.add(mine)
            other = as_read_late(current, accepted, self.setting, self.noise, self.names, self.report)
            if other is not None:
                return other
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
            holds_place = name == "remanence" and current.model.has_kind(kinds.CARRY)
            is_sound = is_plausible(current.model, name, self.setting)
            if holds_place or loss < 10.0 * wanted or not is_sound:
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
        best, full = current, self.full
        for _ in range(CARRIED_ROUNDS):
            model = best.model if best is not current else current.model.with_terms([CARRIED])
            told = with_flux_before(full, model, self.layout)
            trial = fit(
                model, self._part_of(told), self.layout, self.noise, wanted_chi2=current.chi2 - required_chi2(1)
            )
            if trial.chi2 >= best.chi2:
                break
            best, full = trial, told
        self.report(f"  iron that remembers the segment before: gained {current.chi2 - best.chi2:.4g}")
        if current.chi2 - best.chi2 < required_chi2(1):
            return current
        self.full, self.setting = full, replace(self.setting, record=self._part_of(full))
        return best

    def with_new_dictionaries(self, current: Fit) -> Fit:
        current, self.setting = following(current, self.setting, self.noise)
        return current
