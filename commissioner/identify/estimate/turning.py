"""Did the shaft turn during a test? Told by the current beside the axis.

In a rotor that turns, flux along the axis is carried beside it, and as it changes it drives a current there. Sensors of unequal
gain and unequal axes drive one, too, of other forms: all are fitted together. The values along the axis are then those of another
machine, by the square of the angle (rad) that the rotor turns in its time constant.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from commissioner.identify.intake.stretches import Stretch
from commissioner.motor.circuit import InverseGamma
from commissioner.records import Signal

TURNED_SHARE = 1.0
"""Of that square: the worst value of motors at 1 to 3 rad/s was off by 1.7 of it. What an inverter's legs lose damps the current beside
the axis, so that the speed is seen too small."""
PART_S = 1.0
"""A shaft that swings turns one way for about so long."""
SIGMAS = 10.0
"""Of a part's speed, in the root mean square: what a still shaft shows is less."""

LEAST_NOISE = 1e-3
"""Of the current along the axis: a played recording without noise shows what its solver leaves."""


def turning_rad_per_s(stretches: Sequence[Stretch], machine: InverseGamma, period_s: float) -> float:
    """Root mean square of the electrical speed over parts of the test, each by how well it is known; 0 where it is not seen."""
    parts = [part for s in stretches for part in _parts(s, machine, period_s)]
    speed, std = np.array(parts).reshape(-1, 2).T
    if not speed.size or np.mean(np.square(speed / std)) < SIGMAS**2:
        return 0.0
    return float(np.sqrt(np.average(np.square(speed), weights=np.square(1.0 / std))))


def turning_doubt(speed_rad_per_s: float, machine: InverseGamma) -> float:
    """Relative, of every value."""
    return TURNED_SHARE * (speed_rad_per_s * machine.magnetizing_inductance_h / machine.rotor_resistance_ohm) ** 2


def _parts(stretch: Stretch, machine: InverseGamma, period_s: float) -> list[tuple[float, float]]:
    """Speed and its standard error (rad/s) in each part."""
    count = int(PART_S / period_s)
    columns, beside = _beside(stretch.current_a, machine, period_s), stretch.cross_a
    out = []
    for k in range(0, beside.size - count + 1, count):
        x, y = columns[k : k + count], beside[k : k + count]
        solved, _, rank, _ = np.linalg.lstsq(x, y, rcond=None)
        if rank == x.shape[1]:
            noise_a = max(float(np.std(y - x @ solved)), LEAST_NOISE * float(np.std(columns[:, 3])))
            out.append((float(solved[0]), noise_a * float(np.sqrt(np.linalg.inv(x.T @ x)[0, 0]))))
    return out


def _beside(current_a: Signal, machine: InverseGamma, period_s: float) -> Signal:
    """Currents beside the axis (n, 5): of a shaft at 1 rad/s, of main and leakage flux that lean, of unequal gains, an offset."""
    r_s, r_r, leakage_h, main_h = machine.as_tuple()
    size, decay = current_a.size, r_r / main_h
    padded = 2 * size
    s = 2j * np.pi * np.fft.rfftfreq(padded, period_s)
    impedance = r_s + s * leakage_h + s * r_r / (s + decay)
    along = np.fft.rfft(current_a, padded)
    forms = (s * r_r / (s + decay) ** 2, s * r_r / (s + decay), s * leakage_h)
    driven = [np.fft.irfft(-form / impedance * along, padded)[:size] for form in forms]
    return np.column_stack([*driven, current_a, np.ones(size)])
