"""What a first small direct current tells of whatever is connected: its stator inductance, before anything large flows.

Between two settled levels the stator flux moves by L_s times the step of the current, and by the integral of what of the
voltage the static curve does not take: L_s (i_2 - i_1) = integral(u - u_static(i)) dt. The static curve, resistance and
inverter together, is taken as the straight line between the two levels. It bends upwards of that, behind dead time by much;
on the way down that makes L_s too small and on the way up too large by the same, so that the mean of both stands.

Levels are held briefly: where the currents are heading (`settling`) counts, not where they ended, and what of the integral is
still to come is added. Without both, a motor of three times the plate's impedance seemed of 1.4 times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.errors import DataRefused
from commissioner.identify.inverter.settling import Settled
from commissioner.records import Signal


@dataclass(frozen=True)
class FirstCurrent:
    """`slope_ohm`: of the static curve, resistance and the inverter's knee together. Levels of the larger, then the smaller."""

    stator_inductance_h: float
    slope_ohm: float
    voltage_v: tuple[float, float]
    current_a: tuple[float, float]


@dataclass(frozen=True)
class HeldLevel:
    """A DC level from the moment it was asked for: its voltage; voltage and current at the samples, `(n,)` each."""

    voltage_v: float
    samples_v: Signal
    samples_a: Signal


END = 0.1
"""The last part of a level, of which the mean is where the current ended."""


def first_current(levels: Sequence[HeldLevel], settled: Settled, sample_period_s: float) -> FirstCurrent:
    """From the same larger, smaller and larger level, and where their currents are heading.

    DataRefused where the current did not follow the voltage.
    """
    larger, smaller, _ = levels
    first_a, smaller_a, last_a = (float(a) for a in settled.current_a)
    larger_a = 0.5 * (first_a + last_a)
    change_a, change_v = larger_a - smaller_a, larger.voltage_v - smaller.voltage_v
    if not (change_v > 0.0 and change_a > 0.0 and smaller_a > 0.0):
        raise DataRefused(
            "the current does not follow the voltage", step="first current", value=f"{change_a:.3g} A for {change_v:.3g} V",
            limit="a current that falls with the voltage",
            remedy="check the current sensors' sign and order, the motor cable and the contactor",
        )  # fmt: skip
    slope_ohm = change_v / change_a
    line = zip(levels[1:], (smaller_a, last_a), strict=True)
    down, up = (
        _moved_wb(level, heading_a, slope_ohm, settled.time_constant_s, sample_period_s) for level, heading_a in line
    )
    inductance_h = 0.5 * (up - down) / change_a
    return FirstCurrent(inductance_h, slope_ohm, (larger.voltage_v, smaller.voltage_v), (larger_a, smaller_a))


def stepped_inductance_h(larger: HeldLevel, smaller: HeldLevel, settled: Settled, sample_period_s: float) -> float:
    """The static inductance between the last two levels, above the inverter's knee, the second held after the first."""
    larger_a, smaller_a = (float(a) for a in settled.current_a[-2:])
    change_a = max(larger_a - smaller_a, 1e-9)
    slope_ohm = (larger.voltage_v - smaller.voltage_v) / change_a
    return -_moved_wb(smaller, smaller_a, slope_ohm, settled.time_constant_s, sample_period_s) / change_a


def _moved_wb(level: HeldLevel, heading_a: float, slope_ohm: float, time_constant_s: float, period_s: float) -> float:
    """Stator flux gained from the level's first sample to for ever: what of the voltage the static line does not take."""
    end_a = float(np.mean(level.samples_a[-max(8, round(END * level.samples_a.size)) :]))
    seen = float(np.sum(level.samples_v - level.voltage_v - slope_ohm * (level.samples_a - heading_a))) * period_s
    return seen - slope_ohm * (end_a - heading_a) * time_constant_s
