"""Recordings in other people's formats, mapped into the contract's table.

Oscilloscope and logger CSV: any of comma, semicolon, tab; decimal commas; preface lines; a row of units; column names such
as `Ia`, `i_L1`, `Strom U`, `CH1 (mA)`. MATLAB v5: vectors or columns of a matrix under such names, also inside structures.
TDMS, MDF4 and COMTRADE are named and refused: export them as CSV or Parquet.
"""

from __future__ import annotations

import csv
import re
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused, UsageError
from commissioner.recordings import matlab
from commissioner.recordings.bounds import MAX_FOREIGN_BYTES, bounded_bytes
from commissioner.recordings.table import Table, read_table, to_running
from commissioner.records import RunningRecording, Signal

FOREIGN = {
    ".tdms": "TDMS",
    ".mf4": "MDF4",
    ".mdf": "MDF",
    ".cfg": "COMTRADE",
    ".dat": "COMTRADE",
    ".cff": "COMTRADE",
    ".xlsx": "Excel",
    ".xls": "Excel",
}
MAX_PREFACE_LINES = 200
SCALE = {"n": 1e-9, "u": 1e-6, "µ": 1e-6, "μ": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}
UNIT = re.compile(r"^[\[(]?\s*(n|u|µ|μ|m|k|M)?(s|sec|a|v|rad/s|1/min|rpm|hz)\s*[\])]?$", re.IGNORECASE)
IN_NAME = re.compile(r"[\[(]\s*([^\])]*)\s*[\])]\s*$|_(ms|us|s|mA|A|mV|V|kV)$")
PHASES = {"a": "u", "b": "v", "c": "w", "1": "u", "2": "v", "3": "w", "u": "u", "v": "v", "w": "w", "r": "u", "t": "w"}


def read_running(path: Path) -> RunningRecording:
    """The recording in `path`, whatever its format; DataRefused names the column that could not be found."""
    return to_running(import_table(path))


def import_table(path: Path) -> Table:
    """The table of a contract file as it stands, of any other file after its columns were recognised."""
    if not path.is_file():
        raise UsageError(
            f"there is no file {path}",
            step="read recording",
            value=str(path),
            limit="an existing file",
            remedy="check the path",
        )
    suffix = path.suffix.lower()
    if suffix in FOREIGN:
        raise DataRefused(
            f"{path}: {FOREIGN[suffix]} files are not read",
            step="read recording",
            value=suffix,
            limit="CSV, CSV.gz, Parquet, MATLAB v5",
            remedy="export the recording as CSV or Parquet",
        )
    if suffix == ".mat":
        return recognise(matlab.vectors(path), {}, str(path))
    try:
        table = read_table(path)
    except DataRefused as refusal:
        return _foreign_csv(path, refusal)
    if "time_s" in table.columns and any(name.startswith("current_") for name in table.columns):
        return table
    try:
        return recognise(table.columns, table.metadata, str(path))
    except DataRefused as refusal:
        return _foreign_csv(path, refusal)


def _foreign_csv(path: Path, refusal: DataRefused) -> Table:
    """The file read as somebody else's CSV; where that fails too, what was wrong with it as a table stands."""
    if path.suffix.lower() == ".parquet":
        raise refusal
    try:
        columns, metadata = parse_csv(_text(path), str(path))
    except DataRefused:
        raise refusal from None
    return recognise(columns, metadata, str(path))


def _text(path: Path) -> str:
    try:
        data = bounded_bytes(path, MAX_FOREIGN_BYTES)
    except (OSError, EOFError, zlib.error) as error:
        raise _unreadable(path, str(error)) from error
    for encoding in ("utf-16",) if data[:2] in (b"\xff\xfe", b"\xfe\xff") else ("utf-8-sig", "latin-1"):
        try:
            return data.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise _unreadable(path, "the text encoding is not known")


def parse_csv(text: str, source: str) -> tuple[dict[str, Signal], dict[str, float | str]]:
    """Columns by their header (with the unit row's scale applied) and `key: value` lines of the preface."""
    lines = text.splitlines()
    separator, first = _layout(lines, source)
    comma = separator != "," and _has_decimal_commas(lines[first : first + 50])
    header, units = _header(lines, first, separator)
    values = _numbers(lines[first:], separator, comma, len(header), source)
    scales = [_scale(unit) for unit in units]
    columns = {name: values[:, k] * scales[k] for k, name in enumerate(header) if name}
    return columns, _preface(lines[:first])


def _cells(line: str, separator: str) -> list[str]:
    return next(csv.reader([line], delimiter=separator), [])


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
    return above[-1], [_unit_in(name) for name in above[-1]]


def _unit_in(name: str) -> str:
    found = IN_NAME.search(name)
    return (found.group(1) or found.group(2) or "") if found else ""


def _scale(unit: str) -> float:
    """Factor to SI: 1e-3 for mA, 2 pi / 60 for rpm; 1 where no unit is recognised."""
    found = UNIT.match(unit.strip())
    if not found:
        return 1.0
    if found.group(2).lower() in {"rpm", "1/min"}:
        return float(np.pi / 30)
    prefix = found.group(1) or ""
    return SCALE.get(prefix, SCALE.get(prefix.lower(), 1.0))


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


def recognise(columns: Mapping[str, Signal], metadata: Mapping[str, float | str], source: str) -> Table:
    """The contract's columns among others' names; time is made from a rate where there is no time column."""
    kept: dict[str, Signal] = {}
    data = dict(metadata)
    for name, values in columns.items():
        meaning = meaning_of(name)
        if values.size == 1 and _key(name) in {"fs", "samplerate", "samplingrate", "samplingfrequency"}:
            data["sample_period_s"] = 1.0 / float(values[0])
        elif values.size == 1 and _key(name) in {"ts", "dt", "tsample", "sampleperiod"}:
            data["sample_period_s"] = float(values[0])
        elif meaning and meaning not in kept and values.size > 1:
            kept[meaning] = values
    longest = max((v.size for v in kept.values()), default=0)
    kept = {name: values for name, values in kept.items() if values.size == longest}
    period = data.get("sample_period_s")
    if "time_s" not in kept and isinstance(period, float) and longest:
        kept["time_s"] = np.arange(longest) * period
    missing = _missing(kept)
    if missing:
        raise DataRefused(
            f"{source}: the recording lacks {', '.join(missing)}: speed and torque cannot be reconstructed from it",
            step="recognise columns",
            value=_some(columns),
            limit="time_s, three line currents and three voltages, in SI units",
            remedy="record all six channels against time, or rename the columns to the contract's",
        )
    return Table(kept, data, source)


def _missing(kept: Mapping[str, Signal]) -> list[str]:
    """What of time, currents and voltages is not there, in words; a third current or line-to-line voltage follows from two."""
    out = [] if "time_s" in kept else ["time (a time column or a sample rate)"]
    phases = [phase for phase in "uvw" if f"current_{phase}_a" not in kept]
    if len(phases) > 1:
        out.append("the current" + ("s" if len(phases) > 1 else "") + " of phase " + ", ".join(phases))
    star = all(f"voltage_{phase}_v" in kept for phase in "uvw")
    if not star and sum(f"voltage_{pair}_v" in kept for pair in ("uv", "vw", "wu")) < 2:
        out.append("three phase voltages or two line-to-line voltages")
    return out


def _some(columns: Mapping[str, Signal]) -> str:
    names = list(columns)
    return ", ".join(names[:8]) + (f" ... ({len(names)} columns)" if len(names) > 8 else "")


def _key(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.rsplit(".", maxsplit=1)[-1].lower())


def meaning_of(name: str) -> str | None:
    """The contract's column that a name means, or None: `Ia`, `i_L1 (A)`, `Strom U`, `van`, `U12`, `vab`, `t`, `speed`."""
    bare = IN_NAME.sub("", name.rsplit(".", maxsplit=1)[-1] if not name.rsplit(".", maxsplit=1)[-1].isdigit() else name)
    key = re.sub(r"[^a-z0-9]", "", bare.lower())
    if key in {"t", "time", "times", "zeit", "timestamp", "x", "xaxis", "second"}:
        return "time_s"
    if key in {"speed", "speedradpers", "wm", "omegam", "drehzahl", "n", "rpm"}:
        return "speed_rad_per_s"
    found = re.match(
        r"^(?:i|is|cur|current|strom|courant|currentphase|iphase|phasecurrent|il|strom)(?:l)?([abcuvwrt123])a?$", key
    )
    if found and key not in {"it"}:
        return f"current_{PHASES[found.group(1)]}_a"
    found = re.match(
        r"^(?:u|v|vs|vol|volt|voltage|spannung|tension|voltagephase|vl|ul)(?:l)?([abcuvwrt123])(?:n|0|v)?$", key
    )
    if found:
        return f"voltage_{PHASES[found.group(1)]}_v"
    found = re.match(r"^(?:u|v|vs|vol|volt|voltage|spannung|ul|vl)(?:l)?([abcuvwrt123])(?:l)?([abcuvwrt123])v?$", key)
    if found:
        pair = PHASES[found.group(1)] + PHASES[found.group(2)]
        return f"voltage_{pair}_v" if pair in {"uv", "vw", "wu"} else None
    return None


def _unreadable(path: Path, reason: str) -> DataRefused:
    return DataRefused(
        f"{path}: the file cannot be read",
        step="read recording",
        value=reason,
        limit="CSV, CSV.gz, Parquet, MATLAB v5",
        remedy="export the recording again, as CSV or Parquet",
    )
