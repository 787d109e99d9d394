"""The machine at standstill along one axis: exact discrete models of the inverse-Gamma circuit.

    d i/dt     = (u - (R_s + R_R) i + alpha psi_R) / L_sigma        alpha = R_R / L_M
    d psi_R/dt = R_R i - alpha psi_R

Both eigenvalues are real, negative and distinct (a circuit of resistors and one kind of store), so a held voltage has
a closed-form response and the four numbers can be read back from it without approximation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit
from commissioner.motor.circuit import InverseGamma

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class PulseTransfer:
    """Voltage (held over each period) to sampled current: (b1 z + b0) / (z^2 + a1 z + a0)."""

    a1: float
    a0: float
    b1: float
    b0: float


def poles_per_s(machine: InverseGamma) -> tuple[float, float]:
    """(slow, fast) eigenvalues, both negative: roots of s^2 + ((R_s+R_R)/L_sigma + alpha) s + alpha R_s/L_sigma."""
    r_s, r_r, l_s, l_m = machine.as_tuple()
    alpha = r_r / l_m
    half = 0.5 * ((r_s + r_r) / l_s + alpha)
    product = alpha * r_s / l_s
    fast = -(half + math.sqrt(max(half * half - product, 0.0)))
    return product / fast, fast


def held_input(machine: InverseGamma, period_s: float) -> tuple[Matrix, Matrix]:
    """(Ad, bd): x[k+1] = Ad x[k] + bd u[k] with x = (i, psi_R) and u held over `period_s`. Exact."""
    r_s, r_r, l_s, l_m = machine.as_tuple()
    slow, fast = poles_per_s(machine)
    kept = math.exp(slow * period_s), math.exp(fast * period_s)
    taken = math.expm1(slow * period_s) / slow, math.expm1(fast * period_s) / fast
    # Projection onto the slow eigenvector; that onto the fast one is what is left of the identity.
    apart = slow - fast
    p11, p12 = (-(r_s + r_r) / l_s - fast) / apart, r_r / (l_m * l_s) / apart
    p21, p22 = r_r / apart, (-r_r / l_m - fast) / apart

    def of(slow_part: float, fast_part: float) -> tuple[float, float, float, float]:
        step = slow_part - fast_part
        return fast_part + p11 * step, p12 * step, p21 * step, fast_part + p22 * step

    d11, d12, d21, d22 = of(*kept)
    w11, _, w21, _ = of(*taken)
    return np.array([[d11, d12], [d21, d22]]), np.array([w11 / l_s, w21 / l_s])


def to_pulse_transfer(machine: InverseGamma, period_s: float) -> PulseTransfer:
    """The z-transform of the machine behind a zero-order hold."""
    return PulseTransfer(*pulse_transfers(np.array([machine.as_tuple()]), period_s)[0].tolist())


@njit()
def pulse_transfers(machines: Matrix, period_s: float) -> Matrix:
    """(n, 4): (a1, a0, b1, b0) of `machines` (n, 4), rows of (R_s, R_R, L_sigma, L_M)."""
    out = np.empty_like(machines)
    for k in range(machines.shape[0]):
        r_s, r_r, l_s, l_m = machines[k]
        alpha = r_r / l_m
        half = 0.5 * ((r_s + r_r) / l_s + alpha)
        product = alpha * r_s / l_s
        fast = -(half + math.sqrt(max(half * half - product, 0.0)))
        slow = product / fast
        slow_z, fast_z = math.exp(slow * period_s), math.exp(fast * period_s)
        residue_slow = (slow + alpha) / (l_s * (slow - fast)) * math.expm1(slow * period_s) / slow
        residue_fast = (fast + alpha) / (l_s * (fast - slow)) * math.expm1(fast * period_s) / fast
        out[k, 0], out[k, 1] = -(slow_z + fast_z), slow_z * fast_z
        out[k, 2], out[k, 3] = residue_slow + residue_fast, -(residue_slow * fast_z + residue_fast * slow_z)
    return out


def from_pulse_transfer(transfer: PulseTransfer, period_s: float) -> InverseGamma | None:
    """The machine with exactly this pulse transfer; None where no passive machine has it."""
    half = -0.5 * transfer.a1
    root = half * half - transfer.a0
    if not (root > 0.0 and transfer.a0 > 0.0):
        return None
    slow_z = half + math.sqrt(root)
    fast_z = transfer.a0 / slow_z
    if not 0.0 < fast_z < slow_z < 1.0:
        return None
    slow, fast = math.log(slow_z) / period_s, math.log(fast_z) / period_s
    residue_slow = (transfer.b1 * slow_z + transfer.b0) / (slow_z - fast_z) * slow / (slow_z - 1.0)
    residue_fast = (transfer.b1 * fast_z + transfer.b0) / (fast_z - slow_z) * fast / (fast_z - 1.0)
    return from_poles_and_residues(slow, fast, residue_slow, residue_fast)


def from_poles_and_residues(slow: float, fast: float, residue_slow: float, residue_fast: float) -> InverseGamma | None:
    """The machine whose admittance is r_s/(s - slow) + r_f/(s - fast); None where a parameter is not positive."""
    total = residue_slow + residue_fast
    if not (residue_slow > 0.0 and residue_fast > 0.0):
        return None
    leakage_h = 1.0 / total
    alpha = -(residue_slow * fast + residue_fast * slow) / total
    stator_ohm = slow * fast * leakage_h / alpha
    rotor_ohm = (-(slow + fast) - alpha) * leakage_h - stator_ohm
    if not (alpha > 0.0 and stator_ohm > 0.0 and rotor_ohm > 0.0):
        return None
    return InverseGamma(stator_ohm, rotor_ohm, leakage_h, rotor_ohm / alpha)


def admittance_s(machine: InverseGamma, frequency_hz: Matrix) -> NDArray[np.complex128]:
    """Current per volt along the axis at the frequencies, `(n,)` complex: (s + alpha) / (L_sigma (s^2 + a1 s + a0))."""
    r_s, r_r, l_s, l_m = machine.as_tuple()
    s = 2j * np.pi * np.asarray(frequency_hz)
    alpha = r_r / l_m
    return np.asarray((s + alpha) / (l_s * (s * s + ((r_s + r_r) / l_s + alpha) * s + alpha * r_s / l_s)))
