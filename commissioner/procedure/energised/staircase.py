"""The DC staircase: levels of both signs, enough to tell the stator's resistance from what the inverter loses.

On an unknown motor it is preceded by a first current, a fifth of what the plate's motor could take, or more where that told too
little: what it tells of the inductance says how much the motor that is really there may be given.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from commissioner.errors import Aborted
from commissioner.identify.inverter import staircase as resistance
from commissioner.identify.inverter.first_current import FirstCurrent, HeldLevel, first_current, stepped_inductance_h
from commissioner.identify.inverter.settling import Approach, Settled, settle
from commissioner.identify.inverter.staircase import DcLevel, StaircaseLimits
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import prior
from commissioner.motor.plate_match import MOST_INDUCTIVE, OTHER_CONNECTION, inductance_mismatch
from commissioner.motor.standstill import poles_per_s
from commissioner.procedure.energised import ceilings
from commissioner.procedure.energised.direct_current import STEER_S, DirectCurrent
from commissioner.procedure.energised.session import BIAS_RAMP_PER_S, period_s
from commissioner.procedure.findings import FirstCurrentSeen, StaircaseFitted, StepProgress
from commissioner.procedure.plan import Job
from commissioner.procedure.states import Event
from commissioner.procedure.steps import Findings, Step, reject
from commissioner.procedure.verdict import Objection
from commissioner.records import Signal
from commissioner.safety.commands import Command, SetBias, SetDriveLimits, Tell

STEP, FIRST_STEP = "DC staircase", "first current"
RUNGS, UNKNOWN_RUNGS, FIRST_LOWER = (1.0, 0.6, 0.3), (0.6, 0.3), 0.55
"""DC levels of one sign, of the top current; on an unknown motor those before the top; the lower of the first current."""
FIRST_SHARES, TOLD = (0.2, 0.45, 0.45), 0.5
"""The first current, of the top that the plate's most inductive motor could take; once more at the larger where the smaller told the
inductance to no better than this part of a typical one, and a third time where that one had to stay below it. An inverter that loses 21 V left 4.6 A of 25.7 A to look with after the smaller
alone (0.14 +- 0.07 H for 0.07 H), and R_s unknown; with the larger, three times the inductance still keeps 0.9 of the flux limit."""
DOUBT = 4.0
"""Standard errors of the inductance that a larger first current reckons with where a star for delta is possible. An 18.5 kW motor wired so
(unsaturated 5 times the plate's typical), seen as 2.7 +- 1.9 times behind 42 V lost, was taken to 1.55 of the flux limit by the larger one."""
TOP, KNOWN_TOP = 0.9, 0.95
"""Flux of the top DC level, of the limit, and of a machine that is known at its worst (`Findings.at_worst`)."""
SLOWLY_STEERED = 0.8
"""Of that top, on an unknown motor over a link on which steering takes tenths of a second: flux reached 1.00 of its limit without."""
TOP_ROOM = 1.15
"""Current that the drive ends a staircase at, of its top."""
SECONDS = 5.0
"""A staircase's energised time, a first current's included; levels that have not settled by then are extrapolated."""
FIRST_SECONDS, FIRST_END_S = 2.2, 0.05
LEAST_HELD, FIRST_LEAST_HELD = 0.2, 1.3
"""Of the plate's slow time constant: what a level is held at least, however long the climb took. A first current whose levels were held
for 0.3 of it, over a link that steers slowly, said 1.7 times the inductance, and that it was another motor's."""
FIRST_KEEPS = 0.6
"""Of the climb's voltage: what the first current is held at, at the least; a slow motor's climb is nearly all induction."""
IDLE_S = 4.0
"""The climb would pass the whole test voltage in this time as long as no current flows."""
CARRIES, FIRST_CARRIES = 0.02, 0.15
"""Of the top current: from here on the climb is slow."""
RISE_STEPS = 10
KNEE_STEP, KNEE_TOP, KNEE_LAG = 0.02, 0.3, 0.1
"""Points kept from the climb: their distance and how far up, of the top current, and the largest share of flux lag."""
SETTLED = 0.006
FIRST_SETTLED = 0.012
APART = 1.2
"""Current of one level over that of the next, of rungs that are a factor of two apart, from which on the step between them tells an
inductance. Of a motor wired in delta for star behind a nearly ideal inverter both were held at 0.33 V: the step's flux over no step of current
left the top at 0.02 A, and the staircase was refused for too few levels, with no word of the wiring."""
FAST_TIMES = 4.0
PUSH, ARRIVAL = 4.0, 0.85
"""First surplus of a push towards the next level, in resistive steps; it falls to nothing while the flux gets that far."""
PUSH_ABOVE_S = 0.15
"""A shorter push cannot be timed over the link."""


def measure_resistance(job: Job, findings: Findings) -> Step:
    """DC levels of both signs; on the first axis a first current and a slow climb find how much voltage they need."""
    axis_deg = job.plan.tests_deg[findings.tests_done]
    findings.axis_s = 0.0
    for share in FIRST_SHARES if findings.first_current is None else ():
        is_larger = findings.first_current is not None
        seen, typical_h, was_held_back = yield from _first_current(job, findings, axis_deg, share)
        mismatch = inductance_mismatch(seen.stator_inductance_h, seen.stator_inductance_std_h, job.nameplate)
        if mismatch is not None:
            return (yield from reject(findings, (Objection(**asdict(mismatch)),)))
        if seen.stator_inductance_std_h < TOLD * typical_h or (is_larger and not was_held_back):
            break
    stair = _Stair(job, findings, axis_deg)
    yield from stair.begin(stair.ceilings())
    known = stair.known_voltages()
    if known:
        yield from stair.walk((*known, *(-v for v in reversed(known))))
    else:
        yield from stair.climb(UNKNOWN_RUNGS[0])
        yield from stair.walk([stair.voltage_at(rung) for rung in UNKNOWN_RUNGS])
        stair.tighten()
        yield from stair.climb(1.0)
        top = stair.voltage_at(1.0)
        yield from stair.walk((top, *(-stair.voltage_at(rung) for rung in reversed(UNKNOWN_RUNGS)), -top))
    yield from stair.end("staircase measured", 1.0 / BIAS_RAMP_PER_S)
    held = stair.levels()
    findings.knee = findings.knee or settled_points(stair.knee, held)
    fitted = resistance.fit_staircase((*held, *findings.knee), axis_deg)
    findings.staircases.append(fitted)
    findings.held_v = stair.held_v(held)
    value, std = fitted.stator_resistance
    yield Tell(StaircaseFitted(axis_deg, value, std, fitted.error_voltage.value, stair.seconds))
    return Event.RESISTANCE_KNOWN


def settled_points(climbed: Sequence[DcLevel], held: Sequence[DcLevel]) -> tuple[DcLevel, ...]:
    """Of the points that a climb passed, those that can stand beside the levels held: what resistance and inverter take rises with
    the current, so that more voltage than a larger current was held with was still building up flux. A 19 kW motor (T_R 0.6 s)
    passed 1.9 A at 14.8 V and held 13.4 A at 3.1 V: with such points its R_s came out as zero."""
    return tuple(
        point
        for point in climbed
        if all(point.voltage_v <= level.voltage_v for level in held if level.current_a >= point.current_a)
    )


def _most_first_a(job: Job, findings: Findings, flux_wb: float) -> float:
    """What a first current may be of a motor that may be wired in star for delta, by what a smaller one has told of it; infinite where
    nothing has, and for a plate in star, which no connection makes more inductive."""
    seen = findings.first_current
    if seen is None or job.nameplate.connection != "delta":
        return math.inf
    typical = prior(job.nameplate).typical
    most_h = min(
        seen.stator_inductance_h + DOUBT * seen.stator_inductance_std_h,
        OTHER_CONNECTION * MOST_INDUCTIVE * (typical.leakage_inductance_h + typical.magnetizing_inductance_h),
    )
    return TOP * flux_wb / most_h


def _first_current(
    job: Job, findings: Findings, axis_deg: float, share: float
) -> Generator[Command, Any, tuple[FirstCurrent, float, bool]]:
    """This share of the current, then half of that: the static inductance of the motor that is really there, a typical one, and whether less
    was given than this share."""
    stair = _Stair(job, findings, axis_deg, first_share=share)
    yield from stair.begin(stair.ceilings())
    yield from stair.climb(1.0)
    upper_v, lower_v = stair.voltage_at(1.0), stair.voltage_at(FIRST_LOWER)
    yield from stair.walk((upper_v, lower_v, upper_v))
    seen = stair.first_current()
    yield from stair.end("first current seen", FIRST_END_S)
    findings.first_current = seen
    typical = prior(job.nameplate).typical
    typical_h = typical.leakage_inductance_h + typical.magnetizing_inductance_h
    of_typical = seen.stator_inductance_h / typical_h
    yield Tell(
        FirstCurrentSeen(axis_deg, of_typical=of_typical, peak_flux_fraction=stair.peak_fraction, energised_s=stair.seconds, **asdict(seen))
    )  # fmt: skip
    return seen, typical_h, stair.is_held_back


class _Stair(DirectCurrent):
    """One DC staircase under way; `first_share`: of the small one that looks at an unknown motor, the share of the top current."""

    def __init__(self, job: Job, findings: Findings, axis_deg: float, *, first_share: float | None = None) -> None:
        self._known: InverseGamma | None = findings.look.parameters if findings.look else None
        self._is_first = is_first = first_share is not None
        self._most_a = findings.test_current_a(job)
        self.knee: list[DcLevel] = []
        self._reached, self._steady, self._before_v = [0.0], [0.0], 0.0
        self._levels = 3 if is_first else 2 * len(RUNGS)
        self._held: list[tuple[float, Approach]] = []
        self._whole: list[HeldLevel] = []
        flux_wb = job.flux_limit_wb(findings.resistance_ohm(job))
        seen_h = findings.first_current.stator_inductance_h if findings.first_current and not is_first else None
        limits = StaircaseLimits(self._most_a, flux_wb, job.test_voltage_v)
        self._plan = resistance.staircase(job.nameplate, limits, seen_h)
        machine = self._known or prior(job.nameplate).typical
        slow, fast = poles_per_s(machine)
        self._slow_s, self._fast_s = -1.0 / slow, -1.0 / fast
        self._top_a = (first_share or 1.0) * self._plan.top_current_a
        most_a = _most_first_a(job, findings, flux_wb) if is_first else math.inf
        self.is_held_back = self._top_a > most_a
        self._top_a = min(self._top_a, most_a)
        if findings.link.captured and not is_first:
            self._top_a *= SLOWLY_STEERED
        if self._known is not None:
            worst = findings.at_worst(self._known)
            inductance_h = worst.leakage_inductance_h + worst.magnetizing_inductance_h
            self._top_a = min(KNOWN_TOP * flux_wb / inductance_h, self._most_a)
        step = FIRST_STEP if is_first else STEP
        super().__init__(job, findings, step, axis_deg, self._plan.largest_inductance_h, self._known)
        self._already_s = 0.0 if is_first or self._known else min(findings.axis_s, FIRST_SECONDS * job.stretch)

    # -- steps ----------------------------------------------------------------------------------------------------

    def ceilings(self) -> SetDriveLimits:
        """What the drive may let pass: the top current and a little, and of a known motor the top level's voltage."""
        if self._is_first:
            return ceilings.for_current(
                self.job, self.findings, ceilings.FIRST_OVER * self._top_a, self.job.test_voltage_v
            )
        volts = TOP_ROOM * max(self.known_voltages(), default=self.job.test_voltage_v)
        return ceilings.for_current(self.job, self.findings, TOP_ROOM * self._top_a, volts)

    def known_voltages(self) -> tuple[float, ...]:
        """The rungs' voltages once a look has told resistance, inductance and inverter; empty before."""
        if self._known is None:
            return ()
        currents = np.array([rung * self._top_a for rung in RUNGS])
        lost = self.findings.inverter.on_axis(currents, self.axis_deg)
        volts = self._known.stator_resistance_ohm * currents + lost
        return tuple(float(min(v, self.job.test_voltage_v)) for v in volts)

    def climb(self, share: float) -> Generator[Command, Any, None]:
        """Raise the bias until this share of the top current flows, slowly once any flows, from where current was seen to
        flow before.

        What the climb needs to build up flux would drive too much current once held: it is taken off, for the most
        inductive motor that this can be.
        """
        job, slow, reached, steady = self.job, self._plan.climb_v_per_s, self._reached, self._steady
        carries = FIRST_CARRIES if self._is_first else CARRIES
        seen = self.findings.first_current
        voltage_v, wanted_a = max(steady[-1], seen.voltage_v[1] if seen else 0.0), share * self._top_a
        step_s, seen_a = STEER_S, reached[-1]
        while reached[-1] < wanted_a and voltage_v < job.test_voltage_v:
            rate = slow if seen or reached[-1] > carries * self._top_a else max(slow, job.test_voltage_v / IDLE_S)
            voltage_v = min(voltage_v + rate * self.climbing_s(step_s), job.test_voltage_v)
            step_s, seen_a = yield from self.steer(voltage_v, self._top_a)
            self._note_climb(voltage_v, seen_a, (seen_a - reached[-1]) / step_s)
            reached.append(max(reached[-1], seen_a))
            back = min(len(reached) - 1, RISE_STEPS)
            rise = (reached[-1] - reached[-1 - back]) / (back * step_s)
            held_v = voltage_v - self._plan.largest_inductance_h * rise
            steady.append(max(steady[-1], held_v, self._holds_at_least(voltage_v, seen_a)))
        if seen_a < 0.3 * wanted_a:
            raise Aborted(
                "no current flows", step=self._where, value=f"{seen_a:.3g} A",
                limit=f"{wanted_a:.3g} A within {job.test_voltage_v:.3g} V",
                remedy="check the motor cable and the contactor; check rated current and voltage of the plate",
            )  # fmt: skip
        self._top_a = min(self._top_a, reached[-1] / share)

    def _holds_at_least(self, voltage_v: float, current_a: float) -> float:
        """Of the climb's voltage: what such a current takes once it stands still; no less than the first current took for less."""
        seen = self.findings.first_current
        if seen is None:
            return FIRST_KEEPS * voltage_v
        return seen.voltage_v[0] if current_a >= seen.current_a[0] else 0.0

    def voltage_at(self, rung: float) -> float:
        """What the climb has shown to hold this share of the top current."""
        return float(np.interp(rung * self._top_a, self._reached, self._steady))

    def tighten(self) -> None:
        """The inductance between the two levels held last says how high the top may be, where they are apart."""
        period = period_s(self.findings)
        larger, smaller = self._whole[-2:]
        headings_a = self._heading().current_a[-2:]
        if abs(headings_a[0]) < APART * abs(headings_a[1]):
            return
        inductance_h = stepped_inductance_h(larger, smaller, self._heading(), period)
        self._top_a = min(self._top_a, TOP * self._limit_wb / max(resistance.SEEN_DOUBT * inductance_h, 1e-9))

    def walk(self, voltages_v: Sequence[float]) -> Generator[Command, Any, None]:
        """Hold these levels, one after the other."""
        for voltage_v in voltages_v:
            yield from self.hold(self._before_v, voltage_v, self._levels - len(self._held))
            self._before_v = voltage_v
            if not self._is_first:
                yield Tell(self.progress(self._levels))

    def _note_climb(self, voltage_v: float, current_a: float, rise_a_per_s: float) -> None:
        """Points on the knee of the inverter's error, which no settled level shows; the iron's small lag taken off."""
        last_a = self.knee[-1].current_a if self.knee else 0.0
        if last_a + KNEE_STEP * self._top_a <= current_a <= KNEE_TOP * self._top_a:
            typical = prior(self.job.nameplate).typical
            lag_v = (typical.leakage_inductance_h + typical.magnetizing_inductance_h) * rise_a_per_s
            if lag_v < KNEE_LAG * voltage_v:
                self.knee.append(DcLevel(voltage_v - lag_v, current_a, 0.0))

    def hold(self, before_v: float, voltage_v: float, levels_left: int) -> Generator[Command, Any, None]:
        """Hold a level until its current has settled or its share of the time is up; keep how it got there."""
        budget_s = FIRST_SECONDS if self._is_first else SECONDS
        share_s = (budget_s * self.job.stretch - self._already_s - self.seconds) / levels_left
        least_s = (FIRST_LEAST_HELD if self._is_first else LEAST_HELD) * self._slow_s
        until_s = self.seconds + max(share_s, least_s, 0.05)
        yield from self._push(before_v, voltage_v)
        yield SetBias(voltage_v)
        began_s, ramp_s = self.seconds, abs(voltage_v - before_v) / (BIAS_RAMP_PER_S * self.job.test_voltage_v)
        late_s, current, volts = 0.0, np.zeros(0), np.zeros(0)
        while True:
            block = yield from self.fetch()
            late_s = late_s if current.size else block.age_s
            current, volts = np.append(current, self.current(block)), np.append(volts, block.voltage_axis_v)
            skipped = round((FAST_TIMES * self._fast_s + ramp_s + late_s) / period_s(self.findings))
            is_over = self.seconds >= until_s and current.size >= 2 * skipped
            if is_over or self._has_settled(current[skipped:]):
                break
            if self.seconds - began_s > self._plan.longest_dwell_s + late_s:
                break
        time_s = np.arange(current.size, dtype=np.float64) * period_s(self.findings)
        skipped = min(skipped, current.size // 2)
        self._whole.append(HeldLevel(voltage_v, volts, current))
        self._held.append((voltage_v, Approach(time_s[skipped:], current[skipped:])))

    def _push(self, before_v: float, voltage_v: float) -> Generator[Command, Any, None]:
        """More than the step for a while, falling: the flux is nearly there when it ends (known machine only)."""
        if self._known is None:
            return
        machine, job = self._known, self.job
        step_v = machine.stator_resistance_ohm * abs(self._current_at(voltage_v) - self._current_at(before_v))
        room_v = (self._most_a - self._top_a) * (machine.stator_resistance_ohm + machine.rotor_resistance_ohm)
        sign = math.copysign(1.0, voltage_v - before_v)
        # held for ever, it would make no more flux than the top level: the push must not rely on being ended in time
        most_v = min(max(self.known_voltages()), job.test_voltage_v)
        surplus_v = max(0.0, min(PUSH * step_v, room_v, most_v - sign * voltage_v))
        length_s = self._slow_s * _push_length(surplus_v / step_v) if surplus_v > step_v else 0.0
        if length_s < PUSH_ABOVE_S:
            return
        began_s = self.seconds
        while self.seconds - began_s < length_s:
            left = 1.0 - (self.seconds - began_s + 0.5 * STEER_S) / length_s
            yield from self.steer(voltage_v + sign * surplus_v * max(left, 0.0), math.inf)

    def _current_at(self, voltage_v: float) -> float:
        """What a voltage drives through the known machine behind the known inverter in the end."""
        assert self._known is not None
        grid = np.linspace(0.0, 1.2 * self._top_a, 200)
        volts = self._known.stator_resistance_ohm * grid + self.findings.inverter.on_axis(grid, self.axis_deg)
        return math.copysign(float(np.interp(abs(voltage_v), volts, grid)), voltage_v)

    # -- what came out --------------------------------------------------------------------------------------------

    def levels(self) -> tuple[DcLevel, ...]:
        """The levels with the currents they have settled at, or would have."""
        settled = self._heading()
        rows = zip(self._held, settled.current_a, settled.std_a, strict=True)
        return tuple(DcLevel(voltage_v, float(a), float(s)) for (voltage_v, _), a, s in rows)

    def held_v(self, held: Sequence[DcLevel]) -> float:
        """The largest of these levels' voltages whose current is not above the top one."""
        most_a = (1.0 + SETTLED) * self._top_a
        return max((abs(level.voltage_v) for level in held if abs(level.current_a) <= most_a), default=0.0)

    def first_current(self) -> FirstCurrent:
        """From the levels that were held: the larger, the smaller, the larger again."""
        return first_current(self._whole, self._heading(), period_s(self.findings))

    def _heading(self) -> Settled:
        return settle([approach for _, approach in self._held], self._slow_s)

    @property
    def _tail(self) -> int:
        return max(8, round(self._plan.window_s / period_s(self.findings)))

    def progress(self, planned: int) -> StepProgress:
        voltage_v, approach = self._held[-1]
        return StepProgress(
            self.axis_deg, len(self._held) / planned,
            f"{self.seconds:4.1f} s  {voltage_v:+.2f} V drive {approach.current_a[-1]:+.3f} A",
        )  # fmt: skip

    def _has_settled(self, current: Signal) -> bool:
        """The means of the last three windows differ by less than `SETTLED` of the top current."""
        n = self._tail
        if current.size < 3 * n:
            return False
        means = [float(np.mean(current[current.size - k * n : current.size - (k - 1) * n])) for k in (1, 2, 3)]
        return max(means) - min(means) < (FIRST_SETTLED if self._is_first else SETTLED) * self._top_a


def _push_length(push: float) -> float:
    """Time constants x after which a step with a surplus falling from `push` steps to nothing is `ARRIVAL` done:
    (1 + push)(1 - e^-x) - push (x - 1 + e^-x) / x, the response of y' + y = 1 + push (1 - t/x) at t = x."""
    low, high = 0.0, 4.0
    for _ in range(40):
        x = 0.5 * (low + high)
        done = (1.0 + push) * -math.expm1(-x) - push * (x + math.expm1(-x)) / x
        low, high = (x, high) if done < ARRIVAL else (low, x)
    return low
