"""Motors as things: which run was made on which motor, as a person says and the parameters bear out."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from commissioner.errors import DataRefused, UsageError
from commissioner.identify.estimate.axes import Comparison, Identity
from commissioner.operations.history.compare import beside
from commissioner.operations.history.runs import Archive, Wanted, find_runs
from commissioner.run.archive.catalogue import find_run, read_run
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.origin import this_process
from commissioner.run.archive.seal import CLOSED
from commissioner.run.archive.summary import NAMED, RunSummary
from commissioner.run.index.results import has_result, result_of
from commissioner.run.index.rows import Row
from commissioner.run.index.years import rows_of

JUDGED_AGAINST = 5
"""Newest accepted results of a motor that a run is compared with at most."""


@dataclass(frozen=True)
class Motor:
    """One motor of the archive. `motor` is its tag, or its serial number; empty: runs of which nobody said which motor it is,
    of one plate on one drive. Dates in UTC."""

    motor: str
    serial: str
    plate: str
    drive: str
    runs: int
    first_utc: str
    last_utc: str
    last_run: str
    last_standing: str


@dataclass(frozen=True)
class Likeness:
    """How a run's result looks beside the newest comparable one of a motor."""

    motor: str
    serial: str
    against: str
    comparison: Comparison


@dataclass(frozen=True)
class Named:
    """What was added to a run's journal; `likeness`: how it looks beside the motor's earlier runs, None where there are none."""

    run: str
    motor_tag: str
    motor_serial: str
    person: str
    likeness: Likeness | None


def list_motors(archive: Archive) -> tuple[Motor, ...]:
    """The last used first."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in find_runs(archive).rows:
        if row.motor or row.plate:
            groups.setdefault((row.motor,) if row.motor else ("", row.plate, row.drive), []).append(row)
    return tuple(_motor(rows) for rows in groups.values())


def runs_of(archive: Archive, motor: str) -> tuple[Row, ...]:
    """A motor's runs, newest first, by tag, serial number or its plate's name, as they were given. UsageError: there is none."""
    rows = rows_of(archive.runs, motor, archive.database)
    if not rows:
        known = [found.motor for found in list_motors(archive) if found.motor]
        raise UsageError(
            f"no run was made on a motor {motor!r}", step="archive", value=motor,
            limit=", ".join(known[:5]) + (" ..." if len(known) > 5 else "") or "no motor has a name yet",
            remedy="`commissioner runs motors` lists them; `commissioner runs motors RUN --tag TAG` says which motor a run was made on",
        )  # fmt: skip
    return tuple(rows)


def judge_motor(archive: Archive, run: str) -> tuple[Likeness, ...]:
    """The run beside every named motor of its plate, the most alike first. DataRefused: it identified nothing."""
    summary = find_run(archive.runs, run)
    result_of(summary)
    rows = [row for row in find_runs(archive).rows if row.motor and row.run != summary.run]
    by_motor: dict[str, list[Row]] = {}
    for row in rows:
        by_motor.setdefault(row.motor, []).append(row)
    found = [_likeness(summary, motor, own) for motor, own in by_motor.items()]
    order = [Identity.SAME, Identity.CHANGED, Identity.OTHER]
    return tuple(
        sorted(
            (one for one in found if one is not None),
            key=lambda one: (order.index(one.comparison.verdict), one.comparison.changes[0].sigmas),
        )
    )


def name_motor(archive: Archive, run: str, *, tag: str, serial: str = "", confirm: bool = False) -> Named:
    """Add to the run's journal which motor it was made on. UsageError: no tag and no serial number, or the run still goes on.
    DataRefused: the motor of that name has other parameters, unless a person confirms that it is the same one."""
    tag, serial = tag.strip(), serial.strip()
    if not tag and not serial:
        raise UsageError(
            "a motor needs a tag or a serial number", step="name the motor", value="neither", limit="one of them",
            remedy="add --tag TAG or --motor-serial NUMBER",
        )  # fmt: skip
    summary = find_run(archive.runs, run)
    folder = Path(summary.folder)
    records = read_journal(folder / "journal.jsonl")
    if not any(record["kind"] == CLOSED for record in records):  # a restore that was killed since leaves more behind it
        raise UsageError(
            f"{summary.run} has not been closed", step="name the motor", value=summary.outcome, limit="a run that has ended",
            remedy="wait for its end; a run that was cut off identified nothing that could be named",
        )  # fmt: skip
    own = [
        row
        for row in find_runs(archive, Wanted(motor=tag or serial)).rows
        if row.motor == (tag or serial) and row.run != summary.run
    ]
    likeness = _likeness(summary, tag or serial, own) if has_result(summary) else None
    if likeness is not None and likeness.comparison.verdict is Identity.OTHER and not confirm:
        raise DataRefused(
            f"{summary.run} was made on another motor than {likeness.against}, by its parameters", step="name the motor",
            value=likeness.comparison.reason, limit="parameters of the same motor",
            remedy="give another tag, or say with --confirm that it is the same motor, rewound or repaired",
        )  # fmt: skip
    person = this_process().person
    with closing(RunFolder(folder)) as opened:
        facts = {
            "motor_tag": tag,
            "motor_serial": serial,
            "person": person,
            "was_confirmed": confirm,
            "likeness": likeness,
        }
        opened.journal(NAMED, facts, durable=True)
    return Named(summary.run, tag, serial, person, likeness)


def _likeness(summary: RunSummary, motor: str, rows: Sequence[Row]) -> Likeness | None:
    """Beside the newest of the motor's runs that identified something and were made under such a plate; None: there is none."""
    for row in rows[:JUDGED_AGAINST]:
        other = read_run(Path(row.folder))
        if has_result(other) and dict(other.motor) == dict(summary.motor):
            return Likeness(motor, row.motor_serial, other.run, beside(result_of(other), result_of(summary)).comparison)
    return None


def _motor(rows: Sequence[Row]) -> Motor:
    newest = rows[0]
    return Motor(
        newest.motor, newest.motor_serial, newest.plate, newest.drive, len(rows), rows[-1].started_utc, newest.started_utc, newest.run,
        newest.standing,
    )  # fmt: skip
