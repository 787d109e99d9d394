"""An extended running model played: by the voltages of a recording, or started and loaded on ideal mains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.fit import Machine, Problem, columns_of, plain_machine, problem_of, refine, simulate
from commissioner.estimation.held import best_reading
from commissioner.estimation.kernels.march import STATES
from commissioner.estimation.numbers import Scales
from commissioner.estimation.record import Record, between, prepare
from commissioner.estimation.window import Window
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording
from commissioner.running.nominal import RIPPLE

Array = NDArray[np.float64]
SECONDS = 3.0


def play(
    machine: Machine, scales: Scales, plate: Nameplate, period_s: float, like: RunningRecording | None, scenario: Mapping[str, Any],
    noise_a: float, seed: int,
) -> dict[str, Array]:  # fmt: skip
    """The contract's columns of a running recording; the first window of `like` gives voltages and, where measured, speed."""
    if like is None:
        machine, problem = _on_mains(machine, scales, plate, period_s, scenario)
    else:
        machine, problem = _beside(machine, like, plate)
    window = problem.record.windows[0]
    run, shaft = simulate(problem, machine)[0]
    current = np.array(
        [run[:, 0] + run[:, 2], *(run[:, 2] - 0.5 * run[:, 0] + s * np.sqrt(0.75) * run[:, 1] for s in (1.0, -1.0))]
    )
    current += noise_a * np.random.default_rng(seed).standard_normal(current.shape)
    a, b = window.voltage[::2].T
    volts = (a, -0.5 * a + np.sqrt(0.75) * b, -0.5 * a - np.sqrt(0.75) * b)
    columns = {"time_s": window.time_s}
    columns |= {f"current_{p}_a": current[k] for k, p in enumerate("uvw")}
    columns |= {f"voltage_{p}_v": volts[k] for k, p in enumerate("uvw")}
    return columns | {"speed_rad_per_s": shaft[:, 0] / plate.pole_pairs}


def _beside(machine: Machine, like: RunningRecording, plate: Nameplate) -> tuple[Machine, Problem]:
    """On the recording's first window, with what is its own and not the motor's fitted to its currents: fluxes (and a speed that is not
    measured) at its first sample, which comes up to a sample after the contactor closed, and the encoder's ripple. An inverter's voltage is read
    between rows as it fits best, as a fit reads it."""
    record = prepare([like], plate)
    record = replace(record, windows=record.windows[:1])
    problem = problem_of(record, 0.0)
    began = plain_machine(machine.physical()[:4].tolist(), record, has_shaft=not record.has_speed)
    machine = replace(began, theta=machine.theta)
    columns = columns_of(RIPPLE if record.has_speed else (), record, machine)
    problem, fit = best_reading(problem, refine(problem, machine, columns, is_final=False))
    return fit.machine, problem


def _on_mains(
    machine: Machine, scales: Scales, plate: Nameplate, period: float, scenario: Mapping[str, Any]
) -> tuple[Machine, Problem]:
    """A start and two load steps on symmetric mains of the plate, with the shaft of the scenario."""
    count = round(SECONDS / period)
    t = np.arange(count, dtype=np.float64) * np.float64(period)
    u = scales.voltage_v * np.exp(1j * scales.frequency_rad_per_s * t)
    voltage = np.stack([between(u.real), between(u.imag)], axis=1)
    window = Window(t, np.zeros((count, 3)), voltage, np.zeros((2 * count - 1, 2)), np.zeros(count, np.int64), True)
    record = Record((window,), period, scales, plate, False, True, False, False, (1.0, 1.0, 1.0), 0.0)
    inertia = float(
        scenario.get("machine", {}).get(
            "inertia_kg_m2", 0.5 * scales.torque_nm * scales.pole_pairs / scales.frequency_rad_per_s
        )
    )
    times = np.array([[0.0, 0.3, 0.4, 1.0, 1.01, 2.0, 2.01, SECONDS]])
    knots = np.array([[0.0, 0.0, 0.1, 0.1, 0.5, 0.5, 0.9, 0.9]])
    moved = replace(machine, has_shaft=True, knots=knots, knot_times_s=times, first=np.zeros((1, STATES)))
    return moved.with_values({"inertia": inertia}), problem_of(record, 0.0)
