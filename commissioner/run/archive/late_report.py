"""The report of a run that was cut off before it could make its own, from what its archive holds."""

from __future__ import annotations

from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path

from commissioner.encoding import plain
from commissioner.procedure.findings import RunEnded
from commissioner.report.page import with_notice
from commissioner.report.run.page import run_page
from commissioner.report.run.summary import summarise
from commissioner.run.archive.catalogue import RunSummary
from commissioner.run.archive.folder import RunFolder, read_journal
from commissioner.run.archive.replay import learn_again
from commissioner.run.archive.summary import read_file


def mark_restored(run: RunSummary) -> None:
    """The report says on top that the drive holds its old values again."""
    _mark(run, "Restored on {}: the drive holds the values it had before this run.")


def mark_written(run: RunSummary) -> None:
    """The report says on top that the drive holds the values that were only accepted when it was made."""
    _mark(run, "Written on {}: the drive holds the values of this report, read back.")


def _mark(run: RunSummary, sentence: str) -> None:
    """A disk that is full leaves the report as it is."""
    page = Path(run.folder) / "report.html"
    when = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    with suppress(OSError), closing(RunFolder(page.parent)) as folder:
        folder.save_text(page.name, with_notice(page.read_text("utf-8"), sentence.format(when)))


def make_report(run: RunSummary) -> None:
    """`report.html` of the run. DataRefused where it never reached its drive."""
    path = Path(run.folder)
    job, findings = learn_again(path)
    ended = RunEnded(run.outcome, f"{run.reason}; parameters in the drive: {run.written}", run.energised_s)
    result = plain(summarise(findings, ended, run.run, job.parameter_names, job.parameter_factors))
    journal = read_journal(path / "journal.jsonl")
    with closing(RunFolder(path)) as folder:
        folder.save_text("report.html", run_page(result, journal, findings, read_file(path / "request.json")))
