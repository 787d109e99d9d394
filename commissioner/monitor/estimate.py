"""The speed of each harmonic at the fitted parameters, and which harmonics the data carry."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor import fit as fitting
from commissioner.monitor import inversion
from commissioner.monitor.averaging import Lines, keep
from commissioner.monitor.fit import Fitted, Problem, Start
from commissioner.monitor.inversion import SpeedLines
from commissioner.monitor.sidebands import band_error, least_variance_weight
from commissioner.monitor.supply import Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal

LEAST_ORDERS = 2
"""Kept whether they stand out or not: their uncertainty says what they are worth."""
SELECTION_PRICE = 4.0
STANDS_OUT = 16.0
"""|Omega|^2 over its variance that keeps an order beyond the cut: P = (1 + 16/24)^-24 = 5e-6 on noise whose variance 24 blocks
gave. At 9 it is 5e-4 an order: one in 300 healthy recordings then showed a sixteenth order that was none."""


def estimate(
    lines: Lines, mains: int, start: Start, pairs: int, speed: float, speed_std: float
) -> tuple[Lines, Problem, Fitted]:
    """Fit on the orders that the speed shows and the mains harmonics; the waveform's problem leaves out the mains."""
    trimmed = trim(lines, mains, start.circuit, pairs, speed)
    fitted = fitting.fit(
        fitting.pose(keep(trimmed, fitting.informative(trimmed, mains)), start.circuit, pairs, speed, speed_std), start
    )
    trimmed = trim(lines, mains, fitted.circuit, pairs, speed)
    loads_only = keep(trimmed, trimmed.comb < mains)
    return trimmed, fitting.pose(loads_only, fitted.circuit, pairs, speed, speed_std), fitted


def trim(lines: Lines, mains: int, circuit: TCircuit, pairs: int, speed: float) -> Lines:
    """Each comb's significant orders, as long as their two side bands agree on a real speed."""
    wanted = np.ones(lines.comb.size, dtype=np.bool_)
    for comb in range(mains):
        own = keep(lines, (lines.comb == comb) | (lines.comb < 0))
        on = inversion.torus(own)
        _, upper, lower = inversion.complex_speed(circuit, pairs, own, on)
        _, up, low = inversion.speed_noise(circuit, pairs, own, on)
        error = band_error(circuit, pairs, own, on, speed)
        variance_up, variance_low = _power(up), _power(low)
        weight = least_variance_weight(
            variance_up + error.upper**2, variance_low + error.lower**2, error.gap_upper, error.gap_lower
        )
        value = weight * upper + (1 - weight) * lower
        variance = np.abs(weight) ** 2 * variance_up + np.abs(1 - weight) ** 2 * variance_low
        is_real = np.abs(upper - lower) < np.abs(upper + lower) + 3 * np.sqrt(variance_up + variance_low)
        good = kept_orders(own.order[on.positive], np.abs(value) ** 2 * is_real, variance)
        wanted &= ~((lines.comb == comb) & ~np.isin(np.abs(lines.order), good))
    return keep(lines, wanted)


def kept_orders(orders: NDArray[np.int64], power: Signal, variance: Signal) -> NDArray[np.int64]:
    """Those up to a cut, multiples of the strongest order up to another, and single ones that stand out. At least
    `LEAST_ORDERS`.

    Three equal pulses a turn have orders 3, 6, 9 only: between them there is nothing to pay for.
    """
    strength = orders**2 * np.where(power > STANDS_OUT * variance, power, 0.0)
    strongest = int(orders[int(np.argmax(strength))]) if strength.any() else 1
    cut = max(_cut(orders, power, variance), LEAST_ORDERS)
    is_pulse = orders % strongest == 0
    last_pulse = _cut(orders[is_pulse], power[is_pulse], variance[is_pulse])
    kept = (orders <= cut) | (is_pulse & (orders <= last_pulse)) | (power > STANDS_OUT * variance)
    return np.asarray(orders[kept])


def _cut(orders: NDArray[np.int64], power: Signal, variance: Signal) -> int:
    """The cut at which the sum of |Omega|^2 / var - 4 is largest; 0 where nothing gains.

    Mallows' C_p with 4 for 2, because the cut is the best of many. Each order counts by its own variance: weighed by the
    acceleration it makes, one high order of chance would carry all those below it.
    """
    rank = np.argsort(orders)
    gain = np.cumsum(power[rank] / np.maximum(variance[rank], 1e-300) - SELECTION_PRICE)
    best = int(np.argmax(gain))
    return int(orders[rank][best]) if gain[best] > 0 else 0


def speed_lines(problem: Problem, fitted: Fitted, weight: Vector) -> SpeedLines:
    """Each harmonic from its two side bands, `weight` of it from the upper one."""
    mean, upper, lower = inversion.complex_speed(fitted.circuit, problem.pole_pairs, problem.lines, problem.on)
    value = problem.mean_speed_rad_per_s if np.isfinite(problem.mean_speed_std) else mean.real
    return SpeedLines(value, weight * upper + (1 - weight) * lower)


def shrinkage(problem: Problem, fitted: Fitted, weight: Vector) -> Signal:
    """Factor of each harmonic, max(0, 1 - var / |Omega|^2) (positive-part James-Stein): what is noise is not drawn."""
    amplitude = speed_lines(problem, fitted, weight).amplitude_rad_per_s
    _, up, low = inversion.speed_noise(fitted.circuit, problem.pole_pairs, problem.lines, problem.on)
    variance = _power(weight * up + (1 - weight) * low)
    return np.asarray(np.maximum(0.0, 1 - variance / np.maximum(np.abs(amplitude) ** 2, 1e-300)))


def band_weights(problem: Problem, fitted: Fitted) -> Vector:
    """Weight of the upper side band in each harmonic, `(m,)`: noise, circuit errors, air gap and parameters together."""
    _, noise_up, noise_low = inversion.speed_noise(fitted.circuit, problem.pole_pairs, problem.lines, problem.on)
    _, upper, lower = inversion.complex_speed(fitted.circuit, problem.pole_pairs, problem.lines, problem.on)
    error = problem.band_error
    moved_up, moved_low = list(error.gap_upper), list(error.gap_lower)
    for step in fitting.steps(fitted):
        circuit = fitting.circuit_at(fitted, step)
        _, up, low = inversion.complex_speed(circuit, problem.pole_pairs, problem.lines, problem.on)
        moved_up.append(up - upper)
        moved_low.append(low - lower)
    return least_variance_weight(
        _power(noise_up) + error.upper**2, _power(noise_low) + error.lower**2, np.array(moved_up), np.array(moved_low)
    )


def _power(moved: Vector) -> Signal:
    return np.asarray(np.sum(np.abs(moved) ** 2, axis=0), dtype=np.float64)
