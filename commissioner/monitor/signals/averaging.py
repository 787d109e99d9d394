"""Synchronous averaging: the part of the currents and voltages that repeats with a load, and how sure it is.

Schantz & Leeb resample to whole points per period and average (2), (3). `separate` is least squares of all combs at once over a
window: for one period that fits the record both give the same lines; where lines of two combs, or of a comb and a mains harmonic,
lie a few resolution cells apart, only the joint fit keeps them apart, and its phases may follow a shaft whose speed wanders.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from commissioner.monitor.signals.supply import TurningFrame, Vector
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

    `comb[k]` indexes the combs (-1 for the mean, one past the last comb for the mains harmonics), `order[k]` is the
    signed harmonic, `rate_rad_per_s[k]` its mean angular frequency. `*_influence[b, k]` is what block b's
    residual added: the covariance of the lines is their sum of outer products times B / (B - 1) (cluster-robust, so coloured and unsteady noise counts for what it is).
    """

    comb: NDArray[np.int64]
    order: NDArray[np.int64]
    rate_rad_per_s: Signal
    current_a: Vector
    voltage_v: Vector
    current_influence: Vector
    voltage_influence: Vector
    supply_rad_per_s: float
    asymmetry: float = 0.0
    """Share of the mean that unlike sensors turn into a negative sequence."""


def separate(frame: TurningFrame, part: slice, combs: list[Comb], supply_orders: int) -> Lines:
    """All combs and the mains harmonics in one weighted least squares on the segment `part`.

    Columns: the mean, cos and sin of each order of each comb and of k theta_e for k = 1 ... supply_orders, and a cubic drift
    of the mean (only to keep it out of the rest); real columns, complex coefficients, turned into e^{+-j} pairs at the end.
    The normal equations are summed block by block; block b's score A_b^T W r_b is then its right-hand side minus its part
    of the matrix times the solution. Comb phases are `(n,)` over the segment.
    """
    from scipy.signal import windows

    time = frame.time_s[part]
    window = windows.tukey(time.size + 2, TAPERED)[1:-1]
    phases = [*(comb.phase_rad for comb in combs), frame.supply_angle_rad[part]]
    orders = [*(comb.orders for comb in combs), tuple(range(1, supply_orders + 1))]
    drift = _drift(time, window)
    data = np.stack([frame.current_a[part], frame.voltage_v[part]], axis=1).view(np.float64)
    edges = np.linspace(0, time.size, BLOCKS + 1).astype(np.int64)
    grams, sides = [], []
    for low, high in itertools.pairwise(edges):
        columns = _columns([phase[low:high] for phase in phases], orders, drift[:, low:high])
        weighted = columns * window[low:high]
        grams.append(weighted @ columns.T)
        sides.append(weighted @ data[low:high])
    gram, side = np.sum(grams, axis=0), np.sum(sides, axis=0)
    solve = linalg.cho_factor(gram + 1e-12 * np.trace(gram) / gram.shape[0] * np.eye(gram.shape[0]))
    real = linalg.cho_solve(solve, side)
    scores = np.concatenate([s - g @ real for g, s in zip(grams, sides, strict=True)], axis=1)
    moved = linalg.cho_solve(solve, scores).reshape(real.shape[0], BLOCKS, 4) * np.sqrt(BLOCKS / (BLOCKS - 1))
    supply = float(np.average(frame.supply_rad_per_s[part], weights=window))
    rates = [*(2 * np.pi * comb.frequency_hz for comb in combs), supply]
    comb_index, order, rate = _labels(orders, rates)
    amplitude = _pairs(np.ascontiguousarray(real[:-DRIFT_ORDERS]).view(np.complex128), len(comb_index))
    influence = _pairs(np.ascontiguousarray(moved[:-DRIFT_ORDERS]).view(np.complex128), len(comb_index))
    return Lines(
        comb_index,
        order,
        rate,
        amplitude[:, 0],
        amplitude[:, 1],
        influence[..., 0].T.copy(),
        influence[..., 1].T.copy(),
        supply,
    )


def apart(frame: TurningFrame, part: slice, combs: list[Comb], supply_orders: int) -> tuple[Vector, list[Vector]]:
    """The segment's current in parts, `(n,)` each: what `separate` leaves, its mean and the mains harmonics removed, and what it
    gives to each comb.
    """
    lines = separate(frame, part, combs, supply_orders)
    phases = [*(comb.phase_rad for comb in combs), frame.supply_angle_rad[part]]
    left: Vector = frame.current_a[part] - lines.current_a[0]
    made = []
    for p, phase in enumerate(phases):
        own = lines.comb == p
        amplitude = dict(zip(lines.order[own].tolist(), lines.current_a[own], strict=True))
        share = np.zeros(phase.size, dtype=np.complex128)
        for h, row in enumerate(_powers(phase, max(amplitude, default=0)), start=1):
            if h in amplitude:
                share += amplitude[h] * row + amplitude[-h] * np.conj(row)
        left = left - share
        made.append(share)
    return left, made[:-1]


def _columns(phases: list[Signal], orders: list[tuple[int, ...]], drift: Signal) -> Signal:
    """`(columns, samples)`: 1, then cos and sin of every order of every phase, then the drift."""
    rows: list[Signal] = [np.ones(drift.shape[1])]
    for phase, wanted in zip(phases, orders, strict=True):
        powers = _powers(phase, max(wanted, default=0))
        for h in wanted:
            rows += [powers[h - 1].real, powers[h - 1].imag]
    return np.array([*rows, *drift])


def _labels(orders: list[tuple[int, ...]], rates: list[float]) -> tuple[NDArray[np.int64], NDArray[np.int64], Signal]:
    """Comb, signed order and rate of each line: the mean, then +h and -h in turn."""
    labels = [(-1, 0, 0.0)]
    for p, (wanted, rate) in enumerate(zip(orders, rates, strict=True)):
        labels += [(p, sign * h, sign * h * rate) for h in wanted for sign in (1, -1)]
    comb, order, turning = zip(*labels, strict=True)
    return np.array(comb), np.array(order), np.array(turning)


def _pairs(real_basis: Vector, count: int) -> Vector:
    """Coefficients of (1, cos, sin, cos, sin, ...) along the first axis as those of (1, e^+, e^-, e^+, e^-, ...)."""
    out = np.empty((count, *real_basis.shape[1:]), dtype=np.complex128)
    out[0] = real_basis[0]
    cosine, sine = real_basis[1:count:2], real_basis[2:count:2]
    out[1::2] = 0.5 * (cosine - 1j * sine)
    out[2::2] = 0.5 * (cosine + 1j * sine)
    return out


def _powers(phase_rad: Signal, highest: int) -> list[Vector]:
    base = np.exp(1j * phase_rad)
    rows: list[Vector] = []
    for h in range(highest):
        rows.append(base if h == 0 else rows[-1] * base)
    return rows


def _drift(time: Signal, window: Signal) -> Signal:
    """Polynomials without a weighted mean `(orders, n)`, so that line 0 stays the weighted mean."""
    place = (time - time.mean()) / max(0.5 * (time[-1] - time[0]), 1e-9)
    rows = [place**k for k in range(1, DRIFT_ORDERS + 1)]
    return np.array([row - np.average(row, weights=window) for row in rows])


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
    return replace(
        lines,
        comb=lines.comb[wanted],
        order=lines.order[wanted],
        rate_rad_per_s=lines.rate_rad_per_s[wanted],
        current_a=lines.current_a[wanted],
        voltage_v=lines.voltage_v[wanted],
        current_influence=lines.current_influence[:, wanted],
        voltage_influence=lines.voltage_influence[:, wanted],
    )
