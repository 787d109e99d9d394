"""A write-back, restore or tuning that a killed process left in the middle of a drive: told by whoever has that drive next."""

from __future__ import annotations

import json
import sqlite3
from contextlib import suppress
from pathlib import Path
from typing import Any

from commissioner.errors import CommissionerError
from commissioner.procedure.findings import LeftUnfinished
from commissioner.records import DriveIdentity
from commissioner.run.archive.summary import AS_BEFORE, OLD_OR_NEW
from commissioner.run.index.index import find
from commissioner.run.index.rows import Wanted


def left_unfinished(runs: Path, url: str, identity: DriveIdentity) -> LeftUnfinished | None:
    """By the archive in `runs`; None where the last run that wrote into this drive ended, or was restored. `url`: by which a drive
    without a serial number is known. An archive that cannot be looked through keeps no run from its work."""
    with suppress(CommissionerError, OSError, sqlite3.Error, ValueError):
        for row in find(runs, Wanted(drive=identity.drive_type)).rows:
            run: dict[str, Any] = json.loads(row.document)
            if not _is_same(run, url, identity):
                continue
            if row.holds == OLD_OR_NEW:
                return LeftUnfinished(row.run)
            if run["written"] != AS_BEFORE:  # it wrote or restored, and looked
                return None
    return None


def _is_same(run: dict[str, Any], url: str, identity: DriveIdentity) -> bool:
    if identity.serial_number is None:
        return run["serial_number"] is None and run["url"] == url
    return bool(run["serial_number"] == identity.serial_number)
