"""The JSON of `monitor`, as promised: names, shapes, units. What `result` builds and the shipped schemas say."""

from __future__ import annotations

from typing import Any, NotRequired

from typing_extensions import TypedDict


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


class PartialMonitoring(TypedDict):
    """What part of the data says (`outcome`: partial): numbers that could be had, and under `withheld` why others could not."""

    outcome: str
    mean_speed_rad_per_s: Measured | None
    mean_torque_nm: Measured | None
    parameters: None
    periods: list[dict[str, Any]]
    indicators: dict[str, Any]
    withheld: dict[str, str]
    trend: dict[str, Any] | None
    states: list[State]
    audit: dict[str, Any]
    quantities: str
    files: NotRequired[dict[str, str]]


class State(TypedDict):
    """A stretch of the recording: off | residual | standstill | lost | start | ramp | load step | steady | coast-down; `used`: the answer is of it.
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
    sensors: dict[str, Any]
    slip: float
    segment: dict[str, float]
    parameters: dict[str, Measured]
    t_model: dict[str, Any]
    parameters_from: str
    cannot_be_fixed: dict[str, Any]
    periods: list[LoadPeriod]
    waveforms: dict[str, Any]
    current_resimulation_error: dict[str, float | None]
    reference_speed: dict[str, float] | None
    indicators: dict[str, Any]
    trend: dict[str, Any] | None
    audit: dict[str, Any]
    quantities: str
    files: NotRequired[dict[str, str]]
    states: NotRequired[list[State]]


class Refusal(TypedDict):
    """Why a recording cannot carry an answer."""

    code: str
    what: str
    value: Any
    limit: Any
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
    indicators: dict[str, Any]
    audit: dict[str, Any]
    reason: NotRequired[str]
    states: NotRequired[list[State]]
    error: NotRequired[dict[str, Any]]
