"""What the feeder makes of the voltage at load frequencies.

The mains hold no line at a load's frequency but the one that the motor's own current draws across the feeder: V = -Z I with
Z = R + j omega L. Two numbers fit all lines of a recording, so the noise of each measured voltage line, which is the
larger part of the speed's noise at 1 % sensor noise, need not enter. What a line shows beyond that model
and beyond its noise (an inverter's own ripple, a neighbour's) is kept.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor.signals.averaging import Lines
from commissioner.monitor.signals.supply import Vector
from commissioner.records import Signal

PRIOR_SHARE = 0.2
"""Standard deviation of the feeder's impedance around zero, of the motor's own: a short circuit of five times its current."""
KEEPS_BEYOND = 9.0
"""|rest|^2 over its variance below which a line's rest is taken for noise: P = e^-9 on noise alone. At 4 one line in fifty let its
voltage's noise in, which is four times the current's."""
OUTLIER = 3.0


def quieten(lines: Lines, combs: int) -> Lines:
    """The lines with the voltages of the first `combs` combs as feeder plus significant rest, their influences likewise."""
    own = (lines.comb >= 0) & (lines.comb < combs)
    if not own.any():
        return lines
    impedance = feeder_impedance(lines, own)
    drop = impedance[own] * lines.current_a[own]
    moved = impedance[own] * lines.current_influence[:, own]
    rest = lines.voltage_v[own] + drop
    rest_influence = lines.voltage_influence[:, own] + moved
    variance = _variance(rest_influence)
    kept = np.maximum(0.0, 1 - (KEEPS_BEYOND * variance / np.maximum(np.abs(rest) ** 2, 1e-300)) ** 2)
    voltage, influence = lines.voltage_v.copy(), lines.voltage_influence.copy()
    voltage[own] = kept * rest - drop
    influence[:, own] = np.maximum(kept, _hidden(rest, variance, kept)) * rest_influence - moved
    return replace(lines, voltage_v=voltage, voltage_influence=influence)


def feeder_impedance(lines: Lines, own: NDArray[np.bool_]) -> Vector:
    """Z = R + j (rate + omega_e) L at every line, R and L by weighted least squares around a stiff feeder."""
    frequency = lines.rate_rad_per_s + lines.supply_rad_per_s
    current, voltage = lines.current_a[own], lines.voltage_v[own]
    matrix = -np.stack([current, 1j * frequency[own] * current], axis=1)
    scale = PRIOR_SHARE * abs(lines.voltage_v[0] / lines.current_a[0]) * np.array([1.0, 1 / lines.supply_rad_per_s])
    weight = 1 / np.maximum(_variance(lines.voltage_influence[:, own]), 1e-300)
    solution = np.zeros(2)
    for _ in range(6):
        size = np.abs(voltage - matrix @ solution) * np.sqrt(weight)
        robust = weight * np.minimum(1.0, OUTLIER / np.maximum(size, 1e-12))
        gram = np.real(np.conj(matrix.T) @ (robust[:, None] * matrix)) + np.diag(1 / scale**2)
        solution = np.linalg.solve(gram, np.real(np.conj(matrix.T) @ (robust * voltage)))
    return np.asarray(solution[0] + 1j * frequency * solution[1], dtype=np.complex128)


def _variance(influence: Vector) -> Signal:
    return np.asarray(np.sum(np.abs(influence) ** 2, axis=0), dtype=np.float64)


def _hidden(rest: Vector, variance: Signal, kept: Signal) -> float:
    """Share of its standard deviation that a rest taken for noise may still hide: from the excess of all of them over what
    chance gives their mean (two of its standard deviations).
    """
    small = kept == 0.0
    if not small.any():
        return 0.0
    ratio = np.abs(rest[small]) ** 2 / np.maximum(variance[small], 1e-300)
    excess = float(np.mean(ratio)) - 1.0 - 2.0 / np.sqrt(ratio.size)
    return float(np.sqrt(np.clip(excess, 0.0, 1.0)))
