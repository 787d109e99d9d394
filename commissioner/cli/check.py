"""`commissioner check`: everything that can be known without energising or writing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from commissioner.cli import screen
from commissioner.errors import CheckFailed
from commissioner.run.inspection import inspect_drive
from commissioner.settings import load_motor, load_procedure


def check(*, drive: str, profile: str, motor: str, procedure: Path | None, as_json: bool) -> None:
    """Prints every check; raises CheckFailed (exit 3) where one fails."""
    nameplate, plan = load_motor(motor), load_procedure(procedure)
    with screen.busy("asking the drive"):
        inspection = inspect_drive(drive, profile, nameplate, plan)
    failed = [result for result in inspection.checks if not result.has_passed]
    document: dict[str, Any] = {
        "outcome": "rejected" if failed else "passed",
        "reason": f"check failed: {failed[0].name}"
        if failed
        else "every check passed; nothing was energised or written",
        "drive": inspection.identity,
        "nameplate_in_drive": inspection.nameplate,
        "parameters_in_drive": inspection.parameters,
        "watchdog": inspection.watchdog,
        "checks": inspection.checks,
    }
    if as_json:
        screen.emit(document)
        if failed:
            raise SystemExit(CheckFailed.exit_code)
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
    if failed:
        first = failed[0]
        raise CheckFailed(document["reason"], step="check", value=first.value, limit=first.limit, remedy=first.remedy)
    screen.out.print(f"[green]{document['reason']}[/]")
