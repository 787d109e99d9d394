"""What a file from a stranger may cost: its size unpacked is known, or counted, before anything is made of it."""

from __future__ import annotations

import gzip
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pa_parquet

from commissioner.errors import DataRefused

MAX_BYTES = 2 * 1024**3
"""A file, what it unpacks to, or its table in memory above this is refused: 8 h of five channels at 6 kHz."""
MAX_FOREIGN_BYTES = 256 * 1024**2
"""Of a text that is not in the contract's format: it is taken apart line by line, at ten times its size in memory."""
MAX_COLUMNS = 4096
MIN_UNPACKED_BYTES, MAX_RATIO = 64 * 1024**2, 30
"""What a small file may unpack to, and how many times its size a larger one. Measured signals shrink by 2 to 10; only
made-up ones by more, and those can be saved unpacked."""
NUMBER_BYTES = 8
"""A float64: what every number of a file becomes, however short it was."""
_CHUNK = 1 << 20
_FIXED = (
    pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal, pa.types.is_timestamp, pa.types.is_time, pa.types.is_duration,
    pa.types.is_boolean,
)  # fmt: skip
"""Types of columns that are numbers or times, each of a fixed size."""


def unpacked_limit(path: Path) -> int:
    """How many bytes the file may unpack to."""
    return min(MAX_BYTES, max(MIN_UNPACKED_BYTES, MAX_RATIO * path.stat().st_size))


def bounded_bytes(path: Path, limit: int = MAX_BYTES) -> bytes:
    """The file's content, unpacked where it is a `.gz`. DataRefused: more than `limit`. Damage: OSError, EOFError."""
    if path.stat().st_size > limit:
        raise too_large(path, path.stat().st_size, limit)
    if path.suffix != ".gz":
        return path.read_bytes()
    limit = min(limit, unpacked_limit(path))
    with gzip.open(path, "rb") as packed:
        size = 0
        while piece := packed.read(_CHUNK):
            size += len(piece)
            if size > limit:
                raise too_large(path, f"> {limit}", limit)
        packed.rewind()
        return packed.read()


def bounded_text(path: Path, limit: int = MAX_BYTES) -> bytes:
    """As `bounded_bytes`, of a file whose cells, were each a number, stay within the limit as well."""
    data = bounded_bytes(path, limit)
    cells = data.count(b"\n") + data.count(b"\r") + sum(data.count(mark) for mark in (b",", b";", b"\t"))
    if NUMBER_BYTES * cells > unpacked_limit(path):
        raise too_large(path, NUMBER_BYTES * cells, unpacked_limit(path))
    return data


def numeric_columns(path: Path, file: pa_parquet.ParquetFile) -> list[str]:
    """The columns that are numbers or times: texts, lists and dictionaries can unpack to any size and are never read.

    A chunk's metadata are looked at only where its first row could be read: Arrow's own look at damaged ones ends the process.
    """
    if file.metadata.num_columns > MAX_COLUMNS:
        raise too_large(path, f"{file.metadata.num_columns} columns", MAX_COLUMNS)
    schema = file.schema_arrow
    names = [f.name for f in schema if any(kind(f.type) for kind in _FIXED)]
    groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
    rows = max(sum(max(group.num_rows, 0) for group in groups), file.metadata.num_rows)
    limit = unpacked_limit(path)
    if NUMBER_BYTES * rows * len(names) > limit:
        raise too_large(path, NUMBER_BYTES * rows * len(names), limit)
    for k in range(len(groups)):
        next(file.iter_batches(batch_size=1, row_groups=[k], columns=names, use_threads=False), None)
    chunks = [k for k in range(file.metadata.num_columns) if file.schema.column(k).path in names]
    values = sum(max(g.column(k).num_values, 0) for g in groups for k in chunks)
    if NUMBER_BYTES * values > limit:
        raise too_large(path, NUMBER_BYTES * values, limit)
    return names


def too_large(path: Path, seen: object, limit: int) -> DataRefused:
    return DataRefused(
        f"{path}: the file unpacks to too much", step="read recording", value=seen, limit=limit,
        remedy="split the recording, or save it unpacked",
    )  # fmt: skip
