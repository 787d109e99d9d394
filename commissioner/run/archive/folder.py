"""The run folder: every sample, every decision, nothing torn.

<runs>/<run id>/                 0700
    journal.jsonl                one record a line; flushed and synced before anything energises or writes
    blocks.bin                   the samples as they came, each block with its length and check sum
    recording.parquet            the same samples in the contract's format, made when the run ends
    snapshot.json                the drive's parameters as they were found (what `restore` writes back)
    result.json  report.html     what the technician gets
    request.json                 what the run was asked to do; the address without secrets
"""

from __future__ import annotations

import dataclasses
import datetime as dt
import errno
import json
import math
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from enum import Enum
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from commissioner.errors import CommissionerError, DataRefused, UsageError
from commissioner.procedure.assembly import assemble, columns
from commissioner.recordings.table import write_table
from commissioner.records import SampleBlock

_RECORD = struct.Struct("<4sII")  # mark, payload bytes, CRC-32 of the payload
_HEADER = struct.Struct("<IIIIIdddB")  # segment, session, first index, count, lost before, period, axis, DC link, flags
_AGE = struct.Struct("<d")  # behind the signals, where the flags say so
_MARK = b"BLK1"
_CLIPPED, _HAS_W, _HAS_AGE = 1, 2, 4


class RunFolder:
    """One run's folder, open for writing. Close it with `close`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        for name in ("journal.jsonl", "blocks.bin"):
            if (path / name).is_symlink():
                raise damaged(path, name, "a symbolic link")
        self._records = _drop_torn_line(path / "journal.jsonl")
        self._journal = open(path / "journal.jsonl", "a", encoding="utf-8", opener=_open_no_link)  # noqa: SIM115
        self._blocks: BinaryIO = open(path / "blocks.bin", "ab", buffering=0, opener=_open_no_link)  # noqa: SIM115

    @classmethod
    def create(cls, root: Path, label: str) -> RunFolder:
        """A new folder named by the UTC time and `label`; never one that exists."""
        root.mkdir(parents=True, exist_ok=True)
        stamp = dt.datetime.now(dt.UTC).strftime("%Y%m%d-%H%M%S")
        for number in range(1000):
            path = root / (f"{stamp}-{label}" if number == 0 else f"{stamp}-{label}-{number + 1}")
            try:
                path.mkdir(mode=0o700)
            except FileExistsError:
                continue
            return cls(path)
        raise UsageError(
            f"no new run folder can be made in {root}",
            step="archive",
            value=str(root),
            limit="a writable folder",
            remedy="give another folder with --runs",
        )

    def journal(self, kind: str, record: object, *, durable: bool = False) -> None:
        """Append one record; `durable` returns only when it is on the disk."""
        line = {"n": self._records, "utc": dt.datetime.now(dt.UTC).isoformat(), "kind": kind, "record": plain(record)}
        self._records += 1
        self._journal.write(json.dumps(line, allow_nan=False) + "\n")
        self._journal.flush()
        if durable:
            os.fsync(self._journal.fileno())

    def append(self, block: SampleBlock, segment: int) -> None:
        """Append the block in one write, so that a kill leaves it whole or recognisably torn."""
        payload = _encode(block, segment)
        record = _RECORD.pack(_MARK, len(payload), zlib.crc32(payload)) + payload
        start = os.fstat(self._blocks.fileno()).st_size
        if self._blocks.write(record) != len(record):  # what follows a torn record could not be read
            os.ftruncate(self._blocks.fileno(), start)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def save(self, name: str, document: object) -> Path:
        """Write a JSON document whole or not at all."""
        return self.save_text(name, json.dumps(plain(document), indent=2, allow_nan=False) + "\n")

    def save_text(self, name: str, text: str) -> Path:
        target = self.path / name
        temporary = target.with_name(name + ".part")
        with open(temporary, "w", encoding="utf-8", opener=_open_no_link) as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(target)
        _sync_folder(self.path)
        return target

    def close(self) -> None:
        """Never fails: what could not be written by now is lost, and was said when it was tried."""
        for file in (self._journal, self._blocks):
            with suppress(OSError):
                file.close()


def write_recording(folder: Path, metadata: Mapping[str, float | str]) -> Path | None:
    """`recording.parquet` from the blocks that are whole; None where no sample was taken."""
    recording = assemble(read_blocks(folder / "blocks.bin"), metadata, folder.name)
    if recording is None:
        return None
    target = folder / "recording.parquet"
    write_table(target, columns(recording), metadata)
    return target


def read_blocks(path: Path) -> Iterator[tuple[int, SampleBlock]]:
    """(segment, block) in order, up to the first torn record. DataRefused: a whole record that holds no block."""
    if not path.is_file():
        return
    length = path.stat().st_size
    with path.open("rb") as file:
        while len(head := file.read(_RECORD.size)) == _RECORD.size:
            mark, size, check = _RECORD.unpack(head)
            if mark != _MARK or size > length - file.tell():
                return
            payload = file.read(size)
            if zlib.crc32(payload) != check:
                return
            yield _decode(payload)


def read_journal(path: Path) -> list[dict[str, Any]]:
    """The journal's records, up to the first line that is not a whole one."""
    records: list[dict[str, Any]] = []
    if not path.is_file():
        return records
    for line in path.read_text("utf-8", errors="replace").split("\n"):
        record = read_document(line)
        if not isinstance(record.get("kind"), str) or "record" not in record:
            break
        records.append(record)
    return records


def read_saved(folder: Path, name: str, *needed: str) -> dict[str, Any]:
    """The JSON document `name` of a run. DataRefused: missing, damaged, or without one of the `needed` keys."""
    path = folder / name
    document = read_document(path.read_text("utf-8", errors="replace")) if path.is_file() else {}
    missing = [key for key in needed if key not in document]
    if missing or not document:
        raise damaged(
            folder, name, f"no {missing[0]}" if document else "not readable" if path.is_file() else "no such file"
        )
    return document


def damaged(folder: Path, name: str, seen: str) -> DataRefused:
    """What is raised where an archived file is not as a run leaves it."""
    return DataRefused(
        f"{folder.name}: {name} is damaged or missing", step="read the archive", value=seen,
        limit="the file as the run left it", remedy="use the run folder as the run left it, or another run",
    )  # fmt: skip


def archive_lost(folder: Path, failure: OSError, so_far: str = "") -> CommissionerError:
    """The disk took no more of a run."""
    return CommissionerError(
        f"the run's archive cannot be written: {failure.strerror or failure}{so_far}", step="archive",
        value=str(folder), limit="a disk with room that this user may write",
        remedy="make room or give another folder with --runs, then start again",
    )  # fmt: skip


def read_document(text: str) -> dict[str, Any]:
    """The JSON object in `text`; empty where it holds none, or one nested deeper than any of ours."""
    try:
        document = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return document if isinstance(document, dict) else {}


def _open_no_link(path: str, flags: int) -> int:
    """An `opener` that never writes through a symbolic link."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)


def _sync_folder(path: Path) -> None:
    """A name given in a folder outlives a power loss only once the folder is on the disk; some file systems cannot."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        with suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _drop_torn_line(path: Path) -> int:
    """Cut off what a power loss left of a last line, so that what is added can be read; the number of whole lines."""
    if not path.is_file():
        return 0
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    if whole < len(data):
        os.truncate(path, whole)
    return data.count(b"\n")


def plain(value: Any) -> Any:
    """A record as JSON types; arrays become lists, NaN and infinity become null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(v) for v in value]
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | None) else str(value)


def _encode(block: SampleBlock, segment: int) -> bytes:
    flags = _HAS_AGE | (_CLIPPED if block.clipped else 0) | (_HAS_W if block.current_w_a is not None else 0)
    header = _HEADER.pack(
        segment,
        block.session,
        block.first_index,
        block.count,
        block.lost_before,
        block.sample_period_s,
        block.axis_deg,
        block.dc_link_v,
        flags,
    )
    signals = [block.voltage_axis_v, block.current_u_a, block.current_v_a]
    if block.current_w_a is not None:
        signals.append(block.current_w_a)
    return header + b"".join(signal.astype("<f8").tobytes() for signal in signals) + _AGE.pack(block.age_s)


def _decode(payload: bytes) -> tuple[int, SampleBlock]:
    if len(payload) < _HEADER.size:
        raise _no_block(len(payload), f"at least {_HEADER.size} bytes")
    segment, session, first, count, lost, period, axis, link, flags = _HEADER.unpack_from(payload)
    channels = 4 if flags & _HAS_W else 3
    signals_end = _HEADER.size + 8 * channels * count
    has_age = bool(flags & _HAS_AGE)
    if len(payload) != signals_end + _AGE.size * has_age:
        raise _no_block(len(payload), f"{channels} signals of {count} samples")
    numbers = np.frombuffer(payload, "<f8", channels * count, _HEADER.size)
    signals = numbers.reshape(channels, count).astype(np.float64)
    return segment, SampleBlock(
        session=session,
        first_index=first,
        sample_period_s=period,
        axis_deg=axis,
        voltage_axis_v=signals[0],
        current_u_a=signals[1],
        current_v_a=signals[2],
        current_w_a=signals[3] if flags & _HAS_W else None,
        dc_link_v=link,
        lost_before=lost,
        clipped=bool(flags & _CLIPPED),
        age_s=_AGE.unpack_from(payload, signals_end)[0] if has_age else 0.0,
    )


def _no_block(size: int, expected: str) -> DataRefused:
    return DataRefused(
        "the archived samples are not this program's", step="read the archive", value=f"{size} bytes", limit=expected,
        remedy="use the run folder as the run left it",
    )  # fmt: skip
