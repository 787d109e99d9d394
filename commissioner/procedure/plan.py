"""What a run is asked to do: the plan, and the job that it makes of a motor on a drive; as frozen values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

from commissioner.motor.nameplate import Nameplate, prior, rated_flux
from commissioner.procedure.checks import DriveLimits
from commissioner.procedure.link_plan import StreamPace


@dataclass(frozen=True)
class Supervision:
    watchdog_s: float
    max_watchdog_s: float
    standstill_dwell_s: float
    reply_timeout_s: float


@dataclass(frozen=True)
class Limits:
    """Fractions are of rated peak values (current: sqrt(2) I_N; flux: rated stator-flux peak)."""

    current_fraction: float
    trip_fraction: float
    flux_fraction: float
    axis_time_s: float
    total_time_s: float


@dataclass(frozen=True)
class ExcitationPlan:
    seconds: float
    staircase_seconds: float
    first_scale: float
    scale_ramp_per_s: float


@dataclass(frozen=True)
class Acceptance:
    """Standard errors and the spread over axes that a result may have. `strict`: nor may anything unusual have happened."""

    resistance_std_percent: float
    leakage_std_percent: float
    rotor_resistance_std_percent: float
    magnetizing_std_percent: float
    axis_spread_percent: float
    strict: bool = False


@dataclass(frozen=True)
class ProcedurePlan:
    """Axes in electrical degrees; `repeat_first` appends the first axis at the end."""

    axes_deg: tuple[float, ...]
    repeat_first: bool
    supervision: Supervision
    limits: Limits
    excitation: ExcitationPlan
    acceptance: Acceptance

    @property
    def tests_deg(self) -> tuple[float, ...]:
        """The orientations in the order they are tested."""
        return (*self.axes_deg, self.axes_deg[0]) if self.repeat_first and len(self.axes_deg) > 1 else self.axes_deg

    @property
    def total_seconds(self) -> float:
        """About how long the motor will be energised, without the stretch of slow rotors."""
        return len(self.tests_deg) * (self.excitation.seconds + self.excitation.staircase_seconds)


BELOW_TRIP = 0.85
"""Of the drive's current limit: what tests aim at where that is less than they would take otherwise."""
WINDOWS_A_WATCHDOG = 6.0
"""Whole windows that a watchdog must outlast: one that is lost, its time-out, and one more; or, of requests that take as long, two readings
of the status and a steering between two windows: at 150 ms a request these took 612 ms of a watchdog of 608 ms."""


@dataclass(frozen=True)
class Job:
    """What the run was asked to do, and on what."""

    plan: ProcedurePlan
    nameplate: Nameplate
    drive_limits: DriveLimits
    parameter_names: dict[str, str]
    """The drive's name of each written parameter -> the inverse-Gamma field it takes."""
    write_back: bool
    link_latency_s: float
    parameter_factors: dict[str, float] = field(default_factory=dict)
    """By what the drive multiplies a contract's SI value, where that is not 1: 2 for a line-to-line resistance."""
    pace: StreamPace | None = None

    @property
    def scale_ramp_per_s(self) -> float:
        return self.plan.excitation.scale_ramp_per_s

    @property
    def watchdog_s(self) -> float:
        """The drive's: as planned, and longer, up to the longest allowed, where a few windows take longer."""
        planned = self.plan.supervision
        slow_s = WINDOWS_A_WATCHDOG * self.pace.round_trip_s if self.pace else 0.0
        return max(planned.watchdog_s, min(slow_s, planned.max_watchdog_s))

    @property
    def test_current_a(self) -> float:
        """The largest phase current that any test aims at, peak; less on a small drive (`Findings.test_current_a`)."""
        return self.plan.limits.current_fraction * self.nameplate.rated_current_peak_a

    @property
    def trip_current_a(self) -> float:
        return self.plan.limits.trip_fraction * self.nameplate.rated_current_peak_a

    @property
    def test_voltage_v(self) -> float:
        """No test needs more along the axis: 30 % of the rated phase voltage's peak."""
        return 0.3 * math.sqrt(2 / 3) * self.nameplate.rated_voltage_v

    @cached_property
    def stretch(self) -> float:
        """All test times hold for rotor time constants up to 0.5 s and are stretched in proportion beyond."""
        return max(1.0, prior(self.nameplate).typical.rotor_time_constant_s / 0.5)

    @property
    def axis_time_s(self) -> float:
        """Longest energised time of one session."""
        return self.plan.limits.axis_time_s * self.stretch

    @property
    def total_time_s(self) -> float:
        """Longest energised time of the run."""
        return self.plan.limits.total_time_s * self.stretch

    def flux_limit_wb(self, stator_resistance_ohm: float) -> float:
        """The stator-flux peak at which the guard acts. No resistance that the plate does not allow moves it: 55 ohm of a 75 kW motor,
        seen through a converter coarser than the current, had made it thirtyfold."""
        box = prior(self.nameplate)
        most_ohm = min(stator_resistance_ohm, box.upper.stator_resistance_ohm)
        return self.plan.limits.flux_fraction * rated_flux(self.nameplate, most_ohm).stator_peak_wb
