"""Time stamps as files have them: rows written twice, stamps printed with too few digits, an index instead of a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.motor.computed import printed_step
from commissioner.recordings.names import key_of
from commissioner.recordings.reading.preface import Clock
from commissioner.recordings.table import ColumnReading
from commissioner.recordings.units import DAY_S, read_unit
from commissioner.records import ReadingNote, Signal

LEAST_ROWS = 16
_COUNTERS = {"x", "n", "no", "nr", "index", "point", "points", "row", "sample", "samples", "sequence"}
TIME_MADE = "time_made"
"""Code of the note that the rows were counted by the interval which the file gives."""
DATES = ((32874.0, 73051.0), (7.2e5, 7.7e5))
"""Days of the years 1990 to 2099 as Excel counts them, and of 1971 to 2108 as MATLAB does."""
EPOCH_S = (6.3e8, 4.2e9)
"""Seconds since 1970 of the years 1990 to 2103."""
LEAST_STEP_S = 1e-6
SAME_INTERVAL = 0.02
LEAST_BACK = 16
"""Rows by which a time must go back to begin again: less is a row out of its place."""
MOST_REPEATED = 50
"""Rows that may bear one printed stamp: beyond it nothing is left of the time."""
ROUNDED = 0.1
"""Of a period: stamps rounded more coarsely are a straight line's. Without it 4 kHz printed to 0.1 ms, or to six digits beyond 10 s (what many
programs print unasked), was refused as of unequal steps."""


def with_time(columns: dict[str, Signal], clock: Clock) -> list[ReadingNote]:
    """Makes `time_s` of start and increment where there is none, or no cell of it is a time, or where it only counts the rows."""
    if clock.interval_s is None:
        return []
    time = columns.get("time_s")
    rows = max((v.size for v in columns.values()), default=0)
    if time is None or not np.isfinite(time).any():
        columns["time_s"] = (clock.start_s or 0.0) + clock.interval_s * np.arange(rows, dtype=np.float64)
    elif time.size > 2 and np.all(np.diff(time) == 1.0) and abs(clock.interval_s - 1.0) > 1e-9:
        columns["time_s"] = (clock.start_s or 0.0) + clock.interval_s * time
    else:
        return []
    return [
        ReadingNote(TIME_MADE, f"time from {clock.said_by or 'the sample interval'}: {clock.interval_s:.6g} s a row")
    ]


def require_seconds(columns: Mapping[str, Signal], readings: Sequence[ColumnReading], source: str) -> None:
    """DataRefused: what was taken for the time counts the rows, by its name or by a unit that is none of time."""
    time = columns.get("time_s")
    if time is None or time.size < 3 or not np.all(np.diff(time) == 1.0):
        return
    for reading in readings:
        unit = reading.unit.strip("[]() ")
        counts = _COUNTERS & {key_of(reading.name), key_of(unit)} or (unit and read_unit(unit) is None)
        if reading.meaning == "time_s" and counts:
            raise DataRefused(
                f"{source}: {reading.name} counts the rows, and the file does not say how long a row lasts", step="read the time",
                value=f"{reading.name} {unit}".strip(), limit="seconds, or a sample interval or rate above the columns",
                remedy="give `# sample_period_s: 0.000125` as the first line, with the period of your recording",
            )  # fmt: skip


def require_stamps(columns: Mapping[str, Signal], source: str) -> None:
    """DataRefused: there is a column of time, and no cell of it is a time."""
    time = columns.get("time_s")
    if time is not None and time.size and not np.isfinite(time).any():
        raise DataRefused(
            f"{source}: no cell of the time column is a time", step="read the time", value=f"{time.size} rows",
            limit="seconds, or a time of day as 10:11:12.345", remedy="export the time in seconds, or leave it out and give "
            "`# sample_period_s: 0.000125` as the first line, with the period of your recording",
        )  # fmt: skip


def without_infinite(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns with NaN, a missing sample, for what is infinite: a division by zero on the way, an overflow of a channel."""
    many = sum(int(np.isinf(v).sum()) for v in columns.values())
    if not many:
        return dict(columns), []
    note = ReadingNote("infinite", f"{many} infinite numbers are no samples: taken as missing")
    return {name: np.where(np.isinf(v), np.nan, v) for name, v in columns.items()}, [note]


def without_untimed_rows(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns without rows whose time is none: statistics below the samples, header lines, lost stamps."""
    time = columns.get("time_s")
    if time is None or np.isfinite(time).all():
        return dict(columns), []
    keep = np.isfinite(time)
    note = ReadingNote("no_time", f"{int((~keep).sum())} rows hold no time: they were left out")
    return {name: v[keep] if v.size == time.size else v for name, v in columns.items()}, [note]


def through_midnight(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """A time of day that passes midnight, running on: a step back by more than half a day among stamps of one day is that."""
    time = columns.get("time_s")
    if time is None or time.size < LEAST_ROWS or not (time.min() >= 0.0 and time.max() < DAY_S):
        return dict(columns), []
    passed = np.concatenate([[0.0], np.cumsum(np.diff(time) < -0.5 * DAY_S)])
    if passed[-1] == 0.0:
        return dict(columns), []
    note = ReadingNote(
        "midnight", f"the time of day passes midnight in {int(passed[-1])} places: 24 h were added behind each"
    )
    return {**columns, "time_s": time + DAY_S * passed}, [note]


def from_days(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """A date counted in days, as a spreadsheet or MATLAB stores it, in seconds since midnight: stamps of our time whose steps would
    be below a microsecond, which no recording of a motor has."""
    time = columns.get("time_s")
    if time is None or time.size < 2 or not any(low <= time[0] < high for low, high in DATES):
        return dict(columns), []
    if not 0.0 < (step := float(np.ptp(time)) / (time.size - 1)) < LEAST_STEP_S:
        return dict(columns), []
    note = ReadingNote("days", f"the time counts days, {step:.3g} a row: taken as {DAY_S * step:.6g} s a row")
    return {**columns, "time_s": DAY_S * (time - np.floor(time[0]))}, [note]


def from_epoch(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """Milli-, micro- or nanoseconds since 1970 without a unit, in seconds since midnight: as seconds they lie 20 000 years ahead."""
    time = columns.get("time_s")
    for name, per_second in (("milli", 1e3), ("micro", 1e6), ("nano", 1e9)):
        if time is not None and time.size and EPOCH_S[0] <= time[0] / per_second < EPOCH_S[1]:
            day = DAY_S * per_second
            note = ReadingNote("epoch", f"the time counts {name}seconds since 1970: taken as seconds of the day")
            return {**columns, "time_s": (time - day * np.floor(time[0] / day)) / per_second}, [note]
    return dict(columns), []


def require_one_block(columns: Mapping[str, Signal], source: str) -> None:
    """DataRefused: the time begins again inside a segment, where another recording stands below the first."""
    time = columns["time_s"]
    steps, segment = np.diff(time), columns.get("segment", np.zeros(time.size))
    if steps.size < LEAST_ROWS:
        return
    again = np.flatnonzero((steps < -LEAST_BACK * np.median(np.abs(steps))) & (np.diff(segment) == 0.0)) + 1
    if again.size:
        row = int(again[0])
        raise DataRefused(
            f"{source}: the time begins again in row {row + 1} of its numbers: {again.size + 1} recordings stand below each other",
            step="read the time", value=f"from {time[row - 1]:.6g} s back to {time[row]:.6g} s", limit="a time that runs on",
            remedy="save each in a file of its own; at standstill a column segment may number them",
        )  # fmt: skip


def with_running_time(
    columns: Mapping[str, Signal], clock: Clock, source: str
) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """Stamps so coarse that most rows share the one before them, as the rows counted by the interval that the file gives.
    DataRefused: it gives none, or one that the stamps contradict."""
    time = columns.get("time_s")
    if time is None or time.size < LEAST_ROWS or np.median(np.diff(time)) != 0.0:
        return dict(columns), []
    step, interval = _least_step(time), clock.interval_s
    made = None if interval is None else time[0] + interval * np.arange(time.size, dtype=np.float64)
    if made is None or (step > 0.0 and np.ptp(time - made) > 2.0 * step):
        stamps = np.unique(time).size
        raise DataRefused(
            f"{source}: the time stands still from row to row", step="read the time",
            value=f"{stamps} different stamps in {time.size} rows" + (f", in steps of {step:.6g} s" if step > 0.0 else ""),
            limit="a stamp for each row", remedy="export a finer time column, or give `# sample_period_s: 0.000125` as the first line, "
            "with the period of your recording",
        )  # fmt: skip
    note = ReadingNote(
        TIME_MADE,
        f"time from {clock.said_by or 'the sample interval'}: {interval:.6g} s a row; the stamps stand still for several rows",
    )
    return {**columns, "time_s": made}, [note]


def against_interval(
    columns: Mapping[str, Signal], clock: Clock, readings: Sequence[ColumnReading], source: str
) -> list[ReadingNote]:
    """A note where the stamps step by another interval than the preface says. DataRefused: by thousands, and nothing says in which
    unit the stamps are."""
    time, interval = columns.get("time_s"), clock.interval_s
    if time is None or time.size < LEAST_ROWS or interval is None or clock.said_by == "sample_period_s":
        return []
    steps = np.diff(time[np.isfinite(time)])
    ratios = np.array([np.median(steps), np.mean(steps)]) / interval
    if not np.all(ratios > 0.0) or np.any(np.abs(ratios - 1.0) < SAME_INTERVAL):
        return []
    said = f"{clock.said_by} stands above the columns, the stamps step by {interval * ratios[0]:.6g} s"
    thousands = np.log10(ratios[0]) / 3.0
    is_by_thousands = round(thousands) != 0 and abs(thousands - round(thousands)) < SAME_INTERVAL
    if is_by_thousands and not any(r.meaning == "time_s" and read_unit(r.unit) for r in readings):
        raise DataRefused(
            f"{source}: {said}: milli or micro", step="read the time", value=f"{interval * ratios[0]:.6g} s a row",
            limit=f"{interval:.6g} s", remedy="name the unit of the time behind its name, as Time (ms)",
        )  # fmt: skip
    return [ReadingNote("interval", f"{said}: the stamps are used")]


def without_empty_columns(
    columns: Mapping[str, Signal], readings: Sequence[ColumnReading]
) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns without those that mean something and in which no cell is a number."""
    called = {r.meaning: r.name for r in readings if r.meaning}
    empty = [name for name, v in columns.items() if name in called and v.size and not np.isfinite(v).any()]
    notes = [ReadingNote("no_number", f"no cell of {called[name]} is a number: not used") for name in empty]
    return {name: v for name, v in columns.items() if name not in empty}, notes


def without_doubled_rows(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """The columns without rows that repeat the one before them in every cell."""
    time = columns.get("time_s")
    rows = 0 if time is None else time.size
    alike = [v for v in columns.values() if v.size == rows]
    if rows < 2 or len(alike) < 3:
        return dict(columns), []
    same: NDArray[np.bool_] = np.all([np.diff(v) == 0.0 for v in alike], axis=0)
    if not same.any():
        return dict(columns), []
    keep = np.concatenate([[True], ~same])
    note = ReadingNote("doubled_rows", f"{int(same.sum())} rows repeat the one before them: each was taken once")
    return {name: v[keep] if v.size == rows else v for name, v in columns.items()}, [note]


def with_whole_time(columns: Mapping[str, Signal]) -> tuple[dict[str, Signal], list[ReadingNote]]:
    """Stamps that several rows share, or rounded to a good part of the period, where they leave a straight line by no more than their printing
    step, as that line; each segment by itself, all at one period. Any other time stays as it is."""
    time = columns.get("time_s")
    if time is None or time.size < LEAST_ROWS or not np.isfinite(time).all():
        return dict(columns), []
    segment = columns.get("segment", np.zeros(time.size))
    if segment.size != time.size:
        return dict(columns), []
    steps = np.diff(time)[np.diff(segment) == 0.0]
    is_shared = bool(np.any(steps == 0.0))
    if not is_shared and _unevenness(steps) <= ROUNDED:
        return dict(columns), []
    edges = np.concatenate([[0], np.flatnonzero(np.diff(segment) != 0.0) + 1, [time.size]])
    parts = [slice(int(a), int(b)) for a, b in pairwise(edges)]
    period = _period([time[p] for p in parts])
    if period is None:
        return dict(columns), []
    printed = np.full(time.size, _least_step(time)) if is_shared else _rounded_to(time, steps, period)
    if printed is None:
        return dict(columns), []
    mended = np.empty_like(time)
    for part in parts:
        count = np.arange(part.stop - part.start, dtype=np.float64)
        line = period * (count - count.mean()) + time[part].mean()
        if np.max(np.abs(time[part] - line)) > printed[part].max() + 1e-12:
            return dict(columns), []
        mended[part] = line
    note = ReadingNote(
        "rounded_time",
        f"time is printed in steps of {printed.max():.6g} s{', several rows share one' * is_shared}: the period is the mean step, {period:.6g} s",
    )
    return {**columns, "time_s": mended}, [note]


def _unevenness(steps: Signal) -> float:
    """Of the mean step, by which one leaves it; 0 of none. Asked of every recording: a line through the stamps takes many times as long."""
    mean = float(np.mean(steps)) if steps.size else 0.0
    return float(np.max(np.abs(steps - mean))) / mean if mean > 0.0 else 0.0


def _rounded_to(time: Signal, steps: Signal, period_s: float) -> Signal | None:
    """The last digit's worth of every stamp, where it explains how uneven the steps are; else None."""
    uneven_s = float(np.max(np.abs(steps - period_s), initial=0.0))
    if uneven_s >= period_s or period_s < LEAST_STEP_S:
        return None
    printed = printed_step(time)
    return printed if uneven_s <= printed.max() + 1e-12 < period_s else None


def _period(parts: list[Signal]) -> float | None:
    """The mean step over all parts, s; None where stamps run backwards or too many rows share one."""
    long = [p for p in parts if p.size >= LEAST_ROWS]
    if not long or any(np.any(np.diff(p) < 0.0) for p in parts):
        return None
    weights = [float(p.size) for p in long]
    slopes = [float(np.polyfit(np.arange(p.size), p - p[0], 1)[0]) for p in long]
    period = float(np.average(slopes, weights=np.power(weights, 3)))
    step = max(_least_step(p) for p in parts)
    return period if period > 0.0 and step < MOST_REPEATED * period else None


def _least_step(time: Signal) -> float:
    """The least step between stamps that differ."""
    steps = np.diff(time)
    return float(np.min(steps[steps > 0.0], initial=np.inf)) if np.any(steps > 0.0) else 0.0
