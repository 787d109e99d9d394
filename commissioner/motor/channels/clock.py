"""What the voltages say of the time column: the supply turns in its rows at a rate that the plate, or the mains, foretell."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

THOUSANDS = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}
NEAR = 2.0
"""Factor between the plate's frequency and that of a supply which a thousand cannot be taken for."""
MAINS_HZ = (50.0, 60.0)
KEPT, LIKE_MAINS = 0.004, 0.03
"""Share by which mains leave their frequency at most (EN 50160: 1 % in 99.5 % of a year, 0.4 % in any usual hour), and from which it is an inverter's."""

OF_GRID = 0.002
"""Share by which a large grid leaves its frequency at most, but for a few minutes a year."""
BLOCKS = 3
"""Periods of the supply, at least, that tell its frequency better than their turning from sample to sample."""


def turning_hz(vector: NDArray[np.complex128], period_s: float, near_hz: float) -> float:
    """The frequency of a supply that turns about so fast: by the angle from each of its periods to the next, in which harmonics are no part (from
    sample to sample 2 % of a fifth makes it 0.2 % too low)."""
    rows = max(round(1.0 / (near_hz * period_s)), 1)
    whole = vector.size // rows * rows
    if whole < BLOCKS * rows:
        return near_hz
    phase = 2.0 * np.pi * near_hz * period_s * np.arange(whole)
    sense = 1.0 if float(np.sum(np.imag(np.conj(vector[:-1]) * vector[1:]))) > 0.0 else -1.0
    means = np.mean((vector[:whole] * np.exp(-1j * sense * phase)).reshape(-1, rows), axis=1)
    turn = sense * float(np.angle(np.sum(np.conj(means[:-1]) * means[1:])))
    return near_hz + turn / (2.0 * np.pi * rows * period_s)


def of_speed_gain(supply_hz: float | None, gain: float) -> Literal["sensor", "period", "either"]:
    """Whose a speed is that reads so much too high: the speed sensor's, or the time column's, whose sample period is too long by as much: to a motor
    the two are one. Of mains their frequency tells; `supply_hz`: by the time column, None of an inverter or where it moves."""
    if supply_hz is None:
        return "either"
    by_sensor, by_period = (_off(hz) for hz in (supply_hz, supply_hz / (1.0 - gain)))
    if by_sensor < KEPT and by_period > OF_GRID:
        return "sensor"
    return "period" if by_sensor > KEPT and by_period < OF_GRID else "either"


def _off(supply_hz: float) -> float:
    """Share by which it leaves the nearer mains' frequency."""
    return min(abs(supply_hz / hz - 1.0) for hz in MAINS_HZ)


def wrong_unit(supply_hz: float, rated_hz: float) -> str | None:
    """The unit that the time column is in where that makes the supply's frequency, as the column tells it, like the plate's."""
    if not supply_hz > 0.0:
        return None
    ratio = rated_hz / supply_hz
    return next((unit for by, unit in THOUSANDS.items() if by / NEAR < ratio < by * NEAR), None)


def off_mains(supply_hz: float) -> str | None:
    """What to say of a supply that turns near the mains' frequency, and not at it."""
    nearest = min(MAINS_HZ, key=lambda hz: abs(supply_hz / hz - 1.0))
    off = supply_hz / nearest - 1.0
    if not KEPT < abs(off) < LIKE_MAINS:
        return None
    return (
        f"the supply turns at {supply_hz:.4g} Hz by the time column, {100.0 * off:+.1f} % from {nearest:g} Hz: if it is the mains, the sample "
        f"period is {abs(100.0 * off):.1f} % too {'long' if off < 0.0 else 'short'}, and inductances, times and the inertia with it"
    )
