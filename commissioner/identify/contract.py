"""The JSON of an identification, as promised: names, shapes, units. What `document` builds and the shipped schemas say."""

from __future__ import annotations

from typing import NotRequired

from typing_extensions import TypedDict


class Measured(TypedDict):
    """A value and one standard deviation, in SI units; `at_stator_flux_wb`: the peak stator flux at which it holds."""

    value: float
    std: float | None
    at_stator_flux_wb: NotRequired[float]


class AtFlux(TypedDict):
    """A value that depends on the iron: it holds at `at_stator_flux_wb`, the peak stator flux."""

    value: float
    std: float
    at_stator_flux_wb: float


class Parameters(TypedDict):
    """The inverse-Gamma set, the four that standstill data fix, and the rotor's time constant."""

    stator_resistance_ohm: Measured
    rotor_resistance_ohm: Measured
    leakage_inductance_h: Measured
    magnetizing_inductance_h: AtFlux
    rotor_time_constant_s: AtFlux


class TModel(TypedDict):
    """Under `assumption`; inductances at the flux of the parameters."""

    stator_resistance_ohm: Measured
    rotor_resistance_ohm: Measured
    stator_leakage_h: Measured
    rotor_leakage_h: Measured
    magnetizing_inductance_h: Measured
    assumption: str


class Whiteness(TypedDict):
    """Of the residual."""

    statistic: float
    limit: float
    is_white: bool


class Axis(TypedDict):
    """One test along one axis."""

    axis_deg: float
    parameters: Parameters
    batch_parameters: Parameters
    disagreement_sigmas: float
    whiteness: Whiteness
    peak_rotor_flux_wb: float
    peak_stator_flux_wb: float
    residual_rms_a: float
    delay_s: Measured
    energised_s: float


class AxesFinding(TypedDict):
    """What the differences between axes say."""

    cause: str
    sentence: str
    relative_size: float
    relative_std: float
    probability_by_chance: float


class RatedFlux(TypedDict):
    """Of the plate, as rms and as peak of a phase."""

    stator_rms: float
    stator_peak: float


class Inverter(TypedDict):
    """What one leg loses; only `identified` where nothing is known."""

    identified: bool
    leg_error_v: NotRequired[Measured]
    knee_a: NotRequired[float]
    leg_current_a: NotRequired[list[float]]
    leg_voltage_v: NotRequired[list[float]]
    staircase_resistance_ohm: NotRequired[Measured]


class CurvePoint(TypedDict):
    """Secant inductance at a peak stator flux."""

    stator_flux_wb: float
    magnetizing_inductance_h: AtFlux


class Gaps(TypedDict):
    """What the recording lacks."""

    count: int
    lost_samples: int


class FluxReached(TypedDict):
    """Of the flux limit."""

    peak_fraction: float
    acted: bool
    limit_wb: float | None


class IdentificationDocument(TypedDict):
    """`identify`, and part of `run`."""

    outcome: str
    reason: str
    convention: str
    estimator: str
    parameters: Parameters
    holds_for_stator_flux_wb: float
    t_model: TModel
    axes: list[Axis]
    dispersion: dict[str, float]
    findings: list[AxesFinding]
    rated_flux_wb: RatedFlux
    inverter: Inverter
    delay_s: Measured
    time_shift_periods: Measured
    magnetizing_curve: list[CurvePoint]
    stator_resistance_20degc_ohm: Measured | None
    gaps: Gaps
    duration_s: float
    remarks: list[str]


class IdentifiedDocument(IdentificationDocument):
    """With what a recording says of the flux limit; nothing is written."""

    flux_guard: FluxReached
    written: list[str]
