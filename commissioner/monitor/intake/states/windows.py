"""Levels of current, voltage and supply frequency over windows of four supply periods, and the parts and plate they are taken with."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.intake.columns import complete
from commissioner.monitor.signals.supply import Vector, space_vector
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording, Signal

WINDOW_PERIODS, HOPS = 4.0, 4


@dataclass(frozen=True)
class Levels:
    time_s: Signal
    current_a: Signal
    voltage_v: Signal
    frequency_hz: Signal
    sense: Signal
    """1 or -1: which way the supply's vector turns."""
    hop_s: float
    vector_a: Vector | None = None
    """The current in the voltage's frame, peak: active and reactive; None where no voltages were recorded."""

    @property
    def load_a(self) -> Signal | Vector:
        """What moves with the load: at light load the size of the current hardly does."""
        return self.current_a if self.vector_a is None else self.vector_a


def plate_like(recording: RunningRecording) -> Nameplate:
    """A plate of the recording's own levels where it is energised: states are told by ratios."""
    completed, _ = complete(recording)
    i = np.abs(space_vector(*(np.nan_to_num(x) for x in completed.currents_a)))
    v = np.abs(space_vector(*(np.nan_to_num(x) for x in completed.voltages_v)))
    level = float(np.median(i[i > 0.2 * np.quantile(i, 0.9)])) if i.size and np.any(i) else 1.0
    volts = float(np.median(v[v > 0.2 * np.quantile(v, 0.9)])) if v.size and np.any(v) else 1.0
    line = volts * (1.0 if recording.voltages_are_line_to_line else np.sqrt(3.0)) / np.sqrt(2.0)
    return Nameplate(1.0, line, 50.0, level / np.sqrt(2.0), 1450.0, 0.8, 2, "star")


def cut(recording: RunningRecording, keep: slice | np.ndarray) -> RunningRecording:
    i, v = ([x[keep] for x in group] for group in (recording.currents_a, recording.voltages_v))
    speed = recording.speed_rad_per_s
    return replace(
        recording, time_s=recording.time_s[keep], currents_a=(i[0], i[1], i[2]), voltages_v=(v[0], v[1], v[2]),
        speed_rad_per_s=None if speed is None else speed[keep],
    )  # fmt: skip


def levels_of(recording: RunningRecording, plate: Nameplate) -> Levels | None:
    completed, _ = complete(recording)
    period = recording.sample_period_s
    if not period > 0.0:
        return None
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
    return Levels(
        time[starts + n // 2],
        np.sqrt((power_i[starts + n] - power_i[starts]) / n / 2.0),
        np.sqrt((power_v[starts + n] - power_v[starts]) / n / 2.0) * scale,
        np.abs(np.angle(turn)) / (2.0 * np.pi * period),
        np.sign(np.angle(turn)),
        hop * period,
        _in_voltage_frame(i, v, starts, n) if has_volts else None,
    )


def _in_voltage_frame(i: Vector, v: Vector, starts: np.ndarray, n: int) -> Vector:
    """Mean of i v* over each window, by the voltage's rms: of channels that are crossed the current turns the other way."""

    def means(x: np.ndarray) -> Vector:
        total = np.concatenate([[0.0], np.cumsum(x)])
        return np.asarray((total[starts + n] - total[starts]) / n)

    straight, crossed = means(i * np.conj(v)), means(np.conj(i) * np.conj(v))
    turned = straight if np.abs(straight).sum() >= np.abs(crossed).sum() else crossed
    return np.asarray(turned / np.maximum(np.sqrt(means(np.abs(v) ** 2).real), 1e-9))
