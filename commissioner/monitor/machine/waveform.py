"""Speed, torque and load torque within the period, with a standard deviation at every point.

Load torque (1): tau_l = tau_e - J d omega_r / dt, the derivative taken line by line in the frequency domain.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.machine.estimate import Kept, band_weights, speed_lines
from commissioner.monitor.machine.fit import Fitted, Problem, circuit_at, steps
from commissioner.monitor.machine.inversion import (
    RotorState,
    SpeedLines,
    basis_of,
    complex_speed,
    rotor_state,
    speed_noise,
    torque_of,
)
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal


@dataclass(frozen=True)
class Parts:
    """One number of each curve."""

    speed: float
    torque: float
    load_torque: float


@dataclass(frozen=True)
class Waveform:
    """At `(n,)` instants; the load torque is None where the inertia is unknown or the data cannot carry it. Standard deviations likewise."""

    time_s: Signal
    shaft_angle_rad: Signal
    speed_rad_per_s: Signal
    torque_nm: Signal
    load_torque_nm: Signal | None
    speed_std: Signal
    torque_std: Signal
    load_torque_std: Signal | None
    moving_std: Parts
    """Of the curves around their means, rms over the period: what a wrong mean shifts as a whole is not in it."""
    noise_rms: Parts
    """The part of the deviations that is drawn anew in each recording, rms over the period."""


@dataclass(frozen=True)
class Solved:
    """What the inversion found, as lines: enough to evaluate everything at any instant, and its small changes."""

    circuit: TCircuit
    speed: SpeedLines
    state: RotorState
    raw: SpeedLines
    weight: Vector
    kept: Kept
    changes: tuple[tuple[TCircuit, SpeedLines, Vector, Vector], ...]
    """Independent one-sigma changes: (circuit, speed lines, rotor flux lines, current lines)."""
    sensor_changes: int = 0
    """So many of them, the last ones, are the sensors'."""


def solve(problem: Problem, fitted: Fitted, kept: Kept) -> Solved:
    """The solution and one change per noise block and per direction of the parameters' covariance."""
    lines, on, pairs = problem.lines, problem.on, problem.pole_pairs
    weight = band_weights(problem, fitted)
    raw = speed_lines(problem, fitted, weight)
    speed = SpeedLines(raw.mean_rad_per_s, kept.share * raw.amplitude_rad_per_s)
    state = rotor_state(fitted.circuit, pairs, lines, on, speed)
    changes = [
        *_noise_changes(problem, fitted, speed, state, weight, kept),
        *_parameter_changes(problem, fitted, speed, weight, kept),
        *_model_changes(problem, fitted, speed, state, weight, kept),
    ]
    if np.isfinite(problem.mean_speed_std):
        moved = SpeedLines(speed.mean_rad_per_s + problem.mean_speed_std, speed.amplitude_rad_per_s)
        changes.append((fitted.circuit, moved, state.flux_wb, lines.current_a))
    return Solved(fitted.circuit, speed, state, raw, weight, kept, tuple(changes))


def _noise_changes(
    problem: Problem, fitted: Fitted, speed: SpeedLines, state: RotorState, weight: Vector, kept: Kept
) -> list[tuple[TCircuit, SpeedLines, Vector, Vector]]:
    """Each block's residual, in speed, flux and current together."""
    lines, on, pairs = problem.lines, problem.on, problem.pole_pairs
    circuit = fitted.circuit
    _, noise_up, noise_low = speed_noise(circuit, pairs, lines, on)
    noise = kept.share * (weight * noise_up + (1 - weight) * noise_low)
    drive = circuit.rotor_resistance_ohm * circuit.magnetizing_inductance_h / circuit.rotor_inductance_h
    flux_on = on.basis @ state.flux_wb
    changes = []
    for b in range(noise.shape[0]):
        wobble = 2 * np.real(on.basis[:, on.positive] @ noise[b])
        push = drive * lines.current_influence[b] + 1j * pairs * (on.project @ (wobble * flux_on))
        moved = SpeedLines(speed.mean_rad_per_s, speed.amplitude_rad_per_s + noise[b])
        changes.append(
            (circuit, moved, state.flux_wb + state.inverse @ push, lines.current_a + lines.current_influence[b])
        )
    return changes


def _model_changes(
    problem: Problem, fitted: Fitted, speed: SpeedLines, state: RotorState, weight: Vector, kept: Kept
) -> list[tuple[TCircuit, SpeedLines, Vector, Vector]]:
    """Each harmonic moved by its circuit error, real and imaginary part in turn, and all by each air-gap mode."""
    error = problem.band_error
    own = kept.share * np.hypot(np.abs(weight) * error.upper, np.abs(1 - weight) * error.lower) / np.sqrt(2.0)
    alone = np.diag(own).astype(np.complex128)
    gap = kept.share * (weight * error.gap_upper + (1 - weight) * error.gap_lower)
    return [
        (
            fitted.circuit,
            SpeedLines(speed.mean_rad_per_s, speed.amplitude_rad_per_s + move),
            state.flux_wb,
            problem.lines.current_a,
        )
        for move in (*alone, *(1j * alone), *gap[np.any(gap != 0, axis=1)])
    ]


def _parameter_changes(
    problem: Problem, fitted: Fitted, speed: SpeedLines, weight: Vector, kept: Kept
) -> list[tuple[TCircuit, SpeedLines, Vector, Vector]]:
    lines, on, pairs = problem.lines, problem.on, problem.pole_pairs
    _, start_up, start_low = complex_speed(fitted.circuit, pairs, lines, on)
    changes = []
    for step in steps(fitted):
        circuit = circuit_at(fitted, step)
        mean, upper, lower = complex_speed(circuit, pairs, lines, on)
        value = speed.mean_rad_per_s if np.isfinite(problem.mean_speed_std) else mean.real
        shift = kept.share * (weight * (upper - start_up) + (1 - weight) * (lower - start_low))
        moved = SpeedLines(value, speed.amplitude_rad_per_s + shift)
        changes.append((circuit, moved, rotor_state(circuit, pairs, lines, on, moved).flux_wb, lines.current_a))
    return changes


def evaluate(
    problem: Problem, solved: Solved, time_s: Signal, comb_phases_rad: Mapping[int, Signal], inertia_kg_m2: float | None
) -> Waveform:
    """All quantities at instants where the combs have the phases given."""
    lines, pairs = problem.lines, problem.pole_pairs
    basis = basis_of(lines, comb_phases_rad, time_s.size)
    inertia = inertia_kg_m2 or 0.0

    def shown(circuit: TCircuit, speed: SpeedLines, flux: Vector, current: Vector) -> Signal:
        turning, torque, acceleration = _at(circuit, pairs, problem, basis, speed, flux, current)
        return np.stack([turning, torque, torque - inertia * acceleration])

    value = shown(solved.circuit, solved.speed, solved.state.flux_wb, lines.current_a)
    change = np.stack([shown(*one) - value for one in solved.changes])
    left_out = np.array([solved.kept.speed_variance, 0.0, inertia**2 * solved.kept.acceleration_variance])
    std = np.sqrt(np.sum(change**2, axis=0) + left_out[:, None])
    moving = np.sqrt(np.sum(np.var(change, axis=2), axis=0) + left_out)
    noise = np.sqrt(np.sum(np.mean(change[: lines.current_influence.shape[0]] ** 2, axis=2), axis=0))
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (value[0][1:] + value[0][:-1]) * np.diff(time_s))])
    load = (None, None) if inertia_kg_m2 is None else (value[2], std[2])
    return Waveform(
        time_s, angle, value[0], value[1], load[0], std[0], std[1], load[1], Parts(*moving), Parts(*noise)
    )  # fmt: skip


def without_unknown_load(made: Waveform) -> Waveform:
    """No load torque where its movement's uncertainty is larger than the movement: such a curve would show noise."""
    if made.load_torque_nm is None or made.load_torque_std is None:
        return made
    if made.moving_std.load_torque < np.std(made.load_torque_nm):
        return made
    return replace(made, load_torque_nm=None, load_torque_std=None)


def _at(
    circuit: TCircuit, pairs: int, problem: Problem, basis: Vector, speed: SpeedLines, flux: Vector, current: Vector
) -> tuple[Signal, Signal, Signal]:
    """(speed, torque, acceleration) at the basis' instants."""
    positive = problem.on.positive
    rate = problem.lines.rate_rad_per_s[positive]
    both = basis[:, positive] @ np.stack([speed.amplitude_rad_per_s, 1j * rate * speed.amplitude_rad_per_s], axis=1)
    torque = torque_of(circuit, pairs, basis @ flux, basis @ current)
    return speed.mean_rad_per_s + 2 * both[:, 0].real, torque, 2 * both[:, 1].real


def mean_torque_nm(problem: Problem, solved: Solved) -> tuple[float, float, float]:
    """Mean electromagnetic torque over all combs' phases, its standard deviation, and the sensors' part of that."""
    on, lines = problem.on, problem.lines

    def mean(circuit: TCircuit, flux: Vector, current: Vector) -> float:
        return float(torque_of(circuit, problem.pole_pairs, on.basis @ flux, on.basis @ current).mean())

    value = mean(solved.circuit, solved.state.flux_wb, lines.current_a)
    moved = [mean(circuit, flux, current) - value for circuit, _, flux, current in solved.changes]
    sensors = moved[len(moved) - solved.sensor_changes :]
    return value, float(np.sqrt(np.sum(np.square(moved)))), float(np.sqrt(np.sum(np.square(sensors))))
