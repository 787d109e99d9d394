"""The slip that a load's ripple shows: of a motor in steady operation without a speed column its lines beside the supply's say how fast the shaft
turns, where currents and voltages alone hardly tell the slip from the rotor's resistance.

A torque that pulsates k times a turn makes the currents' lines at f_s +- k f_r (pairs about the supply, as seen from a frame that turns with
the voltage: W. T. Thomson, I. Culbert, Current Signature Analysis, Wiley-IEEE 2017, ch. 8). A fit whose shaft turns by a tenth of a turn otherwise
over the recording cannot find them: its ripple runs out of step with the load's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.fit import Machine, Problem, residuals, simulate
from commissioner.running.residual.shaft_lines import frame_of_voltage

Array = NDArray[np.float64]
ORDERS = (1, 2)
"""Times a turn: what the fitted load may have."""
LEAST_SLIP, MOST_SLIP = 0.15, 2.5
"""Of the rated slip: what a shaft under load may have."""
STANDS_OUT = 100.0
"""Of the median power of the searched range, from which a line is one: a fit anew takes as long as the first."""
BESIDE_BINS = 4
"""About the supply's own frequency, where an offset has its line."""
ALIKE = 0.01
"""Of the slip, within which the fit's own shaft is that of the line already."""


@dataclass(frozen=True)
class Slips:
    """Of one window: by the strongest pair of lines, and by the fitted shaft."""

    shown: float
    fitted: float


def slips_of(problem: Problem, machine: Machine) -> Slips | None:
    """Of the window whose lines stand out most; None where none do, or where the fitted shaft turns as they say."""
    record, best, found = problem.record, STANDS_OUT, None
    whitened = residuals(problem, machine)
    for w, rest, (_, shaft) in zip(record.windows, whitened, simulate(problem, machine), strict=True):
        frame, turn = frame_of_voltage(w)
        if np.count_nonzero(frame) < max(rest.shape[0] // 2, 2) or not turn > 0.0:
            continue
        supply_hz, seen = turn / problem.period, (rest[:, 0] + 1j * rest[:, 1]) * np.conj(frame)
        line = _strongest(seen, problem.period, supply_hz, record.scales.pole_pairs, record.plate.rated_slip)
        if line is None or line[0] < best:
            continue
        turns_hz = float(np.mean(np.abs(shaft[:, 0]))) / (2.0 * np.pi)
        best, found = line[0], Slips(line[1], 1.0 - turns_hz / supply_hz)
    if found is None or not found.fitted > 0.0 or abs(found.shown / found.fitted - 1.0) < ALIKE:
        return None
    return found


def _strongest(
    seen: NDArray[np.complex128], period_s: float, supply_hz: float, pole_pairs: int, rated_slip: float
) -> tuple[float, float] | None:
    """(power of the strongest pair of lines over the median, slip) of what is seen from the voltage's own frame."""
    n = seen.size
    spectrum = np.abs(np.fft.fft((seen - seen.mean()) * np.hanning(n))) ** 2
    pairs = spectrum[1 : n // 2] + spectrum[: n // 2 : -1][: n // 2 - 1]
    hz = np.arange(1, n // 2) / (n * period_s)
    found = None
    for order in ORDERS:
        slip = 1.0 - hz * pole_pairs / (order * supply_hz)
        is_asked = (slip > LEAST_SLIP * rated_slip) & (slip < MOST_SLIP * rated_slip)
        for k in (1, 2):
            is_asked &= np.abs(hz - k * supply_hz) > BESIDE_BINS / (n * period_s)
        if is_asked.sum() < 3 * BESIDE_BINS:
            continue
        power = np.where(is_asked, pairs, 0.0)
        top = int(np.argmax(power))
        if 0 < top < power.size - 1 and (found is None or pairs[top] / np.median(pairs[is_asked]) > found[0]):
            a, b, c = np.log(pairs[top - 1 : top + 2])
            off = 0.5 * (a - c) / (a - 2.0 * b + c)
            found = (
                float(pairs[top] / np.median(pairs[is_asked])),
                float(1.0 - (hz[top] + off / (n * period_s)) * pole_pairs / (order * supply_hz)),
            )
    return found
