"""What a run is asked to do: the plan, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass


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
