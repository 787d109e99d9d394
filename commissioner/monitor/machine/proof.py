"""The proof without an encoder: drive the fifth-order model with the measured voltage and the estimated speed.

Schantz & Leeb, section III-C and Fig. 5b: if fluxes, speed and parameters are right, the currents come out as measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from commissioner.estimation.driven import driven
from commissioner.monitor.intake.findings import Audited
from commissioner.monitor.machine.fit import Problem
from commissioner.monitor.machine.inversion import basis_of
from commissioner.monitor.machine.waveform import Solved
from commissioner.monitor.signals.averaging import Comb
from commissioner.monitor.signals.supply import TurningFrame, Vector
from commissioner.records import Signal

LENGTH_S = 1.0
SETTLING_S = 0.3
"""Left out of the comparison: the state at the start is known without its mains harmonics."""


@dataclass(frozen=True)
class Proof:
    """`relative_rms`: all of the current, noise and mains harmonics included; `periodic_share`: the part that repeats with
    the load, error over ripple. The two current vectors `(n,)` are in the turning frame, at `time_s` of the recording.
    """

    relative_rms: float
    periodic_share: float
    time_s: Signal
    measured_a: Vector
    simulated_a: Vector


def prove(
    audited: Audited,
    frame: TurningFrame,
    part: slice,
    combs: tuple[Comb, ...],
    problem: Problem,
    solved: Solved,
    delay_s: float = 0.0,
) -> Proof:
    """Re-simulation of about a second from the middle of the segment, at the recording's own rate.

    The measured currents are read `delay_s` later, which is how late their sensors were found to be.
    """
    assert audited.supply is not None
    period = audited.sample_period_s
    time_part = frame.time_s[part]
    middle = float(time_part[time_part.size // 2])
    length = min(LENGTH_S + SETTLING_S, 0.45 * float(np.ptp(time_part)))
    first, count = int(middle / period), int(length / period)
    window = slice(first, first + count)
    time = np.arange(first, first + count) * period
    turn = np.exp(-1j * (audited.supply.angle_rad(time) - frame.start_angle_rad))
    every = np.arange(audited.current_a.size) * period
    near = slice(max(first - 8, 0), first + count + 8)
    measured = CubicSpline(every[near], audited.current_a[near])(time + delay_s) * turn
    phases = {p: np.interp(time, time_part, comb.phase_rad) for p, comb in enumerate(combs)}
    basis = basis_of(problem.lines, phases, count)
    speed = solved.speed.mean_rad_per_s + 2 * np.real(basis[:, problem.on.positive] @ solved.speed.amplitude_rad_per_s)
    circuit = solved.circuit
    flux = complex(basis[0] @ solved.state.flux_wb) * circuit.magnetizing_inductance_h / circuit.rotor_inductance_h
    current = driven(
        circuit.as_inverse_gamma(),
        audited.voltage_v[window],
        problem.pole_pairs * speed,
        period,
        complex(basis[0] @ problem.lines.current_a) / turn[0],
        flux / turn[0],
    )
    simulated = current * turn
    keep = slice(int(SETTLING_S / length * count), count)
    error = simulated[keep] - measured[keep]
    whole = float(np.sqrt(np.mean(np.abs(error) ** 2) / np.mean(np.abs(measured[keep]) ** 2)))
    return Proof(
        whole,
        _periodic(basis[keep], error, measured[keep]),
        np.asarray(time[keep] + audited.start_s, dtype=np.float64),
        measured[keep],
        simulated[keep],
    )


def _periodic(basis: Vector, error: Vector, measured: Vector) -> float:
    """rms of the error's load lines over the measured ripple's."""
    count = basis.shape[0]
    gram = np.conj(basis.T) @ basis
    ridge = 1e-6 * count * np.eye(basis.shape[1])
    fit = np.linalg.solve(gram + ridge, np.conj(basis.T) @ np.stack([error, measured], axis=1))
    power = np.sum(np.abs(fit) ** 2, axis=0) - np.abs(fit[0]) ** 2
    return float(np.sqrt(power[0] / power[1])) if count > basis.shape[1] and power[1] > 0 else float("nan")
