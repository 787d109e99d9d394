"""The speed of each harmonic at the fitted parameters, and which harmonics the data carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from commissioner.monitor.machine import fit as fitting
from commissioner.monitor.machine import inversion
from commissioner.monitor.machine.fit import Fitted, Problem, Start
from commissioner.monitor.machine.inversion import SpeedLines
from commissioner.monitor.machine.sidebands import band_error, least_variance_weight
from commissioner.monitor.signals.averaging import Lines, keep
from commissioner.monitor.signals.envelope import shares
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal

LEAST_ORDERS = 2
"""Kept whether they stand out or not: their uncertainty says what they are worth."""
LEAST_SHARE = 0.05
"""Orders of which less would be drawn are left out, and what they may hold counted as missing."""


@dataclass(frozen=True)
class Kept:
    """`share` `(m,)`: how much of each harmonic of the problem is drawn. The variances are what is left out by that, in
    speed (rad/s)^2 and acceleration (rad/s^2)^2, the same at every instant.
    """

    share: Signal
    speed_variance: float
    acceleration_variance: float
    between_pulses: float = 0.0
    """Of the acceleration's, the part in the shaft's orders between multiples of the strongest: what makes pulses unlike."""


def estimate(
    lines: Lines, mains: int, start: Start, pairs: int, speed: float, speed_std: float, delay_std_s: float
) -> tuple[Lines, Problem, Fitted, Kept]:
    """Fit on the orders that the speed shows and the mains harmonics; the waveform's problem leaves out the mains.

    The lines that come back hold the currents without the delay that was found.
    """
    trimmed, _ = trim(lines, mains, start.circuit, pairs, speed)
    shown = keep(trimmed, fitting.informative(trimmed, mains))
    fitted = fitting.fit(fitting.pose(shown, start.circuit, pairs, speed, speed_std, delay_std_s), start)
    lines = fitting.advanced(lines, fitted.delay_s)
    trimmed, kept = trim(lines, mains, fitted.circuit, pairs, speed)
    loads_only = keep(trimmed, trimmed.comb < mains)
    return trimmed, fitting.pose(loads_only, fitted.circuit, pairs, speed, speed_std), fitted, kept


def trim(lines: Lines, mains: int, circuit: TCircuit, pairs: int, speed: float) -> tuple[Lines, Kept]:
    """Each comb's orders that carry something, as long as their two side bands agree on a real speed."""
    wanted = np.ones(lines.comb.size, dtype=np.bool_)
    drawn, speed_variance, acceleration_variance, between = [], 0.0, 0.0, 0.0
    for comb in range(mains):
        own = keep(lines, (lines.comb == comb) | (lines.comb < 0))
        if own.order.size == 1:
            continue
        power, variance = _harmonics(own, circuit, pairs, speed)
        positive = own.order > 0
        orders = own.order[positive]
        made = shares(orders, power * orders**2, variance * orders**2)
        is_kept = (made.share > LEAST_SHARE) | (orders <= LEAST_ORDERS)
        wanted &= ~((lines.comb == comb) & ~np.isin(np.abs(lines.order), orders[is_kept]))
        drawn.append(made.share[is_kept])
        missing = made.missing + np.where(is_kept, 0.0, made.share**2 * (variance + power) * orders**2)
        rate = float(own.rate_rad_per_s[positive][0]) / int(orders[0])
        speed_variance += 2 * float(np.sum(missing / orders**2) + made.beyond[1])
        if comb == 0:
            between = 2 * rate**2 * float(np.sum(missing[orders % made.strongest != 0]))
        acceleration_variance += 2 * rate**2 * float(np.sum(missing) + made.beyond[0])
    share = np.concatenate(drawn) if drawn else np.zeros(0)
    return keep(lines, wanted), Kept(share, speed_variance, acceleration_variance, between)


def _harmonics(own: Lines, circuit: TCircuit, pairs: int, speed: float) -> tuple[Signal, Signal]:
    """(|Omega|^2, its variance) of one comb's orders `(m,)`; power 0 where the side bands contradict each other."""
    on = inversion.torus(own)
    _, upper, lower = inversion.complex_speed(circuit, pairs, own, on)
    _, up, low = inversion.speed_noise(circuit, pairs, own, on)
    error = band_error(circuit, pairs, own, on, speed)
    variance_up, variance_low = _power(up), _power(low)
    weight = least_variance_weight(
        variance_up + error.upper**2, variance_low + error.lower**2, error.gap_upper, error.gap_lower
    )
    rest = 1 - weight
    variance = np.abs(weight) ** 2 * (variance_up + error.upper**2) + np.abs(rest) ** 2 * (
        variance_low + error.lower**2
    )
    variance = variance + _power(weight * error.gap_upper + rest * error.gap_lower)
    is_real = np.abs(upper - lower) < np.abs(upper + lower) + 3 * np.sqrt(variance_up + variance_low)
    return np.abs(weight * upper + rest * lower) ** 2 * is_real, variance


def speed_lines(problem: Problem, fitted: Fitted, weight: Vector) -> SpeedLines:
    """Each harmonic from its two side bands, `weight` of it from the upper one."""
    mean, upper, lower = inversion.complex_speed(fitted.circuit, problem.pole_pairs, problem.lines, problem.on)
    value = problem.mean_speed_rad_per_s if np.isfinite(problem.mean_speed_std) else mean.real
    return SpeedLines(value, weight * upper + (1 - weight) * lower)


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
