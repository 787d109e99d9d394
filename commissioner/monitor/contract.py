"""The JSON of `monitor`, as promised: names, shapes, units. What `result` builds and the shipped schemas say."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NotRequired, TypeAlias

from typing_extensions import TypedDict

from commissioner.errors import ErrorDocument


class Measured(TypedDict):
    """A value and one standard deviation, in SI units; L_M and T_R hold at `at_stator_flux_wb`, the peak stator flux."""

    value: float
    std: float | None
    std_from_sensors: NotRequired[float]
    at_stator_flux_wb: NotRequired[float]


class LoadPeriod(TypedDict):
    """A period of the load, against the shaft's."""

    name: str
    frequency_hz: Measured
    period_s: Measured
    ratio_to_shaft: float
    follows: str
    harmonics: int
    periods_averaged: float
    speed_ripple_rms_rad_per_s: float


class LineRow(TypedDict):
    """A line of the currents of part of the data."""

    frequency_hz: float
    above_floor: float


class WatchedRow(TypedDict):
    """One indicator against its range over the healthy recordings; `distance` in standard deviations of a single one."""

    name: str
    value: float
    healthy_mean: float
    healthy_std: float
    distance: float
    threshold: float
    alarms: bool


class TrendDocument(TypedDict):
    """Against the recordings of the baseline at the same operating point."""

    state: str
    sentence: str
    compared_with: int
    alarms: list[str]
    false_alarm_per_indicator: float
    healthy_recordings_that_alarm_against_the_others: int
    healthy_recordings_at_other_operating_points: int
    watched: list[WatchedRow]


class FindingRow(TypedDict):
    """What the audit saw: `kind` note | corrected | refused; its number, what was allowed, what to do."""

    code: str
    kind: str
    what: str
    value: float | str | None
    limit: float | str | None
    remedy: str


class AuditDocument(TypedDict):
    """`channels`: which column was taken for which."""

    sample_period_s: float
    channels: dict[str, str]
    findings: list[FindingRow]


class SideBands(TypedDict):
    """Of the rotor, beside the supply's line."""

    offset_hz: float
    level_db: float
    above_floor_db: float


Indicators: TypeAlias = Mapping[str, Measured | SideBands | float | bool | str | None]
"""By name; the unit is in it. What the fundamental alone says, and what was made out of the motor's state."""


class OpenDirection(TypedDict):
    """The combination of parameters that is least known, and how much of it is prior."""

    combination: str
    relative_std: float
    share_from_prior: float
    sentence: str


class SensorsDocument(TypedDict):
    """What was found of the sensors' own errors, and what was taken where one recording shows nothing."""

    gain_std: float
    current_to_voltage_skew_std_s: float
    current_delay_s: Measured
    asymmetry: float | None
    sentence: str


class TModel(TypedDict):
    """Under `assumption`."""

    stator_resistance_ohm: Measured
    rotor_resistance_ohm: Measured
    magnetizing_inductance_h: Measured
    stator_leakage_h: Measured
    rotor_leakage_h: Measured
    assumption: str


class LoadTorque(TypedDict):
    """Of the waveform."""

    rms_std_nm: float


class Waveforms(TypedDict):
    """`load_torque`: its error, or in words why it is not given."""

    speed_rms_std_rad_per_s: float
    electromagnetic_torque_rms_std_nm: float
    load_torque: LoadTorque | str
    starts_at_s: float
    shaft_angle: str
    contains: str


class PartialMonitoring(TypedDict):
    """What part of the data says (`outcome`: partial): numbers that could be had, and under `withheld` why others could not."""

    outcome: str
    mean_speed_rad_per_s: Measured | None
    mean_torque_nm: Measured | None
    parameters: None
    periods: list[LineRow]
    reference_speed: dict[str, float] | None
    indicators: Indicators
    withheld: dict[str, str]
    trend: TrendDocument | None
    states: list[State]
    audit: AuditDocument
    quantities: str
    files: NotRequired[dict[str, str]]


class State(TypedDict):
    """A stretch of the recording: off | residual | standstill | lost | start | ramp | voltage dip | voltage step | load step | steady | coast-down; `used`: the answer is of it.
    Of a steady stretch beside it, or one that is too short, its own speed and torque; `withheld`: why they are of the terminals
    and the plate only."""

    state: str
    start_s: float
    end_s: float
    current_a: float
    frequency_hz: float
    used: bool
    mean_speed_rad_per_s: NotRequired[Measured]
    mean_torque_nm: NotRequired[Measured]
    withheld: NotRequired[str]


class MonitoringDocument(TypedDict):
    """The answer to one recording."""

    outcome: str
    refused_because: None
    mean_speed_rad_per_s: Measured
    mean_torque_nm: Measured
    used: dict[str, float]
    sensors: SensorsDocument
    slip: float
    segment: dict[str, float]
    parameters: dict[str, Measured]
    t_model: TModel
    parameters_from: str
    cannot_be_fixed: OpenDirection
    periods: list[LoadPeriod]
    waveforms: Waveforms
    current_resimulation_error: dict[str, float | None]
    reference_speed: dict[str, float] | None
    indicators: Indicators
    trend: TrendDocument | None
    audit: AuditDocument
    quantities: str
    files: NotRequired[dict[str, str]]
    states: NotRequired[list[State]]


class Refusal(TypedDict):
    """Why a recording cannot carry an answer."""

    code: str
    what: str
    value: float | str | None
    limit: float | str | None
    remedy: str


class RefusedMonitoring(TypedDict):
    """What was learned before the refusal."""

    outcome: str
    refused_because: Refusal
    mean_speed_rad_per_s: None
    mean_torque_nm: None
    parameters: None
    periods: list[LoadPeriod]
    current_resimulation_error: None
    indicators: Indicators
    audit: AuditDocument
    reason: NotRequired[str]
    states: NotRequired[list[State]]
    error: NotRequired[ErrorDocument]
