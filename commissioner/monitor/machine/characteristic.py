"""One characteristic period as it is shown, and what is reported of each comb in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.monitor.intake.findings import Audited
from commissioner.monitor.machine import waveform
from commissioner.monitor.machine.fit import Problem
from commissioner.monitor.machine.waveform import Solved, Waveform
from commissioner.monitor.periods.periods import Periodicity
from commissioner.monitor.signals.averaging import Comb
from commissioner.monitor.signals.supply import TurningFrame
from commissioner.records import Signal

POINTS_PER_TURN = 360
MOST_POINTS = 7200


@dataclass(frozen=True)
class LoadPeriod:
    """One periodicity as reported: what it is, how long, how sure, how much it moves the shaft."""

    name: str
    frequency_hz: float
    frequency_std_hz: float
    ratio_to_shaft: float
    follows: str
    harmonics: int
    periods_averaged: float
    speed_ripple_rad_per_s: float
    evidence: float


def characteristic(
    audited: Audited,
    frame: TurningFrame,
    part: slice,
    combs: tuple[Comb, ...],
    shaft_hz: float,
    problem: Problem,
    solved: Solved,
    inertia: float | None,
) -> Waveform:
    """One longest period from the segment's middle on, at `POINTS_PER_TURN` points a shaft turn."""
    longest = 1 / min(comb.frequency_hz for comb in combs)
    count = int(min(max(POINTS_PER_TURN * longest * shaft_hz, POINTS_PER_TURN), MOST_POINTS))
    time = frame.time_s[part]
    middle = float(time[time.size // 2])
    instants = middle + longest * np.arange(count) / count
    phases = {p: np.interp(instants, time, comb.phase_rad) for p, comb in enumerate(combs)}
    if len(combs) == 1:
        phases = {0: 2 * np.pi * np.arange(count) / count + float(np.interp(middle, time, combs[0].phase_rad))}
    made = waveform.without_unknown_load(waveform.evaluate(problem, solved, instants, phases, inertia))
    return replace(made, time_s=made.time_s + audited.start_s)


def load_periods(
    members: list[Periodicity],
    combs: tuple[Comb, ...],
    shaft_hz: float,
    problem: Problem,
    solved: Solved,
    length_s: float,
) -> list[LoadPeriod]:
    """What is reported of each comb; `length_s` is that of the segment."""
    made = []
    owner: NDArray[np.int64] = problem.lines.comb[problem.on.positive]
    for p, (member, comb) in enumerate(zip(members, combs, strict=True)):
        own = solved.speed.amplitude_rad_per_s[owner == p]
        ripple: Signal = np.abs(own)
        made.append(
            LoadPeriod(
                member.name,
                member.frequency_hz,
                member.frequency_std_hz,
                member.frequency_hz / shaft_hz,
                comb.follows,
                int(own.size),
                length_s * member.frequency_hz,
                float(np.sqrt(2 * np.sum(ripple**2))),
                member.evidence,
            )
        )
    return made
