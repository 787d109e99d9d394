"""Who logged in, energised, stopped, wrote, restored: one line each, appended, each with the hash of the one before."""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
import threading
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from commissioner.encoding import JsonObject, read_json
from commissioner.service.contract.people import AuditEntry

FIRST = "0" * 64
"""What the first line carries as the hash of its predecessor."""


@dataclass(frozen=True)
class Chain:
    """What a check of the whole file found. `broken_at`: number of the first line that does not follow its predecessor."""

    lines: int
    head: str
    broken_at: int | None

    @property
    def is_intact(self) -> bool:
        return self.broken_at is None


class Audit:
    """The service's own log. Every entry is on the disk before what it says is answered."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = threading.Lock()
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        _end_last_line(path)
        found = verify(path)
        self._number, self._head = found.lines, found.head

    def write(self, person: str, address: str, what: str, **facts: Any) -> None:
        """Append one entry. OSError where the disk takes no more: what needs an entry is then not done."""
        with self._lock:
            when = dt.datetime.now(dt.UTC).isoformat(timespec="milliseconds")
            entry = {"n": self._number, "utc": when, "person": person, "from": address, "what": what, **facts}
            digest = _digest(self._head, entry)
            line = json.dumps(entry | {"before": self._head, "hash": digest}, ensure_ascii=False) + "\n"
            _append(self._path, line)
            self._number, self._head = self._number + 1, digest

    def newest(self, limit: int) -> list[AuditEntry]:
        """The last entries, newest first."""
        return [cast("AuditEntry", entry) for entry in reversed(deque(_entries(self._path), maxlen=limit))]

    def verify(self) -> Chain:
        """The whole chain, read again from the disk."""
        with self._lock:
            return verify(self._path)


def verify(path: Path) -> Chain:
    """Follow the chain. A changed, missing or inserted line breaks it at its number."""
    head, count, broken = FIRST, 0, None
    for entry in _entries(path):
        said, before = entry.pop("hash", ""), entry.pop("before", "")
        if broken is None and (before != head or said != _digest(head, entry) or entry.get("n") != count):
            broken = count
        head, count = str(said), count + 1
    return Chain(count, head, broken)


def _append(path: Path, line: str) -> None:
    """The line, on the disk. OSError: nothing of it is there; half a line would spoil the next one."""
    before = path.stat().st_size if path.is_file() else 0
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
    except OSError:
        with suppress(OSError):
            os.truncate(path, before)
        raise


def _digest(head: str, entry: Mapping[str, Any]) -> str:
    text = json.dumps(entry, sort_keys=True, ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(f"{head}\n{text}".encode("utf-8", "replace")).hexdigest()


def _entries(path: Path) -> Iterator[JsonObject]:
    if not path.is_file():
        return
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            try:
                entry = read_json(line)
            except ValueError:
                entry = {"n": None, "what": "a line that cannot be read"}
            yield entry if isinstance(entry, dict) else {"n": None, "what": "a line that is no entry"}


def _end_last_line(path: Path) -> None:
    """What a power loss left of a last line stays, as a line of its own that cannot be read."""
    if path.is_file() and path.stat().st_size and not path.read_bytes().endswith(b"\n"):
        with Path(path).open("ab") as file:
            file.write(b"\n")
