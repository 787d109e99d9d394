"""Can these currents be a motor's at rest, excited along the named axis? Direction, power, converter's range, sum."""

from __future__ import annotations

import math

import numpy as np

from commissioner.identify.intake.stretches import Stretch, refused
from commissioner.motor.channels.ends import piled_up
from commissioner.motor.channels.sums import LARGEST_SUM_AT_REST, left_in_step
from commissioner.records import Signal, StandstillRecording

LARGEST_CROSS_CURRENT, NOTED_CROSS_CURRENT = 0.12, 0.04
"""Of the current, what may flow across the axis in step with it, and from where on the result says so: 7 and 2 degrees.
Sensors a few per cent apart and an anisotropic machine make 0.03."""
NO_MORE_THAN_NOISE, LEAST_ROWS = 1.5, 500
"""The rms of a current over its noise (from second differences), up to which it may be noise alone, and rows from which that is asked."""
LINE, STANDS_OUT = 0.2, 10.0
"""Of the largest line of the voltage: what is a line; and the mean power of the current there over that of all frequencies, from where on it is
driven. Noise alone makes 2 with the one or two bins of one tone at the most."""
LARGEST_ROTATION = 0.7
LEAST_POWER_FACTOR = 0.01
SLOW_ROWS = 64
"""Over which the power is averaged, many against the few that currents may lie early or late by (`alignment`)."""
LEAST_SLOW_SHARE = 0.1
"""Of the current, from where on its slow part tells which way power flows."""


def require_current(stretch: Stretch) -> None:
    rms = float(np.std(stretch.current_a)) + abs(float(np.mean(stretch.current_a)))
    if rms > 0.0 and not _is_noise_alone(stretch):
        return
    raise refused(
        f"segment {stretch.segment} carries no current",
        f"{rms:.3g} A" + (", no more than the sensors' noise" if rms > 0.0 else ""),
        "a current along the axis",
        "check the current channels, that the drive was enabled, motor cable, terminals and contactor",
    )


def _is_noise_alone(stretch: Stretch) -> bool:
    """Of tones: the current is no larger than what changes from row to row, and has no line where the voltage has its own. A motor taken off
    between two tests was told as of currents beside the axis, or ahead of the voltage."""
    current_a, voltage_v = (x - np.mean(x) for x in (stretch.current_a, stretch.voltage_v))
    if stretch.kind == "staircase" or current_a.size < LEAST_ROWS or not np.any(voltage_v):
        return False
    if float(np.var(current_a)) > NO_MORE_THAN_NOISE**2 * float(np.var(np.diff(current_a, 2))) / 6.0:
        return False
    window = np.hanning(current_a.size)
    driven = np.abs(np.fft.rfft(window * voltage_v))
    lines = driven > LINE * np.max(driven)
    power = np.abs(np.fft.rfft(window * current_a)) ** 2
    return float(np.mean(power[lines])) < STANDS_OUT * float(np.mean(power))


def require_on_axis(stretch: Stretch) -> None:
    """Current must flow where the voltage points: compare what follows the voltage along and across the axis."""
    along = float(np.sqrt(np.mean(stretch.current_a**2)))
    across = float(np.sqrt(np.mean((stretch.cross_a - np.mean(stretch.cross_a)) ** 2)))
    matched = abs(float(np.mean(stretch.cross_a * stretch.current_a))) / max(along, 1e-12)
    if stretch.kind != "staircase" and across > LARGEST_ROTATION * along and matched < LARGEST_CROSS_CURRENT * along:
        raise refused(
            f"segment {stretch.segment}: the current rotates",
            f"{across:.3g} A rms across the axis, {along:.3g} A along it, unrelated",
            f"at most {LARGEST_ROTATION:.0%} of the current across the axis",
            "record with the motor at rest and one axis excited; a running motor is for `commissioner monitor`",
        )
    if (stretch.kind != "staircase" and matched > LARGEST_CROSS_CURRENT * along) or across > 2.0 * along:
        raise refused(
            f"segment {stretch.segment}: the current does not flow along the named axis",
            f"axis_deg {stretch.axis_deg:g}, current along {direction_deg(stretch):.1f} deg (modulo 180)",
            f"at most {LARGEST_CROSS_CURRENT:.0%} of the current across the axis",
            "correct axis_deg, or the order of the phases",
        )


def direction_deg(stretch: Stretch) -> float:
    """Where the current flows, modulo 180 degrees."""
    moment = np.mean((stretch.current_a + 1j * stretch.cross_a) ** 2)
    return (stretch.axis_deg + math.degrees(0.5 * float(np.angle(moment)))) % 180.0


def besides_the_axis(stretch: Stretch) -> str | None:
    """What to say of a current that flows a little beside the named axis; None where it does not."""
    deviation = (direction_deg(stretch) - stretch.axis_deg + 90.0) % 180.0 - 90.0
    if stretch.kind == "staircase" or abs(math.tan(math.radians(deviation))) < NOTED_CROSS_CURRENT:
        return None
    share = 1.0 - math.cos(math.radians(deviation))
    return (
        f"segment {stretch.segment}: the current flows {deviation:+.1f} deg beside axis_deg {stretch.axis_deg:g}; if that "
        f"is the axis' error, all values are {share:.1%} too large"
    )


def require_power(stretch: Stretch) -> None:
    """A machine at standstill only takes power in: told by what is slow, since a large motor's resistance turns a fast tone less
    than currents do that lie a few rows off."""
    voltage, current = _slow(stretch.voltage_v), _slow(stretch.current_a)
    if np.mean(current**2) < LEAST_SLOW_SHARE**2 * np.mean(stretch.current_a**2):
        voltage, current = stretch.voltage_v, stretch.current_a
    rms = float(np.sqrt(np.mean(voltage**2) * np.mean(current**2)))
    power = float(np.mean(voltage * current))
    if power < LEAST_POWER_FACTOR * rms:
        raise refused(
            f"segment {stretch.segment}: the current does not follow the voltage",
            f"power factor {power / rms:.2f}",
            f"above {LEAST_POWER_FACTOR}",
            "check the sign of the current sensors, the order of the phases, axis_deg and the alignment in time",
        )


def _slow(values: Signal) -> Signal:
    count = values.size // SLOW_ROWS
    return values[: count * SLOW_ROWS].reshape(count, SLOW_ROWS).mean(axis=1) if count else values


def require_unclipped(recording: StandstillRecording) -> None:
    moving = np.zeros(recording.time_s.size, dtype=bool)
    moving[1:] = np.abs(np.diff(recording.voltage_axis_v)) > 0.0
    for name in ("current_u_a", "current_v_a", "current_w_a"):
        values = getattr(recording, name)
        if values is None:
            continue
        for sign in (1.0, -1.0):
            piled = piled_up(sign * values[moving])
            if piled is not None:
                raise refused(
                    f"{name} is clipped",
                    f"{piled} samples at {sign * float(np.max(sign * values)):.4g} A",
                    "samples inside the sensor's range",
                    "lower the amplitude or widen the sensor's range, and record again",
                )


def require_balanced(recording: StandstillRecording) -> None:
    """A star point carries no current: where the three phases do not cancel, one channel is limited or wrongly scaled."""
    if recording.current_w_a is None:
        return
    share, phase = left_in_step((recording.current_u_a, recording.current_v_a, recording.current_w_a))
    if share > LARGEST_SUM_AT_REST:
        raise refused(
            "the phase currents do not add up to zero",
            f"{share:.0%} of the current is left, in step with phase {'uvw'[phase]}",
            f"at most {LARGEST_SUM_AT_REST:.0%}",
            "look for a clipped or wrongly scaled current channel; two sound phases are enough, leave the third out",
        )
