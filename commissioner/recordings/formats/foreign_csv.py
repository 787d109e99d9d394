"""Other people's CSV: any of comma, semicolon, tab, space; decimal commas; preface lines; a row of units."""

from __future__ import annotations

import csv
import gzip
import zlib
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import MAX_FOREIGN_BYTES, bounded_text
from commissioner.recordings.units import UNIT, scale_of, unit_in
from commissioner.records import Signal

MAX_PREFACE_LINES = 200
HEAD_BYTES = 65536


def read_text(path: Path) -> str:
    try:
        data = bounded_text(path, MAX_FOREIGN_BYTES)
    except (OSError, EOFError, zlib.error) as error:
        raise _unreadable(path, str(error)) from error
    for encoding in ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "latin-1"):
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise _unreadable(path, "the text encoding is not known")


def has_other_separators(path: Path) -> bool:
    """Whether the names stand between semicolons or tabs, or in UTF-16. Of any other file False, whatever is wrong with it."""
    opener = gzip.open if path.suffix == ".gz" else open
    try:
        with opener(path, "rb") as file:
            head = file.read(HEAD_BYTES)
    except (OSError, EOFError, zlib.error):
        return False
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return True
    if path.suffix == ".parquet" or b"\0" in head:
        return False
    names = next((line for line in head.splitlines() if line and not line.startswith(b"#")), b"")
    return b";" in names or b"\t" in names


def parse_csv(text: str, source: str) -> tuple[dict[str, Signal], dict[str, float | str]]:
    """Columns by their header (with the unit row's scale applied) and `key: value` lines of the preface."""
    lines = text.splitlines()
    separator, first = _layout(lines, source)
    comma = separator != "," and _has_decimal_commas(lines[first : first + 50])
    header, units = _header(lines, first, separator)
    values = _numbers(lines[first:], separator, comma, len(header), source)
    scales = [scale_of(unit) for unit in units]
    columns = {name: values[:, k] * scales[k] for k, name in enumerate(header) if name}
    return columns, _preface(lines[:first])


def _cells(line: str, separator: str) -> list[str]:
    """None where a cell is longer than any number or name."""
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return []


def _layout(lines: list[str], source: str) -> tuple[str, int]:
    """The separator, and the first of at least three lines that hold the same number (2 or more) of numbers."""
    for start in range(min(MAX_PREFACE_LINES, len(lines))):
        for separator in (";", "\t", ",", " "):
            counts = [_count_numbers(line, separator) for line in lines[start : start + 3]]
            if len(counts) == 3 and min(counts) == max(counts) >= 2:
                return separator, start
    raise DataRefused(
        f"{source}: no rows of numbers were found",
        step="read recording",
        value=lines[0][:60] if lines else "",
        limit="two or more columns of numbers",
        remedy="export time, three currents and three voltages as CSV",
    )


def _count_numbers(line: str, separator: str) -> int:
    """Number of cells if every filled cell is a number, else 0."""
    cells = [cell.strip() for cell in _cells(line, separator)]
    filled = [cell for cell in cells if cell]
    if not filled or not all(_is_number(cell, separator != ",") for cell in filled):
        return 0
    return len(cells) if separator != " " else len(filled)


def _is_number(cell: str, commas: bool) -> bool:
    try:
        float(cell.replace(",", ".") if commas else cell)
    except ValueError:
        return False
    return True


def _has_decimal_commas(lines: list[str]) -> bool:
    return any("," in line for line in lines)


def _header(lines: list[str], first: int, separator: str) -> tuple[list[str], list[str]]:
    """Column names and their units: from the row above the numbers, and the one above it where that one holds units."""
    width = len(_cells(lines[first], separator))
    above = [_cells(line, separator) for line in lines[max(0, first - 2) : first]]
    above = [[cell.strip().lstrip("#").strip() for cell in row] for row in above if len(row) == width]
    if not above:
        return [f"column_{k}" for k in range(width)], [""] * width
    if len(above) == 2 and all(not cell or UNIT.match(cell) for cell in above[1]):
        return above[0], above[1]
    return above[-1], [unit_in(name) for name in above[-1]]


def _numbers(lines: list[str], separator: str, comma: bool, width: int, source: str) -> Signal:
    rows = []
    for number, line in enumerate(lines):
        if not line.strip():
            continue
        cells = line.replace(",", ".").split(separator) if comma else line.split(separator)
        cells = [cell.strip() for cell in cells] if separator != " " else line.split()
        if len(cells) < width:
            raise DataRefused(
                f"{source}: row {number} holds {len(cells)} columns",
                step="read recording",
                value=len(cells),
                limit=width,
                remedy="export again, without footer lines",
            )
        rows.append([float(cell) if _is_number(cell, False) else np.nan for cell in cells[:width]])
    return np.array(rows, dtype=np.float64)


def _preface(lines: list[str]) -> dict[str, float | str]:
    metadata: dict[str, float | str] = {}
    for line in lines:
        key, mark, value = line.lstrip("#").partition(":")
        if mark and value.strip() and len(key) < 60:
            cleaned = value.strip().strip(";,\t")
            metadata[key.strip()] = float(cleaned) if _is_number(cleaned, False) else cleaned
    return metadata


def _unreadable(path: Path, reason: str) -> DataRefused:
    return DataRefused(
        f"{path}: the file cannot be read",
        step="read recording",
        value=reason,
        limit="CSV, CSV.gz, Parquet, MATLAB v5",
        remedy="export the recording again, as CSV or Parquet",
    )
