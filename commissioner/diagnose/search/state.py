"""What a search is about, and where it stands: frozen, so that every step says what it changed."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from commissioner.diagnose.causes import Setting
from commissioner.diagnose.causes.cause import Standing
from commissioner.diagnose.fit.gauss_newton import Fit, fit
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.flux_before import with_flux_before
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.rules import RULES, Rules
from commissioner.diagnose.search.acceptance import losses_of, meets_tones
from commissioner.diagnose.search.journal import Beside, RuledOut, Step
from commissioner.diagnose.search.screening import Screening


@dataclass(frozen=True)
class Problem:
    """What stays: the noise, the causes allowed, and the rules."""

    noise: Noise
    names: tuple[str, ...]
    rules: Rules = RULES


@dataclass(frozen=True)
class State:
    """One record (the first part of every segment of `full`, or all of it), one dictionary, the fit so far; remembers what was tried."""

    setting: Setting
    full: Record
    fit: Fit
    accepted: tuple[str, ...] = ()
    ripple_meets_tones: bool = False
    screening: Screening | None = None
    first: Screening | None = None
    below: Mapping[str, float] = field(default_factory=dict)
    """Causes that would gain, but too little: what they gain in chi2."""
    implausible: tuple[str, ...] = ()
    kept: Mapping[str, float] = field(default_factory=dict)
    """Of causes that were ruled out, the share of their promise that a refit kept."""
    ruled_out: RuledOut = field(default_factory=RuledOut)
    """The strongest of them, and the chi2 it would take."""
    looked_at: frozenset[tuple[str, frozenset[str]]] = frozenset()
    """Sets of causes that were looked at as a whole, and by whom: none is looked at again."""
    looks: int = 0
    leakage_side: frozenset[str] = frozenset()
    known: dict[str, tuple[Fit, float]] = field(default_factory=dict, compare=False)
    """What was fitted from here already, and the chi2 that was wanted of it: a search that looks again begins where it was."""

    @property
    def record(self) -> Record:
        return self.setting.record

    @property
    def layout(self) -> Layout:
        return self.setting.layout

    @property
    def model(self) -> Model:
        return self.fit.model

    @cached_property
    def samples(self) -> float:
        """Good samples of all phases."""
        return float(sum(s.good_count for s in self.record.segments) * self.record.facts.phases)

    @cached_property
    def rms_a(self) -> float:
        return float(np.sqrt(np.mean(np.concatenate([s.currents_a.ravel() for s in self.record.segments]) ** 2)))

    def at(self, fitted: Fit, **changes: object) -> State:
        """The state at another fit."""
        known = self.known if fitted is self.fit else {}
        return replace(self, fit=fitted, known=known, **changes)  # type: ignore[arg-type]

    def on_more(self, setting: Setting) -> State:
        """A search of more of the same record: of what was looked at only the sets of causes stay."""
        looked_at = frozenset(x for x in self.looked_at if x[0] in ("", "forms"))
        fresh = begun(setting, self.full, self.fit, self.accepted)
        return replace(fresh, looked_at=looked_at, leakage_side=self.leakage_side)

    def looked(self, who: str, at: frozenset[str]) -> State:
        return replace(self, looked_at=self.looked_at | {(who, at)})


Steps = Generator[Step, None, State]


def begun(setting: Setting, full: Record, fitted: Fit, accepted: tuple[str, ...] = ()) -> State:
    """A search of which nothing was tried yet."""
    return State(setting, full, fitted, accepted, meets_tones(full, setting))


def material_chi2(state: State, problem: Problem) -> float:
    """Delta chi2 of a contribution of `material_share` of the current's rms, or of what coarse steps may imitate."""
    rules, noise = problem.rules, problem.noise
    material = (rules.material_share * state.rms_a) ** 2 * float(np.mean(noise.sigma_a**-2.0))
    return state.samples * max(material, rules.steps_share * noise.rounding_share)


def surely_left(fitted: Fit, noise: Noise, rules: Rules = RULES) -> float:
    """Power that is not explained, over the noise's, of which a noise measured too low makes none."""
    return fitted.chi2 / float(fitted.normal.count.sum()) - 1.0 - rules.noise_doubt * noise.uncertainty


def rest_chi2(state: State, problem: Problem) -> float:
    """Chi2 that is surely not explained."""
    return max(surely_left(state.fit, problem.noise, problem.rules), 0.0) * state.samples


def beside(state: State, problem: Problem, names: Sequence[str]) -> Beside:
    """What is known of these causes when others are judged beside them."""
    return Beside(
        losses_of(state.fit, names),
        rest_chi2(state, problem),
        state.samples,
        material_chi2(state, problem),
        state.ripple_meets_tones,
    )


def standing(state: State, problem: Problem) -> Standing:
    samples = float(state.fit.normal.count.sum())
    return Standing(state.model, state.accepted, problem.names, state.setting, samples, problem.rules)


def refitted(state: State, problem: Problem, model: Model, wanted_chi2: float = np.inf) -> Fit:
    """The fit of another model to the same record; given up where it cannot reach `wanted_chi2`."""
    return fit(model, state.record, state.layout, problem.noise, wanted_chi2=wanted_chi2)


def part_of(state: State, full: Record) -> Record:
    return full.first(state.record.commanded)


def with_new_flux_before(state: State, problem: Problem) -> State:
    """The flux each segment inherits, by the improved model: a wrong one would pass for remanence."""
    if not state.model.has_kind(kinds.CARRY):
        return state
    full = with_flux_before(state.full, state.model, state.layout)
    record = part_of(state, full)
    old, new = (np.array([s.left_before_wb for s in r.segments]) for r in (state.record, record))
    if not np.isfinite(new).all() or np.abs(new - old).max() < 1e-3 * np.abs(new).max():
        return state
    again = fit(state.model, record, state.layout, problem.noise)
    if not np.isfinite(again.chi2):
        return state
    return state.at(again, full=full, setting=replace(state.setting, record=record))
