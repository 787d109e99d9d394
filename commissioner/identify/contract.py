"""The JSON of an identification, as promised: names, shapes, units. What `document` builds and the shipped schemas say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NotRequired

from typing_extensions import TypedDict

from commissioner.motor.nameplate import Plate


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


class Covariance(TypedDict):
    """Of the values named in `of`, row by row."""

    of: list[str]
    matrix: list[list[float]]


class RunningDocument(TypedDict):
    """`identify` of a running motor: `bound_std` is what the noise allows at best; `seconds` of each state."""

    outcome: str
    reason: str
    kind: str
    convention: str
    estimator: str
    parameters: dict[str, Measured]
    inertia_kg_m2: Measured | None
    load: dict[str, float]
    bound_std: dict[str, float]
    covariance: Covariance
    holds_for_stator_flux_wb: float
    t_model: TModel
    residual_over_noise: float
    left_over_noise: float
    speed: str
    seconds: dict[str, float]
    duration_s: float
    remarks: list[str]
    written: list[str]


class ThreeTestsDocument(TypedDict):
    """`identify` of test sheets: direct current, no load, locked rotor. `t_circuit` and `losses` by their SI names; null: the tests do
    not tell it; `rows`: of each test."""

    outcome: str
    reason: str
    kind: str
    method: str
    convention: str
    parameters: dict[str, Measured]
    t_circuit: dict[str, float]
    textbook: dict[str, float]
    at_terminals: dict[str, float]
    losses: dict[str, float | None]
    rows: dict[str, int]
    remarks: list[str]


class ErrorParts(TypedDict):
    """Standard deviations whose squares make that of the whole."""

    rounding: float
    assumptions: float
    tolerances: float


StatedValue = TypedDict("StatedValue", {"value": float, "std": float, "std_of_type": float, "from": ErrorParts})
"""`std`: of a motor of this type; `std_of_type`: without the tolerances."""


class SheetValue(TypedDict):
    """A value of the sheet as printed and as the circuit has it; `is_fitted`: whether it was used."""

    key: str
    given: float
    reproduced: float
    is_fitted: bool
    name: str
    unit: str


@dataclass(frozen=True)
class Silence:
    """A number the sheet leaves open: what was assumed, how far it may be off, how much of that the sheet took away."""

    name: str
    words: str
    value: float
    factor: float
    left: float
    source: str


class SheetDocument(TypedDict):
    """`identify` of a manufacturer's sheet; `withheld`: what each parameter that it does not tell would need."""

    outcome: str
    reason: str
    kind: str
    method: str
    convention: str
    parameters: dict[str, StatedValue]
    holds_for_stator_flux_wb: float
    withheld: dict[str, str]
    t_circuit: dict[str, StatedValue]
    double_cage: dict[str, StatedValue]
    losses: dict[str, StatedValue]
    values: list[SheetValue]
    assumed: tuple[Silence, ...]
    nameplate: Plate | None
    remarks: list[str]


AnyIdentification = IdentifiedDocument | RunningDocument | ThreeTestsDocument | SheetDocument
