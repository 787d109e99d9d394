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


def of_speed_gain(supply_hz: float | None, gain: float) -> Literal["sensor", "period", "either"]:
    """Whose a speed is that reads so much too high: the speed sensor's, or the time column's, whose sample period is too long by as much: to a motor
    the two are one. Of mains their frequency tells; `supply_hz`: by the time column, None of an inverter or where it moves."""
    if supply_hz is None:
        return "either"
    by_sensor, by_period = (abs(_off(hz)[1]) for hz in (supply_hz, supply_hz / (1.0 - gain)))
    if by_sensor < KEPT and by_period > OF_GRID:
        return "sensor"
    return "period" if by_sensor > KEPT and by_period < OF_GRID else "either"


def _off(supply_hz: float) -> tuple[float, float]:
    """(the nearer mains' frequency, share by which it is left)."""
    nearest = min(MAINS_HZ, key=lambda hz: abs(supply_hz / hz - 1.0))
    return nearest, supply_hz / nearest - 1.0


def wrong_unit(supply_hz: float, rated_hz: float) -> str | None:
    """The unit that the time column is in where that makes the supply's frequency, as the column tells it, like the plate's."""
    if not supply_hz > 0.0:
        return None
    ratio = rated_hz / supply_hz
    return next((unit for by, unit in THOUSANDS.items() if by / NEAR < ratio < by * NEAR), None)


def off_mains(supply_hz: float) -> str | None:
    """What to say of a supply that turns near the mains' frequency, and not at it."""
    nearest, off = _off(supply_hz)
    if not KEPT < abs(off) < LIKE_MAINS:
        return None
    return (
        f"the supply turns at {supply_hz:.4g} Hz by the time column, {100.0 * off:+.1f} % from {nearest:g} Hz: if it is the mains, the sample "
        f"period is {abs(100.0 * off):.1f} % too {'long' if off < 0.0 else 'short'}, and inductances, times and the inertia with it"
    )


def turn_a_row(vector: NDArray[np.complex128]) -> float:
    """rad by which a supply's vector turns from row to row, by rows a period apart, where harmonics and its unbalance stand as they stood.

    Between neighbours they turn it too: 3 % of a 5th and of unbalance made 49.77 Hz of 50. Of less than two periods it is that.
    """
    turn = float(np.angle(np.sum(np.conj(vector[:-1]) * vector[1:])))
    for _ in range(2):  # the first count of rows may be one off
        rows = round(2 * np.pi / abs(turn)) if turn else 0
        if 0 < rows <= vector.size // 2:
            off = float(np.angle(np.hanning(vector.size - rows) @ (np.conj(vector[:-rows]) * vector[rows:])))
            turn = (float(np.copysign(2 * np.pi, turn)) + off) / rows
    return turn
