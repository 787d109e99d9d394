"""`commissioner runs compare`: what moved between two runs, a run and recordings, a run and what the drive holds."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.operations.history.compare import Compared, Held, compare_with_drive, compare_with_recordings
from commissioner.operations.history.compare import compare_runs as carry_out


def compare_runs(
    folder: Path, before: str, after: str, *, as_json: bool, recordings: tuple[Path, ...] = (), motor: str | None = None
) -> None:
    """Same motor, changed, or another one; and what would explain it."""
    with screen.busy("comparing"):
        done = (
            compare_with_recordings(folder, before, recordings, motor)
            if recordings
            else carry_out(folder, before, after)
        )
    if as_json:
        screen.emit(done)
    else:
        _show(done)


def compare_drive(folder: Path, run: str, drive: str | None, *, as_json: bool) -> None:
    """Does the drive hold what the run identified?"""
    with screen.busy("reading the drive"):
        done = compare_with_drive(folder, run, drive)
    if as_json:
        screen.emit(done)
    else:
        _show_held(done)


def _show(done: Compared) -> None:
    comparison = done.comparison
    rows = [(c.parameter, f"{100 * c.relative_change:+.2f} %", f"{c.sigmas:.1f}") for c in comparison.changes]
    screen.out.print(f"[bold]{comparison.verdict.value}[/]\n  {comparison.reason}")
    screen.out.print(screen.table("", ("parameter", "change", "standard errors"), rows, right=(1, 2)))
    if done.explained_by:
        screen.out.print("  each of these alone would explain it:")
    for one in done.explained_by:
        screen.out.print(f"    {one.sentence}")
    for sentence in done.common.sentences:
        screen.out.print(f"  [dim]•[/] {screen.text(sentence)}")


def _show_held(done: Held) -> None:
    screen.out.print(f"[bold]{screen.text(done.drive)} holds {done.holds}[/] ({screen.text(done.run)})")
    rows = [
        (
            row.parameter,
            f"{row.run:.5g}",
            f"{row.drive:.5g}",
            f"{100 * row.relative_change:+.2f} %",
            f"{row.sigmas:.1f}",
        )
        for row in done.rows
    ]
    screen.out.print(
        screen.table("", ("parameter", "run", "drive", "change", "standard errors"), rows, right=(1, 2, 3, 4))
    )
