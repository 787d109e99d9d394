"""Which combs are solved together, and their phases where one load's ripple moves another's."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np

from commissioner.monitor.intake.findings import Finding
from commissioner.monitor.machine.estimate import Kept, band_weights, speed_lines
from commissioner.monitor.machine.fit import Fitted, Problem
from commissioner.monitor.periods.combs import Found
from commissioner.monitor.periods.periods import MOST_TURNS, VISIBLE, PairSpectrum, Periodicity
from commissioner.monitor.signals.averaging import Comb
from commissioner.monitor.signals.tracking import PhaseDrift

FM_MATTERS_RAD = 0.02
MOST_PAIRS = 6
SAME_LINE = 3e-4
"""Of a frequency: whole-number ratios of gears and belts with teeth are met as well as that, belts that slip are not."""


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


def pole_count(found: Found, spectrum: PairSpectrum, pairs: int, given_hz: tuple[float, ...]) -> Finding | None:
    """Whether the lines ask for another number of poles than the plate's; the slip is the same for each.

    A line at p / p' of the shaft's frequency is where the once-per-turn line of a motor of p' pole pairs lies. It is
    taken for one where it is a whole part of a turn, or where the shaft's own first line is missing. If, the other way
    round, only every second (third) order is there, a load with as many pulses per turn explains it as well: said only.
    """
    shaft = found.shaft
    assert shaft is not None
    visible = [h for h in range(1, 9) if spectrum.at(np.array([h * shaft.frequency_hz]), 0.3)[0] > VISIBLE]
    for load in found.loads:
        for other in range(1, MOST_PAIRS + 1):
            near = abs(load.frequency_hz * other / (pairs * shaft.frequency_hz) - 1) < SAME_LINE
            told = any(abs(load.frequency_hz - f) < 0.01 * f for f in given_hz)
            if near and other != pairs and not told and (other % pairs == 0 or 1 not in visible):
                return Finding(
                    "pole_count",
                    "refused",
                    f"the load line at {load.frequency_hz:.4g} Hz is the shaft of a motor with {2 * other} poles; "
                    f"the plate says {2 * pairs}, with which the shaft turns at {shaft.frequency_hz:.4g} Hz",
                    2 * pairs,
                    2 * other,
                    "correct pole_pairs and rated_speed_rpm; if a load truly turns at that frequency, give it (--load-hz)",
                )
    for step in range(pairs, 1, -1):
        if pairs % step == 0 and visible and all(h % step == 0 for h in visible):
            return Finding(
                "pole_count",
                "note",
                f"only every {step}. order of the shaft is seen: a load with {step} pulses per turn, or a motor of "
                f"{2 * pairs // step} poles (then the speed is {step} times higher and the torque so much lower)",
                2 * pairs,
                2 * pairs // step,
                "compare poles and speed with the plate of this very motor",
            )
    return None


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
