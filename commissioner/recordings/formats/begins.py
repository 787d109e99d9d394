"""Channels of one rate that began at different times: what all of them have, from the last begin on."""

from __future__ import annotations

from collections.abc import Mapping

from commissioner.errors import DataRefused
from commissioner.records import ReadingNote, Signal

MOST_OFF = 0.01
"""Of a sample period, by which two begins may leave whole samples."""


def from_last_begin(
    values: Mapping[str, Signal], begins_s: Mapping[str, float | None], period_s: float | None, source: str
) -> tuple[dict[str, Signal], tuple[ReadingNote, ...]]:
    """Each channel without its samples before the last begin and behind the first end. DataRefused: begins a part of a sample apart
    or not told of every channel, or no stretch that all have."""
    if period_s is None:
        return dict(values), ()
    told = {name: begin for name, begin in begins_s.items() if begin is not None}
    late = {name: (begin - min(told.values())) / period_s for name, begin in told.items()}
    last = max(late, key=late.__getitem__, default="")
    if not last or late[last] < MOST_OFF:
        return dict(values), ()
    if untold := [name for name in begins_s if name not in told]:
        raise _refused(
            source, f"when {untold[0]} begins is not told, and other channels begin apart", late[last], period_s
        )
    if not min(values[name].size - (late[last] - samples) for name, samples in late.items()) >= 1.0 - MOST_OFF:
        raise _refused(
            source, f"the channels have no time in common: {last} begins when others end", late[last], period_s
        )
    early = {name: round(late[last] - samples) for name, samples in late.items()}
    odd = next((name for name in late if abs(late[last] - late[name] - early[name]) > MOST_OFF), None)
    if odd is not None:
        raise _refused(source, f"{odd} and {last} begin a part of a sample apart", late[last] - late[odd], period_s)
    rows = min(values[name].size - first for name, first in early.items())
    cut = {name: values[name][first : first + rows] for name, first in early.items()}
    first = min(late, key=late.__getitem__)
    note = ReadingNote(
        "begins", f"{last} begins {early[first]} samples ({early[first] * period_s:.6g} s) after {first}: the {rows} samples "
        "that all channels have in common were taken",
    )  # fmt: skip
    return {**values, **cut}, (note,)


def _refused(source: str, what: str, samples: float, period_s: float) -> DataRefused:
    return DataRefused(
        f"{source}: {what}", step="read the time", value=f"{samples:.6g} samples ({samples * period_s:.6g} s)",
        limit=f"begins whole samples apart, within {MOST_OFF:g} of one",
        remedy="start all channels by one trigger, or resample them to one time and export that",
    )  # fmt: skip
