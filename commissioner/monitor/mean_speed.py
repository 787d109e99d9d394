"""The mean shaft speed over everything recorded, not only over the segment that was inverted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.monitor import tracking
from commissioner.monitor.averaging import Lines
from commissioner.monitor.combs import Found, mean_supply, told_apart
from commissioner.monitor.periods import Periodicity
from commissioner.monitor.supply import TurningFrame
from commissioner.records import Signal

DRIFT_KNOWN = 0.1
"""Relative error of the drift found beyond a fixed ratio to the mains: coefficients below three deviations were dropped."""
WANDER_KNOWN = 0.25
"""Relative error of the slip's wander as the start circuit computes it: that of its rotor resistance."""
UNSEEN = 0.01
"""Share of a recording cut at its end: the mean frequency of the rest differs by that share of its wander."""


def whole_record_speed(
    frame: TurningFrame, part: slice, found: Found, lines: Lines, ripple_rad: float
) -> tuple[float, float]:
    """Mean shaft speed over the whole stretch: the comb followed beyond the segment, (rad/s, standard error).

    `ripple_rad`: rms of the shaft angle within the periods; where the stretch ends within one, that much turning more or less
    is in its mean.
    Where the comb is lost outside the segment the segment's ratio to the mains stands, with the slip's spread as error.
    """
    shaft = found.shaft
    assert shaft is not None
    everything = slice(0, frame.time_s.size)
    supply = mean_supply(frame, everything)
    ratio = 2 * np.pi * shaft.frequency_hz / mean_supply(frame, part)
    speed, std = ratio * supply, 2 * np.pi * shaft.frequency_std_hz
    std = float(np.hypot(std, UNSEEN * ratio * np.ptp(frame.supply_rad_per_s)))
    std = float(np.hypot(std, np.sqrt(2.0) * ripple_rad / np.ptp(frame.time_s)))
    wandered = ratio * float(np.std(_detrended(frame.time_s, frame.slip_phase_rad)))
    std = float(np.hypot(std, np.sqrt(2.0) * WANDER_KNOWN * wandered / np.ptp(frame.time_s)))
    ends = frame.time_s[[part.start, min(part.stop, frame.time_s.size) - 1]]
    moved = 0.0 if shaft.drift is None else float(np.diff(shaft.drift(ends))[0] / np.diff(ends)[0])
    if part.start == 0 and part.stop >= frame.time_s.size:
        return speed + moved, float(np.hypot(std, DRIFT_KNOWN * moved))
    time = frame.time_s
    phase = ratio * (frame.supply_angle_rad + frame.slip_phase_rad) + moved * time
    blocks = int(np.clip(np.ptp(time) / 0.8, 16, 256))
    orders = sorted(shaft.harmonics_seen or (1,), key=lambda h: -_power(lines, h))[:3]
    pace = supply / mean_supply(frame, part)
    rest, own = told_apart(frame, everything, [_over_all(one, pace) for one in (shaft, *found.loads)])
    residual = rest + own[0]
    demodulated = tracking.demodulate(residual, time, phase, orders, blocks)
    drift = tracking.track(demodulated, int(np.clip(np.ptp(time) / 4, 2, 16)))
    turned = float(drift(time[-1:])[0] - drift(time[:1])[0]) / float(np.ptp(time))
    return speed + moved + turned, float(np.hypot(std, DRIFT_KNOWN * (abs(turned) + abs(moved))))


def _detrended(time_s: Signal, phase_rad: Signal) -> Signal:
    """Without the straight line: a load that steps leaves turns of the shaft in it."""
    centred = time_s - time_s.mean()
    return np.asarray(phase_rad - phase_rad.mean() - centred * (centred @ phase_rad) / (centred @ centred))


def _over_all(one: Periodicity, pace: float) -> Periodicity:
    """With its mean frequency over everything, where the mains ran `pace` times as fast as in the segment."""
    return replace(one, frequency_hz=one.frequency_hz * pace) if one.follows == "mains" else one


def _power(lines: Lines, order: int) -> float:
    return float(np.sum(np.abs(lines.current_a[(lines.comb == 0) & (np.abs(lines.order) == order)]) ** 2)) * order**2
