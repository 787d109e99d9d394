"""Runs that other computers push: kept apart until they are whole and proved, then put into the archive."""

from __future__ import annotations

import hashlib
import shutil
import threading
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from commissioner.operations.history import share
from commissioner.run.archive.documents import open_no_link
from commissioner.run.archive.journal import whole_lines
from commissioner.run.archive.verify import DAMAGED, verify
from commissioner.run.index.index import JOURNAL
from commissioner.service.contract.incoming import FileHere, JournalHere, OfferedRun
from commissioner.service.problems import Refusal

LARGEST, MOST_FILES = 2_000_000_000, 100
"""Bytes of one file, files of one run."""
FORGOTTEN_S = 7 * 86400.0
"""What broke off and was never gone on with is removed after so long."""
AGAIN = "push it again: only what is missing is sent (another push of the same run may have ended in the meantime)"


class Incoming:
    """`root`: where runs stand until they are whole; `runs`: the archive. Who pushes the same run at the same time shares its
    files here: one call at a time, and none takes away what another sent."""

    def __init__(self, root: Path, runs: Path) -> None:
        self._root, self._runs = root, runs
        self._alone: dict[str, threading.Lock] = {}

    def offered(self, run: str, journal_bytes: int) -> OfferedRun:
        """What is here of a run: its journal in the archive (bytes, and the digest of at most `journal_bytes` of them), whether
        that lies damaged, and the files that an earlier push began."""
        self._forget()
        path = self._runs / run / JOURNAL
        there: JournalHere | None = None
        if path.is_file():
            held = whole_lines(path)
            there = {
                "bytes": len(held),
                "sha256": hashlib.sha256(held[:journal_bytes]).hexdigest(),
                "is_damaged": len(held) == journal_bytes and verify(path.parent).state == DAMAGED,
            }
        with self._alone_with(run) as folder:
            return {"run": run, "journal": there, "begun": {path.name: _state(path) for path in _files(folder)}}

    def keep(self, run: str, file: str, start: int, piece: bytes) -> int:
        """The bytes that are here of a file once `piece` stands at `start`: what stands there already is left, else what followed
        goes; an empty piece ends the file. Refusal: a gap, or more than a run has."""
        with self._alone_with(run) as folder:
            folder.mkdir(parents=True, exist_ok=True, mode=0o700)
            path = folder / file
            held = path.stat().st_size if path.is_file() else 0
            if start > held:
                raise Refusal(
                    409, "a piece is missing before this one", step="push", value=start, limit=held, remedy=AGAIN
                )
            if start + len(piece) > LARGEST or (not path.exists() and len(list(folder.iterdir())) >= MOST_FILES):
                raise Refusal(413, "no run is so large", step="push", value=start + len(piece),
                              limit=f"{LARGEST} bytes a file, {MOST_FILES} files", remedy="copy it by hand to a share")  # fmt: skip
            with open(path, "r+b" if held else "w+b", opener=open_no_link) as target:
                target.seek(start)
                if piece and target.read(len(piece)) == piece:
                    return held
                target.truncate(start)
                target.seek(start)
                target.write(piece)
            return start + len(piece)

    def arrive(self, run: str, files: Collection[str], digests: Mapping[str, str] | None = None) -> share.Moved:
        """All `files` are here: prove the run by its chain and put it in place. Refusal: one has not come, or what is here of it is in
        part another's who pushes another state of this run."""
        with self._alone_with(run) as folder:
            here, sent = _files(folder), digests or {}
            others = {path.name for path in here if path.name in sent and _state(path)["sha256"] != sent[path.name]}
            if missing := ({JOURNAL, *files} - {path.name for path in here}) | others:
                raise Refusal(409, "not every file of the run is here as it was sent", step="push", value=", ".join(sorted(missing))[:200],
                              limit=f"{JOURNAL} and every file named", remedy=AGAIN)  # fmt: skip
            for path in here:
                if path.name not in files:
                    path.unlink()
            (moved,) = share.push(self._root, str(self._runs), [run])
            shutil.rmtree(folder, ignore_errors=True)
            return moved

    @contextmanager
    def _alone_with(self, run: str) -> Iterator[Path]:
        with self._alone.setdefault(run, threading.Lock()):
            yield self._root / run

    def _forget(self) -> None:
        for folder in self._root.iterdir() if self._root.is_dir() else ():
            if time.time() - folder.stat().st_mtime > FORGOTTEN_S:
                shutil.rmtree(folder, ignore_errors=True)


def _files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.is_file()) if folder.is_dir() else []


def _state(path: Path) -> FileHere:
    with path.open("rb") as file:
        return {"bytes": path.stat().st_size, "sha256": hashlib.file_digest(file, "sha256").hexdigest()}
