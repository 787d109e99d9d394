"""Columns in which not every row was measured: a slower clock sampled than wrote them, so that a value stands for several rows, lies on a
straight line between two, or is not there; or a channel stood still while the others of its kind went on.

What stands there was not measured, and a fit would take it for the motor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.errors import DataRefused
from commissioner.motor.computed import printed_step
from commissioner.records import ReadingNote, Signal

LEAST_NEW, LEAST_VALUES = 100, 20
"""Rows with something new, and different values among them: below, a column of a few levels (a switched voltage, a test at rest)."""
REGULAR = 0.99
HELD, ON_LINES, BLANK = "stand", "lie on straight lines", "are blank"
PRINTED = 3.0
"""Last places by which a rounded straight line bends."""
LEAST_STILL, MOST_TURNS = 50, 4
"""Rows of one value, and how often another channel passes its mean meanwhile, from which a channel stands still: two periods. (A converter at its end holds a
value for half of one, the voltage of six steps for a third.)"""
GOES_ON = 0.2
"""Of a channel's standard deviation in the whole file, from which it goes on in a part."""
NO_CURRENT = 0.15
"""Of what the others carry: below, a current that stands still may be one that does not flow."""


@dataclass(frozen=True)
class Pace:
    """A new value on every `every`th row of each block from its entry in `first` on; `first` empty: not on equal steps. `between`: what
    the rows in between hold."""

    every: int
    first: tuple[int, ...]
    between: str

    def is_within(self, slower: Pace) -> bool:
        """Whether every new row of the slower one is one of this too."""
        return slower.every % self.every == 0 and self.first == tuple(k % self.every for k in slower.first)


def pace_of(values: Signal, begins: Sequence[int] = (0,)) -> Pace | None:
    """None: a value of its own in every row, as far as `(n,)` tell. `begins`: the first row of each block, between which the clock may
    have stood."""
    if values.size <= LEAST_NEW:
        return None
    there = np.isfinite(values)
    if not np.all(there):
        return _pace(values, np.flatnonzero(there), begins, BLANK)
    if held := _pace(values, np.setdiff1d(np.flatnonzero(np.diff(values)) + 1, begins), begins, HELD):
        return held
    bends = np.abs(np.diff(values, 2)) > 1e-6 * np.abs(values).max() + PRINTED * printed_step(values).max()
    return _pace(values, np.setdiff1d(np.flatnonzero(bends) + 1, begins), begins, ON_LINES)


def on_one_clock(
    columns: Mapping[str, Signal], watched: Sequence[str], source: str, begins: Sequence[int] = (0,)
) -> tuple[dict[str, Signal], int, list[ReadingNote]]:
    """(columns, of how many rows one is left, what was left out). DataRefused: slow columns whose new rows are not the same."""
    return _measured(columns, _slow(columns, watched, begins), source, begins)


def stood_still(columns: Mapping[str, Signal], channels: Sequence[str], *, is_current: bool) -> dict[str, np.ndarray]:
    """Of each channel that stood still while another of these went on: the rows, `(n,)` bool. An exported value that is no longer renewed, a probe
    that has come off: 326 V all along were taken for a voltage, and the shaft was said to turn three times too fast."""
    still = {}
    for name in channels:
        values, others = columns[name], [columns[other] for other in channels if other != name]
        edges = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1, [values.size]])
        rows = np.zeros(values.size, dtype=bool)
        for k in np.flatnonzero(np.diff(edges) >= LEAST_STILL):
            begin, run = edges[k], slice(edges[k], edges[k + 1])
            if any(_goes_on(x, run) for x in others):
                usual = max(float(np.nanmedian(np.abs(x[run]))) for x in others if np.isfinite(x[run]).any())
                rows[run] = not is_current or abs(values[begin]) > NO_CURRENT * usual
        if rows.any():
            still[name] = rows
    return still


def _goes_on(values: Signal, run: slice) -> bool:
    """Whether a channel turns there, by no less than it does elsewhere: steps of a converter before a motor is switched on are none."""
    there = values[run][np.isfinite(values[run])]
    if there.size == 0 or np.std(there) < GOES_ON * np.nanstd(values):
        return False
    return int(np.count_nonzero(np.diff(there > there.mean()))) >= MOST_TURNS


def currents_on_the_commands_clock(
    columns: Mapping[str, Signal], currents: Sequence[str], command: str, source: str, begins: Sequence[int]
) -> tuple[dict[str, Signal], int, list[ReadingNote]]:
    """As `on_one_clock`, where what drives the currents stands still between their rows. DataRefused where it does not: what the
    currents did meanwhile cannot be computed from a command of fewer rows."""
    paces = _slow(columns, currents, begins)
    driven = pace_of(columns[command], begins) if paces else None
    if any(not p.first or driven is None or not p.is_within(driven) or driven.every != p.every for p in paces.values()):
        raise _refused(
            paces,
            source,
            f"record the currents in every row; or write only their rows, if {command} does not change between them",
        )
    return _measured(columns, paces, source, begins)


def _measured(
    columns: Mapping[str, Signal], paces: Mapping[str, Pace], source: str, begins: Sequence[int]
) -> tuple[dict[str, Signal], int, list[ReadingNote]]:
    if not paces:
        return dict(columns), 1, []
    slowest = max(paces.values(), key=lambda p: p.every)
    if not all(p.first and p.is_within(slowest) for p in paces.values()):
        raise _refused(paces, source, "export every column at one rate, each row measured")
    rows = np.arange(next(iter(columns.values())).size)
    kept = rows % slowest.every == np.repeat(slowest.first, np.diff([*begins, rows.size]))
    note = ReadingNote("slow_columns", f"{_said(paces)}: the rows between were left out")
    return {name: values[kept] for name, values in columns.items()}, slowest.every, [note]


def _slow(columns: Mapping[str, Signal], watched: Sequence[str], begins: Sequence[int]) -> dict[str, Pace]:
    return {name: pace for name in watched if name in columns and (pace := pace_of(columns[name], begins))}


def _pace(values: Signal, at: np.ndarray, begins: Sequence[int], between: str) -> Pace | None:
    if at.size < LEAST_NEW:
        return None
    gaps = np.diff(at)
    every = int(np.bincount(gaps).argmax())
    if every < 2 or np.unique(values[at]).size < LEAST_VALUES:
        return None
    phases = [np.bincount(rows % every, minlength=every) for rows in np.split(at, np.searchsorted(at, begins[1:]))]
    if sum(int(phase.max()) for phase in phases) >= REGULAR * at.size:
        return Pace(every, tuple(int(phase.argmax()) for phase in phases), between)
    steps = np.abs(np.diff(values[at]))
    is_uneven = between == HELD and np.mean(np.abs(gaps - every) <= 1) >= REGULAR and gaps.min() >= 2
    return Pace(every, (), between) if is_uneven and np.median(steps) > PRINTED * steps[steps > 0.0].min() else None


def _said(paces: Mapping[str, Pace]) -> str:
    slowest = max(paces.values(), key=lambda p: p.every)
    steps = f"every {slowest.every} rows" if slowest.first else f"every {slowest.every} rows or one more or less"
    return f"{', '.join(paces)} have a new value {steps} and {slowest.between} in between"


def _refused(paces: Mapping[str, Pace], source: str, remedy: str) -> DataRefused:
    return DataRefused(
        f"{source}: {_said(paces)}: what is there was not measured", step="read the recording",
        value=", ".join(f"{name}: every {pace.every} rows" for name, pace in paces.items()), limit="a measured value in every row",
        remedy=remedy,
    )  # fmt: skip
