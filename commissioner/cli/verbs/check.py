"""`commissioner check`: everything that can be known without energising or writing."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from commissioner.cli.screens import screen
from commissioner.motor.nameplate import prior
from commissioner.procedure.checks import check_failed
from commissioner.procedure.steps import BELOW_TRIP, Job
from commissioner.run.inspection import inspect_drive
from commissioner.settings import load_motor, load_procedure


def check(*, drive: str, profile: str, motor: str, procedure: Path | None, as_json: bool) -> None:
    """Prints every check; raises CheckFailed (exit 3) where one fails."""
    nameplate, plan = load_motor(motor), load_procedure(procedure)
    with screen.busy("asking the drive"):
        inspection = inspect_drive(drive, profile, nameplate, plan)
    failure = check_failed(inspection.checks)
    document: dict[str, Any] = {
        "outcome": "rejected" if failure else "passed",
        "reason": failure.what if failure else "every check passed; nothing was energised or written",
        "drive": inspection.identity,
        "nameplate_in_drive": inspection.nameplate,
        "parameters_in_drive": inspection.parameters,
        "watchdog": inspection.watchdog,
        "checks": inspection.checks,
        "limits": None
        if inspection.job is None
        else limits_of(inspection.job, inspection.identity.rated_drive_current_a),
    }
    if as_json:
        screen.emit(document)
        if failure:
            raise SystemExit(failure.exit_code)
        return
    identity = inspection.identity
    screen.out.print(f"[bold]{identity.drive_type}[/] #{identity.serial_number}, firmware {identity.firmware_version}")
    rows = [
        (
            "[green]✓[/]" if r.has_passed else "[red]✗[/]",
            r.name,
            screen.shown(r.value),
            screen.shown(r.limit),
            "" if r.has_passed else r.remedy,
        )
        for r in inspection.checks
    ]
    screen.out.print(screen.table("", ("", "check", "seen", "wanted", "remedy"), rows))
    if failure:
        raise failure
    screen.out.print(f"[green]{document['reason']}[/]")


def limits_of(job: Job, rated_drive_current_a: float) -> dict[str, Any]:
    """What a run of this job would do to the motor at most: peak values, voltages along the axis, seconds energised."""
    plan, plate = job.plan, job.nameplate
    trip_a = min(job.trip_current_a, rated_drive_current_a * math.sqrt(2))
    typical = prior(plate).typical.stator_resistance_ohm
    return {
        "tests_deg": plan.tests_deg,
        "current_a": min(job.test_current_a, BELOW_TRIP * trip_a),
        "trip_current_a": trip_a,
        "voltage_v": job.test_voltage_v,
        "flux_wb": job.flux_limit_wb(typical),
        "flux_fraction": plan.limits.flux_fraction,
        "levels_s": job.stretch * plan.excitation.staircase_seconds,
        "tones_s": job.stretch * plan.excitation.seconds,
        "all_s": job.stretch * plan.total_seconds,
        "axis_time_s": job.axis_time_s,
        "total_time_s": job.total_time_s,
        "watchdog_s": plan.supervision.watchdog_s,
    }
