"""What closes a run folder: a last record that covers every file, and, with a key, a seal over that.

The chain of digests shows damage and careless editing. It does not stop somebody who computes it anew: against that stands a
seal (HMAC-SHA256 with a key that lies elsewhere), and, before anything is written into a drive, the plausibility box and the
drive's own identity.
"""

from __future__ import annotations

import hashlib
import hmac
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict

from commissioner.errors import UsageError

CLOSED, TO_COME = "folder_closed", "file_to_come"
"""Kinds of records: of every file as it is; of one that is about to take another's place."""
SHORTEST_KEY, LONGEST_KEY = 16, 65536
"""Bytes."""
NOT_COVERED = ("journal.jsonl", "blocks.bin", "summary.json")
"""The first two by the chain itself, the third follows from the last record."""


class Covered(TypedDict):
    """One file as it was when the folder was closed."""

    bytes: int
    sha256: str


Noted = Covered | Any
"""What a journal says of a file: one that somebody else wrote may say anything."""


def read_key(path: Path) -> bytes:
    """The bytes of a key file. UsageError: it cannot be read or is too short or too long to be one."""
    try:
        with path.open("rb") as file:  # a pipe may hand it over, a device without end must not
            key = file.read(LONGEST_KEY + 1).strip()
    except OSError as error:
        raise UsageError(
            f"the key file {path} cannot be read: {error.strerror or error}", step="seal", value=str(path),
            limit="a file that this user may read", remedy="give --seal a key file, e.g. 32 random bytes",
        ) from error  # fmt: skip
    if not SHORTEST_KEY <= len(key) <= LONGEST_KEY:
        is_short = len(key) < SHORTEST_KEY
        raise UsageError(
            f"the key in {path} is too {'short' if is_short else 'long'}", step="seal",
            value=f"{len(key)} bytes" if is_short else f"more than {LONGEST_KEY} bytes",
            limit=f"{SHORTEST_KEY} ... {LONGEST_KEY} bytes", remedy="make one of 32 random bytes and keep it off the run folders",
        )  # fmt: skip
    return key


def cover_of(data: bytes) -> Covered:
    """Size and SHA-256 of a file that is to hold this."""
    return {"bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def cover(path: Path) -> Covered:
    """Size and SHA-256 of one file."""
    with path.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    return {"bytes": path.stat().st_size, "sha256": found}


def covers(folder: Path, names: Iterable[str]) -> dict[str, Covered]:
    """Of each of the files that is there and that the chain does not cover by itself."""
    wanted = [name for name in sorted(names) if name not in NOT_COVERED]
    return {name: cover(folder / name) for name in wanted if (folder / name).is_file()}


def covered_files(records: Iterable[Mapping[str, Any]]) -> dict[str, Noted]:
    """Names and digests of what these records of a journal speak of, the last one of each."""
    found: dict[str, Noted] = {}
    for line in records:
        files = line["record"].get("files") if isinstance(line["record"], dict) else None
        found |= files if isinstance(files, dict) else {}
    return found


def as_closed(journal: Iterable[Mapping[str, Any]]) -> dict[str, Noted]:
    """What the last closing record covers."""
    return covered_files([line for line in journal if line["kind"] == CLOSED][-1:])


def to_come(journal: Sequence[Mapping[str, Any]]) -> dict[str, list[Noted]]:
    """What sessions that were killed before one closed the folder had said would take a file's place: the file may be any of these."""
    last = max((number for number, line in enumerate(journal) if line["kind"] == CLOSED), default=len(journal))
    found: dict[str, list[Noted]] = {}
    for line in journal[last + 1 :]:
        for name, wanted in covered_files([line]).items() if line["kind"] == TO_COME else ():
            found.setdefault(name, []).append(wanted)
    return found


def seal(key: bytes, previous: str, record: Mapping[str, Any]) -> dict[str, str]:
    """The proof that whoever closed the folder had the key: over the chain up to here and over all that is covered."""
    return {"algorithm": "HMAC-SHA256", "mac": hmac.new(key, _sealed(previous, record), hashlib.sha256).hexdigest()}


def is_sealed_by(key: bytes, previous: object, record: Mapping[str, Any]) -> bool:
    """True where the closing record carries the seal of this key."""
    found = record.get("seal")
    mac = found.get("mac") if isinstance(found, dict) else None
    wanted = seal(key, str(previous), record)["mac"]
    return isinstance(mac, str) and hmac.compare_digest(mac.encode(), wanted.encode())


def _sealed(previous: str, record: Mapping[str, Any]) -> bytes:
    kept = {name: value for name, value in record.items() if name != "seal"}
    return f"{previous}\n{json.dumps(kept, sort_keys=True, allow_nan=False)}".encode()
