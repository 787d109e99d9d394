"""What the voltage of an inverter is between two rows: means of neighbours, or held from a row to the next."""

from __future__ import annotations

from dataclasses import replace

from commissioner.estimation.fit import Column, Fit, Problem, refine
from commissioner.estimation.numbers import AT

OF_LEGS = (Column("p", AT["dead_voltage"]),)
CERTAIN = 36.0
"""Chi-square by which held voltages fit better where they are held."""
HELD_WORDS = "Each row's voltage is that from its row to the next, as an inverter holds it, and the current that at its row: so they fit best."


def _read_as(problem: Problem, *, is_held: bool) -> Problem:
    windows = []
    for w in problem.record.windows:
        voltage = w.voltage.copy()
        voltage[1::2] = voltage[:-2:2] if is_held else 0.5 * (voltage[:-2:2] + voltage[2::2])
        windows.append(replace(w, voltage=voltage))
    scales = replace(problem.record.scales, is_held=is_held)
    return replace(problem, record=replace(problem.record, windows=tuple(windows), scales=scales))


def best_reading(problem: Problem, fit: Fit) -> tuple[Problem, Fit]:
    """Problem and fit with the voltage between rows as it fits best, where an inverter renews it once a row; else as they are.

    Means over whole carrier periods of a sliding window lie on a straight line between two rows (read by a cubic, starts of seven motors at 3 and 4 kHz
    had L_M 0.05 to 0.19 % high, up to 3.9 stated errors). Under a held voltage the flux is a polygon, and currents sampled at its corners
    are more than the mean by what its corners stand out, through the leakage: L_M was 2.5 to 10 % low, up to 10.7 stated errors; with a delay
    of half a row fitted instead still 0.5 to 2.3 %. What the legs lose of a commanded voltage is free meanwhile.
    """
    if not problem.record.is_renewed:
        return problem, fit
    mean, held = _read_as(problem, is_held=False), _read_as(problem, is_held=True)
    by_means, by_holding = (refine(own, fit.machine, (*fit.columns, *OF_LEGS), is_final=False) for own in (mean, held))
    is_held = by_holding.chi2 + CERTAIN < by_means.chi2
    own, best = (held, by_holding) if is_held else (mean, by_means)
    fit = refine(own, best.machine.with_values({"dead_voltage": 0.0}), fit.columns)
    if not is_held:
        return mean, fit
    remarks = (*problem.record.remarks, HELD_WORDS)
    return replace(held, record=replace(held.record, remarks=remarks)), fit
