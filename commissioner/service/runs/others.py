"""Runs that somebody else of this computer started: which go on, what they were asked to do, on which drive."""

from __future__ import annotations

import contextlib
import datetime as dt
import time
from pathlib import Path

from commissioner.encoding import JsonObject
from commissioner.errors import CommissionerError
from commissioner.run.archive.catalogue import by_age
from commissioner.run.archive.summary import read_file
from commissioner.service.library import Drive, Library

FRESH_S = 5.0
"""A run without a lock here (another computer's on a share, or one that only diagnoses) goes on where its journal is so young."""
COPIED_S = 60.0
"""A journal's file is as old as its last line, but for what two computers' clocks differ by; a copy's is as old as the copying."""
NEWEST = 20


def going_on(runs: Path, holding: frozenset[str]) -> list[Path]:
    """Folders of the archive whose run has its drive (`holding`), and of those whose journal was written to just now."""
    if not runs.is_dir():
        return []
    names, now = sorted((path.name for path in runs.iterdir()), key=by_age(), reverse=True), time.time()
    found = [runs / name for name in names if name in holding]
    for name in (name for name in names[:NEWEST] if name not in holding):
        with contextlib.suppress(OSError):
            age_s = now - (runs / name / "journal.jsonl").stat().st_mtime
            if abs(age_s) < FRESH_S:  # a clock may have been set back
                found.append(runs / name)
    return found


def is_copied(folder: Path, last_utc: str) -> bool:
    """Whether the journal's file is of another time than its last line: somebody copied it, no run writes it. OSError: it is gone."""
    try:
        written_s = dt.datetime.fromisoformat(last_utc).timestamp()
    except ValueError:  # no line of ours
        return True
    return abs((folder / "journal.jsonl").stat().st_mtime - written_s) > COPIED_S


def request_of(folder: Path) -> JsonObject:
    """What a run was asked to do; empty as long as that is not written down."""
    with contextlib.suppress(OSError):
        return read_file(folder / "request.json")
    return {}


def drive_at(library: Library, url: str) -> Drive | None:
    """The drive of the library that this address leads to, however either is written."""
    from commissioner.link.files.drive_file import load_profile
    from commissioner.link.wire.url import parse_url
    from commissioner.run.holding.endpoint import endpoint

    for drive in (drive for drive in library.drives() if drive.url):
        with contextlib.suppress(CommissionerError):
            device = load_profile(drive.profile).link.device_id
            if endpoint(parse_url(drive.url), device) == endpoint(parse_url(url), device):
                return drive
    return None
