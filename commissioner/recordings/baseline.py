"""The history of one machine on disk: healthy recordings, and every one judged against them since."""

from __future__ import annotations

import datetime as dt
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from commissioner.encoding import read_json
from commissioner.errors import ConfigurationError, UsageError
from commissioner.monitor.trend.trend import Entry, History, State, Verdict, judge
from commissioner.recordings.whole import write_text

VERSION = 1
MAX_BYTES = 50_000_000


def update(path: Path, entry: Entry, learn: bool) -> tuple[Verdict, History]:
    """Judge the entry against the history in `path` and store it there.

    The first recording of a new file, and every one with `learn`, becomes part of the healthy range; others are kept for
    the trend. The file is replaced whole or not at all.
    """
    is_new = not path.exists()
    entry = replace(entry, utc=dt.datetime.now(dt.UTC).isoformat(timespec="seconds"))
    history = History() if is_new else read(path)
    verdict = judge(entry, history)
    if is_new or learn:
        kept = replace(history, healthy=(*history.healthy, entry))
        verdict = replace(verdict, state=State.STORED) if is_new or not verdict.names else verdict
    else:
        kept = replace(history, judged=(*history.judged, entry))
    write(path, kept)
    return verdict, kept


def read(path: Path) -> History:
    """ConfigurationError where the file is not a baseline."""
    if not path.is_file() or path.stat().st_size > MAX_BYTES:
        raise UsageError(
            f"{path} is no baseline file",
            step="read baseline",
            value=str(path),
            limit="a file written by --baseline",
            remedy="name the file, not its folder",
        )
    try:
        document = read_json(path.read_text("utf-8"))
        if document["version"] != VERSION:
            raise ValueError(f"version {document['version']}")
        return History(tuple(map(_entry, document["healthy"])), tuple(map(_entry, document["judged"])))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigurationError(
            file=str(path), key="version", value=str(error), expected=f"a baseline file of version {VERSION}"
        ) from error


def write(path: Path, history: History) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    document = {
        "version": VERSION,
        "healthy": [asdict(entry) for entry in history.healthy],
        "judged": [asdict(entry) for entry in history.judged],
    }
    write_text(path, json.dumps(document, indent=1, allow_nan=False))


def _entry(raw: dict[str, Any]) -> Entry:
    return Entry(
        str(raw["source"]),
        float(raw["speed_rad_per_s"]),
        float(raw["torque_nm"]),
        float(raw["supply_hz"]),
        {str(name): (float(value), float(std)) for name, (value, std) in raw["indicators"].items()},
        str(raw.get("utc", "")),
    )
