"""One energised multitone session: observer, guard and amplitude, block by block."""

from __future__ import annotations

import importlib
from contextlib import suppress
from dataclasses import replace

import numpy as np

from commissioner.errors import Aborted, DataRefused
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.model import OWN, ModelChoice, start_theta
from commissioner.identify.batch.problem import Problem
from commissioner.identify.batch.segments import Segment
from commissioner.identify.excite.amplitude import Amplitude
from commissioner.identify.excite.current_flux import CurrentFlux
from commissioner.identify.excite.flux_guard import BACK_OFF_ABOVE, FluxAdvice, FluxGuard, FluxReading
from commissioner.identify.excite.forecast import Forecast
from commissioner.identify.excite.tones import DesignedExcitation, Excitation, ExcitationLimits, Tone, design
from commissioner.identify.intake.averaged import on_its_period
from commissioner.identify.inverter.compensation import Compensation
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.staircase import IDEAL_INVERTER, InverterError
from commissioner.identify.observer.convergence import Settling, settled
from commissioner.identify.observer.coordinates import PRIOR_LOG_STD
from commissioner.identify.observer.observer import BlockEstimate, ParallelObserver
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, prior
from commissioner.motor.plate_match import MOST_INDUCTIVE, OTHER_CONNECTION, SURE, PlateMismatch, current_mismatch
from commissioner.procedure.energised.ceilings import aimed_current_a, tripping_current_a
from commissioner.procedure.energised.overdrawn import Drawn
from commissioner.procedure.energised.session import along_axis, duration_s, tone_period_s
from commissioner.procedure.findings import AxisFinished, EstimateUpdated
from commissioner.procedure.plan import Job
from commissioner.procedure.steps import Findings
from commissioner.records import SampleBlock, peak
from commissioner.safety.applied import judge_applied
from commissioner.safety.watch import stop_if

TELL_EVERY_S = 0.1
"""Motor time between two estimates in the journal."""
KNOWN_LOG_STD = 0.05
"""How far a machine measured in an earlier test may be off: another axis, another flux, a warmer winding."""
KNEES, EXCITED = 8.0, 0.3
"""The observer adapts once the current reaches this many knees of the inverter's error, or this share of the designed
peak: below, the dead band takes most of the command and the samples tell about its shape, not about the motor."""
AROUND = 3
"""Sample periods before and after a block whose tones it may show."""
COMPENSATION_ROWS = 1025
WARM_UP_SAMPLES, FITTED_SAMPLES = 6000, 600


class UnderTest:
    """Observer, guard and amplitude of one session; made before the motor is energised, begun with `begin`."""

    def __init__(
        self, job: Job, findings: Findings, axis_deg: float, chosen: DesignedExcitation, seconds: float
    ) -> None:
        sample_s, resistance_ohm = tone_period_s(findings), findings.resistance_ohm(job)
        self._job, self._findings, self._axis_deg, self._seconds = job, findings, axis_deg, seconds
        start = findings.estimate or plate_machine(job, findings)
        log_std = KNOWN_LOG_STD if findings.is_measured else PRIOR_LOG_STD
        inverter, least_impedance = findings.inverter, _if_in_delta(job, findings, start)
        self._observer = ParallelObserver(
            prior(job.nameplate), sample_s, job.nameplate.rated_current_peak_a, start=start, start_log_std=log_std,
            compensation=_compensation(inverter, axis_deg, job.trip_current_a),
        )  # fmt: skip
        self._guard = FluxGuard(
            job.flux_limit_wb(resistance_ohm), job.link_latency_s, chosen.excitation, sample_s, resistance_ohm,
            inverter, axis_deg, current_a=aimed_current_a(job, findings), trip_a=tripping_current_a(job, findings),
            held_v=findings.held_v, least_impedance=least_impedance,
        )  # fmt: skip
        first = min(job.plan.excitation.first_scale, self._guard.first_scale)
        if findings.is_measured:
            first = self._guard.begin_known(start, log_std, job.scale_ramp_per_s)
        self.scale = self._most_asked = first
        self._drawn = None if least_impedance is None else Drawn(start, inverter, axis_deg, sample_s)
        self._excitation = chosen.excitation
        self._wakes_a = min(KNEES * inverter.knee_a, EXCITED * chosen.peak_current_a)
        self._is_awake = False
        self.offset_a = 0.0
        self._present_scale = 0.0
        self.time_s = 0.0
        self._told_s = 0.0
        self._lost = 0
        self.peak_fraction = 0.0
        self._history: list[tuple[float, BlockEstimate]] = []
        self._estimate: BlockEstimate | None = None
        self.limit_wb = findings.flux_limit_wb = self._guard.limit_wb

    @property
    def blind_scale(self) -> float:
        """The amplitude of a test that nobody steers: of a motor measured before at its worst, else of any whatever."""
        return self.scale if self._findings.is_measured else self._guard.safe_scale

    def begin(self, offset_a: float) -> None:
        """The current sensors' offset along the axis, measured before the first amplitude."""
        self.offset_a = offset_a

    def take(self, block: SampleBlock) -> FluxReading:
        """Observer first, guard second, on the same block."""
        if self._estimate is None:
            self._guard.began_s = block.first_index * block.sample_period_s
        current = along_axis(block) - self.offset_a
        self._is_awake |= peak(current) >= self._wakes_a
        voltage_v = on_its_period(block.voltage_axis_v, block.averaged)
        self.require_asked(block)
        if self._drawn is not None:
            self._drawn.take(voltage_v, current, block.lost_before)
        self._estimate = self._observer.advance(voltage_v, current, block.lost_before, adapts=self._is_awake)
        taken_s = duration_s(block)
        self.time_s += taken_s
        step = self._job.scale_ramp_per_s * taken_s
        self._present_scale += min(max(self.scale - self._present_scale, -step), step)
        reading = self._guard.advance(
            voltage_v, current, self._estimate, self._present_scale, block.lost_before, block.age_s
        )
        self._lost += block.lost_before
        self.peak_fraction = max(self.peak_fraction, max(reading.observer_wb, reading.model_free_wb) / self.limit_wb)
        self._findings.peak_flux_fraction = max(self._findings.peak_flux_fraction, self.peak_fraction)
        return reading

    def take_biased(self, block: SampleBlock, reached_wb: float, predicted_wb: float) -> FluxReading:
        """A block of the biased stretch, which the observer does not see: flux as the bias' own guard tells it."""
        assert self._estimate is not None
        self.time_s += duration_s(block)
        self._lost += block.lost_before
        self.peak_fraction = max(self.peak_fraction, reached_wb / self.limit_wb)
        self._findings.peak_flux_fraction = max(self._findings.peak_flux_fraction, self.peak_fraction)
        return FluxReading(reached_wb, reached_wb, predicted_wb / self.limit_wb, 0.0, FluxAdvice.HOLD, self.scale)

    def overdrawn(self, reading: FluxReading) -> PlateMismatch | None:
        """Where a motor that may be wired in delta for star is about to pass the current aimed at: whether it can be the plate's at all."""
        if (
            self._drawn is None
            or reading.advice is not FluxAdvice.BACK_OFF
            or reading.current_fraction < BACK_OFF_ABOVE
        ):
            return None
        drawn = self._drawn.over_typical
        return None if drawn is None else current_mismatch(drawn, self._job.nameplate)

    def answer(self, reading: FluxReading) -> float | None:
        """The amplitude to ask for now, or None to leave it. Raises Aborted where the guard says so."""
        if reading.advice is FluxAdvice.ABORT:
            raise Aborted(
                "the flux reached its limit and kept rising", step=f"multitone test, axis {self._axis_deg:g} deg",
                value=reading.fraction * self.limit_wb, limit=self.limit_wb, unit="Wb",
                remedy="check rated voltage, frequency and connection of the plate; lower limits.flux_fraction",
            )  # fmt: skip
        is_new = reading.advice is not FluxAdvice.HOLD and abs(reading.permitted_scale - self.scale) > 1e-3
        if not is_new or (reading.advice is FluxAdvice.RAISE and self._present_scale < self.scale):
            return None
        self.scale = min(1.0, reading.permitted_scale)
        self._most_asked = max(self._most_asked, self.scale)
        return self.scale

    def require_asked(self, block: SampleBlock, scale: float | None = None, bias_v: float = 0.0) -> None:
        """Aborted: the drive applies more than the tones at this amplitude, else at the largest asked for in this session, and the bias."""
        scale = self._most_asked if scale is None else scale
        instants = block.first_index + np.arange(-AROUND, block.count + AROUND, dtype=np.float64)
        asked_v = self._excitation.voltage_v(instants * block.sample_period_s, scale)
        peaks_v = scale * self._excitation.peaks_v
        step = f"multitone test, axis {self._axis_deg:g} deg"
        stop_if(judge_applied(block.voltage_axis_v, asked_v, peaks_v, bias_v), step)

    def is_done(self, longest_s: float) -> bool:
        """The planned time is up and the estimate at rest, or no more time is allowed."""
        margin_s = 1.0 / self._job.scale_ramp_per_s + 0.2
        if self.time_s >= min(longest_s, self._job.axis_time_s - margin_s):
            return True
        return self.time_s >= self._seconds and self._settling().has_settled

    @property
    def rotor_flux_wb(self) -> float:
        """At the last sample, as the observer sees it."""
        return float(self._estimate.rotor_flux_wb[-1]) if self._estimate is not None else 0.0

    def is_time_to_tell(self) -> bool:
        return self.time_s - self._told_s >= TELL_EVERY_S

    def update(self, reading: FluxReading) -> EstimateUpdated:
        assert self._estimate is not None
        self._told_s = self.time_s
        self._history.append((self.time_s, self._estimate))
        return EstimateUpdated(
            axis_deg=self._axis_deg, time_s=self.time_s, planned_s=self._seconds,
            parameters=self._estimate.parameters.as_tuple(), std=self._estimate.std, scale=self._present_scale,
            flux_fraction=reading.fraction,
            agreed_flux_fraction=min(reading.observer_wb, reading.model_free_wb) / self.limit_wb, observer_flux_wb=reading.observer_wb,
            model_free_flux_wb=reading.model_free_wb, residual_rms_a=self._estimate.residual_rms_a,
        )  # fmt: skip

    def finished(self, *, is_look: bool) -> AxisFinished:
        """The verdict on this session. Where no batch fit has measured the motor yet, a settled estimate counts."""
        settling = self._settling()
        if settling.has_settled and self._estimate is not None and not self._findings.is_measured:
            self._findings.estimate, self._findings.is_measured = self._estimate.parameters, True
        return AxisFinished(
            self._axis_deg, is_look, self.time_s, settling.has_settled, settling.reason, self.peak_fraction,
            self._lost,
        )  # fmt: skip

    def _settling(self) -> Settling:
        limits = self._job.plan.acceptance
        percent = (
            limits.resistance_std_percent, limits.rotor_resistance_std_percent, limits.leakage_std_percent,
            limits.magnetizing_std_percent,
        )  # fmt: skip
        r_s, r_r, l_s, l_m = (p / 100 for p in percent)
        return settled(self._history, 0.2 * self._seconds, (r_s, r_r, l_s, l_m))


def plate_machine(job: Job, findings: Findings) -> InverseGamma:
    """The plate's typical machine with the resistance and the static inductance that were measured."""
    box = prior(job.nameplate)
    machine = replace(box.typical, stator_resistance_ohm=findings.resistance_ohm(job))
    if findings.first_current is None:
        return machine
    rest_h = findings.first_current.stator_inductance_h - machine.leakage_inductance_h
    within_h = min(max(rest_h, box.lower.magnetizing_inductance_h), box.upper.magnetizing_inductance_h)
    return replace(machine, magnetizing_inductance_h=within_h)


def _if_in_delta(job: Job, findings: Findings, machine: InverseGamma) -> InverseGamma | None:
    """The motor of a plate in star as it would be wired in delta, with the resistance that was measured; None where it was measured, or its
    first current showed an inductance that no such wiring has."""
    seen = findings.first_current
    if findings.is_measured or job.nameplate.connection != "star":
        return None
    typical = prior(job.nameplate).typical
    typical_h = typical.leakage_inductance_h + typical.magnetizing_inductance_h
    least_h = 0.0 if seen is None else seen.stator_inductance_h - SURE * seen.stator_inductance_std_h
    if least_h > MOST_INDUCTIVE / OTHER_CONNECTION * typical_h:
        return None
    return replace(
        machine,
        rotor_resistance_ohm=machine.rotor_resistance_ohm / OTHER_CONNECTION,
        leakage_inductance_h=machine.leakage_inductance_h / OTHER_CONNECTION,
        magnetizing_inductance_h=typical.magnetizing_inductance_h / OTHER_CONNECTION,
    )


def warm_up(nameplate: Nameplate) -> None:
    """Run observer, guard, design and fit once on made-up samples: what has to be compiled is compiled before anything is
    energised, what is imported late is there, and the motor does not wait for either between two tests."""
    for library in ("scipy.interpolate", "scipy.optimize"):
        importlib.import_module(library)
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
    machine = prior(nameplate).typical
    CurrentFlux(machine, period_s).advance(signal)
    Amplitude(Forecast.behind(IDEAL_INVERTER, tone, 0.0), 1.0, 1.0, 0.0, period_s).by_flux(machine)
    design(
        machine,
        ExcitationLimits(1.0, nameplate.rated_current_peak_a, nameplate.rated_voltage_v),
        period_s,
    )
    cut = [Segment(signal[:FITTED_SAMPLES], signal[:FITTED_SAMPLES], 0.0, starts_at_rest=False)]
    for model in (ModelChoice(), ModelChoice(extra_powers=1, leg=LegLaw(1.0), with_delay=True)):
        with suppress(DataRefused):
            fit_segments(cut, period_s, machine, model, max_iterations=1)
        problem, theta, own = Problem(cut, period_s, model), start_theta(machine, model), np.zeros((1, OWN))
        problem.evaluate(theta, own, near=problem.evaluate(theta, own))


def _compensation(inverter: InverterError, axis_deg: float, span_a: float) -> Compensation:
    """What the observer takes off the command along this axis: the staircase's voltage error over the axis current."""
    return Compensation(inverter.on_axis(np.linspace(0.0, span_a, COMPENSATION_ROWS), axis_deg), span_a)
