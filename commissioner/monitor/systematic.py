"""The sensors' share of every standard deviation: fit and inversion repeated with the lines moved by one sigma of each mistake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.monitor import fit as fitting
from commissioner.monitor.averaging import Lines, keep
from commissioner.monitor.estimate import speed_lines
from commissioner.monitor.fit import Problem, Start
from commissioner.monitor.inversion import SpeedLines, rotor_state
from commissioner.monitor.sensors import Trust
from commissioner.monitor.waveform import Solved


def with_sensors(solved: Solved, trust: Trust, lines: Lines, mains: int, problem: Problem, start: Start) -> Solved:
    """Three more changes: gain of the currents, gain of the voltages, the currents' delay.

    `lines` are those of the fit, `problem` holds the loads' part; the harmonics' weights and shares stay.
    """
    delay = np.exp(-1j * (lines.rate_rad_per_s + lines.supply_rad_per_s) * trust.skew_std_s)
    larger = 1 + trust.gain_std
    made = []
    for current, voltage in ((larger, 1.0), (1.0, larger), (delay, 1.0)):
        moved = replace(lines, current_a=lines.current_a * current, voltage_v=lines.voltage_v * voltage)
        wanted = fitting.informative(moved, mains)
        speed, std = problem.mean_speed_rad_per_s, problem.mean_speed_std
        posed = fitting.pose(keep(moved, wanted), solved.circuit, problem.pole_pairs, speed, std)
        again = fitting.fit(posed, start, solved.circuit)
        loads = keep(moved, moved.comb < mains)
        raw = speed_lines(replace(problem, lines=loads), again, solved.weight)
        turned = SpeedLines(raw.mean_rad_per_s, solved.kept.share * raw.amplitude_rad_per_s)
        state = rotor_state(again.circuit, problem.pole_pairs, loads, problem.on, turned)
        made.append((again.circuit, turned, state.flux_wb, loads.current_a))
    return replace(solved, changes=(*solved.changes, *made), sensor_changes=len(made))
