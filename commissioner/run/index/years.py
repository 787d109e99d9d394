"""A motor over the years: its earlier runs in the archive beside the newest, as the run's report shows them."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

from commissioner.errors import CommissionerError
from commissioner.history.motor import Measured, Trends, motor_trends
from commissioner.run.archive.catalogue import read_run
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.summary import RunSummary, summary_of
from commissioner.run.index.index import find
from commissioner.run.index.results import has_result, result_of
from commissioner.run.index.rows import Row, Wanted


def over_years(folder: Path) -> Trends | None:
    """Of the motor that the run in `folder` was made on, up to this run. None: nobody said which motor it is, the run identified nothing,
    or nothing stands in the archive beside it. A run whose folder cannot be read is left out."""
    newest = summary_of(folder, read_journal(folder / "journal.jsonl"))
    if not newest.motor_id or not has_result(newest):
        return None
    measured = [*(measured_in(run) for run in _earlier(folder.parent, newest)), measured_in(newest)]
    return motor_trends(measured) if len(measured) > 1 else None


def measured_in(run: RunSummary) -> Measured:
    """DataRefused: the run identified nothing."""
    return Measured(run.run, seconds(run.started_utc), result_of(run))


def seconds(utc: str) -> float:
    """Since 1970; 0 where the text is no date."""
    try:
        return dt.datetime.fromisoformat(utc).timestamp()
    except ValueError:
        return 0.0


def rows_of(root: Path, motor: str, database: str | None = None) -> list[Row]:
    """A motor's runs, newest first, by tag, serial number or the name of its plate, as they were given."""
    return [row for row in find(root, Wanted(motor=motor), database).rows if motor in row.motor_names]


def _earlier(root: Path, newest: RunSummary) -> list[RunSummary]:
    """In order of time."""
    found = []
    for row in reversed(rows_of(root, newest.motor_id)):
        if row.run == newest.run:
            continue
        try:
            summary = read_run(Path(row.folder))
        except (CommissionerError, OSError):
            continue
        if has_result(summary) and summary.started_utc <= newest.started_utc:
            found.append(summary)
    return found
