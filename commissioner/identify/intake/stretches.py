"""A recording cut into stretches without a hole, and what kind of excitation each holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.identify.intake.averaged import between_rows, measured, running_mean_v
from commissioner.motor.space_vector import axis_current_a, orthogonal_current_a
from commissioner.records import Signal, StandstillRecording, peak

OWN_LINK_SAMPLE = 0.2
"""Part of the samples at which the link must differ from the one before, or it was not read sample by sample."""
REST_S = 20.0
"""After a pause this long no rotor holds flux any more; after a shorter one the cage may still carry what the current
left behind."""


@dataclass(frozen=True)
class Stretch:
    """Consecutive samples of one segment on one axis without a hole. `kind`: staircase | multitone | biased | zero.

    `link_ratio` is the DC link's voltage over its median, where it was recorded sample by sample. `is_measured`: where rows are
    means, the control periods that hold one; currents of the others only lie between. None: all were measured.
    """

    segment: int
    axis_deg: float
    voltage_v: Signal
    current_a: Signal
    cross_a: Signal
    kind: str
    starts_at_rest: bool
    lost_before: int
    start_s: float
    link_ratio: Signal | None = None
    is_measured: NDArray[np.bool_] | None = None

    @property
    def seen_a(self) -> Signal:
        """The current, NaN where it was not measured."""
        return self.current_a if self.is_measured is None else np.where(self.is_measured, self.current_a, np.nan)

    @property
    def weight(self) -> Signal | None:
        """1 where the current was measured; None where all was."""
        return None if self.is_measured is None else self.is_measured.astype(np.float64)

    @property
    def is_excited(self) -> bool:
        return self.kind != "zero"


def refused(what: str, value: object, limit: object, remedy: str) -> DataRefused:
    """What the audit of a recording cannot let pass."""
    return DataRefused(what, step="audit the recording", value=value, limit=limit, remedy=remedy)


def cut(recording: StandstillRecording) -> list[Stretch]:
    """Stretches in their order; DataRefused where a segment changes its axis."""
    segment = np.asarray(recording.segment)
    for number in np.unique(segment):
        axes = np.unique(recording.axis_deg[segment == number])
        if axes.size > 1:
            raise refused(
                f"segment {int(number)} changes its axis",
                f"{axes[0]:g} and {axes[1]:g} deg",
                "one axis per segment",
                "number the segments so that each has one axis",
            )
    steps = np.diff(recording.time_s)
    new_segment = np.diff(segment) != 0
    in_row = np.ones(segment.size, dtype=np.int64) if recording.averaged is None else recording.averaged
    period_s = recording.sample_period_s * in_row[:-1]
    hole = steps > 1.5 * period_s
    starts = [0, *(np.flatnonzero(new_segment | hole) + 1)]
    ends = [*starts[1:], segment.size]
    out: list[Stretch] = []
    for a, b in zip(starts, ends, strict=True):
        begins = a == 0 or bool(new_segment[a - 1])
        lost = 0 if begins else round(float(steps[a - 1]) / float(period_s[a - 1])) - 1
        rested = begins and (a == 0 or float(steps[a - 1]) > REST_S)
        out.append(_stretch(recording, a, int(b), rested, lost, int(in_row[a])))
    return out


def _stretch(recording: StandstillRecording, a: int, b: int, rested: bool, lost: int, n: int) -> Stretch:
    axis = float(recording.axis_deg[a])
    w = None if recording.current_w_a is None else recording.current_w_a[a:b]
    phases = recording.current_u_a[a:b], recording.current_v_a[a:b], w
    voltage = np.ascontiguousarray(recording.voltage_axis_v[a:b])
    current = axis_current_a(*phases, axis)
    cross = orthogonal_current_a(*phases, axis)
    is_mean = n > 1 and b - a > 1
    return Stretch(
        segment=int(recording.segment[a]),
        axis_deg=axis,
        voltage_v=running_mean_v(voltage, n) if is_mean else voltage,
        current_a=between_rows(current, n) if is_mean else current,
        cross_a=between_rows(cross, n) if is_mean else cross,
        kind=_kind(voltage, recording.voltage_axis_v),
        starts_at_rest=rested and _is_still(current),
        lost_before=lost,
        start_s=float(recording.time_s[a]),
        link_ratio=_link_ratio(recording.dc_link_v, a, b) if n == 1 else None,
        is_measured=measured(b - a, n) if is_mean else None,
    )


def _link_ratio(dc_link_v: Signal | None, a: int, b: int) -> Signal | None:
    if dc_link_v is None or not np.all(np.isfinite(dc_link_v)):
        return None
    median = float(np.median(dc_link_v))
    changes = np.diff(dc_link_v[a:b]) != 0.0
    if median <= 0.0 or not changes.size or np.mean(changes) < OWN_LINK_SAMPLE:
        return None
    return np.asarray(dc_link_v[a:b] / median)


def _is_still(current: Signal) -> bool:
    """Current near zero where a segment begins: its first samples are small beside the stretch."""
    head = np.abs(current[:2])
    return bool(head.size and np.max(head) < 0.1 * max(peak(current), 1e-12))


def _kind(voltage: Signal, everything: Signal) -> str:
    top = float(np.max(np.abs(voltage), initial=0.0))
    if top <= 1e-3 * float(np.max(np.abs(everything), initial=0.0)) or top == 0.0:
        return "zero"
    changes = np.abs(np.diff(voltage)) > 1e-6 * top
    if voltage.size < 3 or np.mean(changes) < 0.5:
        return "staircase"
    spread = float(np.std(voltage))
    return "biased" if abs(float(np.mean(voltage))) > 0.5 * spread else "multitone"


def tones_in(voltage_v: Signal, period_s: float) -> tuple[float, ...]:
    """Frequencies (Hz) of the lines in a stretch's voltage that hold more than 0.1 % of its largest line's power."""
    if voltage_v.size < 16:
        return ()
    x = (voltage_v - np.mean(voltage_v)) * np.hanning(voltage_v.size)
    spectrum = np.abs(np.fft.rfft(x, 4 * voltage_v.size)) ** 2
    top = float(np.max(spectrum))
    if top <= 0.0:
        return ()
    # A Hann line is four bins of the padded spectrum wide on each side; ramps of the amplitude add skirts.
    peaks = _lines(spectrum, 1e-3 * top, 8, 5e-4 * top)
    return tuple(float(p) / (4 * voltage_v.size * period_s) for p in peaks)


def _lines(spectrum: Signal, height: float, apart: int, prominence: float) -> list[int]:
    """Bins of the peaks of this height at least, no two nearer than `apart`, that stand out of what lies between them and any higher
    value. As `scipy.signal.find_peaks`, whose package alone is a third of what starting costs."""
    inner = spectrum[1:-1]
    tops = np.flatnonzero((inner > spectrum[:-2]) & (inner > spectrum[2:]) & (inner >= height)) + 1
    chosen: list[int] = []
    for top in tops[np.argsort(-spectrum[tops], kind="stable")].tolist():
        if all(abs(top - other) >= apart for other in chosen):
            chosen.append(top)
    return [p for p in sorted(chosen) if _stands_out_by(spectrum, p) >= prominence]


def _stands_out_by(spectrum: Signal, top: int) -> float:
    """The peak over the higher of the lowest values on its sides, each up to where something higher begins."""
    higher = np.flatnonzero(spectrum > spectrum[top])
    place = int(np.searchsorted(higher, top))
    first = int(higher[place - 1]) + 1 if place else 0
    last = int(higher[place]) if place < higher.size else spectrum.size
    return float(spectrum[top] - max(np.min(spectrum[first : top + 1]), np.min(spectrum[top:last])))
