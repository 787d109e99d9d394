"""`commissioner runs`: the archive."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from commissioner.cli import screen
from commissioner.run.catalogue import RunSummary, find_run, read_runs


def list_runs(folder: Path, *, as_json: bool) -> None:
    """All runs, newest first."""
    found = read_runs(folder)
    if as_json:
        screen.emit({"runs": found})
        return
    if not found:
        screen.out.print(f"no runs in {folder}/")
        return
    rows = [
        (run.run, screen.outcome_mark(run.outcome), run.drive, f"{run.energised_s:.1f} s", run.written, run.reason)
        for run in found
    ]
    screen.out.print(
        screen.table(
            "", ("run", "outcome", "drive", "energised", "parameters in the drive", "reason"), rows, right=(3,)
        )
    )


def show_run(folder: Path, name: str, *, as_json: bool) -> None:
    """One run, as its result says; a run that was cut off is told from its journal."""
    summary = find_run(folder, name)
    if as_json:
        screen.emit({"run": summary.run, "summary": summary, "result": summary.result})
        return
    _print(summary, summary.result)


def _print(summary: RunSummary, result: dict[str, Any] | None) -> None:
    screen.out.print(f"[bold]{summary.run}[/]  {screen.outcome_mark(summary.outcome)}  {summary.reason}")
    screen.out.print(f"  drive       {summary.drive}\n  energised   {summary.energised_s:.1f} s")
    screen.out.print(f"  parameters  {summary.written}\n  folder      {summary.folder}")
    if result is not None:
        screen.result(result)
