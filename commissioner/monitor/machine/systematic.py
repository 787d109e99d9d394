"""The share of iron loss and sensors in every standard deviation: fit and inversion repeated with the lines moved by one sigma of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.monitor.intake.terminals import IRON_STD
from commissioner.monitor.machine import fit as fitting
from commissioner.monitor.machine.estimate import speed_lines
from commissioner.monitor.machine.fit import Fitted, Problem, Start
from commissioner.monitor.machine.inversion import SpeedLines, rotor_state
from commissioner.monitor.machine.waveform import Solved
from commissioner.monitor.signals.averaging import Lines, keep
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.running import TCircuit


def with_systematic(
    solved: Solved, gain_std: float, lines: Lines, mains: int, problem: Problem, fitted: Fitted, start: Start
) -> Solved:
    """Four more changes: iron loss, gain of the currents, gain of the voltages, the currents' delay beyond what was found of it.

    `lines` are those of the fit, `problem` holds the loads' part; the harmonics' weights and shares stay. Iron and gains are followed by a
    fit of their own; how the circuit goes with the delay is in the fit's covariance.
    """
    larger = 1 + gain_std
    of_iron = replace(lines, current_a=lines.current_a - _iron_current(lines, solved.circuit))
    made = []
    for moved in (
        of_iron,
        replace(lines, current_a=lines.current_a * larger),
        replace(lines, voltage_v=lines.voltage_v * larger),
    ):
        wanted = fitting.informative(moved, mains)
        speed, std = problem.mean_speed_rad_per_s, problem.mean_speed_std
        posed = fitting.pose(keep(moved, wanted), solved.circuit, problem.pole_pairs, speed, std)
        again = fitting.fit(posed, start, solved.circuit)
        made.append(_change(solved, problem, keep(moved, moved.comb < mains), again))
    late = fitted.log_per_s * fitted.delay_std_s
    earlier = fitting.advanced(keep(lines, lines.comb < mains), fitted.delay_std_s)
    made.append(_change(solved, problem, earlier, replace(fitted, circuit=fitting.circuit_at(fitted, late))))
    return replace(solved, changes=(*solved.changes, *made), sensor_changes=len(made) - 1)


def _iron_current(lines: Lines, circuit: TCircuit) -> Vector:
    """What a conductance behind R_s takes whose loss is `IRON_STD` of the apparent power; by the terminals it is one with torque."""
    behind = lines.voltage_v - circuit.stator_resistance_ohm * lines.current_a
    return np.asarray(IRON_STD * abs(lines.current_a[0]) / abs(behind[0]) * behind)


def _change(
    solved: Solved, problem: Problem, loads: Lines, fitted: Fitted
) -> tuple[TCircuit, SpeedLines, Vector, Vector]:
    """(circuit, speed lines, rotor flux lines, current lines) as other lines and another fit give them."""
    raw = speed_lines(replace(problem, lines=loads), fitted, solved.weight)
    turned = SpeedLines(raw.mean_rad_per_s, solved.kept.share * raw.amplitude_rad_per_s)
    state = rotor_state(fitted.circuit, problem.pole_pairs, loads, problem.on, turned)
    return fitted.circuit, turned, state.flux_wb, loads.current_a
