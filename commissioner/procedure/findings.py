"""What a run decides and learns, as records for the journal, the technician and the report."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from commissioner.procedure.checks import CheckResult
from commissioner.records import DriveIdentity, WrittenParameter


@dataclass(frozen=True)
class WarmingUp:
    """Before anything is connected: the numerical kernels are compiled where this machine has not done so yet."""


@dataclass(frozen=True)
class LeftUnfinished:
    """`run` was killed in the middle of writing into this drive, which nobody has restored since."""

    run: str

    @property
    def sentence(self) -> str:
        """Also what it means for the set that the run which tells it keeps as the one before."""
        return (
            f"{self.run} was cut off while it wrote into this drive: what this run finds there, and would restore, may be old values, new ones "
            f"or some of each; `commissioner restore {self.run}` brings back those before both"
        )


@dataclass(frozen=True)
class Diagnosing:
    """The run is over and saved; its samples are looked through for what a simulation would get wrong."""

    seconds: float


@dataclass(frozen=True)
class StateEntered:
    state: str
    because: str
    axis_deg: float | None = None


@dataclass(frozen=True)
class DriveIdentified(DriveIdentity):
    """Who answered."""


@dataclass(frozen=True)
class ChecksJudged:
    results: tuple[CheckResult, ...]


@dataclass(frozen=True)
class LinkPlanned:
    """A link that does not carry every sample: what a sample is instead, and the plan in words, its cost included."""

    channels: tuple[str, ...]
    averaged: int
    plan: str


@dataclass(frozen=True)
class FirstCurrentSeen:
    """The static stator inductance at a tenth of the staircase's current, over the plate's typical one; the two levels."""

    axis_deg: float
    stator_inductance_h: float
    stator_inductance_std_h: float
    of_typical: float
    slope_ohm: float
    voltage_v: tuple[float, float]
    current_a: tuple[float, float]
    peak_flux_fraction: float
    energised_s: float


@dataclass(frozen=True)
class StaircaseFitted:
    """Start values for the fit of all samples together: what the levels alone say, the inverter's knee taken by form."""

    axis_deg: float
    stator_resistance_ohm: float
    stator_resistance_std_ohm: float
    error_voltage_v: float
    energised_s: float


@dataclass(frozen=True)
class FirstLook:
    """(R_s, R_R, L_sigma, L_M) and their standard errors from the first, small test; what one leg loses; the delay."""

    parameters: tuple[float, float, float, float]
    std: tuple[float, float, float, float]
    leg_error_v: float
    delay_s: float


@dataclass(frozen=True)
class ExcitationChosen:
    """Amplitudes in volts along the axis at scale 1; `predicted` in per cent relative standard error. `is_look`: the short
    test of a motor of which only the plate is known."""

    axis_deg: float
    is_look: bool
    tones: tuple[tuple[float, float, float], ...]
    seconds: float
    peak_flux_wb: float
    peak_current_a: float
    predicted_std_percent: Mapping[str, float]


@dataclass(frozen=True)
class BiasChosen:
    """The DC bias a test ends with: voltage, current, share of the tones' amplitude, peak flux of the limit. `seconds` 0:
    left out, because none worth its time fits under flux, current and voltage limits, or the motor is not known yet."""

    axis_deg: float
    seconds: float
    bias_v: float
    bias_a: float
    scale: float
    peak_flux_fraction: float


@dataclass(frozen=True)
class EstimateUpdated:
    """The observer's estimate at a time of the test; written about ten times a second of motor time.

    `flux_fraction` is the largest estimate or prediction, of the guard's limit; `agreed_flux_fraction` is what both flux
    estimates have reached, which the runner's watch judges: an estimate that has not settled alone is no emergency.
    """

    axis_deg: float
    time_s: float
    planned_s: float
    parameters: tuple[float, float, float, float]
    std: tuple[float, float, float, float]
    scale: float
    flux_fraction: float
    agreed_flux_fraction: float
    observer_flux_wb: float
    model_free_flux_wb: float
    residual_rms_a: float


@dataclass(frozen=True)
class GuardActed:
    """The amplitude was taken back to `scale`: flux or current, seen or predicted, in fractions of what is allowed."""

    axis_deg: float
    time_s: float
    advice: str
    flux_fraction: float
    current_fraction: float
    scale: float


@dataclass(frozen=True)
class AxisFinished:
    axis_deg: float
    is_look: bool
    energised_s: float
    has_settled: bool
    why: str
    peak_flux_fraction: float
    lost_samples: int


@dataclass(frozen=True)
class VerdictReached:
    """`decision` is write back | keep | reject; the facts are the numbers that led to it."""

    decision: str
    reason: str
    value: object
    limit: object
    remedy: str


@dataclass(frozen=True)
class RunEnded:
    """`outcome`: commissioned | rejected | aborted | faulted; `error` holds a failure's step, value, limit, remedy. `energised_s`:
    None where nobody counted: a drive that tunes itself does not say, nor can a run that was cut off."""

    outcome: str
    reason: str
    energised_s: float | None
    error: Mapping[str, object] | None = None


@dataclass(frozen=True)
class ParametersWritten:
    """Written, read back and, where the drive file knows how, stored."""

    written: tuple[WrittenParameter, ...]
    store_count: int | None
    wear_fraction: float | None
    is_stored: bool


@dataclass(frozen=True)
class StepProgress:
    """How far an energised step without an estimate is; shown, not judged."""

    axis_deg: float
    fraction: float
    numbers: str
