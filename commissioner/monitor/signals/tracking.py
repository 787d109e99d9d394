"""One comb followed through the segment: its frequency, that frequency's standard error, and how its phase drifts.

Block sums of the demodulated current hold all that is needed: any small change of the comb's phase is a sum over 64 of them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor.signals.supply import Vector
from commissioner.records import Signal

DEMODULATION_BLOCKS = 64


@dataclass(frozen=True)
class Demodulated:
    """Block sums of x e^{-j h phi} for the harmonics used: the comb's power for any small change of phase is a sum of 64."""

    harmonic: NDArray[np.int64]
    sums: Vector
    time_s: Signal
    noise_variance: Signal


def demodulate(
    vector: Vector, time_s: Signal, phase_rad: Signal, harmonics: list[int], blocks: int = DEMODULATION_BLOCKS
) -> Demodulated:
    """Sums per block for each +-h of `harmonics`; blocks of equal length, the rest of the record is dropped."""
    length = vector.size // blocks
    used = length * blocks
    orders, sums = [], []
    for h in harmonics:
        turn = np.exp(-1j * h * phase_rad[:used])
        for signed, factor in ((h, turn), (-h, np.conj(turn))):
            orders.append(signed)
            sums.append((vector[:used] * factor).reshape(blocks, length).sum(axis=1))
    stacked = np.array(sums)
    steps = np.diff(stacked, axis=1)
    noise = 0.5 * np.median(np.abs(steps - steps.mean(axis=1, keepdims=True)) ** 2, axis=1) / np.log(2)
    centre = time_s[:used].reshape(blocks, length).mean(axis=1)
    return Demodulated(np.array(orders), stacked, centre, noise)


def captured(demodulated: Demodulated, phase_change_rad: Signal) -> float:
    """Comb power over noise after the fundamental's phase moved by `phase_change_rad` `(blocks,)`."""
    turn = np.exp(-1j * demodulated.harmonic[:, None] * phase_change_rad[None, :])
    total = np.abs((demodulated.sums * turn).sum(axis=1)) ** 2
    return float(np.sum(total / (demodulated.noise_variance + 1e-300)) / demodulated.time_s.size)


def refine(demodulated: Demodulated, half_range_hz: float) -> tuple[float, float, float]:
    """(frequency correction in Hz, its standard error, captured power): the peak of `captured` over a pure frequency."""
    centre = demodulated.time_s - demodulated.time_s.mean()
    highest = np.abs(demodulated.harmonic).max()
    resolution = 1 / (np.ptp(demodulated.time_s) * highest)
    grid = np.arange(-half_range_hz, half_range_hz + resolution / 8, resolution / 8)
    power = np.array([captured(demodulated, 2 * np.pi * shift * centre) for shift in grid])
    best = int(np.argmax(power))
    low, high = max(best - 1, 0), min(best + 1, grid.size - 1)
    shift = _parabola_peak(demodulated, centre, grid[low], grid[high])
    return shift, _frequency_std(demodulated, centre, shift), captured(demodulated, 2 * np.pi * shift * centre)


def _parabola_peak(demodulated: Demodulated, centre: Signal, low: float, high: float) -> float:
    """Four golden-section-like shrinkings, then a parabola: the peak is smooth on this scale."""
    for _ in range(4):
        grid = np.linspace(low, high, 7)
        power = [captured(demodulated, 2 * np.pi * shift * centre) for shift in grid]
        k = int(np.clip(np.argmax(power), 1, 5))
        low, high = grid[k - 1], grid[k + 1]
    left, mid, right = power[k - 1], power[k], power[k + 1]
    bend = left - 2 * mid + right
    shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(grid[k] + np.clip(shift, -1, 1) * (grid[1] - grid[0]))


def _frequency_std(demodulated: Demodulated, centre: Signal, shift: float) -> float:
    """Cramer-Rao bound of a comb in white noise: 1 / var = 2 sum_h (2 pi h)^2 |c_h|^2 sum_b t_b^2 / noise_b."""
    turn = np.exp(-2j * np.pi * demodulated.harmonic[:, None] * shift * centre[None, :])
    mean = np.abs((demodulated.sums * turn).mean(axis=1)) ** 2
    known = np.maximum(mean - demodulated.noise_variance / centre.size, 0.0)
    information = (
        2
        * np.sum((2 * np.pi * demodulated.harmonic) ** 2 * known / (demodulated.noise_variance + 1e-300))
        * np.sum(centre**2)
    )
    return float(1 / np.sqrt(information)) if information > 0 else float("inf")


DRIFT_KNOWN = 0.1
"""Relative error of the drift's mean: coefficients below three deviations were dropped."""


@dataclass(frozen=True)
class PhaseDrift:
    """What a comb's fundamental phase did beyond its nominal one: a polynomial in time scaled to -1 ... 1, constant outside.
    `mean_std_rad_per_s`: of its mean rate, by the scatter of the blocks."""

    polynomial: NDArray[np.float64]
    centre_s: float
    half_s: float
    mean_std_rad_per_s: float = 0.0

    def __call__(self, time_s: Signal) -> Signal:
        place = np.clip((time_s - self.centre_s) / self.half_s, -1.0, 1.0)
        return np.asarray(np.polynomial.legendre.legval(place, self.polynomial))

    @property
    def mean_rad_per_s(self) -> float:
        """Mean rate from end to end."""
        return float(np.sum(self.polynomial[1::2]) / self.half_s)

    @property
    def mean_error_rad_per_s(self) -> float:
        """Of the mean rate: `mean_std_rad_per_s` and what was dropped."""
        return float(np.hypot(DRIFT_KNOWN * self.mean_rad_per_s, self.mean_std_rad_per_s))

    def without_mean(self) -> PhaseDrift:
        """The same without its mean rate: it ends as it began."""
        polynomial = self.polynomial.copy()
        polynomial[1] -= np.sum(polynomial[1::2])
        return replace(self, polynomial=polynomial)


def track(demodulated: Demodulated, degree: int) -> PhaseDrift:
    """The smooth phase that the comb's blocks show together: delta_b = sum h Im(z_b conj c) / sum h^2 |c|^2, iterated.

    Harmonics are weighed by their noise; coefficients below three standard deviations are dropped: those of that noise, or, where
    the blocks scatter more, of their scatter.
    """
    time = demodulated.time_s
    centre, half = 0.5 * (time[0] + time[-1]), 0.5 * np.ptp(time)
    basis = np.polynomial.legendre.legvander((time - centre) / half, degree)
    h = demodulated.harmonic[:, None]
    weight = 1 / (demodulated.noise_variance[:, None] + 1e-300)
    coefficients = np.zeros(degree + 1)
    for _ in range(5):
        turned = demodulated.sums * np.exp(-1j * h * (basis @ coefficients)[None, :])
        mean = turned.mean(axis=1, keepdims=True)
        bottom = np.sum(h**2 * np.abs(mean) ** 2 * weight)
        delta = np.sum(h * weight * np.imag(turned * np.conj(mean)), axis=0) / max(bottom, 1e-300)
        coefficients = coefficients + np.linalg.lstsq(basis, delta, rcond=None)[0]
    std = max(np.sqrt(0.5 / max(bottom, 1e-300)), np.std(delta)) / np.sqrt(np.sum(basis**2, axis=0))
    coefficients = np.where(np.abs(coefficients) > 3 * std, coefficients, 0.0)
    coefficients[0] = 0.0
    kept = np.where(coefficients != 0.0, std, 0.0)
    return PhaseDrift(coefficients, float(centre), float(half), float(np.linalg.norm(kept[1::2])) / float(half))
