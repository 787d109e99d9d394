"""From the lines of voltage and current to fluxes, speed and torque within one period.

Schantz & Leeb, (10)-(18), with the signs corrected (see `commissioner.motor.running`) and the amplitude-invariant torque
factor. Every comb is solved in the frequency domain; fluxes, their derivatives and rotor currents are then summed over
all lines at the instants wanted, the mean counted once: that is (17)-(18) without an interpolation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from commissioner.monitor.averaging import Lines
from commissioner.monitor.supply import Vector
from commissioner.motor.running import TCircuit
from commissioner.records import Signal


@dataclass(frozen=True)
class FluxLines:
    """Stator and rotor flux of each line `(k,)`, and the numerator of (14) and its time derivative."""

    stator_flux_wb: Vector
    rotor_flux_wb: Vector
    slip_voltage_v: Vector


@dataclass(frozen=True)
class Motion:
    """At `(n,)` instants: shaft speed (complex; a true speed has no imaginary part), its derivative, and the torque."""

    speed_rad_per_s: Vector
    acceleration_rad_per_s2: Signal
    torque_nm: Signal
    stator_flux_wb: Vector
    rotor_flux_wb: Vector


def flux_lines(circuit: TCircuit, current_a: Vector, voltage_v: Vector, rate_rad_per_s: Signal, supply: float) -> FluxLines:
    """(10), (12), (13), (16) line by line.

    Lambda_s = (V - R_s I) / j(rate + omega_e); Lambda_r = (L_ar Lambda_s + D I) / L_m; I_r = (L_m Lambda_s - L_as
    Lambda_r) / D; slip voltage = d lambda_r / dt + R_r i_r.
    """
    d = circuit.determinant_h2
    l_m = circuit.magnetizing_inductance_h
    stator = (voltage_v - circuit.stator_resistance_ohm * current_a) / (1j * (rate_rad_per_s + supply))
    rotor = (circuit.rotor_inductance_h * stator + d * current_a) / l_m
    rotor_current = (l_m * stator - circuit.stator_inductance_h * rotor) / d
    return FluxLines(stator, rotor, 1j * rate_rad_per_s * rotor + circuit.rotor_resistance_ohm * rotor_current)


def motion(
    circuit: TCircuit, pole_pairs: int, current_a: Vector, voltage_v: Vector, rate_rad_per_s: Signal, supply: float,
    basis: Vector,
) -> Motion:
    """(14), (15) at the instants of `basis` `(n, k)`, whose columns are e^{j phase of line k}.

    omega_r = ((d lambda_r/dt + R_r i_r) / (j lambda_r) + omega_e) / p, torque = (3/2) p (L_m / D) Im{lambda_s* lambda_r};
    the derivative of the quotient is taken line by line as well.
    """
    lines = flux_lines(circuit, current_a, voltage_v, rate_rad_per_s, supply)
    rate = 1j * rate_rad_per_s
    stacked = np.stack(
        [lines.stator_flux_wb, lines.rotor_flux_wb, rate * lines.rotor_flux_wb, lines.slip_voltage_v,
         rate * lines.slip_voltage_v], axis=1,
    )
    lambda_s, lambda_r, lambda_r_dot, slip_v, slip_v_dot = (basis @ stacked).T
    quotient = slip_v / (1j * lambda_r)
    slope = (slip_v_dot - quotient * 1j * lambda_r_dot) / (1j * lambda_r)
    torque = 1.5 * pole_pairs * circuit.magnetizing_inductance_h / circuit.determinant_h2 * np.imag(
        np.conj(lambda_s) * lambda_r
    )
    return Motion((quotient + supply) / pole_pairs, np.real(slope) / pole_pairs, torque, lambda_s, lambda_r)


def basis_of(lines: Lines, comb_phases_rad: list[Signal]) -> Vector:
    """`(n, k)`: e^{j order phase} of each line at instants where the combs' phases are `comb_phases_rad` `(n,)` each."""
    count = comb_phases_rad[0].size if comb_phases_rad else 1
    columns = [
        np.ones(count, dtype=np.complex128) if p < 0 else np.exp(1j * h * comb_phases_rad[p])
        for p, h in zip(lines.comb, lines.order, strict=True)
    ]
    return np.stack(columns, axis=1)
