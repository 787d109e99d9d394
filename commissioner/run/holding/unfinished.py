"""A write-back, restore or tuning that a killed process left in the middle of a drive: told by whoever has that drive next."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from commissioner.errors import CommissionerError
from commissioner.procedure.findings import LeftUnfinished
from commissioner.records import DriveIdentity
from commissioner.report.run.standing import Held
from commissioner.run.archive.catalogue import is_ahead
from commissioner.run.archive.summary import held_of
from commissioner.run.index.index import find
from commissioner.run.index.rows import Wanted


@dataclass(frozen=True)
class Word:
    """What one run last said of its drive: `held` since `utc`."""

    run: str
    held: Held
    utc: str

    @property
    def _since(self) -> tuple[str, str]:
        return self.utc, self.run


def left_by(words: Iterable[Word]) -> str:
    """The run that left one drive in the middle; empty where it ended, or another wrote or restored since, and looked. Told by a
    clock that was ahead, it ended nothing of others, and nothing of others ended it."""
    of_drive = list(words)
    settled = [word for word in of_drive if word.held in (Held.NEW, Held.RESTORED) and not is_ahead(word.utc)]
    last = max((word._since for word in settled), default=("", ""))
    open_ends = [
        word for word in of_drive if word.held is Held.OLD_OR_NEW and (word._since > last or is_ahead(word.utc))
    ]
    return max(open_ends, key=lambda word: word._since).run if open_ends else ""


def left_unfinished(runs: Path, url: str, identity: DriveIdentity) -> LeftUnfinished | None:
    """By the archive in `runs`; None where the last run that wrote into this drive ended, or was restored. `url`: by which a drive
    without a serial number is known. An archive that cannot be looked through keeps no run from its work."""
    with suppress(CommissionerError, OSError, sqlite3.Error, ValueError):
        told = [json.loads(row.document) for row in find(runs, Wanted(drive=identity.drive_type)).rows]
        run = left_by(_word(one) for one in told if _is_same(one, url, identity))
        return LeftUnfinished(run) if run else None
    return None


def _word(run: dict[str, Any]) -> Word:
    return Word(run["run"], held_of(run), run["held_utc"] or run["started_utc"])


def _is_same(run: dict[str, Any], url: str, identity: DriveIdentity) -> bool:
    if identity.serial_number is None:
        return run["serial_number"] is None and run["url"] == url
    return bool(run["serial_number"] == identity.serial_number)
