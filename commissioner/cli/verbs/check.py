"""`commissioner check`: everything that can be known without energising or writing."""

from __future__ import annotations

from dataclasses import asdict

from commissioner.cli.screens import screen
from commissioner.operations.check import Checked, CheckRequest
from commissioner.operations.check import check as carry_out


def check(request: CheckRequest, *, as_json: bool) -> None:
    """Prints every check; exit 3 where one fails."""
    with screen.busy("asking the drive"):
        done = carry_out(request)
    if as_json:
        screen.emit(done)
        if done.failure:
            raise SystemExit(done.failure.exit_code)
        return
    _show(done)
    if done.failure:
        raise done.failure
    screen.out.print(f"[green]{done.reason}[/]")


def _show(done: Checked) -> None:
    from commissioner.report.sheet.words import check_words

    drive = done.drive
    firmware = f"firmware {drive.firmware_version}" if drive.firmware_version else "firmware unknown"
    screen.out.print(f"[bold]{screen.text(drive.words)}[/], {firmware}")
    rows = [
        (
            "[green]✓[/]" if r.has_passed else "[red]✗[/]",
            *map(screen.text, check_words(asdict(r))),
            "" if r.has_passed else screen.text(r.remedy),
        )
        for r in done.checks
    ]
    rows += [("[yellow]–[/]", r.name, "not checked", "", screen.text(r.why)) for r in done.not_checked]
    header, width = ("", "check", "seen", "wanted", "remedy"), 5 if any(row[4] for row in rows) else 4
    screen.out.print(screen.table("", header[:width], [row[:width] for row in rows]))
    for remark in done.remarks:
        screen.out.print(f"[yellow]•[/] {screen.text(remark)}")
