"""The samples of a run on the disk: each block framed by a mark, its length and its check sum.

A damaged frame costs the one block in it: the reader looks for the next mark whose frame is whole, says what lies between,
and counts the samples that are missing there as lost.
"""

from __future__ import annotations

import errno
import math
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from commissioner.records import SampleBlock

MARK, PACKED = b"BLK1", b"BLKZ"
"""Of a frame, and of one whose payload is deflated (RFC 1951)."""
MARKS = b"BLK"
_FRAME = struct.Struct("<4sII")  # mark, payload bytes, CRC-32 of the payload
_HEADER = struct.Struct("<IIIIIdddB")  # segment, session, first index, count, lost before, period, axis, DC link, flags
_AGE, _AVERAGED = struct.Struct("<d"), struct.Struct("<H")  # behind the signals, where the flags say so
_UNITS = struct.Struct("<dd")  # before the signals, where these are whole numbers of the drive's counts
_CLIPPED, _HAS_W, _HAS_AGE, _IS_AVERAGED, _IN_COUNTS = 1, 2, 4, 8, 16
_FLAGS_AT = _HEADER.size - 1
LARGEST_BLOCK = 1 << 16
"""Payload bytes, unpacked; eight of a drive's largest windows make 8 kB. Each false mark costs the check sum of so many."""

COUNTS = np.iinfo(np.int16)

Values = NDArray[np.float64]
Placed = tuple[int, SampleBlock]
"""Segment and block."""


@dataclass(frozen=True)
class BlockDamage:
    """Bytes of `blocks.bin` that hold no whole block. `after`: segment and next sample index of the last whole one before;
    `lost_samples` where the next whole block is of the same segment. `is_tail`: nothing whole follows."""

    offset: int
    size: int
    after: tuple[int, int] | None
    lost_samples: int | None
    is_tail: bool

    @property
    def where(self) -> str:
        """The place in words."""
        place = (
            "before the first whole block" if self.after is None else "after segment {} sample {}".format(*self.after)
        )
        lost = "" if self.lost_samples is None else f", {self.lost_samples} samples lost"
        return f"bytes {self.offset} to {self.offset + self.size - 1}, {place}{lost}"


def frame(block: SampleBlock, segment: int) -> bytes:
    """The bytes that `blocks.bin` takes for the block."""
    mark, payload = MARK, _encode(block, segment)
    if payload[_FLAGS_AT] & _IN_COUNTS:
        mark, payload = PACKED, zlib.compress(payload, wbits=-zlib.MAX_WBITS)
    return _FRAME.pack(mark, len(payload), zlib.crc32(payload)) + payload


def append_frame(descriptor: int, record: bytes, written: int) -> None:
    """Make sure that a frame of which `written` bytes got to the disk is there whole or not at all. OSError: it is not."""
    if written != len(record):  # what follows a torn frame would have to be looked for
        os.ftruncate(descriptor, os.fstat(descriptor).st_size - written)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def read_blocks(path: Path, damage: list[BlockDamage] | None = None) -> Iterator[Placed]:
    """Every whole (segment, block) in order; what lies between them is told in `damage`: also a frame whose check sum is right and
    that holds no block.

    A block behind a damaged one counts the samples that are missing before it.
    """
    data = path.read_bytes() if path.is_file() else b""
    yield from _walk(data, [] if damage is None else damage)


def follow_blocks(path: Path, offset: int, most: int) -> list[tuple[int, Placed]]:
    """The whole blocks from byte `offset` on, `most` at a time, each with the byte where it ends and the next one begins: a frame that
    is still being written is left for later."""
    if not path.is_file():
        return []
    with path.open("rb") as file:
        file.seek(offset)
        data = file.read()
    found: list[tuple[int, Placed]] = []
    at = 0
    while len(found) < most and (whole := _block_at(data, at)) is not None:
        placed, at = whole
        found.append((offset + at, placed))
    return found


def _walk(data: bytes, damage: list[BlockDamage]) -> Iterator[Placed]:
    at = 0
    after: tuple[int, int] | None = None
    while at < len(data):
        whole = _block_at(data, at)
        lost = None
        if whole is None:
            end = _next_whole(data, at + 1)
            whole = _block_at(data, end)
            if whole is None:
                damage.append(BlockDamage(at, len(data) - at, after, None, True))
                return
            (segment, block), _ = whole
            lost = block.first_index - after[1] if after is not None and after[0] == segment else None
            damage.append(BlockDamage(at, end - at, after, lost, False))
        (segment, block), at = whole
        yield segment, block if lost is None else replace(block, lost_before=max(lost, block.lost_before))
        after = segment, block.first_index + block.count


def _next_whole(data: bytes, at: int) -> int:
    """Where the next whole block begins at `at` or later; the end of the data where there is none."""
    while (at := data.find(MARKS, at)) >= 0:
        if _block_at(data, at) is not None:
            return at
        at += 1
    return len(data)


def _block_at(data: bytes, at: int) -> tuple[Placed, int] | None:
    """The block whose whole frame begins at `at`, and where that ends; None where there is none."""
    if at + _FRAME.size > len(data):
        return None
    mark, size, check = _FRAME.unpack_from(data, at)
    start = at + _FRAME.size
    if mark not in (MARK, PACKED) or size > LARGEST_BLOCK or start + size > len(data):
        return None
    held = data[start : start + size]
    if zlib.crc32(held) != check:
        return None
    payload = _unpacked(held) if mark == PACKED else held
    placed = None if payload is None else _decode(payload)
    return None if placed is None else (placed, start + size)


def _unpacked(payload: bytes) -> bytes | None:
    """None where it is not one whole deflated block, is more than one has, or something stands behind it."""
    unpacking = zlib.decompressobj(-zlib.MAX_WBITS)
    try:
        unpacked = unpacking.decompress(payload, LARGEST_BLOCK)
    except zlib.error:
        return None
    return unpacked if unpacking.eof and not unpacking.unused_data else None


def _encode(block: SampleBlock, segment: int) -> bytes:
    flags = _HAS_AGE | (_CLIPPED if block.clipped else 0) | (_HAS_W if block.current_w_a is not None else 0)
    flags |= _IS_AVERAGED if block.averaged > 1 else 0
    tail = _AGE.pack(block.age_s) + (_AVERAGED.pack(block.averaged) if block.averaged > 1 else b"")

    def header(flags: int) -> bytes:
        return _HEADER.pack(
            segment, block.session, block.first_index, block.count, block.lost_before, block.sample_period_s,
            block.axis_deg, block.dc_link_v, flags,
        )  # fmt: skip

    signals = [block.voltage_axis_v, block.current_u_a, block.current_v_a]
    if block.current_w_a is not None:
        signals.append(block.current_w_a)
    values = np.stack(signals).astype("<f8")
    counts = _counts(values, block.unit_v, block.unit_a)
    if counts is None:
        return header(flags) + values.tobytes() + tail
    return header(flags | _IN_COUNTS) + _UNITS.pack(block.unit_v, block.unit_a) + counts.tobytes() + tail


def _counts(values: Values, unit_v: float, unit_a: float) -> NDArray[np.int16] | None:
    """(channels, n) in the drive's counts, a quarter of the bytes; None where that is not bit by bit what the values are."""
    if unit_v <= 0.0 or unit_a <= 0.0:
        return None
    units = _units(len(values), unit_v, unit_a)
    counts = np.rint(values / units)
    if not np.all((counts >= COUNTS.min) & (counts <= COUNTS.max)):
        return None
    whole = counts.astype("<i2")
    return whole if (whole * units).tobytes() == values.tobytes() else None


def _units(channels: int, unit_v: float, unit_a: float) -> Values:
    return np.array([[unit_v], *[[unit_a]] * (channels - 1)])


def _decode(payload: bytes) -> Placed | None:
    """None where it is no block: not its length, no period above zero, a number that is none."""
    if len(payload) < _HEADER.size:
        return None
    segment, session, first, count, lost, period, axis, link, flags = _HEADER.unpack_from(payload)
    channels = 4 if flags & _HAS_W else 3
    in_counts = bool(flags & _IN_COUNTS)
    signals_at = _HEADER.size + _UNITS.size * in_counts
    signals_end = signals_at + (2 if in_counts else 8) * channels * count
    has_age, is_averaged = bool(flags & _HAS_AGE), bool(flags & _IS_AVERAGED)
    averaged_at = signals_end + _AGE.size * has_age
    if len(payload) != averaged_at + _AVERAGED.size * is_averaged:
        return None
    numbers = np.frombuffer(payload, "<i2" if in_counts else "<f8", channels * count, signals_at).reshape(
        channels, count
    )
    unit_v, unit_a = _UNITS.unpack_from(payload, _HEADER.size) if in_counts else (0.0, 0.0)
    averaged = _AVERAGED.unpack_from(payload, averaged_at)[0] if is_averaged else 1
    age_s = _AGE.unpack_from(payload, signals_end)[0] if has_age else 0.0
    if not (averaged and 0.0 < period < math.inf and all(map(math.isfinite, (axis, unit_v, unit_a)))):
        return None
    signals = numbers * _units(channels, unit_v, unit_a) if in_counts else numbers.astype(np.float64)
    return segment, SampleBlock(
        session=session, first_index=first, sample_period_s=period, axis_deg=axis, voltage_axis_v=signals[0],
        current_u_a=signals[1], current_v_a=signals[2], current_w_a=signals[3] if flags & _HAS_W else None,
        dc_link_v=link, lost_before=lost, clipped=bool(flags & _CLIPPED),
        age_s=age_s, averaged=averaged, unit_v=unit_v, unit_a=unit_a,
    )  # fmt: skip
