"""Channels of an MDF 4 file (ASAM MDF 4.1): fixed-length numbers of sorted groups, plain or zipped, linearly converted.

Unfinished and unsorted files, texts, arrays and other conversions are passed over or refused by name.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from commissioner.recordings.bounds import MAX_COLUMNS, NUMBER_BYTES, too_large, unpacked_limit
from commissioner.recordings.formats.stretch import Stretch
from commissioner.records import Signal

_FORM = "MDF 4"
MAX_BLOCKS = 200_000
_FIXED, _MASTER, _TIME = 0, 2, 1
_PLAIN, _LINEAR = 0, 1
_NUMBERS = {0: "<u", 1: ">u", 2: "<i", 3: ">i", 4: "<f", 5: ">f"}
_RECORD_PLACES = {8: 1, 16: 2, 32: 4, 64: 8}


@dataclass(frozen=True)
class _Block:
    """One block: its links and what follows them."""

    links: tuple[int, ...]
    data: Stretch


class _File:
    """Blocks by their place. However they point at each other, at most MAX_BLOCKS are read."""

    def __init__(self, path: Path) -> None:
        self.stretch = Stretch.of_file(path, _FORM)
        self.left = MAX_BLOCKS
        self.limit = unpacked_limit(path)
        self.unpacked = self.numbers = 0

    def block(self, place: int, *marks: str) -> _Block:
        self.left -= 1
        if self.left < 0:
            self.stretch.refuse(f"more than {MAX_BLOCKS} blocks")
        head = self.stretch.part(place, 24)
        mark, length, count = head.read("<4s4xQQ")
        if mark.decode("latin-1") not in marks or length < 24 + 8 * count:
            self.stretch.refuse(f"a block {mark!r} where {' or '.join(marks)} belongs")
        body = self.stretch.part(place + 24, length - 24)
        return _Block(body.read(f"<{count}Q"), Stretch(body.data[8 * count :], body.path, _FORM))

    def text(self, place: int) -> str:
        """A name or a unit; of a comment in XML nothing."""
        if place == 0:
            return ""
        data = self.block(place, "##TX", "##MD").data.data
        text = bytes(data[:4096]).split(b"\0", 1)[0].decode("utf-8", errors="replace")
        return "" if text.startswith("<") else text

    def chain(self, place: int, mark: str) -> Iterator[_Block]:
        """The blocks that follow each other by their first link."""
        while place:
            block = self.block(place, mark)
            if not block.links:
                self.stretch.refuse(f"a {mark} without links")
            yield block
            place = block.links[0]

    def records(self, place: int) -> bytes:
        """The data of a group, put together and unpacked."""
        return b"".join(self._pieces(place)) if place else b""

    def _pieces(self, place: int) -> Iterator[bytes]:
        block = self.block(place, "##DT", "##DZ", "##DL", "##HL")
        mark = bytes(self.stretch.data[place : place + 4])
        if mark == b"##DT":
            yield self._counted(bytes(block.data.data))
        elif mark == b"##DZ":
            yield self._counted(self._inflated(block.data))
        elif mark == b"##HL":
            yield from self._pieces(_link(block, 0, self.stretch))
        else:
            for part in self.chain(place, "##DL"):
                for link in part.links[1:]:
                    if link and bytes(self.stretch.data[link : link + 4]) not in (b"##DT", b"##DZ"):
                        self.stretch.refuse("a data list that holds no data")
                    yield from self._pieces(link) if link else ()

    def _counted(self, data: bytes) -> bytes:
        self.unpacked += len(data)
        self._check(self.unpacked)
        return data

    def make_room(self, count: int) -> None:
        """Before `count` numbers are made of the file's."""
        self.numbers += NUMBER_BYTES * count
        self._check(self.numbers)

    def _check(self, size: int) -> None:
        if size > self.limit:
            raise too_large(self.stretch.path, size, self.limit)

    def _inflated(self, packed: Stretch) -> bytes:
        original, kind, columns, size, length = packed.read("<2sBxIQQ")
        if original != b"DT" or kind not in (0, 1):
            packed.refuse(f"packed data of kind {kind}")
        self._check(self.unpacked + size)
        stream = zlib.decompressobj()
        try:
            data = stream.decompress(packed.take(length), size + 1)
        except zlib.error as error:
            packed.refuse(str(error))
        if len(data) != size:
            packed.refuse(f"{len(data)} bytes unpacked where {size} were promised")
        return _turned(data, columns) if kind == 1 else data


def channels(path: Path) -> dict[str, Signal]:
    """The numbers of the group with the most samples: by channel name, `name [unit]`; its time as `time`.

    Groups of the same length and the same time are put together. DataRefused: damaged, too large, or not read here.
    """
    file = _File(path)
    identification = file.stretch.part(0, 64)
    if bytes(identification.data[:8]) != b"MDF     " or bytes(identification.data[8:9]) != b"4":
        identification.refuse(f"its beginning {bytes(identification.data[:16])!r}")
    header = file.block(64, "##HD")
    groups = [group for place in file.chain(_link(header, 0, file.stretch), "##DG") for group in _groups(file, place)]
    longest = max((size for size, _ in groups), default=0)
    merged: dict[str, Signal] = {}
    for _, signals in (group for group in groups if group[0] == longest):
        time, known = signals.get("time"), merged.get("time")
        if time is not None and known is not None and not np.allclose(time, known, rtol=0.0, atol=1e-9):
            continue
        merged |= signals
    return merged


def _groups(file: _File, group: _Block) -> Iterator[tuple[int, dict[str, Signal]]]:
    """(samples, signals) of the channel groups of a data group, which must be sorted: one channel group each."""
    (identifier_bytes,) = group.data.read("<B")
    first = _link(group, 1, file.stretch)
    found = list(file.chain(first, "##CG")) if first else []
    if len(found) > 1:
        file.stretch.refuse("an unsorted data group")
    for channel_group in found:
        _, cycles, _, _, data_bytes, invalid_bytes = channel_group.data.read("<QQHH4xII")
        width = identifier_bytes + data_bytes + invalid_bytes
        if not cycles or not width:
            continue
        raw = file.records(_link(group, 2, file.stretch))
        if len(raw) < cycles * width:
            file.stretch.refuse(f"{len(raw)} bytes of data for {cycles} records of {width} bytes")
        records = np.frombuffer(raw, np.uint8, cycles * width).reshape(cycles, width)[:, identifier_bytes:]
        yield cycles, _signals(file, channel_group, records[:, :data_bytes])


def _signals(file: _File, group: _Block, records: np.ndarray) -> dict[str, Signal]:
    signals: dict[str, Signal] = {}
    for channel in file.chain(_link(group, 1, file.stretch), "##CN"):
        kind, sync, number, bit_offset, byte_offset, bits, flags = channel.data.read("<BBBBIII")
        size = _RECORD_PLACES.get(bits)
        is_plain = bit_offset == 0 and size is not None and number in _NUMBERS and not flags & 1
        if kind not in (_FIXED, _MASTER) or not is_plain or size is None or channel.links[1]:
            continue
        if byte_offset + size > records.shape[1] or (number > 3 and size == 1):
            file.stretch.refuse(f"a channel at byte {byte_offset} of records of {records.shape[1]}")
        if len(signals) >= MAX_COLUMNS:
            raise too_large(file.stretch.path, f"{len(signals)} channels", MAX_COLUMNS)
        file.make_room(records.shape[0])
        words = np.ascontiguousarray(records[:, byte_offset : byte_offset + size]).view(f"{_NUMBERS[number]}{size}")
        values = _converted(file, _link(channel, 4, file.stretch), words.ravel().astype(np.float64))
        if values is not None:
            name, unit = file.text(_link(channel, 2, file.stretch)), file.text(_link(channel, 6, file.stretch))
            is_time = kind == _MASTER and sync == _TIME
            signals["time" if is_time else f"{name} [{unit}]" if unit else name] = values
    return signals


def _converted(file: _File, place: int, values: Signal) -> Signal | None:
    """SI as the channel's conversion says; None where it is neither none nor linear."""
    if place == 0:
        return values
    conversion = file.block(place, "##CC").data
    kind, _, _, _, count, _, _ = conversion.read("<BBHHHdd")
    if kind == _PLAIN:
        return values
    if kind != _LINEAR or count != 2:
        return None
    offset, slope = conversion.read("<dd")
    return np.asarray(float(slope) * values + float(offset), dtype=np.float64)


def _turned(data: bytes, columns: int) -> bytes:
    """Undo the transposition of packed data; the rest that filled no row stands at the end as it was."""
    if columns < 2:
        return data
    rows = len(data) // columns
    body = np.frombuffer(data, np.uint8, rows * columns).reshape(columns, rows)
    return np.ascontiguousarray(body.T).tobytes() + data[rows * columns :]


def _link(block: _Block, number: int, file: Stretch) -> int:
    if number >= len(block.links):
        file.refuse(f"a block with {len(block.links)} links")
    return block.links[number]
