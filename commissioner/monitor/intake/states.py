"""What state the motor is in, stretch by stretch: off, start, ramp, steady, load step, coast-down; from its terminals alone.

Levels of current, voltage and supply frequency over windows of four supply periods. A recording without any of off, start,
ramp or step is one steady stretch, whatever its load does within a second.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.intake.columns import complete
from commissioner.monitor.signals.supply import space_vector
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording, Signal

WINDOW_PERIODS, HOPS = 4.0, 4
OFF_CURRENT = 0.05
"""Of the rated current: an energised motor idles on 0.12 at least."""
RESIDUAL_VOLTAGE = 0.03
"""Of the rated voltage, from which on a motor without current still has flux: it coasts."""
FAST_CHANGE = 0.12
"""Of the supply frequency, within half a second, that makes a ramp."""
STEP = 0.15
"""Of the current's level, between two stretches that are each constant within a third of it."""
SETTLED = 0.08
"""Of the level that follows, within which a start's current has come down."""
START_CURRENT = 2.0
"""Of the rated current, from which on a recording that begins with it begins in a start."""
LEAST_OFF_S = 0.02
"""At the head of a recording that begins in a start."""
LOST_S, MOST_LOST = 0.02, 20
"""A shorter gap is left to the audit; more of them are a clock, not losses."""
STANDING = 0.02
"""Of the rated frequency: a slower vector is direct current."""
LEAST_STEADY_S = 0.4


@dataclass(frozen=True)
class Stretch:
    """`state`: off | start | ramp | load step | steady | coast-down; from `start_s` to `end_s` of the recording's
    time, with the mean current (rms) and supply frequency."""

    state: str
    start_s: float
    end_s: float
    current_a: float
    frequency_hz: float

    @property
    def duration_s(self) -> float:
        return self.end_s - self.start_s


@dataclass(frozen=True)
class _Levels:
    time_s: Signal
    current_a: Signal
    voltage_v: Signal
    frequency_hz: Signal
    hop_s: float


def states(recording: RunningRecording, plate: Nameplate | None) -> tuple[Stretch, ...]:
    """The stretches in their order; one steady stretch where nothing else is seen. Without a plate levels are against the
    recording's own."""
    plate = plate or _plate_like(recording)
    parts = _whole_parts(recording)
    if len(parts) < 2:
        return _of_one(recording, plate)
    out: list[Stretch] = []
    for k, part in enumerate(parts):
        if k:
            lost = (float(recording.time_s[parts[k - 1].stop - 1]), float(recording.time_s[part.start]))
            out.append(Stretch("lost", *lost, 0.0, 0.0))
        out += _of_one(_cut(recording, part), plate)
    return tuple(out)


def _of_one(recording: RunningRecording, plate: Nameplate) -> tuple[Stretch, ...]:
    levels = _levels(recording, plate)
    whole = (Stretch("steady", float(recording.time_s[0]), float(recording.time_s[-1]), 0.0, plate.rated_frequency_hz),)
    if levels is None or levels.time_s.size < 8:
        return whole
    names = _named(levels, plate)
    if set(names) <= {"steady"}:
        return whole
    return tuple(_sharpened(_joined(levels, names, recording), recording, plate))


def _whole_parts(recording: RunningRecording) -> list[slice]:
    """Index ranges between losses: a gap in time, or rows without a number, of `LOST_S` and more."""
    t = recording.time_s
    seen = [x for x in (*recording.currents_a, *recording.voltages_v) if np.isfinite(x).any()]
    good = np.flatnonzero(np.all([np.isfinite(x) for x in (*seen, t)], axis=0))
    if good.size < 2 or not np.all(np.diff(t[good]) > 0.0):
        return [slice(0, t.size)]
    cuts = np.flatnonzero(np.diff(t[good]) > LOST_S)
    if cuts.size == 0 or cuts.size > MOST_LOST:
        return [slice(0, t.size)]
    edges = [0, *(int(c) + 1 for c in cuts), good.size]
    return [slice(int(good[a]), int(good[b - 1]) + 1) for a, b in itertools.pairwise(edges)]


def _plate_like(recording: RunningRecording) -> Nameplate:
    """A plate of the recording's own levels where it is energised: states are told by ratios."""
    completed, _ = complete(recording)
    i = np.abs(space_vector(*(np.nan_to_num(x) for x in completed.currents_a)))
    v = np.abs(space_vector(*(np.nan_to_num(x) for x in completed.voltages_v)))
    level = float(np.median(i[i > 0.2 * np.quantile(i, 0.9)])) if i.size and np.any(i) else 1.0
    volts = float(np.median(v[v > 0.2 * np.quantile(v, 0.9)])) if v.size and np.any(v) else 1.0
    line = volts * (1.0 if recording.voltages_are_line_to_line else np.sqrt(3.0)) / np.sqrt(2.0)
    return Nameplate(1.0, line, 50.0, level / np.sqrt(2.0), 1450.0, 0.8, 2, "star")


def _cut(recording: RunningRecording, keep: slice | np.ndarray) -> RunningRecording:
    i, v = ([x[keep] for x in group] for group in (recording.currents_a, recording.voltages_v))
    speed = recording.speed_rad_per_s
    return replace(
        recording, time_s=recording.time_s[keep], currents_a=(i[0], i[1], i[2]), voltages_v=(v[0], v[1], v[2]),
        speed_rad_per_s=None if speed is None else speed[keep],
    )  # fmt: skip


def _levels(recording: RunningRecording, plate: Nameplate) -> _Levels | None:
    completed, _ = complete(recording)
    period = recording.sample_period_s
    n = round(WINDOW_PERIODS / plate.rated_frequency_hz / period)
    hop = max(n // HOPS, 1)
    time = recording.time_s
    if n < 16 or time.size < 3 * n or not np.all(np.diff(time) > 0):
        return None
    i = space_vector(*(np.nan_to_num(x) for x in completed.currents_a))
    v = space_vector(*(np.nan_to_num(x) for x in completed.voltages_v))
    starts = np.arange(0, time.size - n + 1, hop)
    power_i, power_v = (np.concatenate([[0.0], np.cumsum(np.abs(x) ** 2)]) for x in (i, v))
    has_volts = bool(np.any(v))
    turner = v if has_volts else i
    turning = np.concatenate([[0.0], np.cumsum(turner[1:] * np.conj(turner[:-1]))])
    turn = turning[starts + n - 1] - turning[starts]
    scale = 1.0 / np.sqrt(3.0) if recording.voltages_are_line_to_line else 1.0
    return _Levels(
        time[starts + n // 2],
        np.sqrt((power_i[starts + n] - power_i[starts]) / n / 2.0),
        np.sqrt((power_v[starts + n] - power_v[starts]) / n / 2.0) * scale,
        np.abs(np.angle(turn)) / (2.0 * np.pi * period),
        hop * period,
    )


def _named(levels: _Levels, plate: Nameplate) -> list[str]:
    current, count = levels.current_a, levels.time_s.size
    idle = current < OFF_CURRENT * plate.rated_current_a
    names = ["steady"] * count
    if idle.all():
        return names
    has_run = False
    for k in range(count):
        if idle[k]:
            has_voltage = levels.voltage_v[k] > RESIDUAL_VOLTAGE * plate.rated_voltage_v / np.sqrt(3.0)
            names[k] = "coast-down" if has_run else ("residual" if has_voltage else "off")
        else:
            has_run = True
    standing = ~idle & (levels.frequency_hz < STANDING * plate.rated_frequency_hz)
    for k in np.flatnonzero(standing).tolist():
        names[k] = "standstill"
    if standing.all():
        return names
    _name_ramps(levels, idle | standing, names)
    for begin, end in _runs([n != "steady" for n in names]):
        _name_within(levels, begin, end, names, plate.rated_current_a)
    return names


def _name_ramps(levels: _Levels, idle: np.ndarray, names: list[str]) -> None:
    half = max(round(0.25 / levels.hop_s), 1)
    for k in range(len(names)):
        a, b = max(k - half, 0), min(k + half, len(names) - 1)
        if idle[a : b + 1].any():
            continue
        change = abs(levels.frequency_hz[b] - levels.frequency_hz[a]) / max(levels.frequency_hz[a : b + 1].max(), 1e-9)
        if change > FAST_CHANGE * (b - a) / (2 * half):
            names[k] = "ramp"
    # what lies between off and a ramp, shorter than a ramp is seen over, belongs to it
    ramps = [k for k, n in enumerate(names) if n == "ramp"]
    if ramps and (k := ramps[0]) <= 2 * half + int(np.argmin(idle)):
        for j in range(int(np.argmin(idle)), k):
            names[j] = "ramp"


def _runs(cut: list[bool]) -> list[tuple[int, int]]:
    """(begin, end) of the stretches that are not cut."""
    edges = np.flatnonzero(np.diff(np.r_[1, np.array(cut, dtype=int), 1]))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _name_within(levels: _Levels, begin: int, end: int, names: list[str], rated_a: float) -> None:
    """The start at the head of an energised stretch, and steps of the level inside it."""
    current = levels.current_a[begin:end]
    later = float(np.median(current[current.size // 2 :]))
    settled = 0
    was_off = begin > 0 and names[begin - 1] in ("off", "residual", "coast-down")
    is_first = begin == 0 and float(current[:HOPS].max()) > max(START_CURRENT * rated_a, 2.0 * later)
    if was_off or is_first:
        above = np.flatnonzero(current > (1.0 + STEP) * later)
        if above.size and above[0] <= 2 * HOPS and current.max() > 1.5 * later:
            settled = int(_first_still(current, int(np.argmax(current))))
        else:
            settled = HOPS
        for k in range(begin, min(begin + settled, end)):
            names[k] = "start"
    if end < len(names):
        # windows that reach over the switch-off: half of them lie before it
        for k in range(max(end - HOPS // 2, begin + settled), end):
            names[k] = names[end]
        end = max(end - HOPS, begin + settled)
    if begin > 0:
        for k in range(begin, min(begin + HOPS // 2, end)):
            names[k] = names[begin - 1]
    _name_steps(levels, begin + settled, end, names)


def _first_still(current: Signal, peak: int) -> int:
    """From where behind the peak the level stays within a few per cent of what follows."""
    for k in range(peak, current.size - HOPS):
        ahead = current[k : k + 3 * HOPS]
        if np.ptp(ahead) < SETTLED * np.median(ahead):
            return k
    return current.size


def _name_steps(levels: _Levels, begin: int, end: int, names: list[str]) -> None:
    least = round(LEAST_STEADY_S / levels.hop_s)
    if end - begin < 2 * least:
        return
    current = levels.current_a[begin:end]
    at = range(least, current.size - least)
    apart = [abs(np.median(current[k + HOPS // 2 :]) - np.median(current[: k - HOPS // 2])) for k in at]
    rest = [float(np.std(current[: k - HOPS // 2]) + np.std(current[k + HOPS // 2 :])) for k in at]
    k = int(np.argmin(rest))
    if apart[k] < STEP * float(np.median(current)) or rest[k] > apart[k] / 3.0:
        return
    middle = begin + at[k]
    for j in range(middle - HOPS // 2, middle + HOPS // 2):
        names[j] = "load step"
    _name_steps(levels, begin, middle - HOPS // 2, names)
    _name_steps(levels, middle + HOPS // 2, end, names)


def _joined(levels: _Levels, names: list[str], recording: RunningRecording) -> list[Stretch]:
    cuts = [0, *(k for k in range(1, len(names)) if names[k] != names[k - 1]), len(names)]
    out = []
    for a, b in itertools.pairwise(cuts):
        begin = float(recording.time_s[0]) if a == 0 else float(0.5 * (levels.time_s[a - 1] + levels.time_s[a]))
        end = float(recording.time_s[-1]) if b == len(names) else float(0.5 * (levels.time_s[b - 1] + levels.time_s[b]))
        out.append(
            Stretch(
                names[a], begin, end, float(np.mean(levels.current_a[a:b])), float(np.median(levels.frequency_hz[a:b]))
            )
        )
    return out


def _sharpened(stretches: list[Stretch], recording: RunningRecording, plate: Nameplate) -> list[Stretch]:
    """Switching on and off at the sample where the current comes or goes; windows see it to half their length."""
    completed, _ = complete(recording)
    flows = np.abs(space_vector(*(np.nan_to_num(x) for x in completed.currents_a)))
    flows = flows > OFF_CURRENT * np.sqrt(2.0) * plate.rated_current_a
    t, reach = recording.time_s, WINDOW_PERIODS / plate.rated_frequency_hz
    out = list(stretches)
    for k, s in enumerate(out):
        before = out[k - 1] if k else None
        if s.state in ("start", "ramp", "steady") and (before is None or before.state in ("off", "residual")):
            near = np.flatnonzero(flows & (t >= s.start_s - reach) & (t <= s.start_s + reach))
            if near.size and before is not None and before.start_s < t[near[0]] < s.end_s:
                out[k - 1], out[k] = replace(before, end_s=float(t[near[0]])), replace(s, start_s=float(t[near[0]]))
            elif near.size and before is None and t[near[0]] - s.start_s > LEAST_OFF_S:
                at = float(t[near[0]])
                return [Stretch("off", s.start_s, at, 0.0, 0.0), replace(s, start_s=at), *out[1:]]
        elif s.state == "coast-down" and before is not None:
            near = np.flatnonzero(flows & (t >= s.start_s - reach) & (t <= s.start_s + reach))
            if near.size and before.start_s < t[near[-1]] < s.end_s:
                out[k - 1], out[k] = replace(before, end_s=float(t[near[-1]])), replace(s, start_s=float(t[near[-1]]))
    return [replace(s, current_a=0.0, frequency_hz=0.0) if s.state == "off" else s for s in out]


def cut_out(recording: RunningRecording, stretch: Stretch, margin_s: float) -> RunningRecording:
    """The samples of one stretch, without `margin_s` at either end."""
    t = recording.time_s
    keep = (t >= stretch.start_s + margin_s) & (t <= stretch.end_s - margin_s)
    return _cut(recording, keep)
