"""Lines that stand at whole multiples of the shaft's turns in what a fit leaves of a steady motor: rotor slots, a load or coupling that pulsates
more often than twice a turn, eccentricity. No motor is without them, no number of the machine makes them, and they hide nothing.

Seen from a frame that turns with the voltage they are at k f_r, f_r the shaft's frequency: principal slot harmonics at |k| = number of bars, mixed
eccentricity at |k| = 1 (S. Nandi, H. A. Toliyat, X. Li, IEEE Trans. Energy Convers. 20 (4), 2005, doi 10.1109/TEC.2005.847955).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.fit import Machine, Problem, simulate
from commissioner.estimation.window import Window

Array = NDArray[np.float64]
Spectrum = NDArray[np.complex128]
MOST_PER_TURN = 80
"""Bars of a cage and what stands beside their lines."""
STEADY = 0.01
"""Of its mean, by which a shaft's speed may vary."""
STANDS_OUT = 30.0
"""Of the median power, from which a bin holds a line: chance reaches 17 in a hundred thousand."""
MOST_LINES = 60
OFF, OFF_BINS, BESIDE_BINS = 0.0015, 2.0, 4
"""By how much the fit may miss the shaft's frequency; a line its multiple; what belongs to a line on either side of it."""
LEAST_LINES = 2
"""One alone may stand there by chance."""


@dataclass(frozen=True)
class ShaftLine:
    """So many times a turn, both side bands together; `sigma`: over the noise, root mean square."""

    per_turn: int
    sigma: float


def without_shaft_lines(
    problem: Problem, machine: Machine, left: Sequence[Array]
) -> tuple[list[Array], tuple[ShaftLine, ...]]:
    """What is left of each window (n, 2 or 3), whitened, without such lines, and these, the strongest first."""
    out, power = [], dict[int, float]()
    for w, rest, (_, shaft) in zip(problem.record.windows, left, simulate(problem, machine), strict=True):
        speed = np.abs(shaft[:, 0])
        turns_hz = float(np.mean(speed)) / (2.0 * np.pi * problem.record.scales.pole_pairs)
        if w.is_from_rest or not turns_hz > 0.0 or np.std(speed) > STEADY * np.mean(speed):
            out.append(rest)
            continue
        cleaned, found = _cleaned(w, rest, turns_hz, problem.period)
        out.append(cleaned)
        for per_turn, taken in found.items():
            power[per_turn] = power.get(per_turn, 0.0) + taken
    count = sum(rest.size for rest in left)
    lines = (ShaftLine(n, float(np.sqrt(max(taken, 0.0) / count))) for n, taken in power.items())
    return out, tuple(sorted(lines, key=lambda line: -line.sigma))


def frame_of_voltage(w: Window) -> tuple[Spectrum, float]:
    """(unit vector of the voltage at each sample, 0 where there is none; turns a sample)."""
    voltage = w.voltage[::2] @ np.array([1.0, 1j])
    frame = voltage / np.maximum(np.abs(voltage), 1e-12)
    turned = frame[1:] * np.conj(frame[:-1])
    return frame, abs(float(np.sum(np.angle(turned)))) / (2.0 * np.pi * max(int(np.count_nonzero(turned)), 1))


def _cleaned(w: Window, rest: Array, turns_hz: float, period_s: float) -> tuple[Array, dict[int, float]]:
    """The window's rest without its lines, and the square sum that each multiple had."""
    frame, turn = frame_of_voltage(w)
    spectrum: Spectrum = np.fft.fft((rest[:, 0] + 1j * rest[:, 1]) * np.conj(frame))
    n = spectrum.size
    supply = turn * n
    power = np.abs(spectrum) ** 2 / n
    usual = float(np.median(power)) / np.log(2.0)
    bins = np.fft.fftfreq(n, 1.0 / n)
    peaks = _peaks(power, STANDS_OUT * usual * np.log(2.0))
    of_supply = np.abs(bins[peaks] / supply - np.round(bins[peaks] / supply)) * supply
    peaks = peaks[(of_supply > BESIDE_BINS) & (np.abs(bins[peaks]) < (MOST_PER_TURN + 0.5) * turns_hz * n * period_s)]
    per_turn = _multiples(bins[peaks], np.log(power[peaks] / usual), turns_hz * n * period_s)
    if np.count_nonzero(per_turn) < LEAST_LINES:
        return rest, {}
    taken: dict[int, float] = {}
    for at, k in zip(peaks[per_turn != 0], np.abs(per_turn[per_turn != 0]), strict=True):
        around = np.arange(at - BESIDE_BINS, at + BESIDE_BINS + 1) % n
        too_much = np.sqrt(np.minimum(usual / np.maximum(power[around], 1e-300), 1.0))
        taken[int(k)] = taken.get(int(k), 0.0) + float(np.sum(power[around] * (1.0 - too_much**2)))
        spectrum[around] *= too_much
        power[around] *= too_much**2
    cleaned = np.fft.ifft(spectrum) * frame
    return np.column_stack([cleaned.real, cleaned.imag, rest[:, 2:]]), taken


def _peaks(power: Array, least: float) -> NDArray[np.int64]:
    is_top = (power > least) & (power >= np.roll(power, 1)) & (power > np.roll(power, -1))
    found = np.flatnonzero(is_top)
    return found[np.argsort(-power[found])[:MOST_LINES]]


def _multiples(bins: Array, weight: Array, turns: float) -> NDArray[np.int64]:
    """Of each peak the whole multiple of the shaft's `turns` over the window that it stands at, for the speed at which most do; 0: of none."""
    step = 0.5 / MOST_PER_TURN
    tried = np.arange(turns * (1.0 - OFF), turns * (1.0 + OFF), step)[:, None]
    nearest = np.round(bins / tried)
    hits = (np.abs(bins - nearest * tried) < OFF_BINS) & (nearest != 0.0)
    best = int(np.argmax(hits @ weight)) if bins.size else 0
    return np.where(hits[best], nearest[best], 0.0).astype(np.int64) if bins.size else np.zeros(0, np.int64)
