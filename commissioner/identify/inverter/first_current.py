"""What a first small direct current tells of whatever is connected: its stator inductance, before anything large flows.

Between two settled levels the stator flux moves by L_s times the step of the current, and by the integral of what of the
voltage the static curve does not take: L_s (i_2 - i_1) = integral(u - u_static(i)) dt. The static curve, resistance and
inverter together, is taken as the straight line between the two levels. It bends upwards of that, behind dead time by much;
on the way down that makes L_s too small and on the way up too large by the same, so that the mean of both stands.

Levels are held briefly: where the currents are heading (`settling`) counts, not where they ended, and what of the integral is
still to come is added. Without both, a motor of three times the plate's impedance seemed of 1.4 times.
"""

from __future__ import annotations

import math
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
    stator_inductance_std_h: float
    slope_ohm: float
    voltage_v: tuple[float, float]
    current_a: tuple[float, float]


@dataclass(frozen=True)
class HeldLevel:
    """A DC level from the moment it was asked for: its voltage; voltage and current at the samples, `(n,)` each."""

    voltage_v: float
    samples_v: Signal
    samples_a: Signal


AS_ASKED = (0.8, 1.25)
"""Of the voltage asked for, what the samples of a level held may show: a scale wrong by ten made another motor of the right one."""
END = 0.1
"""The last part of a level, of which the mean is where the current ended."""


def first_current(levels: Sequence[HeldLevel], settled: Settled, sample_period_s: float) -> FirstCurrent:
    """From the same larger, smaller and larger level, and where their currents are heading.

    DataRefused where the current did not follow the voltage, or the samples' voltage is not the one asked for.
    """
    larger, smaller, _ = levels
    _require_asked_voltage(larger)
    first_a, smaller_a, last_a = (float(a) for a in settled.current_a)
    larger_a = 0.5 * (first_a + last_a)
    change_a, change_v = larger_a - smaller_a, larger.voltage_v - smaller.voltage_v
    if not (change_v > 0.0 and change_a > 0.0 and smaller_a > 0.0):
        raise DataRefused(
            "the current does not follow the voltage", step="first current", value=f"{smaller_a:.3g} A at {smaller.voltage_v:.3g} V, {larger_a:.3g} A at {larger.voltage_v:.3g} V",
            limit="a current that falls with the voltage",
            remedy="check the current sensors' sign and order, the motor cable and the contactor",
        )  # fmt: skip
    slope_ohm = change_v / change_a
    time_s = settled.time_constant_s, sample_period_s
    down_wb, fall_a = _step(larger, smaller, (first_a, smaller_a), slope_ohm, *time_s)
    up_wb, rise_a = _step(smaller, levels[2], (smaller_a, last_a), slope_ohm, *time_s)
    doubts_as = [_doubt_as(level, a, *time_s) for level, a in zip(levels[1:], settled.std_a[1:], strict=True)]
    moved_a = max(rise_a - fall_a, 1e-9)
    inductance_h, std_h = (up_wb - down_wb) / moved_a, slope_ohm * math.hypot(*doubts_as) / moved_a
    return FirstCurrent(inductance_h, std_h, slope_ohm, (larger.voltage_v, smaller.voltage_v), (larger_a, smaller_a))


def _require_asked_voltage(level: HeldLevel) -> None:
    seen_v = float(np.mean(level.samples_v[-_tail(level) :]))
    if AS_ASKED[0] * abs(level.voltage_v) <= abs(seen_v) <= AS_ASKED[1] * abs(level.voltage_v):
        return
    raise DataRefused(
        "the samples show another voltage than the drive was asked for", step="first current", value=f"{seen_v:.4g} V",
        limit=f"{level.voltage_v:.4g} V as asked",
        remedy="compare the scales of items.dc_bias_v and items.voltage_scale_v with the firmware; see that nothing else writes to this drive",
    )  # fmt: skip


def stepped_inductance_h(larger: HeldLevel, smaller: HeldLevel, settled: Settled, sample_period_s: float) -> float:
    """The static inductance between the last two levels, above the inverter's knee, the second held after the first."""
    larger_a, smaller_a = (float(a) for a in settled.current_a[-2:])
    slope_ohm = (larger.voltage_v - smaller.voltage_v) / max(larger_a - smaller_a, 1e-9)
    down_wb, fall_a = _step(larger, smaller, (larger_a, smaller_a), slope_ohm, settled.time_constant_s, sample_period_s)
    return down_wb / min(fall_a, -1e-9)


def _step(
    before: HeldLevel,
    level: HeldLevel,
    headings_a: tuple[float, float],
    slope_ohm: float,
    time_constant_s: float,
    period_s: float,
) -> tuple[float, float]:
    """Stator flux and current gained from where `before` had come to, which need not be where it was heading, to for ever."""
    was_heading_a, heading_a = headings_a
    mean_a, since_s = float(np.mean(before.samples_a[-_tail(before) :])), 0.5 * _tail(before) * period_s
    start_a = was_heading_a + (mean_a - was_heading_a) * math.exp(-since_s / time_constant_s)
    return _moved_wb(level, heading_a, slope_ohm, time_constant_s, period_s), heading_a - start_a


def _doubt_as(level: HeldLevel, heading_std_a: float, time_constant_s: float, period_s: float) -> float:
    """Standard error of the integral of the current that `_moved_wb` takes off: of the samples' noise, of the mean at the end, and of where
    the current is heading, which counts for all of the time.
    """
    count, tail = level.samples_a.size, _tail(level)
    noise_a = float(np.std(np.diff(level.samples_a))) / math.sqrt(2.0)
    of_samples = noise_a * math.hypot(math.sqrt(count) * period_s, time_constant_s / math.sqrt(tail))
    return math.hypot(of_samples, heading_std_a * (count * period_s + time_constant_s))


def _moved_wb(level: HeldLevel, heading_a: float, slope_ohm: float, time_constant_s: float, period_s: float) -> float:
    """Stator flux gained from the level's first sample to for ever: what of the voltage the static line does not take."""
    tail = _tail(level)
    end_a, counted = float(np.mean(level.samples_a[-tail:])), slice(level.samples_a.size - tail // 2)
    taken = level.samples_v - level.voltage_v - slope_ohm * (level.samples_a - heading_a)
    # the mean at the end is the current in the tail's middle: what is to come is counted from there
    return float(np.sum(taken[counted])) * period_s - slope_ohm * (end_a - heading_a) * time_constant_s


def _tail(level: HeldLevel) -> int:
    return max(8, round(END * level.samples_a.size))
