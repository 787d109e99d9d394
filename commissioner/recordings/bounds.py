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
_CHUNK = 1 << 20


def bounded_bytes(path: Path, limit: int = MAX_BYTES) -> bytes:
    """The file's content, unpacked where it is a `.gz`. DataRefused: more than `limit`. Damage: OSError, EOFError."""
    if path.stat().st_size > limit:
        raise too_large(path, path.stat().st_size, limit)
    if path.suffix != ".gz":
        return path.read_bytes()
    with gzip.open(path, "rb") as packed:
        size = 0
        while piece := packed.read(_CHUNK):
            size += len(piece)
            if size > limit:
                raise too_large(path, f"> {limit}", limit)
        packed.rewind()
        return packed.read()


def numeric_columns(path: Path, file: pa_parquet.ParquetFile) -> list[str]:
    """The columns that are numbers: texts, lists and dictionaries can unpack to any size and are never read."""
    if file.metadata.num_columns > MAX_COLUMNS:
        raise too_large(path, f"{file.metadata.num_columns} columns", MAX_COLUMNS)
    schema = file.schema_arrow
    names = [f.name for f in schema if pa.types.is_integer(f.type) or pa.types.is_floating(f.type)]
    rows = sum(max(file.metadata.row_group(k).num_rows, 0) for k in range(file.metadata.num_row_groups))
    size = 8 * max(rows, file.metadata.num_rows) * len(names)
    if size > MAX_BYTES:
        raise too_large(path, size, MAX_BYTES)
    return names


def too_large(path: Path, seen: object, limit: int) -> DataRefused:
    return DataRefused(
        f"{path}: the file unpacks to too much", step="read recording", value=seen, limit=limit,
        remedy="split the recording",
    )  # fmt: skip
