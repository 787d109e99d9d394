"""The mean shaft speed over everything recorded, not only over the segment that was inverted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.monitor.machine.fit import Fitted
from commissioner.monitor.machine.slow_slip import slip_phase
from commissioner.monitor.periods.combs import Found, mean_supply, told_apart
from commissioner.monitor.periods.periods import Periodicity
from commissioner.monitor.signals import tracking
from commissioner.monitor.signals.averaging import Lines
from commissioner.monitor.signals.supply import TurningFrame
from commissioner.records import Signal

WANDER_KNOWN = 0.1
"""Relative error of the slip's wander as the fitted circuit computes it: right in the segment, it carries saturation and warmth
to other loads."""
SHIFT_KNOWN = 0.05
"""Relative error of the difference between the segment's speed and that of everything, followed: a load that steps has corners."""
UNSEEN = 0.01
"""Share of a recording cut at its end: the mean frequency of the rest differs by that share of its wander."""


def whole_record_speed(
    frame: TurningFrame, part: slice, found: Found, lines: Lines, ripple_rad: float, fitted: Fitted
) -> tuple[float, float]:
    """Mean shaft speed over the whole stretch: the comb followed beyond the segment, (rad/s, standard error).

    `ripple_rad`: rms of the shaft angle within the periods; where the stretch ends within one, that much turning more or less
    is in its mean. The slip outside the segment is first computed with the circuit that was `fitted` to the segment: a load
    that steps turns the shaft by whole turns against a constant slip, and what is followed then is only the rest.
    """
    shaft = found.shaft
    assert shaft is not None
    everything = slice(0, frame.time_s.size)
    time, length = frame.time_s, float(np.ptp(frame.time_s))
    ratio = 2 * np.pi * shaft.frequency_hz / mean_supply(frame, part)
    std = 2 * np.pi * shaft.frequency_std_hz
    std = float(np.hypot(std, UNSEEN * ratio * np.ptp(frame.supply_rad_per_s)))
    std = float(np.hypot(std, np.sqrt(2.0) * ripple_rad / length))
    if part.start == 0 and part.stop >= time.size:
        return ratio * mean_supply(frame, everything), std
    late = np.exp(1j * lines.supply_rad_per_s * fitted.delay_s)
    in_time = replace(frame, current_a=frame.current_a * late)
    turned = _beyond(frame, part, slip_phase(in_time, fitted.circuit))
    phase = ratio * (frame.supply_angle_rad + turned)
    speed = float(phase[-1] - phase[0]) / length
    std = float(np.hypot(std, np.sqrt(2.0) * WANDER_KNOWN * ratio * float(np.std(_detrended(time, turned))) / length))
    blocks = int(np.clip(length / 0.8, 16, 256))
    orders = sorted(shaft.harmonics_seen or (1,), key=lambda h: -_power(lines, h))[:3]
    pace = speed / (2 * np.pi * shaft.frequency_hz)
    straight = replace(frame, slip_phase_rad=turned)
    rest, own = told_apart(straight, everything, [_over_all(one, pace) for one in (shaft, *found.loads)])
    demodulated = tracking.demodulate(rest + own[0], time, phase, orders, blocks)
    drift = tracking.track(demodulated, int(np.clip(length / 4, 2, 16)))
    std = float(np.hypot(std, SHIFT_KNOWN * (speed - ratio * mean_supply(frame, everything))))
    return speed + drift.mean_rad_per_s, float(np.hypot(std, drift.mean_error_rad_per_s))


def _beyond(frame: TurningFrame, part: slice, slip_rad: Signal) -> Signal:
    """The slip's phase with its mean slope in the segment taken out: that is in the shaft's own frequency."""
    ends = [part.start, min(part.stop, frame.time_s.size) - 1]
    slope = np.diff(slip_rad[ends])[0] / np.diff(frame.time_s[ends])[0]
    return np.asarray(slip_rad - slope * frame.time_s, dtype=np.float64)


def _detrended(time_s: Signal, phase_rad: Signal) -> Signal:
    """Without the straight line: a load that steps leaves turns of the shaft in it."""
    centred = time_s - time_s.mean()
    return np.asarray(phase_rad - phase_rad.mean() - centred * (centred @ phase_rad) / (centred @ centred))


def _over_all(one: Periodicity, pace: float) -> Periodicity:
    """With its mean frequency over everything, where the shaft ran `pace` times as fast as in the segment."""
    return replace(one, frequency_hz=one.frequency_hz * pace) if one.follows == "mains" else one


def _power(lines: Lines, order: int) -> float:
    return float(np.sum(np.abs(lines.current_a[(lines.comb == 0) & (np.abs(lines.order) == order)]) ** 2)) * order**2
