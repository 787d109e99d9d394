"""What state the motor is in, stretch by stretch: off, start, ramp, steady, load step, coast-down; from its terminals alone.

Levels of current, voltage and supply frequency over windows of four supply periods. A recording without any of off, start,
ramp or step is one steady stretch, whatever its load does within a second.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.intake.clock import LEAST_SAMPLES
from commissioner.monitor.intake.columns import complete
from commissioner.monitor.intake.states.naming import OFF_CURRENT, named
from commissioner.monitor.intake.states.windows import WINDOW_PERIODS, Levels, cut, levels_of, plate_like
from commissioner.monitor.signals.supply import dominant_frequency_hz, phase_voltages, space_vector
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording

LEAST_OFF_S = 0.02
"""At the head of a recording that begins in a start."""
LOST_S, MOST_LOST = 0.02, 20
"""A shorter gap is left to the audit; more of them are a clock, not losses."""


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


def states(recording: RunningRecording, plate: Nameplate | None) -> tuple[Stretch, ...]:
    """The stretches in their order; one steady stretch where nothing else is seen. Without a plate levels are against the
    recording's own."""
    plate = plate or plate_like(recording)
    parts = _whole_parts(recording)
    if len(parts) < 2:
        return _of_one(recording, plate)
    out: list[Stretch] = []
    for k, part in enumerate(parts):
        if k:
            lost = (float(recording.time_s[parts[k - 1].stop - 1]), float(recording.time_s[part.start]))
            out.append(Stretch("lost", *lost, 0.0, 0.0))
        out += _of_one(cut(recording, part), plate)
    return tuple(out)


def _of_one(recording: RunningRecording, plate: Nameplate) -> tuple[Stretch, ...]:
    levels = levels_of(recording, plate)
    names = [] if levels is None or levels.time_s.size < 8 else named(levels, plate)
    if levels is None or set(names) <= {"steady"}:
        current_a, frequency_hz = _whole_levels(recording, plate)
        return (Stretch("steady", float(recording.time_s[0]), float(recording.time_s[-1]), current_a, frequency_hz),)
    return tuple(_sharpened(_joined(levels, names, recording), recording, plate))


def _whole_levels(recording: RunningRecording, plate: Nameplate) -> tuple[float, float]:
    """Of a recording of one state: rms current, and the frequency of the voltages, or of the currents where there are none; the
    plate's frequency where neither turns."""
    part, _ = complete(recording)
    volts = phase_voltages(*part.voltages_v) if part.voltages_are_line_to_line else part.voltages_v
    current, voltage = (np.nan_to_num(space_vector(*x)) for x in (part.currents_a, volts))
    if current.size < LEAST_SAMPLES or not np.any(current):
        return 0.0, plate.rated_frequency_hz
    current, voltage = current - current.mean(), voltage - voltage.mean()
    turning = voltage if np.any(voltage) else current
    frequency_hz = abs(dominant_frequency_hz(turning, recording.sample_period_s))
    return float(np.sqrt(np.mean(np.abs(current) ** 2) / 2.0)), frequency_hz


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


def _joined(levels: Levels, names: list[str], recording: RunningRecording) -> list[Stretch]:
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
    return cut(recording, keep)
