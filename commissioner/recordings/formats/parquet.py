"""Columns of a Parquet file as numbers: decimals too, stamps and durations in seconds, by what each field says of unit and scale."""

from __future__ import annotations

import re
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pa_parquet

from commissioner.recordings.bounds import numeric_columns
from commissioner.recordings.formats.counts import in_unit, is_said
from commissioner.recordings.names import meanings_of
from commissioner.recordings.units import DAY_S, without_brackets
from commissioner.records import ReadingNote

NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
PER_SECOND = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
INDEX = "__index_level_0__"
"""What pandas calls an index that has no name."""


def columns_of(path: Path, file: pa_parquet.ParquetFile) -> tuple[pa.Table, list[str], tuple[ReadingNote, ...]]:
    """(the columns of numbers and times, the names of others that mean a column of a recording which no number does, notes)."""
    names, schema = numeric_columns(path, file), file.schema_arrow
    raw, time = file.read(columns=names), _time_among(schema, names)
    found: dict[str, pa.ChunkedArray] = {}
    notes: list[ReadingNote] = []
    for name in names:
        column, said = raw.column(name), _said(schema.field(name))
        if pa.types.is_temporal(column.type):
            found["time_s" if name == time else name] = _seconds(column)
            continue
        column = column.cast(pa.float64(), safe=False)
        if factors := {key: float(text) for key, text in said.items() if is_said(key) and NUMBER.fullmatch(text)}:
            values, more = in_unit(name, column.to_numpy(), factors, str(path))
            column, notes = pa.chunked_array([values]), [*notes, *more]
        unit = said.get("unit") or said.get("units") or ""
        found[f"{name} [{unit}]" if unit and name == without_brackets(name) else name] = column
    if nested := [name for name in schema.names if pa.types.is_nested(schema.field(name).type)]:
        notes.append(
            ReadingNote(
                "nested",
                f"{', '.join(nested)[:120]}: lists or structures in each cell, not used; store a number in each",
            )
        )
    return pa.table(found), _without_numbers(schema.names, names, time), tuple(notes)


def _without_numbers(all_names: list[str], names: list[str], time: str | None) -> list[str]:
    meant = meanings_of(all_names)
    held = {meant.get(name) for name in names} | ({"time_s"} if time else set())
    return [name for name in all_names if name not in names and name in meant and meant[name] not in held]


def _time_among(schema: pa.Schema, names: list[str]) -> str | None:
    """Of columns of times the one that means the recording's time, pandas' index, or the only one; None where a number means it."""
    meant = meanings_of(names)
    stamped = [name for name in names if pa.types.is_temporal(schema.field(name).type)]
    if any(meaning == "time_s" and name not in stamped for name, meaning in meant.items()):
        return None
    called = [name for name in stamped if meant.get(name) == "time_s" or name == INDEX]
    return next(iter(called or stamped if len(stamped) == 1 else called), None)


def _seconds(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Seconds; of stamps since the midnight (UTC) before the first, for a double has no room for nanoseconds since 1970."""
    counted = column.cast(pa.int32() if pa.types.is_time32(column.type) else pa.int64()).cast(pa.int64())
    per_second = PER_SECOND[column.type.unit]
    first = pc.min(counted).as_py() if pa.types.is_timestamp(column.type) else None
    if first is not None:
        counted = pc.subtract(counted, pa.scalar(first - first % (DAY_S * per_second), pa.int64()))
    return pc.divide(counted.cast(pa.float64(), safe=False), float(per_second))


def _said(field: pa.Field) -> dict[str, str]:
    return {k.decode(errors="replace").lower(): v.decode(errors="replace") for k, v in (field.metadata or {}).items()}
