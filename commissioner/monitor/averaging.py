"""Synchronous averaging: the part of the currents and voltages that repeats with a load, and how sure it is.

`synchronous_average` is the method of Schantz & Leeb, (2) and (3). `separate` is what the chain uses: least squares of
all combs at once over a Hann window. For one period that fits the record both give the same lines; where lines of two
combs, or of a comb and a mains harmonic, lie a few resolution cells apart, only the joint fit keeps them apart, and its
phases may follow a shaft whose speed wanders.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, linalg
from scipy.signal import windows

from commissioner.monitor.supply import TurningFrame, Vector
from commissioner.records import Signal

BLOCKS = 24
"""Stretches whose residuals are taken as independent: each at least 0.3 s, longer than any filter of the chain."""
DRIFT_ORDERS = 3
TAPERED = 0.3
"""Share of the segment under the window's flanks: 8 % more noise than a plain mean, a Hann window has 22 %."""


@dataclass(frozen=True)
class Comb:
    """One periodicity: its phase at every sample of the segment, and which harmonics are kept.

    `follows`: "mains" where the phase is tied to the supply angle (a shaft at constant slip), "clock" where to time.
    """

    name: str
    phase_rad: Signal
    frequency_hz: float
    orders: tuple[int, ...]
    follows: str


@dataclass(frozen=True)
class Lines:
    """Complex amplitudes of every line in the turning frame; line 0 is the mean.

    `comb[k]` indexes the combs (-1 for the mean, one past the last comb for the mains harmonics), `order[k]` is the signed harmonic, `rate_rad_per_s[k]` its mean
    angular frequency. `*_influence[b, k]` is what block b's residual added: the covariance of the lines is their sum of
    outer products times B / (B - 1) (cluster-robust, so coloured and unsteady noise counts for what it is).
    """

    comb: NDArray[np.int64]
    order: NDArray[np.int64]
    rate_rad_per_s: Signal
    current_a: Vector
    voltage_v: Vector
    current_influence: Vector
    voltage_influence: Vector
    supply_rad_per_s: float
    residual_current_a: Vector
    residual_voltage_v: Vector


def synchronous_average(signal: Vector, sample_period_s: float, period_s: float) -> Vector:
    """One characteristic period, `(N_p,)`: resampled to f_sp = floor(f_s T_p) / T_p by zero padding, then averaged (2), (3).

    The spectrum is evaluated on the finer grid by padding to the next multiple and band-limited interpolation of
    `scipy.signal.resample`'s kind; the last, incomplete period is dropped.
    """
    points = max(int(np.floor(period_s / sample_period_s)), 8)
    periods = int(signal.size * sample_period_s / period_s)
    padded = _zero_padded(signal, 8)
    fine_period = sample_period_s / 8
    place = np.arange(points * periods) * (period_s / points) / fine_period
    low = np.minimum(place.astype(np.int64), padded.size - 2)
    part = place - low
    sampled = padded[low] * (1 - part) + padded[low + 1] * part
    return np.asarray(sampled.reshape(periods, points).mean(axis=0), dtype=np.complex128)


def _zero_padded(signal: Vector, factor: int) -> Vector:
    count = signal.size
    spectrum = fft.fft(signal)
    padded = np.zeros(factor * count, dtype=np.complex128)
    half = count // 2
    padded[: count - half] = spectrum[: count - half]
    padded[-half:] = spectrum[-half:]
    return np.asarray(fft.ifft(padded) * factor, dtype=np.complex128)


def separate(frame: TurningFrame, part: slice, combs: list[Comb], supply_orders: int) -> Lines:
    """All combs and the mains harmonics in one weighted least squares on the segment `part`.

    Columns: the mean, e^{+-j h phi} of each comb, e^{j k theta_e} for k = +-1 ... +-supply_orders, and a cubic drift of the
    mean (only to keep it out of the rest). Comb phases are `(n,)` over the segment.
    """
    time = frame.time_s[part]
    count = time.size
    window = windows.tukey(count + 2, TAPERED)[1:-1]
    rows: list[Vector] = [np.ones(count, dtype=np.complex128)]
    comb_index, order, rate = [-1], [0], [0.0]
    for p, comb in enumerate(combs):
        powers = _powers(comb.phase_rad, max(comb.orders, default=0))
        for h in comb.orders:
            row = powers[h - 1]
            rows += [row, np.conj(row)]
            comb_index += [p, p]
            order += [h, -h]
            rate += [2 * np.pi * h * comb.frequency_hz, -2 * np.pi * h * comb.frequency_hz]
    supply = float(np.average(frame.supply_rad_per_s[part], weights=window))
    for k, row in enumerate(_powers(frame.supply_angle_rad[part], supply_orders), start=1):
        rows += [row, np.conj(row)]
        comb_index += [len(combs)] * 2
        order += [k, -k]
        rate += [k * supply, -k * supply]
    wanted = len(rows)
    rows += _drift(time, window)
    design = np.array(rows)
    both = np.stack([frame.current_a[part], frame.voltage_v[part]])
    weighted = np.conj(design) * window
    gram = weighted @ design.T
    solve = linalg.cho_factor(gram + 1e-12 * np.trace(gram).real / len(rows) * np.eye(len(rows)))
    amplitudes = linalg.cho_solve(solve, weighted @ both.T)
    residual = both - amplitudes.T @ design
    influence = _influence(weighted, residual, solve)[:, :wanted]
    return Lines(
        np.array(comb_index), np.array(order), np.array(rate), amplitudes[:wanted, 0], amplitudes[:wanted, 1],
        influence[..., 0], influence[..., 1], supply, residual[0], residual[1],
    )


def _powers(phase_rad: Signal, highest: int) -> list[Vector]:
    base = np.exp(1j * phase_rad)
    rows: list[Vector] = []
    for h in range(highest):
        rows.append(base if h == 0 else rows[-1] * base)
    return rows


def _drift(time: Signal, window: Signal) -> list[Vector]:
    """Polynomials without a weighted mean, so that line 0 stays the weighted mean."""
    place = (time - time.mean()) / max(0.5 * (time[-1] - time[0]), 1e-9)
    rows = []
    for k in range(1, DRIFT_ORDERS + 1):
        row = place**k
        rows.append((row - np.average(row, weights=window)).astype(np.complex128))
    return rows


def _influence(weighted: Vector, residual: Vector, solve: tuple[Vector, bool]) -> Vector:
    """`(blocks, lines, 2)`: G^-1 A_b^H W r_b, scaled so that the sum of outer products is the covariance."""
    edges = np.linspace(0, residual.shape[1], BLOCKS + 1).astype(np.int64)
    scores = np.stack([
        weighted[:, a:b] @ residual[:, a:b].T for a, b in zip(edges[:-1], edges[1:], strict=True)
    ])
    flat = np.moveaxis(scores, 1, 0).reshape(weighted.shape[0], -1)
    solved = linalg.cho_solve(solve, flat).reshape(weighted.shape[0], BLOCKS, 2)
    return np.asarray(np.moveaxis(solved, 0, 1) * np.sqrt(BLOCKS / (BLOCKS - 1)), dtype=np.complex128)


def free_orders(
    frequency_hz: float, highest: int, taken_hz: list[float], supply_hz: float, duration_s: float
) -> tuple[int, ...]:
    """Orders of a comb whose lines can be told from lines of others and of the mains within `duration_s`.

    Mains lines that carry something are the odd harmonics: in the turning frame multiples of 2 f_e, and f_e (offset).
    """
    cell = 1.0 / duration_s
    mains = np.array([1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 14.0]) * supply_hz
    others = np.concatenate([mains, np.asarray(taken_hz, dtype=np.float64)])
    orders = np.arange(1, highest + 1)
    apart = np.abs(orders[:, None] * frequency_hz - others[None, :]).min(axis=1)
    return tuple(int(h) for h in orders[apart > cell])


def keep(lines: Lines, wanted: NDArray[np.bool_]) -> Lines:
    """Only the lines marked `wanted` `(k,)`."""
    return Lines(
        lines.comb[wanted], lines.order[wanted], lines.rate_rad_per_s[wanted], lines.current_a[wanted],
        lines.voltage_v[wanted], lines.current_influence[:, wanted], lines.voltage_influence[:, wanted],
        lines.supply_rad_per_s, lines.residual_current_a, lines.residual_voltage_v,
    )
