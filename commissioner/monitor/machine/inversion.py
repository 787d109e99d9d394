"""From the lines of voltage and current to fluxes, speed and torque.

Schantz & Leeb, (10)-(18), with the signs corrected (see `commissioner.motor.running`) and the amplitude-invariant torque
factor. Every comb is solved in the frequency domain; fluxes and slip voltage are summed over all lines at the instants
wanted, the mean counted once: that is (17)-(18) without an interpolation.

One step is added. The line at -p times the shaft frequency stands nearly still in stator coordinates (at slip times
f_e): there (10) divides by almost zero, and its noise and every error of R_s grow some thirtyfold. A true speed has both
side bands, so each harmonic is taken from the two by their variances, and the torque from the rotor's own equation
driven by that speed, which divides by nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from commissioner.monitor.signals.averaging import Lines
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal


@dataclass(frozen=True)
class FluxLines:
    """Stator and rotor flux of each line, and the numerator of (14), d lambda_r / dt + R_r i_r."""

    stator_flux_wb: Vector
    rotor_flux_wb: Vector
    slip_voltage_v: Vector


@dataclass(frozen=True)
class Torus:
    """Instants that cover the phases of all combs evenly, the basis e^{j order phase} `(n, k)` there, and the way back.

    For one comb this is one period. For several the phases are independent, so the instants are a lattice on the torus:
    products of two combs then average out instead of leaking into the lines.
    """

    basis: Vector
    project: Vector
    positive: NDArray[np.int64]
    partner: NDArray[np.int64]


def flux_lines(
    circuit: TCircuit, current_a: Vector, voltage_v: Vector, rate_rad_per_s: Signal, supply: float
) -> FluxLines:
    """(10), (12), (13), (16) line by line, all `(..., k)`.

    Lambda_s = (V - R_s I) / j(rate + omega_e); Lambda_r = (L_ar Lambda_s + D I) / L_m; I_r = (L_m Lambda_s - L_as
    Lambda_r) / D; slip voltage = d lambda_r / dt + R_r i_r.
    """
    d = circuit.determinant_h2
    l_m = circuit.magnetizing_inductance_h
    stator = (voltage_v - circuit.stator_resistance_ohm * current_a) / (1j * (rate_rad_per_s + supply))
    rotor = (circuit.rotor_inductance_h * stator + d * current_a) / l_m
    rotor_current = (l_m * stator - circuit.stator_inductance_h * rotor) / d
    return FluxLines(stator, rotor, 1j * rate_rad_per_s * rotor + circuit.rotor_resistance_ohm * rotor_current)


def torus(lines: Lines) -> Torus:
    """Instants enough for eight times the lines; one comb: one period, several: a golden lattice."""
    combs = sorted({int(p) for p in lines.comb} - {-1})
    count = max(64, 8 * lines.comb.size)
    place = np.arange(count)
    if len(combs) <= 1:
        phases = dict.fromkeys(combs, 2 * np.pi * place / count)
    else:
        root = brentq(lambda x: x ** (len(combs) + 1) - x - 1, 1.0, 2.0)
        phases = {p: 2 * np.pi * place * root ** -(k + 1) for k, p in enumerate(combs)}
    basis = basis_of(lines, phases, count)
    positive = np.flatnonzero(lines.order > 0)
    partner = np.array(
        [int(np.flatnonzero((lines.comb == lines.comb[k]) & (lines.order == -lines.order[k]))[0]) for k in positive],
        dtype=np.int64,
    )
    project = np.asarray(np.linalg.solve(np.conj(basis.T) @ basis, np.conj(basis.T)), dtype=np.complex128)
    return Torus(basis, project, positive, partner)


def basis_of(lines: Lines, comb_phases_rad: Mapping[int, Signal], count: int) -> Vector:
    """`(count, k)`: e^{j order phase} of each line where the combs' phases are `comb_phases_rad` `(count,)` each."""
    columns = [
        np.ones(count, dtype=np.complex128) if p < 0 else np.exp(1j * h * comb_phases_rad[p])
        for p, h in zip(lines.comb, lines.order, strict=True)
    ]
    return np.stack(columns, axis=1)


def complex_speed(circuit: TCircuit, pole_pairs: int, lines: Lines, on: Torus) -> tuple[complex, Vector, Vector]:
    """(14) on the torus, back in lines: the mean, the upper side bands, and the conjugates of the lower ones.

    omega_r = ((d lambda_r/dt + R_r i_r) / (j lambda_r) + omega_e) / p. A true speed has upper = conj(lower).
    """
    flux = flux_lines(circuit, lines.current_a, lines.voltage_v, lines.rate_rad_per_s, lines.supply_rad_per_s)
    rotor, slip = (on.basis @ np.stack([flux.rotor_flux_wb, flux.slip_voltage_v], axis=1)).T
    speed = (slip / (1j * rotor) + lines.supply_rad_per_s) / pole_pairs
    amplitude = on.project @ speed
    return complex(amplitude[0]), amplitude[on.positive], np.conj(amplitude[on.partner])


def moved_speed(
    circuit: TCircuit, pole_pairs: int, lines: Lines, on: Torus, current_change_a: Vector, voltage_change_v: Vector
) -> tuple[Vector, Vector, Vector]:
    """What small changes `(b, k)` of the lines do to (mean, upper, conj lower), first order: `(b,)`, `(b, m)` twice.

    delta omega = (delta slip voltage - j q delta lambda_r) / (j Lambda_0 p) with q the mean slip frequency.
    """
    rate, supply = lines.rate_rad_per_s, lines.supply_rad_per_s
    mean = flux_lines(circuit, lines.current_a[:1], lines.voltage_v[:1], rate[:1], supply)
    slip_frequency = mean.slip_voltage_v / (1j * mean.rotor_flux_wb)
    flux = flux_lines(circuit, current_change_a, voltage_change_v, rate, supply)
    moved = (flux.slip_voltage_v - 1j * slip_frequency * flux.rotor_flux_wb) / (1j * mean.rotor_flux_wb * pole_pairs)
    return moved[:, 0], moved[:, on.positive], np.conj(moved[:, on.partner])


def speed_noise(circuit: TCircuit, pole_pairs: int, lines: Lines, on: Torus) -> tuple[Vector, Vector, Vector]:
    """`moved_speed` of each block's residual."""
    return moved_speed(circuit, pole_pairs, lines, on, lines.current_influence, lines.voltage_influence)


@dataclass(frozen=True)
class SpeedLines:
    """Real speed: mean and complex amplitude of each positive order, omega(t) = mean + 2 Re sum Omega e^{j order phase}."""

    mean_rad_per_s: float
    amplitude_rad_per_s: Vector


@dataclass(frozen=True)
class RotorState:
    """Rotor flux of each line, and the inverse of the operator that made it (to propagate small changes)."""

    flux_wb: Vector
    inverse: Vector


def speed_on(on: Torus, speed: SpeedLines) -> Signal:
    """The real speed at the torus' instants."""
    return np.asarray(speed.mean_rad_per_s + 2 * np.real(on.basis[:, on.positive] @ speed.amplitude_rad_per_s))


def rotor_state(circuit: TCircuit, pole_pairs: int, lines: Lines, on: Torus, speed: SpeedLines) -> RotorState:
    """The periodic solution of d lambda_r/dt = j (p omega_r - omega_e) lambda_r - R_r i_r, i_r = (lambda_r - L_m i_s)/L_ar."""
    slip = pole_pairs * speed_on(on, speed) - lines.supply_rad_per_s
    decay = circuit.rotor_resistance_ohm / circuit.rotor_inductance_h
    operator = np.diag(1j * lines.rate_rad_per_s + decay) - 1j * (on.project * slip) @ on.basis
    inverse = np.asarray(np.linalg.inv(operator), dtype=np.complex128)
    flux = inverse @ (decay * circuit.magnetizing_inductance_h * lines.current_a)
    return RotorState(flux, inverse)


def torque_of(circuit: TCircuit, pole_pairs: int, rotor_flux_wb: Vector, current_a: Vector) -> Signal:
    """(15) with lambda_s eliminated: (3/2) p (L_m / L_ar) Im{lambda_r* i_s}, at any instants."""
    coupling = circuit.magnetizing_inductance_h / circuit.rotor_inductance_h
    return np.asarray(1.5 * pole_pairs * coupling * np.imag(np.conj(rotor_flux_wb) * current_a))
