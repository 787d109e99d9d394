"""Which combs are solved together, and their phases where one load's ripple moves another's."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from commissioner.monitor.averaging import Comb
from commissioner.monitor.combs import Found
from commissioner.monitor.estimate import Kept, band_weights, speed_lines
from commissioner.monitor.fit import Fitted, Problem
from commissioner.monitor.periods import Periodicity
from commissioner.monitor.tracking import PhaseDrift

MOST_TURNS = 6
"""A load that repeats after at most so many shaft turns is one comb with the shaft."""
FM_MATTERS_RAD = 0.02


def members_of(found: Found) -> list[Periodicity]:
    """Shaft and loads; a load at a rational share of the shaft becomes one comb with it, of the longest common period."""
    assert found.shaft is not None
    shaft = found.shaft
    independent: list[Periodicity] = []
    divisor = 1
    for load in found.loads:
        ratio = Fraction(load.frequency_hz / shaft.frequency_hz).limit_denominator(MOST_TURNS)
        apart = abs(load.frequency_hz - shaft.frequency_hz * ratio.numerator / ratio.denominator)
        if apart < 4 * float(np.hypot(load.frequency_std_hz, shaft.frequency_std_hz)) + 1e-5 * shaft.frequency_hz:
            divisor = int(np.lcm(divisor, ratio.denominator))
        else:
            independent.append(load)
    if divisor > 1:
        drift = shaft.drift
        slow = PhaseDrift(drift.polynomial / divisor, drift.centre_s, drift.half_s) if drift else None
        shaft = replace(
            shaft,
            name=f"{divisor} shaft turns",
            frequency_hz=shaft.frequency_hz / divisor,
            frequency_std_hz=shaft.frequency_std_hz / divisor,
            drift=slow,
        )
    return [shaft, *independent]


def with_wobble(
    combs: tuple[Comb, ...], problem: Problem, fitted: Fitted, kept: Kept, shaft_speed: float
) -> tuple[Comb, ...] | None:
    """Combs locked to the shaft with the phase that the other loads' speed ripple gives it; None where it is small.

    delta phi = integral of the ripple of all combs that do not follow the shaft: sum 2 Re(Omega / (j rate) e^{j phase}).
    """
    speed = speed_lines(problem, fitted, band_weights(problem, fitted))
    lines, on = problem.lines, problem.on
    orders, owner, rate = lines.order[on.positive], lines.comb[on.positive], lines.rate_rad_per_s[on.positive]
    wobble = np.zeros(combs[0].phase_rad.size)
    for p, comb in enumerate(combs[1:], start=1):
        for k in np.flatnonzero(owner == p):
            amplitude = 2 * kept.share[k] * speed.amplitude_rad_per_s[k] / (1j * rate[k])
            if abs(amplitude) > 1e-5:
                wobble = wobble + np.real(amplitude * np.exp(1j * orders[k] * comb.phase_rad))
    if np.abs(wobble).max() * 8 < FM_MATTERS_RAD:
        return None
    bent = [
        replace(combs[0], phase_rad=combs[0].phase_rad + wobble * (2 * np.pi * combs[0].frequency_hz / shaft_speed))
    ]
    return (*bent, *combs[1:])
