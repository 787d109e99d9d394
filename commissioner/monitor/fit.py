"""Circuit parameters from running data: theta = (R_s, R_r, L_m, L_l), leakages split as the start says.

Schantz & Leeb, (19), (20): a true speed has no imaginary part, and its mean is the shaft speed that the spectrum gave.
Here each line's imaginary part is weighed by its own noise plus a share of the line itself (a real machine's air gap
makes lines that no torque made), and a prior around the start keeps what the data leave open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from commissioner.monitor.averaging import Lines
from commissioner.monitor.inversion import basis_of, motion
from commissioner.monitor.supply import Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal

NAMES = ("R_s", "R_r", "L_m", "L_l")
PRIOR_FROM_NAMEPLATE = (0.40, 0.35, 0.30, 0.40)
"""Standard deviations of the logarithms of (R_s, R_r, L_m, L_l) around a nameplate start: published machines against it."""
PRIOR_FROM_COMMISSIONING = (0.12, 0.15, 0.08, 0.08)
"""A warm motor has up to 40 % more resistance than a cold one, and its own saturation."""
LINE_MODEL_ERROR = 0.01
"""Share of a line's speed amplitude that air-gap effects may put into its imaginary part."""
MEAN_IMAGINARY_ERROR = 2e-4
"""Of synchronous speed: iron loss and sensor phase put this much into the mean's imaginary part."""
DECADE = np.log(10.0)


@dataclass(frozen=True)
class Start:
    """Where the fit begins, how far it may be wrong (log std), and where it came from."""

    circuit: TCircuit
    log_std: tuple[float, float, float, float]
    origin: str


@dataclass(frozen=True)
class Fitted:
    """The circuit, the covariance of log(R_s, R_r, L_m, L_l), and what the data left to the prior.

    `open_direction` is the unit combination of the logarithms that the data fix worst; `open_share` says which part of its
    prior variance is left (1 = the data say nothing).
    """

    circuit: TCircuit
    log_covariance: NDArray[np.float64]
    open_direction: NDArray[np.float64]
    open_share: float
    chi_square_per_line: float
    imaginary_rms_rad_per_s: float


@dataclass(frozen=True)
class Problem:
    """The fit's data: lines, the grid on which the quotient is formed, and how to get back to lines from there."""

    lines: Lines
    pole_pairs: int
    mean_speed_rad_per_s: float
    mean_speed_std: float
    basis: Vector
    project: Vector
    partner: NDArray[np.int64]
    positive: NDArray[np.int64]


def pose(lines: Lines, phases_rad: list[Signal], pole_pairs: int, mean_speed: float, mean_std: float) -> Problem:
    """The problem on a grid `phases_rad` of instants that covers every comb several times."""
    basis = basis_of(lines, phases_rad)
    project = np.linalg.pinv(basis)
    positive = np.flatnonzero(lines.order > 0)
    partner = np.array([
        int(np.flatnonzero((lines.comb == lines.comb[k]) & (lines.order == -lines.order[k]))[0]) for k in positive
    ], dtype=np.int64)
    return Problem(lines, pole_pairs, mean_speed, mean_std, basis, project, partner, positive)


def split_speed(problem: Problem, circuit: TCircuit, current_a: Vector, voltage_v: Vector) -> tuple[complex, Vector, Vector]:
    """(mean, lines of the real part, lines of the imaginary part) of the complex speed."""
    lines = problem.lines
    made = motion(
        circuit, problem.pole_pairs, current_a, voltage_v, lines.rate_rad_per_s, lines.supply_rad_per_s, problem.basis
    )
    amplitude = problem.project @ made.speed_rad_per_s
    upper, lower = amplitude[problem.positive], np.conj(amplitude[problem.partner])
    return complex(amplitude[0]), 0.5 * (upper + lower), -0.5j * (upper - lower)


def fit(problem: Problem, start: Start) -> Fitted:
    """Bounded trust-region least squares within a decade of the start (20); two rounds, weights from the first."""
    centre = _logs(start.circuit)
    split = start.circuit.rotor_leakage_h / start.circuit.stator_leakage_h
    prior = np.array(start.log_std)
    theta = centre
    for _ in range(2):
        weights = _weights(problem, _circuit(theta, split))

        def residual(logs: NDArray[np.float64], weights: tuple[Signal, float, float] = weights) -> NDArray[np.float64]:
            return np.concatenate([_misfit(problem, _circuit(logs, split), weights), (logs - centre) / prior])

        solved = least_squares(
            residual, np.clip(theta, centre - 0.99 * DECADE, centre + 0.99 * DECADE), method="trf",
            bounds=(centre - DECADE, centre + DECADE), x_scale=prior, max_nfev=60,
        )
        theta = solved.x
    information = solved.jac.T @ solved.jac
    covariance = np.linalg.inv(information)
    circuit = _circuit(theta, split)
    data = solved.fun[: -len(prior)]
    direction, share = _open(covariance, prior)
    _, _, imaginary = split_speed(problem, circuit, problem.lines.current_a, problem.lines.voltage_v)
    return Fitted(
        circuit, covariance, direction, share, float(np.mean(data**2)),
        float(np.sqrt(2 * np.sum(np.abs(imaginary) ** 2))),
    )


def _open(covariance: NDArray[np.float64], prior: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """The combination with the largest share of its prior variance left."""
    scaled = covariance / np.outer(prior, prior)
    values, vectors = np.linalg.eigh(scaled)
    direction = vectors[:, -1] * prior
    direction = direction / np.linalg.norm(direction)
    return direction * np.sign(direction[int(np.argmax(np.abs(direction)))]), float(values[-1])


def _logs(circuit: TCircuit) -> NDArray[np.float64]:
    return np.log([
        circuit.stator_resistance_ohm, circuit.rotor_resistance_ohm, circuit.magnetizing_inductance_h,
        circuit.stator_leakage_h,
    ])


def _circuit(logs: NDArray[np.float64], split: float) -> TCircuit:
    r_s, r_r, l_m, l_l = (float(x) for x in np.exp(logs))
    return TCircuit(r_s, r_r, l_l, l_l * split, l_m)


def circuit_at(fitted: Fitted, step: NDArray[np.float64]) -> TCircuit:
    """The fitted circuit moved by `step` in the logarithms."""
    split = fitted.circuit.rotor_leakage_h / fitted.circuit.stator_leakage_h
    return _circuit(_logs(fitted.circuit) + step, split)


def _weights(problem: Problem, circuit: TCircuit) -> tuple[Signal, float, float]:
    """Standard deviations of the imaginary lines, of the mean's imaginary part and of its real part."""
    lines = problem.lines
    mean, real, imaginary = split_speed(problem, circuit, lines.current_a, lines.voltage_v)
    spread = np.zeros(real.size)
    mean_spread = 0.0
    for b in range(lines.current_influence.shape[0]):
        moved_mean, _, moved = split_speed(
            problem, circuit, lines.current_a + lines.current_influence[b], lines.voltage_v + lines.voltage_influence[b]
        )
        spread += np.abs(moved - imaginary) ** 2
        mean_spread += abs(moved_mean - mean) ** 2
    model = LINE_MODEL_ERROR * np.abs(real)
    synchronous = lines.supply_rad_per_s / problem.pole_pairs
    return (
        np.sqrt(0.5 * spread + model**2), float(np.hypot(np.sqrt(0.5 * mean_spread), MEAN_IMAGINARY_ERROR * synchronous)),
        float(np.hypot(np.sqrt(0.5 * mean_spread), problem.mean_speed_std)),
    )


def _misfit(problem: Problem, circuit: TCircuit, weights: tuple[Signal, float, float]) -> NDArray[np.float64]:
    line_std, mean_imaginary_std, mean_real_std = weights
    mean, _, imaginary = split_speed(problem, circuit, problem.lines.current_a, problem.lines.voltage_v)
    scaled = imaginary / line_std
    return np.concatenate([
        scaled.real, scaled.imag,
        [mean.imag / mean_imaginary_std, (mean.real - problem.mean_speed_rad_per_s) / mean_real_std],
    ])
