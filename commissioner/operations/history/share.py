"""Run folders to a share and from it: proved by their chain, resumed where it broke off, never a changed one over a whole one."""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from commissioner.errors import CommissionerError, UsageError
from commissioner.run.archive.catalogue import find_folder, run_folders
from commissioner.run.archive.documents import open_no_link
from commissioner.run.archive.journal import drop_torn_line, whole_lines
from commissioner.run.archive.seal import cover
from commissioner.run.archive.verify import DAMAGED, verify
from commissioner.run.index.index import JOURNAL, note

INCOMING = ".incoming"
"""Folder of the target in which runs stand until they are whole; a list does not look into it."""
PIECE = 1 << 20
COPIED, UPDATED, THERE, NEWER, LEFT, NOT_TAKEN, CONFLICT = (
    "copied",
    "updated",
    "there already",
    "newer there",
    "left: damaged",
    "left: not taken",
    "conflict",
)
CONFLICTING = "the two have gone different ways since they were copied; neither was touched"


@dataclass(frozen=True)
class Moved:
    """What became of one run; `why` where it was not taken along."""

    run: str
    what: str
    files: int
    bytes: int
    why: str = ""

    @property
    def is_good(self) -> bool:
        """False where a person has to look at it."""
        return self.what not in (LEFT, NOT_TAKEN, CONFLICT)


def push(runs: Path, target: str, names: Sequence[str] = ()) -> tuple[Moved, ...]:
    """The runs named, or all, into the archive at `target`. CommissionerError: the target cannot be written; what was copied
    by then stays, and the next call goes on from there."""
    return _move(runs, _folder(target), names)


def pull(runs: Path, source: str, names: Sequence[str] = ()) -> tuple[Moved, ...]:
    """As `push`, the other way round."""
    origin = _folder(source)
    if not origin.is_dir():
        raise UsageError(
            f"there is no archive at {source}",
            step="pull",
            value=source,
            limit="a folder of runs",
            remedy="is the share mounted?",
        )
    return _move(origin, runs, names)


def _move(source: Path, target: Path, names: Sequence[str]) -> tuple[Moved, ...]:
    if source.resolve() == target.resolve():
        raise UsageError(
            "source and target are the same archive", step="move runs", value=str(target), limit="two archives",
            remedy="give another folder",
        )  # fmt: skip
    if target.exists() and not target.is_dir():
        raise UsageError(
            f"{target} is a file, no archive", step="move runs", value=str(target), limit="a folder of runs, or none yet",
            remedy="give another folder",
        )  # fmt: skip
    folders = [find_folder(source, name) for name in names] if names else run_folders(source)
    try:
        target.mkdir(parents=True, exist_ok=True)
        return tuple(_one(folder, target) for folder in folders)
    except OSError as failure:
        raise CommissionerError(
            f"{target} takes no more: {failure.strerror or failure}", step="move runs", value=failure.filename or str(target),
            limit="a folder with room that this user may write", remedy="make room or mount the share again; the same call goes on",
        ) from failure  # fmt: skip


def _one(folder: Path, target: Path) -> Moved:
    there, seen = target / folder.name, verify(folder)
    if seen.state == DAMAGED:
        return Moved(folder.name, LEFT, 0, 0, f"{seen.losses[0].file}: {seen.losses[0].what}")
    relation = _relation(folder, there) if (there / JOURNAL).is_file() else COPIED
    if relation == CONFLICT:
        return Moved(folder.name, CONFLICT, 0, 0, CONFLICTING)
    if relation == THERE and verify(there).state == DAMAGED:
        relation = UPDATED  # what lies there was spoilt; ours is whole
    if relation in (THERE, NEWER):
        return Moved(folder.name, relation, 0, 0)
    try:
        return _moved(folder, there, relation)
    except FileNotFoundError:
        if (there / JOURNAL).is_file() and _relation(folder, there) == THERE:  # another mover was faster
            return Moved(folder.name, THERE, 0, 0)
        raise


def _moved(folder: Path, there: Path, relation: str) -> Moved:
    incoming = there.parent / INCOMING / folder.name
    files, size = _copy(folder, incoming)
    drop_torn_line(incoming / JOURNAL)
    arrived = verify(incoming)
    if arrived.state == DAMAGED:
        shutil.rmtree(incoming, ignore_errors=True)
        why = f"it was written to, or the copy is not what was read ({arrived.losses[0].what}); try again"
        return Moved(folder.name, LEFT, 0, 0, why)
    _put_in_place(incoming, there)
    note(there)
    return Moved(folder.name, relation, files, size)


def _relation(folder: Path, there: Path) -> str:
    """By the chains: one journal that begins with the other is its later state."""
    ours, theirs = whole_lines(folder / JOURNAL), whole_lines(there / JOURNAL)
    if ours == theirs:
        return THERE
    if ours.startswith(theirs):
        return UPDATED
    return NEWER if theirs.startswith(ours) else CONFLICT


def _copy(folder: Path, incoming: Path) -> tuple[int, int]:
    """(files, bytes) that had to be copied: what lies there whole from a copy that broke off stays, what was begun goes on."""
    incoming.mkdir(parents=True, exist_ok=True)
    files = size = 0
    names = file_names(folder)
    with os.scandir(incoming) as entries:
        left_over = [entry.name for entry in entries if entry.name not in names]
    for name in left_over:
        (incoming / name).unlink()
    for name in names:
        if copied := _copy_file(folder / name, incoming / name):
            files, size = files + 1, size + copied
    return files, size


def file_names(folder: Path) -> list[str]:
    """The files that a run consists of."""
    with os.scandir(folder) as entries:
        return sorted(
            entry.name for entry in entries if entry.is_file(follow_symlinks=False) and not entry.name.endswith(".part")
        )


def _copy_file(source: Path, target: Path) -> int:
    """Bytes copied, on the disk when this returns. A beginning that is not ours is copied anew."""
    begun = target.stat().st_size if target.is_file() else 0
    with source.open("rb") as origin:
        if begun and _digest(origin, begun) != cover(target)["sha256"]:
            begun = 0
        origin.seek(begun)
        with open(target, "r+b" if begun else "wb", opener=open_no_link) as file:
            file.seek(begun)
            shutil.copyfileobj(origin, file, PIECE)
            file.truncate()
            copied = file.tell() - begun
            file.flush()
            os.fsync(file.fileno())
    shutil.copystat(source, target)
    return copied


def _digest(file: BinaryIO, count: int) -> str:
    found = hashlib.sha256()
    while count > 0 and (piece := file.read(min(PIECE, count))):
        found.update(piece)
        count -= len(piece)
    return found.hexdigest()


def _put_in_place(incoming: Path, there: Path) -> None:
    """An older state makes room only once the newer one is whole beside it; a kill in between leaves both under `.incoming`."""
    old = incoming.with_name(f"{incoming.name}.old")
    shutil.rmtree(old, ignore_errors=True)
    if there.exists():
        there.rename(old)
    try:
        incoming.rename(there)
    except OSError:
        with suppress(OSError):
            old.rename(there)
        raise
    shutil.rmtree(old, ignore_errors=True)
    with suppress(OSError):
        incoming.parent.rmdir()


def _folder(target: str) -> Path:
    if "://" in target:
        raise UsageError(
            "runs are moved to a folder, or pushed to a service", step="move runs", value=target.partition("://")[0] + "://...",
            limit="a folder, also of a mounted share; http(s)://HOST:PORT to push", remedy="mount the share and give its folder",
        )  # fmt: skip
    return Path(target)
