"""The index of one archive, brought into step with its folders whenever it is asked."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from commissioner.encoding import LARGEST
from commissioner.errors import CommissionerError
from commissioner.run.archive.catalogue import read_run
from commissioner.run.archive.origin import machine_part
from commissioner.run.index.rows import STAMPS, Row, Wanted, row_of, select
from commissioner.run.index.store import NAME, SharedStore, SqliteStore, Store, check_url, forget, open_file

FEW = 100
"""An archive of fewer runs has no index file unless one was asked for: its summaries are read in 20 ms."""
ARCHIVE = "COMMISSIONER_ARCHIVE"
"""Environment: the URL of a shared database that every ended run is told to as well."""
JOURNAL = "journal.jsonl"
T = TypeVar("T")
Stamps = Mapping[str, tuple[int, int]]
"""Run -> size and modification time of its journal: whatever happens to a run is journalled."""


@dataclass(frozen=True)
class Found:
    """`rows` newest first; `total`: how many there are without the limit; `indexed`: by what they were found."""

    rows: tuple[Row, ...]
    total: int
    indexed: str


@dataclass(frozen=True)
class Refreshed:
    """How many runs there are, were read anew, and were taken out as their folders are gone."""

    runs: int
    read: int
    gone: int
    index: str


def find(root: Path, wanted: Wanted, archive: str | None = None) -> Found:
    """The runs of the archive in `root` that are wanted; with `archive` also those that other computers told that database.

    An index that cannot be had here (a disk that is full or read-only, a lock that is held too long) is done without.
    """
    place, seen = place_of(root), stamps(root)
    if archive is not None:
        with closing(SharedStore(check_url(archive))) as shared:
            _refresh(shared, root, place, seen)
            return _select(shared, wanted, place, archive)
    if len(seen) >= FEW or (root / NAME).is_file():
        with suppress(sqlite3.Error):
            return _on_file(
                root, lambda store: (_refresh(store, root, place, seen), _select(store, wanted, place, NAME))[1]
            )
    with closing(SqliteStore(None)) as memory:
        _refresh(memory, root, place, seen)
        return _select(memory, wanted, place, "folders")


def refresh(root: Path, archive: str | None = None, *, rebuild: bool = False) -> Refreshed:
    """Bring the index into step; `rebuild` reads every folder, and needs nothing of what was there. CommissionerError: it
    cannot be written."""
    place, seen = place_of(root), stamps(root)
    try:
        if archive is None:
            read, gone = _on_file(root, lambda store: _refresh(store, root, place, seen, anew=rebuild))
        else:
            with closing(SharedStore(check_url(archive))) as shared:
                read, gone = _refresh(shared, root, place, seen, anew=rebuild)
    except (sqlite3.Error, OSError) as failure:
        raise CommissionerError(
            f"the index cannot be written: {failure}", step="archive index", value=str(root / NAME),
            limit="a folder that this user may write", remedy="lists work without it, from the folders; free the disk or the lock",
        ) from failure  # fmt: skip
    return Refreshed(len(seen), read, gone, str(root / NAME) if archive is None else archive)


def unlike(root: Path, runs: Collection[str]) -> Mapping[str, str]:
    """What `index.sqlite` says of these runs otherwise than their folders, though the journal is the one it was made from: somebody
    changed the index. By run, the name of the first value; empty where there is no index."""
    if not (root / NAME).is_file():
        return {}
    place, seen = place_of(root), _stamps_of(root, runs)
    wanted = Wanted(text=min(runs)) if len(runs) == 1 else Wanted()
    rows = {row.run: row for row in _on_file(root, lambda store: _select(store, wanted, place, NAME)).rows}
    differ = dict[str, str]()
    for run, row in rows.items():
        if seen.get(run) == (row.journal_bytes, row.journal_mtime_ns):
            true = _row(root / run, place, seen[run])
            if other := [name for name in Row._fields if getattr(row, name) != getattr(true, name)]:
                differ[run] = other[0]
    return differ


def note(folder: Path) -> None:
    """Tell the indexes that there are of a run that has ended or was changed. Never fails: a list puts right what is missing."""
    root, archive = folder.parent, os.environ.get(ARCHIVE, "").strip()
    with suppress(sqlite3.Error, OSError):
        if (root / NAME).is_file():
            _on_file(root, lambda store: _note(store, folder))
    if archive:
        with suppress(CommissionerError, OSError), closing(SharedStore(check_url(archive), connect_s=2)) as shared:
            _note(shared, folder)


def stamps(root: Path) -> Stamps:
    """Of every folder with a journal; empty where there is no archive."""
    try:
        with os.scandir(root) as entries:
            return _stamps_of(root, [entry.name for entry in entries])
    except OSError:
        return {}


def _stamps_of(root: Path, names: Iterable[str]) -> Stamps:
    """Of those of the folders that have a journal."""
    found: dict[str, tuple[int, int]] = {}
    prefix = f"{root}{os.sep}"
    for name in names:
        with suppress(OSError, ValueError):
            seen = os.stat(f"{prefix}{name}{os.sep}{JOURNAL}")  # noqa: PTH116  a Path for each of 10 000 takes as long as the rest
            found[name] = _stamp(seen)
    return found


def place_of(root: Path) -> str:
    """Which archive this is, where several share a database: the computer and the folder, bytes that are no text spelled out."""
    return f"{machine_part()}:{root.absolute()}".encode("utf-8", "backslashreplace").decode("utf-8")


def _on_file(root: Path, act: Callable[[Store], T]) -> T:
    """What `act` makes of the SQLite index; one that turns out to be damaged is made anew. sqlite3.Error: it cannot be had."""
    try:
        with closing(open_file(root)) as store:
            return act(store)
    except sqlite3.DatabaseError as failure:
        if not _is_damaged(failure):
            raise
        forget(root)
    with closing(open_file(root)) as store:
        return act(store)


def _is_damaged(failure: sqlite3.DatabaseError) -> bool:
    """False of a file that is locked, read-only or has no room; a statement that fails as such found another table than ours."""
    return not isinstance(failure, sqlite3.OperationalError) or failure.sqlite_errorcode == sqlite3.SQLITE_ERROR


def _refresh(store: Store, root: Path, place: str, seen: Stamps, *, anew: bool = False) -> tuple[int, int]:
    """(read anew, gone)"""
    known = {} if anew else {str(run): (size, time) for run, size, time in store.read(STAMPS, {"place": place})}
    changed = [name for name, stamp in seen.items() if known.get(name) != stamp]
    gone = [name for name in known if name not in seen]
    if changed or gone or anew:
        rows = [_row(root / name, place, seen[name]) for name in changed]
        store.write(place, rows, gone, anew=anew)
    return len(changed), len(gone)


def _note(store: Store, folder: Path) -> None:
    place = place_of(folder.parent)
    store.write(place, [_row(folder, place, _stamp((folder / JOURNAL).stat()))], ())


def _stamp(seen: os.stat_result) -> tuple[int, int]:
    """Size and time; a time that no index can keep (a clock centuries off) is the latest or earliest that it can."""
    return seen.st_size, max(-LARGEST, min(seen.st_mtime_ns, LARGEST - 1))


def _row(folder: Path, place: str, stamp: tuple[int, int]) -> Row:
    """A name that is no text (bytes of another encoding) is told with marks for what cannot be said."""
    row = row_of(read_run(folder, with_result=False), place, stamp)
    return Row._make(_sayable(value) for value in row)


def _sayable(value: str | int) -> str | int:
    return value.encode("utf-8", "replace").decode("utf-8") if isinstance(value, str) else value


def _select(store: Store, wanted: Wanted, place: str, indexed: str) -> Found:
    rows, count, meant = select(wanted, place, is_shared=store.is_shared)
    bound = {name: _sayable(value) for name, value in meant.items()}
    found = list[Row]()
    for statement in rows:
        most = min(wanted.limit, LARGEST - 1) - len(found)
        if wanted.limit <= 0 or most > 0:
            found += map(Row._make, store.read(statement, bound | ({"most": most} if wanted.limit > 0 else {})))
    total = int(store.read(count, bound)[0][0]) if wanted.limit > 0 and len(found) == wanted.limit else len(found)
    return Found(tuple(found), total, indexed)
