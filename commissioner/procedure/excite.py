"""The two energised steps: the DC staircase and the multitone test, sample block by sample block."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from commissioner.errors import Aborted, DataRefused
from commissioner.identify import excitation, resistance
from commissioner.identify.analysis import Identification, identify
from commissioner.identify.compensation import Compensation
from commissioner.identify.convergence import Settling, settled
from commissioner.identify.excitation import DesignedExcitation, Excitation, ExcitationLimits, Tone
from commissioner.identify.flux import FluxAdvice, FluxGuard, FluxReading
from commissioner.identify.observer import BlockEstimate, ParallelObserver
from commissioner.identify.resistance import IDEAL_INVERTER, DcLevel, InverterError, StaircaseLimits
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, ParameterBox, prior
from commissioner.motor.space_vector import axis_current_a
from commissioner.procedure.assembly import assemble
from commissioner.procedure.findings import (
    AxisFinished,
    EstimateUpdated,
    ExcitationChosen,
    FirstLook,
    GuardActed,
    StaircaseFitted,
    StepProgress,
)
from commissioner.procedure.states import Event
from commissioner.procedure.steps import Findings, Job, Step
from commissioner.records import SampleBlock, Signal
from commissioner.safety.commands import Command, Disarm, Enable, Fetch, LoadExcitation, SetBias, SetScale, Tell

TELL_EVERY_S = 0.1
"""Motor time between two estimates in the journal."""
BIAS_RAMP_PER_S = 4.0
"""The drive's bias ramp in test voltages per second: a DC level is reached in a few hundredths of a second."""
CLIMB_STEP_S = 0.02
RISE_STEPS = 10
RUNGS = (1.0, 0.6, 0.3)
"""DC levels of one sign, of the top current."""
KNOWN_TOP = 0.95
"""Flux of the top DC level, of the limit, once the inductance is known."""
SETTLED = 0.006
KNEE_STEP, KNEE_TOP, KNEE_LAG = 0.02, 0.3, 0.1
"""Points kept from the climb: their distance and how far up, of the top current, and the largest share of flux lag."""
LOOK_STD = 0.15
"""A value of the first look counts where its relative standard error is below this."""
COMPENSATION_ROWS = 1025
WARM_UP_SAMPLES = 6000
OFFSET_S = 0.1
"""Enabled without voltage before each test: what the current sensors show then is their offset."""
FIRST_LOOK = 0.3
"""Share of a test's time spent, the first time, on an excitation chosen from the plate alone."""


# --- DC staircase ---------------------------------------------------------------------------------------------------


def measure_resistance(job: Job, findings: Findings) -> Step:
    """DC levels of both signs, settled one by one; on the first axis a slow climb finds how much voltage they need."""
    axis_deg = job.plan.tests_deg[findings.tests_done]
    stair = _Stair(job, findings, axis_deg)
    yield LoadExcitation(axis_deg, (), BIAS_RAMP_PER_S * job.test_voltage_v, job.scale_ramp_per_s, job.axis_time_s)
    yield Enable("DC staircase")
    findings.segment += 1
    yield from stair.zero()
    voltages = stair.known_voltages() or (yield from stair.climb())
    for voltage_v in (*voltages, *(-v for v in reversed(voltages))):
        yield from stair.hold(voltage_v)
        yield Tell(stair.progress(2 * len(voltages)))
    yield SetBias(0.0)
    yield from _ramp_down(findings, "DC staircase", axis_deg, 1.0 / BIAS_RAMP_PER_S)
    yield Disarm("staircase measured")
    findings.knee = findings.knee or tuple(stair.knee)
    fitted = resistance.fit_staircase((*stair.levels, *findings.knee), axis_deg)
    findings.staircases.append(fitted)
    value, std = fitted.stator_resistance
    yield Tell(StaircaseFitted(axis_deg, value, std, fitted.error_voltage.value, stair.seconds))
    return Event.RESISTANCE_KNOWN


@dataclass
class _Stair:
    """One DC staircase under way."""

    job: Job
    findings: Findings
    axis_deg: float
    levels: list[DcLevel] = field(default_factory=list)
    knee: list[DcLevel] = field(default_factory=list)
    seconds: float = 0.0
    offset_a: float = 0.0

    def __post_init__(self) -> None:
        job = self.job
        limits = StaircaseLimits(
            job.test_current_a, job.flux_limit_wb(self.findings.resistance_ohm(job)), job.test_voltage_v
        )
        self._plan = resistance.staircase(job.nameplate, limits)

    def zero(self) -> Generator[Command, Any, None]:
        """Before any voltage: what the sensors show is offset."""
        self.offset_a = yield from _measure_offset(self.findings, "DC staircase", self.axis_deg)
        self.seconds += OFFSET_S

    def known_voltages(self) -> tuple[float, ...]:
        """The rungs' voltages once the first look has told resistance, inductance and inverter; empty before."""
        look = self.findings.first_look
        if look is None:
            return ()
        machine = look.parameters
        inductance_h = machine.leakage_inductance_h + machine.magnetizing_inductance_h
        limit_wb = self.job.flux_limit_wb(machine.stator_resistance_ohm)
        top_a = min(KNOWN_TOP * limit_wb / inductance_h, self.job.test_current_a)
        currents = np.array([rung * top_a for rung in RUNGS])
        volts = machine.stator_resistance_ohm * currents + self.findings.inverter.on_axis(currents, self.axis_deg)
        return tuple(float(min(v, self.job.test_voltage_v)) for v in volts)

    def climb(self) -> Generator[Command, Any, tuple[float, ...]]:
        """Raise the bias slowly until the top current flows; the voltages of a few rungs below it, largest first.

        What the climb needs to build up flux would drive too much current once held: it is taken off, for the most
        inductive motor the plate allows.
        """
        top_a, voltage_v, steady, reached = self._plan.top_current_a, 0.0, [0.0], [0.0]
        while reached[-1] < top_a and voltage_v < self.job.test_voltage_v:
            voltage_v = min(voltage_v + self._plan.climb_v_per_s * CLIMB_STEP_S, self.job.test_voltage_v)
            yield SetBias(voltage_v)
            step_s, current = 0.0, np.zeros(0)
            while step_s < CLIMB_STEP_S:
                block = yield from self._fetch()
                current = self._current(block)
                step_s += block.count * block.sample_period_s
            seen_a = float(np.mean(current))
            self._note_climb(voltage_v, seen_a, (seen_a - reached[-1]) / step_s)
            reached.append(max(reached[-1], seen_a))
            back = min(len(reached) - 1, RISE_STEPS)
            rise = (reached[-1] - reached[-1 - back]) / (back * step_s)
            steady.append(max(steady[-1], voltage_v - self._plan.largest_inductance_h * rise))
        if reached[-1] < 0.3 * top_a:
            raise Aborted(
                "no current flows", step=f"DC staircase, axis {self.axis_deg:g} deg", value=f"{reached[-1]:.3g} A",
                limit=f"{top_a:.3g} A within {self.job.test_voltage_v:.3g} V",
                remedy="check the motor cable and the contactor; check rated current and voltage of the plate",
            )  # fmt: skip
        return tuple(float(np.interp(rung * reached[-1], reached, steady)) for rung in RUNGS)

    def _note_climb(self, voltage_v: float, current_a: float, rise_a_per_s: float) -> None:
        """Points on the knee of the inverter's error, which no settled level shows; the iron's small lag taken off."""
        step_a, top_a = KNEE_STEP * self._plan.top_current_a, KNEE_TOP * self._plan.top_current_a
        last_a = self.knee[-1].current_a if self.knee else 0.0
        if last_a + step_a <= current_a <= top_a:
            typical = prior(self.job.nameplate).typical
            lag_v = (typical.leakage_inductance_h + typical.magnetizing_inductance_h) * rise_a_per_s
            if lag_v < KNEE_LAG * voltage_v:
                self.knee.append(DcLevel(voltage_v - lag_v, current_a, 0.0))

    def hold(self, voltage_v: float) -> Generator[Command, Any, None]:
        """Hold a level until its current has settled; keep the means of the last window."""
        yield SetBias(voltage_v)
        voltage, current, passed_s = np.zeros(0), np.zeros(0), 0.0
        while passed_s < self._plan.longest_dwell_s and not self._has_settled(current):
            block = yield from self._fetch()
            voltage = np.append(voltage, block.voltage_axis_v)
            current = np.append(current, self._current(block))
            passed_s += block.count * block.sample_period_s
        tail = slice(-self._window_samples, None)
        spread = float(np.std(current[tail])) / np.sqrt(self._window_samples)
        self.levels.append(DcLevel(float(np.mean(voltage[tail])), float(np.mean(current[tail])), spread))

    @property
    def _window_samples(self) -> int:
        assert self.findings.identity is not None
        return max(8, round(self._plan.window_s / self.findings.identity.control_period_s))

    def _has_settled(self, current: Signal) -> bool:
        """The means of the last three windows differ by less than `SETTLED` of the top current."""
        n = self._window_samples
        if current.size < 3 * n:
            return False
        means = [float(np.mean(current[current.size - k * n : current.size - (k - 1) * n])) for k in (1, 2, 3)]
        return max(means) - min(means) < SETTLED * self._plan.top_current_a

    def _current(self, block: SampleBlock) -> Signal:
        return _along_axis(block) - self.offset_a

    def _fetch(self) -> Generator[Command, Any, SampleBlock]:
        block = yield from _next_block(self.findings, "DC staircase", self.axis_deg)
        self.seconds += (block.count + block.lost_before) * block.sample_period_s
        return block

    def progress(self, planned: int) -> StepProgress:
        last = self.levels[-1]
        return StepProgress(
            self.axis_deg, len(self.levels) / planned,
            f"{self.seconds:4.1f} s  {last.voltage_v:+.2f} V drive {last.current_a:+.3f} A",
        )  # fmt: skip


# --- multitone ------------------------------------------------------------------------------------------------------


def excite(job: Job, findings: Findings) -> Step:
    """The multitone test of one axis; the first one begins with a look chosen from the plate alone."""
    axis_deg = job.plan.tests_deg[findings.tests_done]
    seconds = job.plan.excitation.seconds * job.stretch
    limits = _excitation_limits(job, findings)
    if not findings.has_looked:
        look_s = FIRST_LOOK * seconds
        guess = excitation.design(
            job.nameplate, _known(job, findings), limits, _period_s(findings), findings.inverter, look_s
        )
        yield from _test(job, findings, axis_deg, guess, look_s, look_s)
        yield from _look_closer(job, findings)
    assert findings.estimate is not None
    chosen = excitation.design(
        job.nameplate, findings.estimate, limits, _period_s(findings), findings.inverter, seconds
    )
    yield from _test(job, findings, axis_deg, chosen, seconds, job.axis_time_s)
    findings.tests_done += 1
    return Event.AXES_DONE if findings.tests_done == len(job.plan.tests_deg) else Event.AXIS_DONE


def _look_closer(job: Job, findings: Findings) -> Generator[Command, Any, None]:
    """Batch fit of the staircase and the first look together, the motor de-energised meanwhile.

    It separates resistance from the inverter's lost voltage, which design, observer and guard need from here on.
    """
    recording = assemble(findings.blocks, {}, "first look")
    assert recording is not None
    findings.has_looked = True
    try:
        look = identify(recording, job.nameplate, "nls")
    except DataRefused:
        findings.estimate = _known(job, findings)  # too little in it: the test that follows is designed from the plate
        return
    findings.first_look = look
    findings.estimate = _believable(look, _known(job, findings), prior(job.nameplate))
    error = look.inverter.plateau_v if look.inverter else 0.0
    yield Tell(FirstLook(look.parameters.as_tuple(), look.std, error, look.delay_s[0]))


def _known(job: Job, findings: Findings) -> InverseGamma:
    """The plate's typical machine with the resistance that was measured."""
    return replace(prior(job.nameplate).typical, stator_resistance_ohm=findings.resistance_ohm(job))


def _believable(look: Identification, otherwise: InverseGamma, box: ParameterBox) -> InverseGamma:
    """Each value of the look, or the plate's where the look is too uncertain or outside what the plate allows."""
    corners = zip(
        look.parameters.as_tuple(),
        look.std,
        otherwise.as_tuple(),
        box.lower.as_tuple(),
        box.upper.as_tuple(),
        strict=True,
    )
    return InverseGamma(*(v if s < LOOK_STD * v and low <= v <= high else plate for v, s, plate, low, high in corners))


def _excitation_limits(job: Job, findings: Findings) -> ExcitationLimits:
    return ExcitationLimits(
        flux_wb=job.flux_limit_wb(findings.resistance_ohm(job)),
        current_a=job.test_current_a,
        voltage_v=job.test_voltage_v,
    )


def _test(
    job: Job, findings: Findings, axis_deg: float, chosen: DesignedExcitation, seconds: float, longest_s: float
) -> Generator[Command, Any, None]:
    """One energised multitone session: start small, raise as the guard permits, end when the time is up and settled.

    An estimate that has not settled after `seconds` gets more time, up to `longest_s`.
    """
    tones = tuple((t.amplitude_v, t.frequency_hz, t.phase_rad) for t in chosen.excitation.tones)
    yield Tell(
        ExcitationChosen(
            axis_deg, tones, seconds, chosen.peak_flux_wb, chosen.peak_current_a,
            dict(zip(("R_s", "R_R", "L_sigma", "L_M"), (100 * s for s in chosen.relative_std), strict=True)),
        )
    )  # fmt: skip
    yield LoadExcitation(axis_deg, tones, BIAS_RAMP_PER_S * job.test_voltage_v, job.scale_ramp_per_s, job.axis_time_s)
    yield Enable("multitone test")
    findings.segment += 1
    offset_a = yield from _measure_offset(findings, "multitone test", axis_deg)
    under_test = _UnderTest(job, findings, axis_deg, chosen, seconds, offset_a)
    yield SetScale(under_test.scale)
    while not under_test.is_done(longest_s):
        block = yield from _next_block(findings, "multitone test", axis_deg)
        reading = under_test.take(block)
        wanted = under_test.answer(reading)
        if wanted is not None:
            if reading.advice is FluxAdvice.BACK_OFF:
                findings.guard_acted = True
                yield Tell(GuardActed(axis_deg, under_test.time_s, reading.advice.name, reading.fraction, wanted))
            yield SetScale(wanted)
        if under_test.is_time_to_tell():
            yield Tell(under_test.update(reading))
    yield SetScale(0.0)
    yield from _ramp_down(findings, "multitone test", axis_deg, 1.0 / job.scale_ramp_per_s)
    yield Disarm("test done")
    yield Tell(under_test.finished())


class _UnderTest:
    """Observer, guard and amplitude of one session."""

    def __init__(
        self, job: Job, findings: Findings, axis_deg: float, chosen: DesignedExcitation, seconds: float,
        offset_a: float,
    ) -> None:  # fmt: skip
        period_s, resistance_ohm = _period_s(findings), findings.resistance_ohm(job)
        self._job, self._findings, self._axis_deg, self._seconds = job, findings, axis_deg, seconds
        self._observer = ParallelObserver(
            prior(job.nameplate), period_s, job.nameplate.rated_current_peak_a,
            start=findings.estimate or _known(job, findings),
            compensation=_compensation(findings.inverter, axis_deg, job.trip_current_a),
        )  # fmt: skip
        self._guard = FluxGuard(
            job.flux_limit_wb(resistance_ohm), job.link_latency_s, chosen.excitation, period_s, resistance_ohm,
            findings.inverter, axis_deg,
        )  # fmt: skip
        self.scale = min(job.plan.excitation.first_scale, self._guard.safe_scale)
        self._offset_a = offset_a
        self._present_scale = 0.0
        self.time_s = 0.0
        self._told_s = 0.0
        self._lost = 0
        self._peak_fraction = 0.0
        self._history: list[tuple[float, BlockEstimate]] = []
        self._estimate: BlockEstimate | None = None
        self._limit_wb = findings.flux_limit_wb = self._guard.limit_wb

    def take(self, block: SampleBlock) -> FluxReading:
        """Observer first, guard second, on the same block."""
        current = _along_axis(block) - self._offset_a
        self._estimate = self._observer.advance(block.voltage_axis_v, current, block.lost_before)
        taken_s = (block.count + block.lost_before) * block.sample_period_s
        self.time_s += taken_s
        step = self._job.scale_ramp_per_s * taken_s
        self._present_scale += float(np.clip(self.scale - self._present_scale, -step, step))
        reading = self._guard.advance(
            block.voltage_axis_v, current, self._estimate, self._present_scale, block.lost_before
        )
        self._lost += block.lost_before
        self._peak_fraction = max(self._peak_fraction, self._measured_fraction(reading))
        self._findings.peak_flux_fraction = max(self._findings.peak_flux_fraction, self._peak_fraction)
        return reading

    def answer(self, reading: FluxReading) -> float | None:
        """The amplitude to ask for now, or None to leave it. Raises Aborted where the guard says so."""
        if reading.advice is FluxAdvice.ABORT:
            raise Aborted(
                "the flux reached its limit and kept rising", step=f"multitone test, axis {self._axis_deg:g} deg",
                value=reading.fraction * self._limit_wb, limit=self._limit_wb,
                remedy="check rated voltage, frequency and connection of the plate; lower limits.flux_fraction",
            )  # fmt: skip
        is_new = reading.advice is not FluxAdvice.HOLD and abs(reading.permitted_scale - self.scale) > 1e-3
        if not is_new or (reading.advice is FluxAdvice.RAISE and self._present_scale < self.scale):
            return None
        self.scale = min(1.0, reading.permitted_scale)
        return self.scale

    def is_done(self, longest_s: float) -> bool:
        """The planned time is up and the estimate at rest, or no more time is allowed."""
        margin_s = 1.0 / self._job.scale_ramp_per_s + 0.2
        if self.time_s >= min(longest_s, self._job.axis_time_s - margin_s):
            return True
        return self.time_s >= self._seconds and self._settling().has_settled

    def is_time_to_tell(self) -> bool:
        return self.time_s - self._told_s >= TELL_EVERY_S

    def update(self, reading: FluxReading) -> EstimateUpdated:
        assert self._estimate is not None
        self._told_s = self.time_s
        self._history.append((self.time_s, self._estimate))
        self._findings.estimate = self._estimate.parameters
        return EstimateUpdated(
            axis_deg=self._axis_deg, time_s=self.time_s, planned_s=self._seconds,
            parameters=self._estimate.parameters.as_tuple(), std=self._estimate.std, scale=self._present_scale,
            flux_fraction=reading.fraction,
            agreed_flux_fraction=min(reading.observer_wb, reading.model_free_wb) / self._limit_wb, observer_flux_wb=reading.observer_wb,
            model_free_flux_wb=reading.model_free_wb, residual_rms_a=self._estimate.residual_rms_a,
        )  # fmt: skip

    def finished(self) -> AxisFinished:
        settling = self._settling()
        return AxisFinished(
            self._axis_deg, self.time_s, settling.has_settled, settling.reason, self._peak_fraction, self._lost
        )

    def _settling(self) -> Settling:
        limits = self._job.plan.acceptance
        percent = (
            limits.resistance_std_percent, limits.rotor_resistance_std_percent, limits.leakage_std_percent,
            limits.magnetizing_std_percent,
        )  # fmt: skip
        r_s, r_r, l_s, l_m = (p / 100 for p in percent)
        return settled(self._history, 0.2 * self._seconds, (r_s, r_r, l_s, l_m))

    def _measured_fraction(self, reading: FluxReading) -> float:
        return max(reading.observer_wb, reading.model_free_wb) / self._limit_wb


def warm_up(nameplate: Nameplate) -> None:
    """Run observer and guard once on made-up samples: what has to be compiled is compiled before anything is energised."""
    period_s = 2e-4
    time_s = np.arange(WARM_UP_SAMPLES) * period_s
    signal = np.cos(2.0 * np.pi * time_s)
    tone = Excitation((Tone(1.0, 1.0, 0.0), Tone(1.0, 20.0, 0.0)), 0.0, float(time_s[-1]))
    observer = ParallelObserver(
        prior(nameplate), period_s, nameplate.rated_current_peak_a, compensation=_compensation(IDEAL_INVERTER, 0.0, 1.0)
    )
    guard = FluxGuard(1.0, 0.01, tone, period_s, 1.0)
    for part in np.array_split(signal, 4):
        guard.advance(part, part, observer.advance(part, part, 1), 0.1)


# --- shared ---------------------------------------------------------------------------------------------------------


def _next_block(findings: Findings, step: str, axis_deg: float) -> Generator[Command, Any, SampleBlock]:
    """The next block of the session, kept for the judgement. A drive that stops by itself ends the run."""
    block: SampleBlock | None = yield Fetch()
    if block is None:
        raise Aborted(
            "the drive ended the test by itself", step=f"{step}, axis {axis_deg:g} deg", value="session ended",
            limit="the whole test", remedy="check the drive's own time limit and its status",
        )  # fmt: skip
    findings.blocks.append((findings.segment, block))
    return block


def _measure_offset(findings: Findings, step: str, axis_deg: float) -> Generator[Command, Any, float]:
    """Mean current along the axis while the drive is enabled and commands nothing."""
    seen = np.zeros(0)
    while (seen.size + 1) * _period_s(findings) < OFFSET_S:
        block = yield from _next_block(findings, step, axis_deg)
        seen = np.append(seen, _along_axis(block))
    return float(np.mean(seen))


def _period_s(findings: Findings) -> float:
    assert findings.identity is not None
    return findings.identity.control_period_s


def _ramp_down(findings: Findings, step: str, axis_deg: float, seconds: float) -> Generator[Command, Any, None]:
    """Fetch until the drive's ramp has reached zero, so that the motor is left without a jerk."""
    passed = 0.0
    while passed < seconds:
        block = yield from _next_block(findings, step, axis_deg)
        passed += (block.count + block.lost_before) * block.sample_period_s


def _compensation(inverter: InverterError, axis_deg: float, span_a: float) -> Compensation:
    """What the observer takes off the command along this axis: the staircase's voltage error over the axis current."""
    return Compensation(inverter.on_axis(np.linspace(0.0, span_a, COMPENSATION_ROWS), axis_deg), span_a)


def _along_axis(block: SampleBlock) -> Signal:
    return axis_current_a(block.current_u_a, block.current_v_a, block.current_w_a, block.axis_deg)
