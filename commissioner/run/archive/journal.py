"""The journal of a run: one record a line, each with the digest of the line before it, so that no line can be changed,
added or taken out without the next one showing it.

A line: `{"n", "utc", "previous", "blocks", "kind", "record"}`. `previous`: SHA-256 of the line before, without its line feed;
64 zeros for the first. `blocks`: bytes of `blocks.bin` written by then and the SHA-256 over them.
Journals of version 0.1.0 have neither `previous` nor `blocks`: they are read, and called unverified.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from commissioner.encoding import plain
from commissioner.run.archive.documents import open_no_link, read_document

FIRST = 64 * "0"
"""What stands for the digest of the line before the first."""
Record = dict[str, Any]
LOCK = ".lock.part"
"""Held by whoever writes into the folder; gone when it is closed. By its ending no part of the run."""


def is_being_written(folder: Path) -> bool:
    """Whether a process has the folder now; False also where its disk knows no locks."""
    if not (folder / LOCK).exists():
        return False
    from filelock import FileLock, Timeout  # late: hardly any list asks

    lock = FileLock(folder / LOCK, thread_local=False)
    try:
        with lock.acquire(timeout=0):
            return False
    except Timeout:
        return True
    except OSError:
        return False


class Journal:
    """A journal open for adding. What a power loss left of a torn last line is cut off first."""

    def __init__(self, path: Path) -> None:
        whole = drop_torn_line(path)
        self.records = whole.count(b"\n")
        self.head = digest(whole.rstrip(b"\n").rpartition(b"\n")[2]) if whole else FIRST
        self._path = path
        self._file: TextIO = open(path, "a", encoding="utf-8", newline="\n", opener=open_no_link)  # noqa: SIM115

    def write(self, kind: str, record: object, blocks: tuple[int, str], *, durable: bool) -> None:
        """Append one record; `durable` returns only when it is on the disk. FileNotFoundError: somebody removed, moved or
        unmounted the folder, and what is written into the open file is lost."""
        line = {
            "n": self.records, "utc": dt.datetime.now(dt.UTC).isoformat(), "previous": self.head, "blocks": blocks,
            "kind": kind, "record": plain(record),
        }  # fmt: skip
        text = json.dumps(line, allow_nan=False)
        self._file.write(text + "\n")
        self._file.flush()
        self.records, self.head = self.records + 1, digest(text.encode())
        if durable:
            os.fsync(self._file.fileno())
        self._path.stat()

    def close(self) -> None:
        with suppress(OSError):
            self._file.close()


def digest(data: bytes) -> str:
    """SHA-256 in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def read_journal(path: Path) -> list[Record]:
    """The journal's records, up to the first line that is not a whole one."""
    return _records(path.read_bytes())[0] if path.is_file() else []


@dataclass(frozen=True)
class Line:
    """One line as it lies in the file; `record` None: it is not a whole record. `digest` is what the next line must carry."""

    record: Record | None
    digest: str


def read_lines(path: Path) -> tuple[list[Line], bool]:
    """Every line, whole or not, and whether the last one is torn (no line feed: what a kill leaves)."""
    data = path.read_bytes() if path.is_file() else b""
    *lines, rest = data.split(b"\n")
    return [Line(_record(line), digest(line)) for line in lines], bool(rest)


def _records(data: bytes) -> tuple[list[Record], int]:
    """Records up to the first line that is none or has no end, and the bytes they take."""
    records: list[Record] = []
    size = 0
    *lines, _ = data.split(b"\n")
    for line in lines:
        record = _record(line)
        if record is None:
            break
        records.append(record)
        size += len(line) + 1
    return records, size


def _record(line: bytes) -> Record | None:
    record = read_document(line.decode("utf-8", errors="replace"))
    return record if isinstance(record.get("kind"), str) and "record" in record else None


def whole_lines(path: Path) -> bytes:
    """The journal without what a kill or a power loss left after its last line feed."""
    data = path.read_bytes() if path.is_file() else b""
    return data[: data.rfind(b"\n") + 1]


def drop_torn_line(path: Path) -> bytes:
    """The whole lines, once what follows the last of them is cut off, so that what is added can be read."""
    whole = whole_lines(path)
    if path.is_file() and path.stat().st_size > len(whole):
        os.truncate(path, len(whole))
    return whole
