"""What the archive holds, told from the folders alone, also for runs that were killed."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commissioner.errors import UsageError
from commissioner.run.archive import read_journal


@dataclass(frozen=True)
class RunSummary:
    """`written` says which parameter set the drive holds after the run, as far as the run could know."""

    run: str
    folder: str
    outcome: str
    reason: str
    drive: str
    energised_s: float
    written: str
    result: dict[str, Any] | None = None


def read_runs(root: Path) -> list[RunSummary]:
    """Newest first; empty where there is no archive."""
    if not root.is_dir():
        return []
    return [summarise(path) for path in sorted(root.iterdir(), reverse=True) if (path / "journal.jsonl").is_file()]


def find_run(root: Path, name: str) -> RunSummary:
    """The one run whose id starts with `name`, or the newest for `last`."""
    runs = read_runs(root)
    matching = runs[:1] if name == "last" else [run for run in runs if run.run.startswith(name)]
    exact = [run for run in matching if run.run == name] or matching
    if len(exact) != 1:
        raise UsageError(
            f"{len(exact)} runs match {name!r}",
            step="archive",
            value=", ".join(run.run for run in exact[:5]) or "none",
            limit="exactly one",
            remedy=f"`commissioner runs list --runs {root}` shows the ids",
        )
    return exact[0]


def summarise(folder: Path) -> RunSummary:
    """The run in `folder`, from its result if it has one, else from its journal."""
    records = read_journal(folder / "journal.jsonl")
    result = _result(folder)
    end = next((r["record"] for r in reversed(records) if r["kind"] == "run_ended"), None)
    outcome, reason = (end["outcome"], end["reason"]) if end else ("cut off", _last_state(records))
    return RunSummary(
        run=folder.name,
        folder=str(folder),
        outcome=outcome,
        reason=reason,
        drive=_drive(records),
        energised_s=float(end["energised_s"]) if end else 0.0,
        written=_written(records),
        result=result,
    )


def _result(folder: Path) -> dict[str, Any] | None:
    path = folder / "result.json"
    if not path.is_file():
        return None
    document: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return document


def _drive(records: list[dict[str, Any]]) -> str:
    for record in records:
        if record["kind"] == "drive_identified":
            found = record["record"]
            return f"{found['drive_type']} #{found['serial_number']}"
    return "not identified"


def _last_state(records: list[dict[str, Any]]) -> str:
    states = [r["record"]["state"] for r in records if r["kind"] == "state_entered"]
    return f"the service ended while {states[-1]}" if states else "the service ended before it connected"


def _written(records: list[dict[str, Any]]) -> str:
    """Old, new, or unknown: judged by what was announced and what was confirmed."""
    kinds = [r["kind"] for r in records]
    if "parameters_written" in kinds:
        return "new, read back and stored"
    announced = {r["record"]["action"] for r in records if r["kind"] == "about_to"}
    if not announced & {"stage", "commit", "store"}:
        return "as before"
    if "snapshot_restored" in kinds:
        return "as before (restored)"
    return "old or new: read the drive, or `commissioner restore` this run"
