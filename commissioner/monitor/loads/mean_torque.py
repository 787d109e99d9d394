"""The mean torque over everything recorded, not only over the segment that was inverted."""

from __future__ import annotations

import math

import numpy as np

from commissioner.monitor.machine.fit import Fitted
from commissioner.monitor.periods.combs import Found, mean_supply
from commissioner.monitor.signals.quiet import wander
from commissioner.monitor.signals.supply import TurningFrame

SHIFT_KNOWN = 0.05
"""Relative error of the difference between the segment's torque and that of everything: of the stator resistance in it."""
LEVEL_S = 1.0
"""Least time over which the load has a level; whole periods of the slowest load that was found."""


def whole_record_torque(
    frame: TurningFrame, part: slice, found: Found, fitted: Fitted, pole_pairs: int, segment: tuple[float, float]
) -> tuple[float, float]:
    """(mean, standard deviation) of everything: the segment's, moved by the air-gap power's difference. What the load drifts or
    swings by, more slowly than any period that was found, is in the deviation: no mean tells it."""
    loss_w = 1.5 * fitted.circuit.stator_resistance_ohm * np.abs(frame.current_a) ** 2
    air_gap_w = 1.5 * np.real(frame.voltage_v * np.conj(frame.current_a)) - loss_w
    synchronous = mean_supply(frame, slice(0, frame.time_s.size)) / pole_pairs
    shift = float(air_gap_w.mean() - air_gap_w[part].mean()) / synchronous
    slowest_hz = min(f.frequency_hz for f in (found.shaft, *found.loads) if f is not None)
    level_s = max(math.ceil(LEVEL_S * slowest_hz), 1) / slowest_hz
    moves = wander(air_gap_w, max(round(level_s / frame.sample_period_s), 1)) / synchronous
    return segment[0] + shift, math.hypot(segment[1], SHIFT_KNOWN * shift, moves)
