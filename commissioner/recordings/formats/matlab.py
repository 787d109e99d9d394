"""Numeric vectors of a MATLAB v5 file, strictly: every length is checked before a byte is taken.

Our own, because `scipy.io.loadmat` 1.x ends the process by a segmentation fault on a file with one bit turned round in a
dimension or a tag, which a file from a stranger may well have. Format: MathWorks, "MAT-File Format", level 5.
Read are real numeric arrays, text of one line, and scalar structures of them; cells, sparse and complex arrays are passed over.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import NUMBER_BYTES, bounded_bytes, too_large, unpacked_limit
from commissioner.recordings.formats.stretch import Stretch
from commissioner.records import Signal

MAX_DEPTH, MAX_FIELDS, MAX_MATRIX_COLUMNS = 8, 512, 64
_HEADER, _HDF5 = 128, b"\x89HDF"
_INT8, _INT32, _UINT32, _MATRIX, _COMPRESSED = 1, 5, 6, 14, 15
_CELLS, _STRUCTURE, _OBJECT, _TEXT, _SPARSE, _NUMERIC, _COMPLEX = 1, 2, 3, 4, 5, range(6, 16), 0x08
_PASSED_OVER = {_CELLS: "cells", _STRUCTURE: "an array of structures", _OBJECT: "an object", _SPARSE: "sparse"}
_CODES = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8"}
LONGEST_TEXT = 1000
_TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip


@dataclass(frozen=True)
class _PassedOver:
    kind: str

    def __str__(self) -> str:
        return self.kind


class _Bytes(Stretch):
    """A stretch of the file with its byte order."""

    def __init__(self, data: memoryview, order: str, path: Path) -> None:
        super().__init__(data, path, "MATLAB v5 (`save -v6` or `-v7`)")
        self.order = order

    def element(self) -> tuple[int, _Bytes]:
        """(type, content) of the next data element; small ones hold their length in the upper half of the type."""
        kind, length = (int(word) for word in np.frombuffer(self.take(8), self.order + "u4"))
        if kind >> 16:
            self.at -= 4
            kind, length = kind & 0xFFFF, kind >> 16
            content = self.take(4)[:length]
        else:
            content = self.take(length)
            if kind != _COMPRESSED:
                self.at = min(self.at + -length % 8, len(self.data))
        return kind, _Bytes(content, self.order, self.path)

    def numbers(self, *kinds: int) -> np.ndarray:
        """The next element as numbers; of one of the `kinds` where they are given."""
        kind, content = self.element()
        if kind not in (kinds or _TYPES):
            self.refuse(f"an element of type {kind}")
        size = np.dtype(_TYPES[kind]).itemsize
        return np.frombuffer(content.data[: len(content.data) // size * size], self.order + _TYPES[kind])

    def text(self) -> str:
        return self.numbers(_INT8).tobytes().decode("latin-1")


def vectors(path: Path) -> dict[str, Signal]:
    """Every real numeric vector, matrix column and scalar, by its dotted path. DataRefused: damaged, or too large."""
    return variables(path)[0]


def variables(path: Path) -> tuple[dict[str, Signal], dict[str, float | str], dict[str, str]]:
    """(`vectors`, texts of one line, what was passed over), by their dotted paths. DataRefused: damaged, or too large."""
    raw = bounded_bytes(path)
    order = {b"IM": "<", b"MI": ">"}.get(raw[_HEADER - 2 : _HEADER], "")
    file = _Bytes(memoryview(raw)[_HEADER:], order, path)
    if _HDF5 in (raw[:4], raw[512:516]) or raw[:10] == b"MATLAB 7.3":
        raise DataRefused(
            f"{path}: MATLAB v7.3 files (HDF5) are not read", step="read recording", value="v7.3", limit=file.form,
            remedy="load it in MATLAB and save it again with '-v7', or export the recording as CSV or Parquet",
        )  # fmt: skip
    if not order:
        file.refuse("another format, such as v4")
    found: dict[str, Signal] = {}
    texts: dict[str, float | str] = {}
    left: dict[str, str] = {}
    limit, unpacked, numbers = unpacked_limit(path), 0, 0
    while not file.is_at_end:
        kind, content = file.element()
        if kind == _COMPRESSED:
            content = _unpacked(content, limit - unpacked, limit)
            unpacked += len(content.data)
            kind, content = content.element()
        for name, signal in _array(content, "", MAX_DEPTH) if kind == _MATRIX else ():
            if isinstance(signal, str | _PassedOver):
                (texts if isinstance(signal, str) else left)[name] = str(signal)
                continue
            found[name] = signal
            numbers += NUMBER_BYTES * signal.size
            if numbers > limit:
                raise too_large(path, f"> {limit}", limit)
    return found, texts, left


def _unpacked(packed: _Bytes, left: int, limit: int) -> _Bytes:
    stream = zlib.decompressobj()
    try:
        data = stream.decompress(packed.data, left + 1)
    except zlib.error as error:
        packed.refuse(str(error))
    if len(data) > left:
        raise too_large(packed.path, f"> {limit}", limit)
    return _Bytes(memoryview(data), packed.order, packed.path)


def _array(body: _Bytes, prefix: str, depth: int) -> Iterator[tuple[str, Signal | str | _PassedOver]]:
    """The vectors of one array element: itself, or its fields'."""
    if body.is_at_end:  # an empty field
        return
    flags = body.numbers(_UINT32)
    shape = [int(length) for length in body.numbers(_INT32)]
    if len(flags) < 2 or len(shape) < 2 or min(shape) < 0:
        body.refuse(f"an array of {shape}")
    name = body.text()
    full = f"{prefix}.{name}" if prefix and name else prefix or name
    kind, is_complex = int(flags[0]) & 0xFF, bool(int(flags[0]) >> 8 & _COMPLEX)
    if kind == _STRUCTURE and math.prod(shape) == 1 and depth:
        yield from _fields(body, full, depth)
    elif kind in _NUMERIC and not is_complex:
        yield from _columns(full, body.numbers(), shape, body)
    elif kind == _TEXT and shape[0] == 1 and len(shape) == 2:
        code, content = body.element()
        if code in _CODES and len(content.data) <= LONGEST_TEXT:
            little = "-le" if body.order == "<" else "-be"
            yield full, bytes(content.data).decode(_CODES[code] + (little if code == 4 else ""), "replace")
    elif is_complex or kind in _PASSED_OVER:
        yield full, _PassedOver("complex" if is_complex else _PASSED_OVER[kind])


def _fields(body: _Bytes, prefix: str, depth: int) -> Iterator[tuple[str, Signal | str | _PassedOver]]:
    widths = body.numbers(_INT32)
    width = int(widths[0]) if len(widths) == 1 else 0
    text = body.text()
    if width < 1 or len(text) % width or len(text) // width > MAX_FIELDS:
        body.refuse(f"a structure with field names of {width} characters")
    for start in range(0, len(text), width):
        kind, content = body.element()
        if kind != _MATRIX:
            body.refuse(f"a field of type {kind}")
        yield from _array(content, f"{prefix}.{text[start : start + width].split(chr(0))[0]}", depth - 1)


def _columns(name: str, values: np.ndarray, shape: list[int], body: _Bytes) -> Iterator[tuple[str, Signal]]:
    """MATLAB stores column by column; the longer side of a matrix is time."""
    if values.size != math.prod(shape):
        body.refuse(f"{values.size} numbers in an array of {shape}")
    limit = unpacked_limit(body.path)
    if NUMBER_BYTES * values.size > limit:
        raise too_large(body.path, NUMBER_BYTES * values.size, limit)
    numbers = values.astype(np.float64)
    sides = [length for length in shape if length != 1]
    if len(sides) <= 1:
        yield name, numbers
    elif len(sides) == 2 and 0 < min(sides) <= MAX_MATRIX_COLUMNS:
        matrix = numbers.reshape(sides, order="F")
        for k, column in enumerate(matrix.T if sides[0] >= sides[1] else matrix):
            yield f"{name}.{k}", np.ascontiguousarray(column)
