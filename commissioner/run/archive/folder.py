"""The run folder: every sample, every decision, nothing torn, nothing changed unseen.

<runs>/<run id>/                 0700; the id: UTC time, drive file, six digits of the machine
    journal.jsonl                one record a line, each with the digest of the one before; synced before anything energises
    blocks.bin                   the samples as they came, each block with its length and check sum
    recording.parquet            the same samples in the contract's format, made when the run ends
    snapshot.json                the drive's parameters as they were found (what `restore` writes back)
    result.json  report.html     what the technician gets
    request.json                 what the run was asked to do; the address without secrets
    summary.json                 the run as a row of a list; written last
"""

from __future__ import annotations

import datetime as dt
import hashlib
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from commissioner.encoding import plain
from commissioner.errors import UsageError
from commissioner.procedure.assembly import assemble, columns
from commissioner.recordings.whole import whole_file
from commissioner.records import SampleBlock
from commissioner.run.archive.blocks import append_frame, frame, read_blocks
from commissioner.run.archive.documents import damaged, open_no_link
from commissioner.run.archive.journal import LOCK, Journal, read_journal
from commissioner.run.archive.origin import machine_part, this_process
from commissioner.run.archive.seal import CLOSED, TO_COME, as_closed, cover_of, covers, seal, to_come
from commissioner.run.archive.summary import NAME as SUMMARY
from commissioner.run.archive.summary import NOT_KEPT, summary_of
from commissioner.run.index.index import note

if TYPE_CHECKING:
    from filelock import FileLock

LOCK_S = 30.0
"""So long is waited for another writer: a session on a run that is over takes a second, on a busy computer ten."""


class RunFolder:
    """One run's folder, open for writing, by one process at a time: two that continued one chain would break it. Close it with `close`,
    which leaves every file covered by the journal's last record, sealed where a `key` is given. UsageError: another process goes on
    writing into it."""

    def __init__(self, path: Path, key: bytes | None = None) -> None:
        self.path, self.key = path, key
        for name in ("journal.jsonl", "blocks.bin"):
            if (path / name).is_symlink() or ((path / name).exists() and not (path / name).is_file()):
                raise damaged(path, name, "a link, a pipe or a folder in its place")
        self._lock = _sole_writer(path)
        self._covered = _covered_before(path)
        self._saved: set[str] = set()
        self._journal = Journal(path / "journal.jsonl")
        self._blocks: BinaryIO = open(path / "blocks.bin", "ab", buffering=0, opener=open_no_link)  # noqa: SIM115
        held = (path / "blocks.bin").read_bytes()
        self._blocks_bytes, self._blocks_digest = len(held), hashlib.sha256(held)
        self._is_open = True

    @classmethod
    def create(cls, root: Path, label: str, key: bytes | None = None) -> RunFolder:
        """A new folder named by the UTC time, `label` and machine; never one that exists. Its first record says whence."""
        root.mkdir(parents=True, exist_ok=True)
        stem = f"{dt.datetime.now(dt.UTC).strftime('%Y%m%d-%H%M%S')}-{label}-{machine_part()}"
        for number in range(1000):
            path = root / (stem if number == 0 else f"{stem}-{number + 1}")
            try:
                path.mkdir(mode=0o700)
            except FileExistsError:
                continue
            made = cls(path, key)
            made.journal("run_started", {"run": path.name} | vars(this_process()), durable=True)
            return made
        raise UsageError(
            f"no new run folder can be made in {root}",
            step="archive",
            value=str(root),
            limit="a writable folder",
            remedy="give another folder with --runs",
        )

    def journal(self, kind: str, record: object, *, durable: bool = False) -> None:
        """Append one record; `durable` returns only when it is on the disk."""
        covered = (self._blocks_bytes, self._blocks_digest.hexdigest())
        self._journal.write(kind, record, covered, durable=durable)

    def append(self, block: SampleBlock, segment: int) -> None:
        """Append the block in one write, so that a kill leaves it whole or recognisably torn."""
        record = frame(block, segment)
        append_frame(self._blocks.fileno(), record, self._blocks.write(record))
        self._blocks_bytes += len(record)
        self._blocks_digest.update(record)

    def save(self, name: str, document: object) -> Path:
        """Write a JSON document whole or not at all."""
        return self.save_text(name, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")

    def save_text(self, name: str, text: str) -> Path:
        """Write it whole or not at all. What takes the place of a covered file is journalled before: killed between, either is known."""
        target = self.path / name
        if name in self._covered:
            self.journal(TO_COME, {"files": {name: cover_of(text.encode())}}, durable=True)
        with whole_file(target) as part, open(part, "w", encoding="utf-8", newline="\n", opener=open_no_link) as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        _sync_folder(self.path)
        self._saved.add(name)
        return target

    def cover(self) -> None:
        """Journal the digest of every file as it is now, sealed where there is a key, and keep the run's summary."""
        blocks = {"bytes": self._blocks_bytes, "sha256": self._blocks_digest.hexdigest()}
        records = read_journal(self.path / "journal.jsonl")
        summary = plain(summary_of(self.path, records), without=NOT_KEPT)
        self._covered |= covers(self.path, self._saved)
        self._saved.clear()
        record: dict[str, Any] = {"files": self._covered, "blocks": blocks, "summary": summary, "seal": None}
        if self.key is not None:
            record["seal"] = seal(self.key, self._journal.head, record)
        self.journal(CLOSED, record, durable=True)
        journal = {
            "bytes": (self.path / "journal.jsonl").stat().st_size, "records": self._journal.records, "head": self._journal.head,
        }  # fmt: skip
        self.save(SUMMARY, {"summary": summary, "journal": journal})
        self._saved.clear()

    def write_recording(self, metadata: Mapping[str, float | str]) -> None:
        """`recording.parquet` from the blocks that are whole; nothing where no sample was taken."""
        if (target := write_recording(self.path, metadata)) is not None:
            self._saved.add(target.name)

    def close(self) -> None:
        """Never fails: what could not be written by now is lost, and was said when it was tried. The archive's index is told."""
        if not self._is_open:
            return
        with suppress(OSError, ValueError):
            self.cover()
        self._is_open = False
        self._journal.close()
        with suppress(OSError):
            self._blocks.close()
        _let_go(self.path, self._lock)
        note(self.path)


def write_recording(folder: Path, metadata: Mapping[str, float | str]) -> Path | None:
    """`recording.parquet` from the blocks that are whole; None where no sample was taken."""
    from commissioner.recordings.table import write_table

    recording = assemble(read_blocks(folder / "blocks.bin"), metadata, folder.name)
    if recording is None:
        return None
    target = folder / "recording.parquet"
    write_table(target, columns(recording), recording.metadata)
    return target


def _covered_before(path: Path) -> dict[str, Any]:
    """What the last closing record covers: files that this session does not write stay covered as they were, or as a session that was
    killed before it closed the folder had announced them, where they are that."""
    records = read_journal(path / "journal.jsonl")
    announced = to_come(records)
    seen = covers(path, announced)
    came = {name: seen[name] for name, either in announced.items() if seen.get(name) in either}
    return {**as_closed(records), **came}


def _sole_writer(path: Path) -> FileLock | None:
    """The lock on the folder; None where its disk knows no locks. The system drops it with the process, however that ends."""
    from filelock import FileLock, Timeout  # late: who only reads runs takes none

    if not path.is_dir():
        return None  # taking it would make the folder
    lock = FileLock(path / LOCK, thread_local=False)
    try:
        lock.acquire(timeout=LOCK_S)
    except Timeout:
        raise UsageError(
            f"another process writes into {path.name}", step="archive", value=str(path), limit="one writer for one run",
            remedy="wait until the run, its restore or its diagnosis has ended, then start again",
        ) from None  # fmt: skip
    except OSError:  # the journal says it if nothing at all can be written
        return None
    return lock


def _let_go(path: Path, lock: FileLock | None) -> None:
    """The file goes first: who waits for it sees that it is gone, and makes another."""
    if lock is not None:
        with suppress(OSError):
            (path / LOCK).unlink(missing_ok=True)
        with suppress(OSError):
            lock.release()


def _sync_folder(path: Path) -> None:
    """A name given in a folder outlives a power loss only once the folder is on the disk; some systems cannot."""
    with suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
