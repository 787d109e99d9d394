"""When, and behind which filter, a channel reads the current: delay, wandering clock and lag in one place.

The current is cubic between samples, and steps where the held voltage does by what a conductance across the terminals draws.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.record import Segment
from commissioner.diagnose.kernels.kinds import CLOCK, DELAY, IRON_LOSS, LAG
from commissioner.diagnose.plant.low_pass import SHORT_LAG, Between, behind, by_lag, by_shape, low_pass
from commissioner.diagnose.plant.model import Model, Term
from commissioner.diagnose.plant.resample import held_at, resample, resample_hermite, step_shown
from commissioner.diagnose.plant.ripple import Pulses

Array = NDArray[np.float64]
SHAPE, RIPPLED = 1, 2
"""Of a lag's numbers: its shape, and the lag of a filter that sees the switching's ripple."""


@dataclass(frozen=True)
class Reading:
    """`late` (n,) in samples; the filter's `lag` in samples, 0 for none, and its `shape`; `turns` and `clock` (k, n) delays in s
    per unit of their numbers.
    """

    late: Array
    lag: float
    shape: float
    period_s: float
    turns: Array
    clock: Array
    pulses: Pulses | None = None
    filtered: tuple[float, float] = (0.0, 0.0)
    """Lag (samples) and shape of the filter that sees them; `per_henry` of the leakage inductance."""
    per_henry: float = 0.0

    @cached_property
    def shown(self) -> NDArray[np.intp]:
        """Which step of the held voltage each sample shows."""
        return step_shown(self.late)

    @cached_property
    def ripple_a(self) -> Array:
        """(3, n) of the switching, as it is seen behind the filter."""
        return self.per_henry * self.pulses.behind(*self.filtered) if self.pulses else np.zeros((3, self.late.size))

    def of(self, current: Terminals) -> tuple[Array, Array]:
        """Values and slopes (1/s) read of the current."""
        if self.lag:
            value, slope = behind(current.between(self.period_s), self.lag, self.shape, self.late)
            return value, slope / self.period_s
        if not self.late.any():
            return current.values, current.before
        value, slope = resample_hermite(current.unheld, current.after, current.before, self.late, self.period_s)
        return value + held_at(current.held, self.shown), slope

    def of_row(self, row: Array, held: Array | None = None) -> Array:
        """A derivative (rows, n) of the current as it is read, with its part that is held from each sample on."""
        if held is not None:
            unheld = row - _until(held)
            if self.lag:
                return behind(Between.straight(unheld, held), self.lag, self.shape, self.late)[0]
            return self.of_row(unheld) + held_at(held, self.shown)
        lagged = low_pass(row, self.lag, self.shape) if self.lag else row
        return resample(lagged, self.late) if self.late.any() else lagged

    def by(self, term: Term, current: Terminals, slope: Array) -> Array:
        """Derivative by a number of the reading itself, from the current and the slope that was read."""
        if term.kind == DELAY:
            return np.asarray(-slope * self.turns[term.index])
        if term.kind == CLOCK:
            return np.asarray(-slope * self.clock[term.index])
        smooth, rows = self._by_filter(term, current, slope), slope.shape[0]
        if self.pulses is None or term.index == 0:
            return smooth
        by = self.pulses.by_lag if term.index == RIPPLED else self.pulses.by_shape
        per_number = self.per_henry / (self.period_s if term.index == RIPPLED else 1.0)
        return np.asarray(smooth + per_number * by(*self.filtered)[:rows])

    def _by_filter(self, term: Term, current: Terminals, slope: Array) -> Array:
        if not self.lag:
            return np.asarray(-slope if term.index != SHAPE else np.zeros_like(slope))
        between = current.between(self.period_s)
        if term.index != SHAPE:
            return by_lag(between, self.lag, self.shape, self.late) / self.period_s
        return by_shape(between, self.lag, self.shape, self.late)


@dataclass(frozen=True)
class Terminals:
    """Currents (rows, n) at the samples with their slopes (1/s) after and before each; `held`: their part from each sample on."""

    values: Array
    after: Array
    before: Array
    held: Array

    @property
    def unheld(self) -> Array:
        return self.values - _until(self.held)

    def between(self, period_s: float) -> Between:
        return Between(self.unheld, self.after * period_s, self.before * period_s, self.held)


def reading(model: Model, segment: Segment, listed: Sequence[Term], pulses: Callable[[], Pulses]) -> Reading:
    """Of one segment, from the model's delay, clock and lag; `listed`: numbers whose derivatives will be asked for."""
    at_work = {t.kind for t in (*model.terms, *listed)}
    turns = _delays(segment) if DELAY in at_work else np.zeros((0, segment.count))
    clock = 1e-6 * clock_courses(segment) if CLOCK in at_work else np.zeros((0, segment.count))
    late = model.sum_kind(DELAY, len(turns)) @ turns + model.sum_kind(CLOCK, len(clock)) @ clock
    period = segment.period_s
    rippled, shape = model.total(LAG, RIPPLED) / period, model.total(LAG, SHAPE)
    lag = model.total(LAG) / period + rippled
    is_short = lag < SHORT_LAG
    smooth = late / period + (lag if is_short else 0.0), 0.0 if is_short else lag, shape, period, turns, clock
    if rippled or any(t.kind == LAG and t.index == RIPPLED for t in listed):
        return Reading(*smooth, pulses(), (rippled, shape), 1.0 / model.nominal[2])
    return Reading(*smooth)


def conductance_per_volt(model: Model) -> tuple[float, float]:
    """What each volt of the held voltage draws at once, A/V, and how that grows with the conductance: (4) of `trajectory`."""
    conductance = model.total(IRON_LOSS)
    shrink = 1.0 / (1.0 + conductance * model.nominal[0])
    return conductance * shrink, shrink**2


def _until(held: Array) -> Array:
    """The part held until each sample: what the sample itself still shows."""
    return np.hstack([np.zeros((held.shape[0], 1)), held[:, :-1]])


def _delays(segment: Segment) -> Array:
    """Delay (s) per unit at every sample: alike, and longer for every other one."""
    return np.stack([np.ones(segment.count), np.where(np.arange(segment.count) % 2, -1.0, 1.0)])


def clock_courses(segment: Segment) -> Array:
    """Delay (s) that each unit of a clock's rate error makes from the start of the segment: constant, and wandering once to
    and fro within it (cosine and sine); and constant from the start of the recording, of a clock that runs on over segments.
    """
    elapsed = segment.time_s - segment.time_s[0]
    turn = 2.0 * np.pi / max(segment.count * segment.period_s, 1e-9)
    wander = np.sin(turn * elapsed) / turn, (1.0 - np.cos(turn * elapsed)) / turn
    return np.stack([elapsed, *wander, segment.age_s + elapsed])
