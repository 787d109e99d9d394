"""`commissioner check`: everything that can be known without energising or writing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from commissioner.cli.screens import screen
from commissioner.procedure.checks import check_failed
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
