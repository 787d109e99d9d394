"""The report of a run that was cut off before it could make its own, from what its archive holds."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

from commissioner.procedure.findings import RunEnded
from commissioner.report.run_page import run_page
from commissioner.report.summary import summarise
from commissioner.run.archive import RunFolder, plain, read_journal
from commissioner.run.catalogue import RunSummary
from commissioner.run.replay import learn_again


def make_report(run: RunSummary) -> None:
    """`report.html` of the run. DataRefused where it never reached its drive."""
    path = Path(run.folder)
    job, findings = learn_again(path)
    ended = RunEnded(run.outcome, f"{run.reason}; parameters in the drive: {run.written}", run.energised_s)
    result = plain(summarise(findings, ended, run.run, job.parameter_names))
    journal = read_journal(path / "journal.jsonl")
    with closing(RunFolder(path)) as folder:
        folder.save_text("report.html", run_page(result, journal, findings))
