"""Drives and motors that can be chosen, what was checked, who operates."""

from __future__ import annotations

from typing_extensions import TypedDict

from commissioner.errors import ErrorDocument
from commissioner.motor.nameplate import Nameplate
from commissioner.report.run.contract import CheckRow, IdentityDocument
from commissioner.service.library import Drive


class DrivesDocument(TypedDict):
    """Addresses without what is secret."""

    drives: list[Drive]


class DriveWord(TypedDict):
    """What the drive said last; null: nothing yet, or its file knows no such register. `age_s`: of that word; `latency_s`: of its
    reply; `error`: why it says nothing now, else empty."""

    drive_type: str | None
    serial_number: int | None
    firmware_version: str | None
    state: str | None
    is_energised: bool | None
    age_s: float | None
    latency_s: float | None
    error: str


class DriveStateDocument(DriveWord):
    """`run`: id of the run that has the drive."""

    run: str | None


class MotorDocument(TypedDict):
    """`origin`: added | packaged."""

    id: str
    name: str
    origin: str
    nameplate: Nameplate


class MotorsDocument(TypedDict):
    """Added ones first."""

    motors: list[MotorDocument]


class ProcedureDocument(TypedDict):
    """`origin`: packaged | added. `procedure`: the file's tables; each value's unit is in its name, and the file says what it means."""

    id: str
    origin: str
    procedure: dict[str, dict[str, float | bool | list[float]]]


class ProceduresDocument(TypedDict):
    procedures: list[ProcedureDocument]


class UncheckedRow(TypedDict):
    """What could not be judged, and why."""

    name: str
    why: str


class RunLimitsDocument(TypedDict):
    """What a run would do to the motor at most: peak values, voltages along the axis, seconds energised."""

    tests_deg: list[float]
    current_a: float | None
    trip_current_a: float | None
    voltage_v: float
    flux_wb: float
    flux_fraction: float
    levels_s: float
    tones_s: float
    all_s: float
    axis_time_s: float
    total_time_s: float
    watchdog_s: float


class CheckDocument(TypedDict):
    """`check`. `outcome`: passed | rejected. `error`: the first check that says no. `remarks`: what is unusual about the plate. `limits`: null of a drive that
    cannot energise for us. `nameplate_in_drive` and `parameters_in_drive` by the drive file's names and in its units."""

    outcome: str
    reason: str
    error: ErrorDocument | None
    drive: IdentityDocument
    nameplate_in_drive: dict[str, float | None]
    parameters_in_drive: dict[str, float | None]
    watchdog: dict[str, float | str | bool | None]
    checks: list[CheckRow]
    not_checked: list[UncheckedRow]
    remarks: list[str]
    limits: RunLimitsDocument | None


class CheckedDocument(CheckDocument):
    """With the time at which the service asked."""

    checked_utc: str


class ControlDocument(TypedDict):
    """Who operates the drive, who asks for it, whether that is `you`; `wait_s` until it passes by itself."""

    holder: str | None
    asking: str | None
    you: bool
    wait_s: float
