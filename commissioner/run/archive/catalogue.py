"""What the archive holds, told from the folders alone, also for runs that were killed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commissioner.errors import UsageError
from commissioner.report.run.standing import ACCEPTED, RESTORED_SINCE
from commissioner.run.archive.folder import read_document, read_journal

RESTORED, OLD_OR_NEW = "as before (restored)", "old or new"


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

    @property
    def standing(self) -> str:
        """The outcome, and whether the drive holds what came of it."""
        if self.outcome != "commissioned" or self.is_unknown:
            return self.outcome
        if self.written.startswith(RESTORED):
            return RESTORED_SINCE
        return "commissioned" if self.written.startswith("new") else ACCEPTED

    @property
    def is_unknown(self) -> bool:
        """Only the drive can tell which parameter set it holds."""
        return self.written.startswith(OLD_OR_NEW)


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
    end: dict[str, Any] = next(reversed(_of(records, "run_ended")), {})
    return RunSummary(
        run=folder.name,
        folder=str(folder),
        outcome=str(end.get("outcome", "cut off")),
        reason=str(end.get("reason", _last_state(records))),
        drive=_drive(records),
        energised_s=_seconds(end.get("energised_s")),
        written=_written(records),
        result=_result(folder),
    )


def _of(records: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    """What was journalled as `kind`, in order."""
    return [line["record"] for line in records if line["kind"] == kind and isinstance(line["record"], dict)]


def _seconds(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0


def _result(folder: Path) -> dict[str, Any] | None:
    path = folder / "result.json"
    return (read_document(path.read_text("utf-8", errors="replace")) or None) if path.is_file() else None


def _drive(records: list[dict[str, Any]]) -> str:
    for found in _of(records, "drive_identified"):
        number = found.get("serial_number")
        return (
            f"{found.get('drive_type')} #{number}" if number else f"{found.get('drive_type')}, serial number not known"
        )
    return "not identified"


def _last_state(records: list[dict[str, Any]]) -> str:
    states = [record.get("state") for record in _of(records, "state_entered")]
    return f"the service ended while {states[-1]}" if states else "the service ended before it connected"


def _written(records: list[dict[str, Any]]) -> str:
    """Old, new, or unknown: the last announcement or confirmation in the journal decides."""
    said = "as before"
    for line in records:
        if line["kind"] == "parameters_written":
            said = "new" + _kept(line["record"]) + _wear(line["record"])
        elif line["kind"] == "snapshot_restored":
            said = RESTORED + _wear(line["record"])
        elif line["kind"] == "about_to" and _touches_parameters(line["record"]):
            said = f"{OLD_OR_NEW}: read the drive, or `commissioner restore` this run"
    return said


def _kept(report: Any) -> str:
    is_stored = not isinstance(report, dict) or report.get("is_stored", True)
    return ", read back and stored" if is_stored else ", read back; not stored, so lost at power-off"


def _wear(report: Any) -> str:
    """How much of the drive's non-volatile memory is used up, where the drive counts its writes."""
    facts = report if isinstance(report, dict) else {}
    used, endurance = facts.get("store_count_after"), facts.get("endurance_writes")
    return f"; {used} of {endurance} writes of the drive's memory used" if used and endurance else ""


def _touches_parameters(intent: Any) -> bool:
    return isinstance(intent, dict) and intent.get("action") in ("stage", "commit", "store")
