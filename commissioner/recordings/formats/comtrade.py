"""Analogue channels of a COMTRADE recording (IEEE C37.111-1991, -1999, -2013 / IEC 60255-24).

`.cfg` with its `.dat` beside it, or one `.cff`. ASCII, BINARY, BINARY32 and FLOAT32 data at one rate; status channels are
passed over. A sample that is marked as missing is NaN. Values on the secondary side come out on the primary side.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import MAX_BYTES, MAX_COLUMNS, MAX_FOREIGN_BYTES, bounded_bytes, too_large
from commissioner.recordings.formats.stretch import Stretch
from commissioner.recordings.reading.mend import LEAST_ROWS, SAME_INTERVAL
from commissioner.records import ReadingNote, Signal

_FORM = "COMTRADE"
_SECTION = re.compile(rb"^--- file type: ([A-Z]+)([^\r\n]*?)---[ \t]*\r?\n", re.MULTILINE | re.IGNORECASE)
_SAMPLES = {"BINARY": ("<i2", -0x8000), "BINARY32": ("<i4", -0x80000000), "FLOAT32": ("<f4", None)}
_MISSING_IN_ASCII = 99999.0
LEAST_SKEW = 0.01
"""Of a sample period: channels less apart are sampled together."""
_NANOSECONDS = re.compile(r":[\d ]+\.\d{9}")


@dataclass(frozen=True)
class _Channel:
    name: str
    phase: str
    unit: str
    slope: float
    offset: float
    to_primary: float
    skew_us: float


@dataclass(frozen=True)
class _Configuration:
    channels: tuple[_Channel, ...]
    status_count: int
    rate_hz: float
    """0 where only the time stamps tell."""
    promised: int
    """Samples; 0 where it does not say."""
    data_type: str
    stamp_s: float
    """What a time stamp counts: micro-, or since 2013 nanoseconds, times the file's factor."""


def channels(path: Path) -> tuple[dict[str, Signal], dict[str, float | str], tuple[ReadingNote, ...]]:
    """(values by `name [unit]`, metadata with the sample period, what is missing). DataRefused: damaged, or not at one rate."""
    text, data = _parts(path)
    configuration = _configuration(text, path)
    stamps, raw = _samples(configuration, data)
    columns = {}
    for k, channel in enumerate(configuration.channels):
        values = (channel.slope * raw[:, k] + channel.offset) * channel.to_primary
        columns[_label(channel, k)] = values
    period = _period(configuration, stamps, data)
    notes = (*_fewer(configuration.promised, stamps.size), *_skewed(configuration.channels, period))
    return columns, {"sample_period_s": period}, notes


def _skewed(channels: tuple[_Channel, ...], period: float) -> tuple[ReadingNote, ...]:
    """A note where channels were sampled apart, each by so much behind its row's time."""
    skews = {channel.name: channel.skew_us for channel in channels}
    apart = max(skews.values()) - min(skews.values())
    if apart < LEAST_SKEW * 1e6 * period:
        return ()
    said = ", ".join(f"{name} {skew:g} µs" for name, skew in skews.items() if skew)
    return (ReadingNote("skew", f"channels were sampled up to {apart:g} µs apart ({said}): taken as of one time"),)


def _fewer(promised: int, count: int) -> tuple[ReadingNote, ...]:
    if count >= promised:
        return ()
    return (
        ReadingNote(
            "fewer_samples", f"the configuration promises {promised} samples, {count} are there: the end is lost"
        ),
    )


def _parts(path: Path) -> tuple[str, Stretch]:
    """The configuration as text, and the samples."""
    if path.suffix.lower() == ".cff":
        whole = bounded_bytes(path)
        found = list(_SECTION.finditer(whole))
        ends = [mark.start() for mark in found[1:]] + [len(whole)] * bool(found)
        parts = {mark[1].upper(): whole[mark.end() : end] for mark, end in zip(found, ends, strict=True)}
        if not {b"CFG", b"DAT"} <= parts.keys():
            Stretch(memoryview(b""), path, _FORM).refuse("no CFG and DAT section")
        return _decoded(parts[b"CFG"]), Stretch(memoryview(parts[b"DAT"]), path, _FORM)
    return _decoded(bounded_bytes(_beside(path, ".cfg"), MAX_FOREIGN_BYTES)), Stretch.of_file(
        _beside(path, ".dat"), _FORM
    )


def _beside(path: Path, ending: str) -> Path:
    for candidate in (ending, ending.upper()):
        if path.with_suffix(candidate).is_file():
            return path.with_suffix(candidate)
    raise DataRefused(
        f"{path}: its {ending} file is missing", step="read recording", value=path.with_suffix(ending).name,
        limit="both files of a COMTRADE recording in one folder", remedy="copy the .cfg and the .dat file together",
    )  # fmt: skip


def _decoded(data: bytes) -> str:
    return data.decode("utf-8" if data.isascii() else "latin-1")


def _rows_of(text: str) -> list[list[str]]:
    rows = [[cell.strip() for cell in row] for row in csv.reader(text.splitlines())]
    return [row for row in rows if row]


def _configuration(text: str, path: Path) -> _Configuration:
    lines = iter(_rows_of(text))
    try:
        next(lines)
        counts = next(lines)
        analogue, status = (int(cell.rstrip("AaDd")) for cell in counts[1:3])
        if not 0 < analogue <= MAX_COLUMNS or not 0 <= status <= 16 * MAX_COLUMNS:
            raise ValueError(f"{analogue} analogue and {status} status channels")
        rows = [
            next(lines) for _ in range(analogue)
        ]  # a list: in a generator the end of the lines would be no StopIteration
        found = tuple(_channel(row, number, analogue) for number, row in enumerate(rows, 3))
        for _ in range(status):
            next(lines)
        next(lines)  # line frequency
        rate_count = int(next(lines)[0])
        stretches = [next(lines) for _ in range(max(rate_count, 1))]
        rates = [float(row[0]) for row in stretches]
        promised = int(float(stretches[-1][1])) if len(stretches[-1]) > 1 and stretches[-1][1] else 0
        first, _ = next(lines), next(lines)  # first sample, trigger
        stamp_s = 1e-9 if _NANOSECONDS.search(",".join(first)) else 1e-6
        data_type = next(lines)[0].upper()
        factor = float(next(lines, ["1"])[0] or 1)
        if len(set(rates)) > 1 or data_type not in (*_SAMPLES, "ASCII"):
            raise ValueError(f"rates of {rates[:5]} Hz, {data_type} data")
    except (ValueError, OverflowError, IndexError, StopIteration, csv.Error) as error:
        Stretch(memoryview(b""), path, _FORM).refuse(f"configuration: {str(error) or _cut_short(_rows_of(text))}")
    return _Configuration(found, status, rates[0], promised, data_type, stamp_s * factor)


def _channel(row: list[str], line: int, promised: int) -> _Channel:
    """number, id, phase, component, unit, a, b, skew, min, max, primary, secondary, P|S; the last three since 1999."""
    try:
        slope, offset, skew = float(row[5]), float(row[6]), float(row[7] or 0)
        primary, secondary = (float(row[k] or 1) for k in (10, 11)) if len(row) > 12 else (1.0, 1.0)
    except (ValueError, IndexError) as error:
        said = ",".join(row)[:40]
        raise ValueError(
            f"line {line} ({said}) is no channel, where the second promises {promised} analogue ones"
        ) from error
    is_secondary = len(row) > 12 and row[12].upper() == "S" and secondary != 0
    return _Channel(row[1], row[2], row[4], slope, offset, primary / secondary if is_secondary else 1.0, skew)


def _cut_short(lines: list[list[str]]) -> str:
    """Where a configuration ends, and what it had promised."""
    promised = f", where the second promises {', '.join(lines[1])} channels" if len(lines) > 1 else ""
    return f"cut short after line {len(lines)}{promised}"


def _samples(configuration: _Configuration, data: Stretch) -> tuple[Signal, Signal]:
    """(time stamps as they are counted, one row of analogue numbers per sample)."""
    count = len(configuration.channels)
    if configuration.data_type == "ASCII":
        return _ascii(data, count)
    kind, missing = _SAMPLES[configuration.data_type]
    row = np.dtype(
        [
            ("number", "<u4"),
            ("stamp", "<u4"),
            ("a", kind, (count,)),
            ("d", "<u2", (-(-configuration.status_count // 16),)),
        ]
    )
    rows = len(data.data) // row.itemsize
    if 8 * rows * (count + 1) > MAX_BYTES:
        raise too_large(data.path, 8 * rows * (count + 1), MAX_BYTES)
    table = np.frombuffer(data.take(rows * row.itemsize), row)
    values = table["a"].astype(np.float64)
    if missing is not None:
        values[table["a"] == missing] = np.nan
    return table["stamp"].astype(np.float64), values


def _ascii(data: Stretch, count: int) -> tuple[Signal, Signal]:
    if len(data.data) > MAX_FOREIGN_BYTES:
        raise too_large(data.path, len(data.data), MAX_FOREIGN_BYTES)
    rows = []
    for number, line in enumerate(_decoded(bytes(data.data)).replace("\x1a", "").splitlines()):
        if not line.strip():
            continue
        cells = line.split(",")[1 : count + 2]
        try:
            rows.append([float(cell) if cell.strip() else _MISSING_IN_ASCII for cell in cells])
        except ValueError:
            data.refuse(f"row {number} of the samples: {line[:40]}")
        if len(cells) != count + 1:
            data.refuse(f"row {number} of the samples holds {len(cells)} numbers")
    if not rows:
        data.refuse("no samples")
    table = np.array(rows, dtype=np.float64)
    values = np.where(table[:, 1:] == _MISSING_IN_ASCII, np.nan, table[:, 1:])
    return table[:, 0], values


def _period(configuration: _Configuration, stamps: Signal, data: Stretch) -> float:
    steps = np.diff(stamps) * configuration.stamp_s
    if configuration.rate_hz > 0:
        _require_agreement(configuration.rate_hz, steps, data.path)
        return 1.0 / configuration.rate_hz
    if steps.size == 0 or not steps.min() > 0 or steps.max() - steps.min() > 1.5 * configuration.stamp_s:
        data.refuse("time stamps that are not at one rate")
    return float(steps.mean())


def _require_agreement(rate_hz: float, steps: Signal, path: Path) -> None:
    """DataRefused: stamps that run, at another rate than the configuration's. Where it names one, they may be left out."""
    if steps.size < LEAST_ROWS or not steps.min() > 0:
        return
    stamped_hz = 1.0 / np.array([np.median(steps), np.mean(steps)])
    if np.any(np.abs(stamped_hz / rate_hz - 1.0) < SAME_INTERVAL):
        return
    raise DataRefused(
        f"{path}: the configuration and the time stamps name two rates", step="read the time",
        value=f"{rate_hz:g} Hz in the configuration, stamps at {stamped_hz[0]:.6g} Hz", limit=f"the same within {SAME_INTERVAL:.0%}",
        remedy="correct the sampling rate in the .cfg file; 0 there lets the time stamps tell",
    )  # fmt: skip


def _label(channel: _Channel, number: int) -> str:
    """The channel's own name with its unit; by unit and phase where the name says nothing: `I_A [A]`."""
    name = channel.name or f"{'I' if channel.unit.upper().endswith('A') else 'U'}_{channel.phase or number + 1}"
    return f"{name} [{channel.unit}]" if channel.unit else name
