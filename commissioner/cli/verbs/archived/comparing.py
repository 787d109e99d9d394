"""`commissioner runs compare`: what moved between two runs, a run and recordings, a run and what the drive holds."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.motor.quantities import field_name
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
    rows = [
        (field_name(c.parameter), f"{100 * c.relative_change:+.2f} %", f"{c.sigmas:.1f}") for c in comparison.changes
    ]
    screen.out.print(f"[bold]{comparison.verdict.value}[/]\n  {screen.text(comparison.reason)}")
    screen.out.print(screen.table("", ("parameter", "change", "standard errors"), rows, right=(1, 2)))
    if done.explained_by:
        screen.out.print("  each of these alone would explain it:")
    for one in done.explained_by:
        screen.out.print(f"    {screen.text(one.sentence)}")
    for sentence in done.common.sentences:
        screen.out.print(f"  [dim]•[/] {screen.signs(screen.text(sentence))}")


def _show_held(done: Held) -> None:
    screen.out.print(f"[bold]{screen.text(done.drive)} holds {done.holds}[/] ({screen.text(done.run)})")
    rows = [
        (
            field_name(row.parameter),
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
    if done.holds != "the run's values":
        screen.out.print(f"  [dim]•[/] {screen.text(_levels(done))}", soft_wrap=True)


def _levels(done: Held) -> str:
    """At which flux the two L_M hold, as far as it is known."""
    ours = (
        "the run says no flux"
        if done.holds_for_stator_flux_wb is None
        else f"the run's L_M and T_R hold at {done.holds_for_stator_flux_wb:.3f} Wb of stator flux"
    )
    if done.set_by is None:
        return f"{ours}; at which flux the drive's hold is not known: saturation alone moves them"
    theirs = done.set_by.holds_for_stator_flux_wb
    level = "at a flux it does not say" if theirs is None else f"at {theirs:.3f} Wb"
    return f"{ours}; the drive's are those of {done.set_by.run}, {level}: `commissioner runs compare {done.set_by.run} {done.run}` brings both to one flux"
