"""Is the stretch steady enough, and does it hold enough periods, for waveforms that repeat?"""

from __future__ import annotations

import numpy as np

from commissioner.monitor.intake.findings import Finding
from commissioner.monitor.periods import periods
from commissioner.monitor.periods.combs import Found
from commissioner.monitor.periods.periods import ShaftSearch
from commissioner.monitor.signals.supply import TurningFrame
from commissioner.records import Signal

LARGEST_FREQUENCY_WANDER = 0.004
"""Of the mean, within the stretch analysed: the grid's own drift is ten times smaller."""
LARGEST_SWING_RAD = 0.03
"""rms of the voltage's angle around its smooth course, up to `SWING_BAND_HZ`: a feeder's drop under a pulsing load makes a
tenth of it. Beyond it the supply's own frequency pulses, and what repeats in the speed is the supply's.
"""
SWING_BAND_HZ = 15.0
RAMP = 0.9
"""Of all that the frequency moves, from which on, end to end, it ramps."""
LEAST_TURNS = 30
LEAST_LOAD_PERIODS = 8


def frequency_wander(frame: TurningFrame, part: slice) -> Finding:
    """How far the supply frequency moves inside the segment, slowly (grid, ramps) or to and fro (a controlled inverter)."""
    swing = _swing(frame, part)
    if swing > LARGEST_SWING_RAD:
        return Finding(
            "frequency_wander",
            "refused",
            f"the supply's angle swings by {swing:.2g} rad rms around its course: its frequency is not steady",
            swing,
            LARGEST_SWING_RAD,
            "record at a steady set point of the inverter, without speed control or slip compensation",
        )
    frequency = frame.supply_rad_per_s[part]
    share = float(np.ptp(frequency) / frequency.mean())
    is_steady = share <= LARGEST_FREQUENCY_WANDER
    moved = f"moves by {share:.2%}" if is_steady else _course(frequency / (2 * np.pi))
    return Finding(
        "frequency_wander",
        "note" if is_steady else "refused",
        f"the supply frequency {moved} within the quietest stretch: "
        + ("steady" if is_steady else "the motor is not in a steady state"),
        share,
        LARGEST_FREQUENCY_WANDER,
        "record at a steady set point",
    )


def _course(hertz: Signal) -> str:
    first, last, span = float(hertz[0]), float(hertz[-1]), float(np.ptp(hertz))
    if abs(last - first) > RAMP * span:
        return f"ramps from {first:.4g} to {last:.4g} Hz"
    return f"wanders between {hertz.min():.4g} and {hertz.max():.4g} Hz"


def _swing(frame: TurningFrame, part: slice) -> float:
    """rms angle of the segment's voltage in its own frame, averaged over 1 / (2 `SWING_BAND_HZ`), its slow course removed."""
    step = max(1, round(0.5 / (SWING_BAND_HZ * frame.sample_period_s)))
    voltage = frame.voltage_v[part]
    blocks = voltage.size // step
    angle = np.angle(voltage[: blocks * step].reshape(blocks, step).mean(axis=1) * np.conj(voltage.mean()))
    return float(np.std(angle))


def too_little(frame: TurningFrame, part: slice, found: Found, search: ShaftSearch) -> Finding | None:
    length = float(np.ptp(frame.time_s[part]))
    if found.shaft is None and not found.loads:
        low, high = periods.range_hz(search)
        return Finding(
            "no_period",
            "refused",
            f"the currents show neither the shaft (looked for from {low:.4g} to {high:.4g} Hz) nor any periodic load",
            periods.strongest_in_range(found.spectrum, search),
            f"a line {periods.SHAFT_SIGNIFICANT:g} times as strong as the noise around it",
            "record longer, with better sensors, or at a load that turns; check rated_speed_rpm and pole_pairs",
        )
    slowest = min(f.frequency_hz for f in (found.shaft, *found.loads) if f is not None)
    turns = length * slowest
    least = LEAST_TURNS if found.loads == () else LEAST_LOAD_PERIODS
    if turns < least:
        return Finding(
            "too_few_periods",
            "refused",
            f"{slowest:.2g} Hz, the slowest line of the currents, fits {turns:.1f} times into {length:.2f} s: too few to tell a period",
            turns,
            float(least),
            "record 30-60 s at steady load",
        )
    if found.shaft is None:
        return Finding(
            "no_shaft_line",
            "refused",
            "periodic loads are seen but no shaft line: the mean speed is not fixed",
            None,
            None,
            "record longer or with better current sensors; give the rotor slots",
        )
    if not np.isfinite(found.shaft.frequency_std_hz):
        return Finding(
            "no_shaft_line",
            "refused",
            "what looks like a shaft line does not stay in phase over the stretch: the mean speed is not fixed",
            found.shaft.frequency_hz,
            "a line above the noise of its 64 blocks",
            "record longer, at steady load or with better current sensors",
        )
    if not found.shaft.is_told_from_mains:
        drop_hz = abs(search.synchronous_hz - found.shaft.frequency_hz)
        return Finding(
            "no_shaft_line",
            "refused",
            f"the shaft's line, {drop_hz:.2g} +- {found.shaft.frequency_std_hz:.2g} Hz beside the supply's, is not told from it within {length:.2f} s: the slip is not known",
            drop_hz * length,
            "a period of the recording's length apart",
            "record 30-60 s at steady load, or at more load",
        )
    return None
