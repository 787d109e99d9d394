"""What the index keeps of a run, and the statements that read and write it.

One text each for SQLite and PostgreSQL, with `:name` for what is bound. SQLite runs them through Python's own `sqlite3`, since to
import SQLAlchemy costs as much CPU as a whole list of 10 000 runs may take; any other database runs the same texts through
SQLAlchemy Core (`store`). Tables of a shared database are made and changed by alembic (`migrations`).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from commissioner.encoding import plain
from commissioner.motor.quantities import plate_words
from commissioner.run.archive.catalogue import names_until
from commissioner.run.archive.summary import NOT_KEPT, RunSummary, motor_names

SCHEMA = 4
"""Of an index, raised with every change of what a row holds; an earlier one is filled anew from the folders."""
CREATE = (
    "CREATE TABLE runs (place TEXT NOT NULL, run TEXT NOT NULL, folder TEXT NOT NULL, journal_bytes BIGINT NOT NULL, "
    "journal_mtime_ns BIGINT NOT NULL, started_utc TEXT NOT NULL, outcome TEXT NOT NULL, standing TEXT NOT NULL, "
    "reason TEXT NOT NULL, drive TEXT NOT NULL, holds TEXT NOT NULL, person TEXT NOT NULL, motor TEXT NOT NULL, "
    "motor_serial TEXT NOT NULL, plate TEXT NOT NULL, document TEXT NOT NULL, PRIMARY KEY (place, run))",
    "CREATE INDEX runs_by_motor ON runs (motor)",
    "CREATE INDEX runs_in_step ON runs (place, run, journal_bytes, journal_mtime_ns)",  # else to compare stamps reads every document
)


class Row(NamedTuple):
    """One run. `place`: the archive that holds it; `motor`: the tag or serial number a person gave, else empty; `plate`: the rated
    values in words and the name they were given under; `holds`: as the summary's; `document`: the summary as JSON text."""

    place: str
    run: str
    folder: str
    journal_bytes: int
    journal_mtime_ns: int
    started_utc: str
    outcome: str
    standing: str
    reason: str
    drive: str
    holds: str
    person: str
    motor: str
    motor_serial: str
    plate: str
    document: str

    @property
    def motor_names(self) -> tuple[str, ...]:
        """Of the summary."""
        return motor_names(json.loads(self.document))


COLUMNS = ", ".join(Row._fields)
UPSERT = (
    f"INSERT INTO runs ({COLUMNS}) VALUES ({', '.join(f':{name}' for name in Row._fields)}) ON CONFLICT (place, run) DO UPDATE SET "
    + ", ".join(f"{name} = excluded.{name}" for name in Row._fields[2:])
)
DELETE = "DELETE FROM runs WHERE place = :place AND run = :run"
CLEAR = "DELETE FROM runs WHERE place = :place"
STAMPS = "SELECT run, journal_bytes, journal_mtime_ns FROM runs WHERE place = :place"
Bound = Mapping[str, str | int]


@dataclass(frozen=True)
class Wanted:
    """Which runs; each part that is given must hold. `motor`: part of tag, serial number or plate; `serial`: of the drive or the
    motor, whole; `outcome`: as it ended or as it stands; `since`, `until`: UTC dates, until included; `text`: words, all of them
    anywhere. `limit` 0: all."""

    motor: str = ""
    drive: str = ""
    serial: str = ""
    person: str = ""
    outcome: str = ""
    since: str = ""
    until: str = ""
    text: str = ""
    limit: int = 0


DATED, CALLED = "run{c} >= '0' AND run{c} < '{until}'", "(run{c} < '0' OR run{c} >= '{until}')"
"""As `catalogue.by_age`: what is not called by a time that has been comes behind all that is. Ranges of the primary key: to sort by an
expression reads every document."""
_ALL_WORDS = "lower(run || ' ' || motor || ' ' || motor_serial || ' ' || plate || ' ' || drive || ' ' || person || ' ' || outcome || ' ' || reason)"


def select(wanted: Wanted, place: str, *, is_shared: bool) -> tuple[tuple[str, str], str, dict[str, str | int]]:
    """(the rows newest first, in two statements, how many there are without the limit, what is bound). Where several places share a database, a run
    that lies in more than one of them is told once, from here if it is here."""
    bound: dict[str, str | int] = {}
    parts = []
    for name, expression in (
        ("motor", "lower(motor || ' ' || motor_serial || ' ' || plate)"), ("drive", "lower(drive)"), ("person", "lower(person)"),
    ):  # fmt: skip
        if value := getattr(wanted, name).strip().lower():
            parts.append(f"{expression} LIKE :{name} ESCAPE '\\'")
            bound[name] = _part(value)
    for number, word in enumerate(wanted.text.lower().split()):
        parts.append(f"{_ALL_WORDS} LIKE :word{number} ESCAPE '\\'")
        bound[f"word{number}"] = _part(word)
    if serial := wanted.serial.strip():
        parts.append("(lower(motor_serial) = :serial OR drive LIKE :drive_serial ESCAPE '\\')")
        bound |= {"serial": serial.lower(), "drive_serial": f"%#{_part(serial)[1:-1]}"}
    if wanted.outcome:
        parts.append("(outcome = :outcome OR standing = :outcome)")
        bound["outcome"] = wanted.outcome
    if wanted.since:
        parts.append("started_utc >= :since")
        bound["since"] = wanted.since
    if wanted.until:
        parts.append("substr(started_utc, 1, :until_length) <= :until")
        bound |= {"until": wanted.until, "until_length": len(wanted.until)}
    source = "runs"
    if not is_shared:
        parts.append("place = :here")
    else:
        order = "ORDER BY CASE WHEN place = :here THEN 0 ELSE 1 END, place"
        source = f"(SELECT runs.*, row_number() OVER (PARTITION BY run {order}) AS nth FROM runs) AS told"
        parts.append("nth = 1")
    bound["here"] = place
    where = f" WHERE {' AND '.join(parts)}"
    limit = " LIMIT :most" if wanted.limit > 0 else ""
    count = f"SELECT count(*) FROM {source}{where}"
    collation, until = ' COLLATE "C"' if is_shared else "", names_until()
    dated, called = (
        f"SELECT {COLUMNS} FROM {source}{where} AND {half.format(c=collation, until=until)} ORDER BY run{collation} DESC{limit}"
        for half in (DATED, CALLED)
    )
    return (dated, called), count, bound


def row_of(summary: RunSummary, place: str, stamp: tuple[int, int]) -> Row:
    """The summary as a row; `stamp`: size and time of the journal that it was made from."""
    document = _rounded(plain(summary, without=NOT_KEPT)) | {
        "folder": summary.folder,
        "standing": summary.standing.value,
    }
    return Row(
        place, summary.run, summary.folder, *stamp, summary.started_utc or utc_of(summary.run), summary.outcome, summary.standing.value,
        summary.reason, summary.drive, summary.holds, summary.person, summary.motor_id,
        summary.motor_serial, ", ".join(filter(None, (plate_words(summary.motor), summary.motor_name))), json.dumps(document, separators=(",", ":"), allow_nan=False),
    )  # fmt: skip


def _rounded(value: Any) -> Any:
    """Numbers with as many digits as a list needs: half of what ten thousand rows would take."""
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    return float(f"{value:.9g}") if isinstance(value, float) else value


def utc_of(run: str) -> str:
    """A run's name begins with its time; empty where it does not."""
    digits = run[:8] + run[9:15]
    if len(digits) < 14 or not (digits.isascii() and digits.isdigit()) or run[8] != "-":
        return ""
    return f"{run[:4]}-{run[4:6]}-{run[6:8]}T{run[9:11]}:{run[11:13]}:{run[13:15]}+00:00"


def _part(value: str) -> str:
    """The value anywhere in a text, its own signs meant as they stand."""
    return "%" + value.replace("\\", "\\\\").replace("%", "\\%").replace("_", "\\_") + "%"
