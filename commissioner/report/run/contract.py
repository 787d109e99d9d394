"""The JSON of a run, as promised: what `run --json` prints and `result.json` holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NotRequired

from typing_extensions import TypedDict

from commissioner.diagnose.contract import Gain, Limit, NextExperiment, Size
from commissioner.errors import ErrorDocument
from commissioner.identify.contract import (
    AxesFinding,
    Axis,
    CurvePoint,
    Gaps,
    Inverter,
    Measured,
    Parameters,
    RatedFlux,
    TModel,
)
from commissioner.records import DiagnosisVerdict


class IdentityDocument(TypedDict):
    """Who answers. Null or empty: the drive file knows no register for it."""

    drive_type: str
    serial_number: int | None
    firmware_version: str
    map_version: int | None
    rated_drive_current_a: float | None
    control_period_s: float | None
    switching_frequency_hz: float | None


class GuardDocument(TypedDict):
    """The highest flux of the run, of its limit, and whether the guard acted."""

    peak_fraction: float | None
    acted: bool
    limit_wb: float | None


class WrittenRow(TypedDict):
    """One parameter of the drive, in its own unit and convention: before, as written, as read back. `field`: the contract's
    name; `per_si`: the drive's value by the contract's; not there where both are one."""

    name: str
    field: str | None
    per_si: NotRequired[float]
    register: int
    before: float
    after: float
    read_back: float


class CheckRow(TypedDict):
    """A check before the motor is energised."""

    name: str
    has_passed: bool
    value: Any
    limit: Any
    remedy: str


class PlateMatchDocument(TypedDict):
    """How the combined values fit the plate, each a ratio (`motor.plate_match`); `unseen_gain`: bounds of a gain common to all
    current sensors that would not have been noticed."""

    current_ratio: float
    copper_loss_ratio: float
    impedance_ratio: float
    unseen_gain: list[float]


class Objection(TypedDict):
    """One reason why the result is not good enough."""

    what: str
    value: Any
    limit: Any
    remedy: str


class ClosingCause(TypedDict):
    """A cause that the closing diagnosis names."""

    name: str
    title: str
    parameters: dict[str, Size]
    confidence: float
    equivalent: list[str]
    strength_over_noise: float | None


class Moved(TypedDict):
    """What a parameter would have come out as without its `cause`."""

    parameter: str
    four_parameters: float
    with_causes: float
    cause: str


class ClosingDiagnosis(TypedDict):
    """Of the run's own samples; the whole of it is in `file`."""

    verdict: DiagnosisVerdict
    reason: str
    causes: list[ClosingCause]
    moved: list[Moved]
    file: str | None
    is_complete: bool
    gain: NotRequired[Gain]
    parameters_before: NotRequired[dict[str, Measured]]
    parameters_after: NotRequired[dict[str, Measured]]
    detection_limits: NotRequired[Mapping[str, Limit | dict[str, Limit]]]
    below_materiality: NotRequired[list[str]]
    cannot_tell: NotRequired[list[str]]
    next_experiment: NotRequired[NextExperiment | None]
    remarks: NotRequired[list[str]]


class LinkDocument(TypedDict):
    """What a slow link carried: `averaged` control periods in each sample's mean; `captured`: the same of a test that the drive kept, 0:
    none was."""

    channels: list[str]
    averaged: int
    captured: int


class LongerTestDocument(TypedDict):
    """Relative standard errors of (R_s, R_R, L_sigma, L_M), `(4,)` each, now and after tests of `seconds` each."""

    seconds: float
    now: list[float]
    then: list[float]


class RunDocument(TypedDict):
    """`parameters` is empty, and what comes of an identification missing, where a run did not get so far. `energised_s`: motor time under
    voltage; `duration_s` is the same, under the name that an identification of a recording has for it."""

    run: str
    outcome: str
    reason: str
    error: ErrorDocument | None
    energised_s: float | None
    duration_s: float | None
    drive: IdentityDocument | None
    checks: list[CheckRow]
    before: dict[str, float | None] | None
    written: list[WrittenRow]
    objections: Sequence[Objection]
    parameters: Parameters | dict[str, Measured]
    remarks: list[str]
    diagnosis: ClosingDiagnosis | None
    flux_guard: GuardDocument
    convention: NotRequired[str]
    estimator: NotRequired[str]
    holds_for_stator_flux_wb: NotRequired[float]
    t_model: NotRequired[TModel]
    axes: NotRequired[list[Axis]]
    dispersion: NotRequired[dict[str, float | None]]
    findings: NotRequired[list[AxesFinding]]
    rated_flux_wb: NotRequired[RatedFlux]
    inverter: NotRequired[Inverter]
    delay_s: NotRequired[Measured]
    time_shift_periods: NotRequired[Measured]
    magnetizing_curve: NotRequired[list[CurvePoint]]
    stator_resistance_20degc_ohm: NotRequired[Measured | None]
    gaps: NotRequired[Gaps]
    winding_temperature_degc: NotRequired[float | None]
    link: NotRequired[LinkDocument]
    longer_test: NotRequired[LongerTestDocument | None]
    plate_match: NotRequired[PlateMatchDocument]


class PlanRow(TypedDict):
    """One register: what the drive holds now and would hold, in the drive's own unit and convention."""

    name: str
    register: int
    now: float | None
    will_be: float | None
    unit: str
    convention: str


class WritePlan(TypedDict):
    """A table that somebody is asked to agree to. `token` stands for exactly this table."""

    run: str
    what: str
    drive_type: str
    serial_number: int | None
    holds_for_stator_flux_wb: float | None
    rows: list[PlanRow]
    token: str
