"""Everything that can be known of a drive without energising or writing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from commissioner.encoding import HIDDEN
from commissioner.errors import CheckFailed, ErrorDocument
from commissioner.motor.nameplate import Nameplate, plate_doubts, prior
from commissioner.procedure.checks import CheckResult, NotChecked, check_failed
from commissioner.procedure.plan import BELOW_TRIP, Job, ProcedurePlan
from commissioner.records import DriveIdentity
from commissioner.run.inspection import WHICH, Inspection, inspect_drive
from commissioner.settings import load_motor, load_procedure


@dataclass(frozen=True)
class CheckRequest:
    """A drive, its file, the motor on it. `procedure`: None takes the shipped one; `axes_deg`: None takes the procedure's."""

    drive: str
    profile: str
    motor: str
    procedure: Path | None = None
    axes_deg: tuple[float, ...] | None = None


@dataclass(frozen=True)
class RunLimits:
    """What a run would do to the motor at most: peak values, voltages along the axis, seconds energised."""

    tests_deg: tuple[float, ...]
    current_a: float
    trip_current_a: float
    voltage_v: float
    flux_wb: float
    flux_fraction: float
    levels_s: float
    tones_s: float
    all_s: float
    axis_time_s: float
    total_time_s: float
    watchdog_s: float


@dataclass(frozen=True)
class Checked:
    """`outcome` passed | rejected. `error`: the first check that says no. `remarks`: what is unusual about the plate, whatever the checks
    say. `limits`: None of a drive that cannot energise for us."""

    outcome: str
    reason: str
    error: ErrorDocument | None
    drive: DriveIdentity
    nameplate_in_drive: Mapping[str, float]
    parameters_in_drive: Mapping[str, float]
    watchdog: Mapping[str, int | float | str | bool | None]
    checks: tuple[CheckResult, ...]
    not_checked: tuple[NotChecked, ...]
    remarks: tuple[str, ...]
    limits: RunLimits | None
    nameplate: Nameplate = field(metadata=HIDDEN)
    plan: ProcedurePlan = field(metadata=HIDDEN)
    job: Job | None = field(metadata=HIDDEN)

    @property
    def failure(self) -> CheckFailed | None:
        """The first check that says no, as the error it is."""
        return check_failed(self.checks)


def check(request: CheckRequest) -> Checked:
    """Connects, reads, judges. DriveError where the drive does not answer; a check that fails is a result."""
    nameplate = load_motor(request.motor)
    plan = load_procedure(request.procedure, axes_deg=request.axes_deg)
    seen = inspect_drive(request.drive, request.profile, nameplate, plan)
    failure = check_failed(seen.checks)
    return Checked(
        outcome="rejected" if failure else "passed",
        reason=failure.what if failure else _passed(seen),
        error=failure.as_dict() if failure else None,
        drive=seen.identity,
        nameplate_in_drive=seen.nameplate,
        parameters_in_drive=seen.parameters,
        watchdog=seen.watchdog,
        checks=seen.checks,
        not_checked=seen.not_checked,
        remarks=plate_doubts(nameplate),
        limits=None if seen.job is None else limits_of(seen.job, seen.identity.rated_drive_current_a),
        nameplate=nameplate,
        plan=plan,
        job=seen.job,
    )


def _passed(seen: Inspection) -> str:
    """Where no register tells which drive answers, the person has to look: a sister type answers alike."""
    left = f"every check that this drive file allows passed, {len(seen.not_checked)} could not be made"
    if any(row.name == WHICH for row in seen.not_checked):
        left += f", among them whether this is a {seen.identity.drive_type}: compare the label"
    return f"{left if seen.not_checked else 'every check passed'}; nothing was energised or written"


def limits_of(job: Job, rated_drive_current_a: float) -> RunLimits:
    """Of a run of this job on a drive of this rated current."""
    plan, plate = job.plan, job.nameplate
    trip_a = min(job.trip_current_a, rated_drive_current_a * math.sqrt(2))
    typical = prior(plate).typical.stator_resistance_ohm
    return RunLimits(
        tests_deg=tuple(plan.tests_deg),
        current_a=min(job.test_current_a, BELOW_TRIP * trip_a),
        trip_current_a=trip_a,
        voltage_v=job.test_voltage_v,
        flux_wb=job.flux_limit_wb(typical),
        flux_fraction=plan.limits.flux_fraction,
        levels_s=job.stretch * plan.excitation.staircase_seconds,
        tones_s=job.stretch * plan.excitation.seconds,
        all_s=job.stretch * plan.total_seconds,
        axis_time_s=job.axis_time_s,
        total_time_s=job.total_time_s,
        watchdog_s=plan.supervision.watchdog_s,
    )
