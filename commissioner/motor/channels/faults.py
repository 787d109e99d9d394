"""What every verb asks of the channels of a running recording, in one place: what can be put right is, and is said."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.motor.channels.closing import TURNS, Behind, currents_behind
from commissioner.motor.channels.drift import DRIVES, drifts_of, supply_hz
from commissioner.motor.channels.ends import clipped, runs_into, unwrapped
from commissioner.motor.channels.late import Late, late, shifted
from commissioner.motor.channels.rows import held, lost, written_twice
from commissioner.motor.channels.spikes import without_spikes
from commissioner.motor.channels.stamps import with_even_time
from commissioner.motor.channels.sums import OpenSum, open_sum
from commissioner.records import ReadingNote, RunningRecording, Signal, StandstillRecording

PHASES, LINES = ("u", "v", "w"), ("uv", "vw", "wu")
SPIKES, WRAPPED, LATE, POLARITY = "spikes", "wrapped", "late_channel", "polarity"
HELD, LOST, DRIFT = "held_rows", "lost_rows", "drifting_offset"
Group = tuple[Signal, Signal, Signal]


def put_right(one: RunningRecording) -> RunningRecording:
    """The recording without wraps, spikes, a turned sign, drifting offsets and delays between its channels, with a note of each."""
    one = with_even_time(one, TURNS @ np.array(one.voltages_v)) if one.sample_period_s > 0.0 else one
    one = _without_held(one)
    _require_once(one)
    one = _with_losses(one)
    return _with_channels_on_time(_without_drifts(_with_channels_whole(one)))


def _with_channels_whole(one: RunningRecording) -> RunningRecording:
    """The recording with what ran over put back, without spikes, and with a turned channel's sign."""
    groups: list[Group] = []
    notes, spikes = list(one.notes), 0
    for kind, unit, names, group in _groups(one):
        channels, own, count = _whole(group, kind, unit, names)
        groups.append((channels[0], channels[1], channels[2]))
        notes, spikes = notes + own, spikes + count
    return replace(one, currents_a=groups[0], voltages_v=groups[1], notes=(*notes, *_of_spikes(spikes)))


def _whole(
    group: Sequence[Signal], kind: str, unit: str, names: Sequence[str], cuts: Sequence[int] = ()
) -> tuple[list[Signal], list[ReadingNote], int]:
    """(channels with what ran over put back, without spikes, and of three with a turned one's sign; notes; how many spikes). `cuts`: first rows behind a pause."""
    channels, notes, spikes = list(group), [], 0
    for k, name in enumerate(names):
        parts = [unwrapped(part) for part in np.split(channels[k], cuts)]
        span, many = max(p[1] for p in parts), sum(p[2] for p in parts)
        channels[k] = np.concatenate([p[0] for p in parts]) if many else channels[k]
        if many:
            what = f"{many} samples of {kind} {name} ran over the end of its range and began again at the other ({span:.4g} {unit} away): put back"
            notes.append(ReadingNote(WRAPPED, what))
        channels[k], count = without_spikes(channels[k])
        spikes += count
    if len(channels) == len(PHASES) and (odd := _turned(channels, kind, names)) is not None:
        channels[odd] = -channels[odd]
        what = f"{kind} {names[odd]} is minus what the other two leave for it: its sign was turned (or that of both others)"
        notes.append(ReadingNote(POLARITY, what))
    return channels, notes, spikes


def _of_spikes(count: int) -> tuple[ReadingNote, ...]:
    if not count:
        return ()
    what = f"{count} samples stand out of their neighbours alone (spikes): taken as the neighbours tell them"
    return (ReadingNote(SPIKES, what),)


def _without_drifts(one: RunningRecording) -> RunningRecording:
    """The recording without what its channels' offsets drift by."""
    hz = supply_hz(TURNS @ np.nan_to_num(one.voltages_v), one.sample_period_s) if one.sample_period_s > 0.0 else 0.0
    if not hz > 0.0:
        return one
    notes, groups = list(one.notes), []
    seen = [drifts_of(group, one.time_s, hz) for group in (one.currents_a, one.voltages_v)]
    flows = max((d.share for d in seen[0] if d), default=0.0)
    for (kind, unit, names, group), drifts in zip(_groups(one), seen, strict=True):
        channels = list(group)
        for k, (name, drift) in enumerate(zip(names, drifts, strict=True)):
            if drift is not None and (kind == "current" or flows < DRIVES * drift.share):
                channels[k] = channels[k] - drift.curve
                notes.append(ReadingNote(DRIFT, f"{drift.said(kind, name, unit)}: taken off"))
        groups.append((channels[0], channels[1], channels[2]))
    return replace(one, currents_a=groups[0], voltages_v=groups[1], notes=tuple(notes))


def _with_channels_on_time(one: RunningRecording) -> RunningRecording:
    """The recording with the channels of a group that were taken one after another shifted back."""
    groups: list[Group] = []
    notes, beyond = list(one.notes), np.zeros(one.time_s.size, dtype=bool)
    for kind, _, names, group in _groups(one):
        channels = list(group)
        if seen := late(channels, one.sample_period_s):
            gaps = np.flatnonzero(~(np.diff(one.time_s) < 1.5 * one.sample_period_s)) + 1
            channels = _shifted_back(channels, seen, gaps, one.sample_period_s)
            notes.append(ReadingNote(LATE, f"{seen.said(kind, names)}: shifted back"))
            beyond |= ~np.isfinite(channels).all(axis=0) & np.isfinite(group).all(axis=0)
        groups.append((channels[0], channels[1], channels[2]))
    mended = replace(one, currents_a=groups[0], voltages_v=groups[1], notes=tuple(notes))
    return _without_ends(mended, beyond)


def _groups(one: RunningRecording) -> tuple[tuple[str, str, tuple[str, str, str], Group], ...]:
    """(kind, unit, names, channels) of currents and voltages."""
    return ("current", "A", PHASES, one.currents_a), ("voltage", "V", names_of_voltages(one), one.voltages_v)


def put_right_at_rest(one: StandstillRecording) -> StandstillRecording:
    """A recording at standstill without wraps, spikes, a turned sign and delays between its currents, with a note of each. Of rows that are means
    over several periods it is not asked."""
    if one.averaged is not None:
        return one
    group = [one.current_u_a, one.current_v_a, *([] if one.current_w_a is None else [one.current_w_a])]
    (u, v, *rest), notes, spikes = _whole(
        group, "current", "A", PHASES[: len(group)], (np.flatnonzero(np.diff(one.segment)) + 1).tolist()
    )
    notes += _of_spikes(spikes)
    if notes:
        w = rest[0] if rest else None
        one = replace(one, current_u_a=u, current_v_a=v, current_w_a=w, notes=(*one.notes, *notes))
    return put_on_time(one)


def put_on_time(one: StandstillRecording) -> StandstillRecording:
    """The recording at standstill with three currents that were taken one after another shifted back, and a note of it; else as it is. Rows at a
    stretch's end for which no later one tells the late current are left out."""
    if one.current_w_a is None or one.averaged is not None:
        return one
    currents = [one.current_u_a, one.current_v_a, one.current_w_a]
    seen = late(currents, one.sample_period_s)
    if seen is None:
        return one
    is_new = (np.diff(one.segment) != 0) | ~(np.diff(one.time_s) < 1.5 * one.sample_period_s)
    moved = _shifted_back(currents, seen, np.flatnonzero(is_new) + 1, one.sample_period_s)
    whole: NDArray[np.bool_] = np.asarray(np.isfinite(moved).all(axis=0))
    last = np.append(is_new, True)
    ends = np.zeros(whole.size, dtype=bool)
    for end in np.flatnonzero(last).tolist():  # rows behind the last one that can be shifted
        k = end
        while k >= 0 and not whole[k]:
            ends[k], k = True, k - 1
    u, v, w = (np.where(np.isfinite(y), y, x)[~ends] for x, y in zip(currents, moved, strict=True))
    note = ReadingNote(LATE, f"{seen.said('current', PHASES)}: shifted back")
    return replace(
        one, time_s=one.time_s[~ends], segment=one.segment[~ends], axis_deg=one.axis_deg[~ends], voltage_axis_v=one.voltage_axis_v[~ends],
        current_u_a=u, current_v_a=v, current_w_a=w, dc_link_v=None if one.dc_link_v is None else one.dc_link_v[~ends], notes=(*one.notes, note),
    )  # fmt: skip


def currents_on_time(
    one: RunningRecording, rated_voltage_peak_v: float, *, by_whole_rows: bool = False
) -> tuple[RunningRecording, Behind | None]:
    """The recording with its currents shifted by what a closing shows them to be behind the voltages, a note of it, and what was seen;
    `by_whole_rows`: to the nearest row, of which no noise is changed and a fit takes the rest."""
    seen = currents_behind(one, rated_voltage_peak_v)
    if seen is None or not seen.is_told:
        return one, seen
    rows = seen.late_s / one.sample_period_s
    rows = round(rows) if by_whole_rows else rows
    if rows == 0.0:
        return one, seen
    gaps = np.flatnonzero(~(np.diff(one.time_s) < 1.5 * one.sample_period_s)) + 1
    u, v, w = (np.concatenate([shifted(p, rows) for p in np.split(x, gaps)]) for x in one.currents_a)
    ends = [~np.isfinite(x) & np.isfinite(before) for x, before in zip((u, v, w), one.currents_a, strict=True)]
    what = f"{seen.words}: shifted back{' by whole rows' if by_whole_rows else ''}"
    mended = replace(one, currents_a=(u, v, w), notes=(*one.notes, ReadingNote(LATE, what)))
    return _without_ends(mended, np.any(ends, axis=0)), seen


def without_clipped(one: RunningRecording) -> tuple[RunningRecording, list[str]]:
    """The recording without the samples that sit at the end of a channel's range (NaN), and what is said of each."""
    groups, said = [list(one.currents_a), list(one.voltages_v)], []
    named = (("current", "A", PHASES), ("voltage", "V", names_of_voltages(one)))
    for group, (kind, unit, names) in zip(groups, named, strict=True):
        for k, name in enumerate(names):
            rows, _ = clipped(group[k])
            if rows.any() and runs_into(group[k], rows):
                end = float(np.max(np.abs(group[k][rows])))
                first = one.time_s[int(np.argmax(rows))]
                what = f"{kind} {name} is clipped: {int(rows.sum())} samples, the first at {first:.3g} s, sit at the end of its range, {end:.4g} {unit}"
                said.append(f"{one.source}: {what}: not used.")
                group[k] = np.where(rows, np.nan, group[k])
    (u, v, w), (a, b, c) = groups
    return (replace(one, currents_a=(u, v, w), voltages_v=(a, b, c)) if said else one), said


def no_lines(one: RunningRecording, rated_current_peak_a: float, rated_voltage_peak_v: float) -> OpenSum | None:
    """Three currents, or voltages, that cannot be those of one motor's lines: a doubled export, a wrong range, a dead sensor's noise."""
    return open_sum(one.currents_a, "current", PHASES, rated_current_peak_a) or open_sum(
        one.voltages_v,
        "voltage",
        names_of_voltages(one),
        rated_voltage_peak_v,
        may_move=not one.voltages_are_line_to_line,
    )


def names_of_voltages(one: RunningRecording) -> tuple[str, str, str]:
    return LINES if one.voltages_are_line_to_line else PHASES


def _require_once(one: RunningRecording) -> None:
    """DataRefused where a block of rows stands twice in the recording."""
    there = np.isfinite([*one.currents_a, *one.voltages_v])
    currents = np.nan_to_num(one.currents_a)
    flows = np.any(currents, axis=0) & there[there.any(axis=1)].all(axis=0)
    twice = written_twice([*currents, *np.nan_to_num(one.voltages_v)], flows)
    if twice is not None:
        first, end, of = twice
        raise DataRefused(
            f"{one.source}: rows {first + 1} to {end} repeat rows {of + 1} to {of + end - first}: they were written twice, and the time behind them is off",
            step="read running recording", value=f"{end - first} rows, from {one.time_s[first]:.4g} s on", limit="each measured row once",
            remedy="export again; or cut the recording there",
        )  # fmt: skip


def _without_held(one: RunningRecording) -> RunningRecording:
    """The recording without rows in which every channel stands still (NaN): the time ran on, the samples did not."""
    rows = held([*one.currents_a, *one.voltages_v], one.voltages_v, one.sample_period_s)
    if not rows.any():
        return one
    what = f"{int(rows.sum())} rows from {one.time_s[int(np.argmax(rows))]:.4g} s on repeat the one before them in every channel while the motor is fed: not measured, left out"
    (u, v, w), (a, b, c) = ([np.where(rows, np.nan, x) for x in group] for group in (one.currents_a, one.voltages_v))
    return replace(one, currents_a=(u, v, w), voltages_v=(a, b, c), notes=(*one.notes, ReadingNote(HELD, what)))


def _with_losses(one: RunningRecording) -> RunningRecording:
    """The recording with a gap in its time where the voltages' angle jumps and the time does not: it is no stretch without a break."""
    steps = (
        np.diff(one.time_s, prepend=one.time_s[0]) / one.sample_period_s if one.sample_period_s > 0.0 else one.time_s
    )
    found = {k: rows for k, rows in lost(one.voltages_v, one.sample_period_s).items() if 0.5 < steps[k] < 1.5}
    if not found:
        return one
    later, notes = np.zeros(one.time_s.size), list(one.notes)
    for k, rows in found.items():
        later[k:] += max(round(rows), 1) * one.sample_period_s
        what = f"the voltages turn on at once at {one.time_s[k]:.4g} s, by {max(round(rows), 1)} rows' turning: rows are lost that the time does not show (or the supply was switched over): taken as a gap"
        notes.append(ReadingNote(LOST, what))
    return replace(one, time_s=one.time_s + later, notes=tuple(notes))


def _turned(channels: Sequence[Signal], kind: str, names: Sequence[str]) -> int | None:
    """The one channel whose sign alone keeps the three from adding up to zero."""
    seen = open_sum(channels, kind, names, 0.0)
    if seen is None or seen.odd is None or not seen.is_turned:
        return None
    whole = [-x if k == seen.odd else x for k, x in enumerate(channels)]
    return seen.odd if open_sum(whole, kind, names, 0.0) is None else None


def _shifted_back(channels: Sequence[Signal], seen: Late, gaps: NDArray[np.int64], period_s: float) -> list[Signal]:
    """The channels shifted back; NaN where that would reach over a gap."""
    out = []
    for x, late_s in zip(channels, seen.late_s, strict=True):
        out.append(np.concatenate([shifted(p, late_s / period_s) for p in np.split(x, gaps)]) if late_s != 0.0 else x)
    return out


def _without_ends(one: RunningRecording, beyond: NDArray[np.bool_]) -> RunningRecording:
    """Without the first and last rows that a shift has no value for."""
    if not beyond.any():
        return one
    kept = np.flatnonzero(~beyond)
    part = slice(int(kept[0]), int(kept[-1]) + 1)
    speed = one.speed_rad_per_s
    (u, v, w), (a, b, c) = ([x[part] for x in group] for group in (one.currents_a, one.voltages_v))
    return replace(
        one, time_s=one.time_s[part], currents_a=(u, v, w), voltages_v=(a, b, c),
        speed_rad_per_s=None if speed is None else speed[part],
    )  # fmt: skip
