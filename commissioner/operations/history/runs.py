"""Which runs there are. Light: a list starts no estimator and reads no journal (tests/architecture/test_start_up.py)."""

from __future__ import annotations

import datetime as dt
import json
from dataclasses import dataclass, replace
from pathlib import Path

from commissioner.errors import UsageError
from commissioner.report.run.standing import Standing
from commissioner.run.archive.catalogue import find_folder, must_be_archive, read_run
from commissioner.run.archive.documents import Loss, read_result
from commissioner.run.archive.summary import RunSummary
from commissioner.run.index.index import Found, Refreshed
from commissioner.run.index.index import find as look_up
from commissioner.run.index.index import refresh as bring_into_step
from commissioner.run.index.rows import Row, Wanted

__all__ = ["Found", "Refreshed", "Row", "Wanted", "find_runs", "index_runs", "show_run", "write_runs"]


@dataclass(frozen=True)
class Archive:
    """The run folders, and the URL of a database that several computers share."""

    runs: Path
    database: str | None = None


def find_runs(archive: Archive, wanted: Wanted | None = None) -> Found:
    """Newest first, all of them where nothing is wanted; a folder that cannot be read is a row that says so. UsageError: a date
    that is none, an outcome that no run has."""
    wanted = wanted or Wanted()
    must_be_findable(wanted)
    return look_up(archive.runs, wanted, archive.database)


@dataclass(frozen=True)
class Shown:
    """A run, and what of its folder is not as the run left it."""

    summary: RunSummary
    losses: tuple[Loss, ...]


@dataclass(frozen=True)
class WrittenTable:
    table: str
    runs: int


def write_runs(archive: Archive, wanted: Wanted, out: Path) -> WrittenTable:
    """The runs that are wanted as a table. UsageError: no date, no ending of a table."""
    from commissioner.operations.history.runs_table import write_table

    return WrittenTable(
        str(out), write_table((json.loads(row.document) for row in find_runs(archive, wanted).rows), out)
    )


def show_run(runs: Path, run: str) -> Shown:
    """The run of which the id starts so, or the newest for `last`. UsageError: none or several. DataRefused: its result is damaged."""
    from commissioner.run.archive.verify import losses_at_sight

    folder = find_folder(runs, run)
    return Shown(replace(read_run(folder, with_result=False), result=read_result(folder)), losses_at_sight(folder))


def index_runs(archive: Archive, *, rebuild: bool = False) -> Refreshed:
    """The index in step with the folders, made where there is none; `rebuild`: from the folders alone. UsageError: there is no such archive."""
    must_be_archive(archive.runs)
    return bring_into_step(archive.runs, archive.database, rebuild=rebuild)


def must_be_findable(wanted: Wanted) -> None:
    """UsageError: a date that is none, an outcome that no run has; an empty list would say that there is no such run."""
    if wanted.outcome and wanted.outcome not in list(Standing):
        raise UsageError(
            "no run ends like this", step="archive", value=wanted.outcome, limit=" | ".join(Standing), remedy="ask for one of these",
        )  # fmt: skip
    for name in ("since", "until"):
        _check_date(getattr(wanted, name), name)


def _check_date(value: str, name: str) -> None:
    shape, rest = "2026-11-25T10:17:45", "2026-10-10T10:00:00"
    is_begun = len(value) >= 4 and all(
        a.isdigit() if b.isdigit() else a == b for a, b in zip(value, shape, strict=False)
    )
    try:
        fits = not value or (is_begun and bool(dt.datetime.fromisoformat(value + rest[len(value) :])))
    except ValueError:  # a month or day that no year has
        fits = False
    if not fits:
        raise UsageError(
            f"{name} is no date", step="archive", value=value, limit=f"{shape[:4]}, {shape[:7]}, {shape[:10]} or {shape}, UTC",
            remedy="write year, month and day with four, two and two digits",
        )  # fmt: skip
