"""The machine at standstill along one axis: exact discrete models of the inverse-Gamma circuit.

    d i/dt     = (u - (R_s + R_R) i + alpha psi_R) / L_sigma        alpha = R_R / L_M
    d psi_R/dt = R_R i - alpha psi_R

Both eigenvalues are real, negative and distinct (a circuit of resistors and one kind of store), so a held voltage has
a closed-form response from which the four numbers could be read back without approximation.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit
from commissioner.motor.circuit import InverseGamma

Matrix = NDArray[np.float64]


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


@njit()
def pulse_transfers(machines: Matrix, period_s: float) -> Matrix:
    """(n, 4): (a1, a0, b1, b0) of `machines` (n, 4), rows of (R_s, R_R, L_sigma, L_M), behind a zero-order hold: voltage (held
    over each period) to sampled current is (b1 z + b0) / (z^2 + a1 z + a0)."""
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


@njit()
def played(transfer: Matrix, signal: Matrix) -> Matrix:
    """What (b1 z + b0) / (z^2 + a1 z + a0), `transfer` (4,) = (a1, a0, b1, b0), makes of a signal `(n,)`, from rest: to the bit as
    `scipy.signal.lfilter`, which takes a third of a second to import.
    """
    a1, a0, b1, b0 = transfer
    out = np.empty_like(signal)
    next_, after = 0.0, 0.0
    for k in range(signal.size):
        out[k] = next_
        next_, after = b1 * signal[k] + after - a1 * out[k], b0 * signal[k] - a0 * out[k]
    return out


def admittance_s(machine: InverseGamma, frequency_hz: Matrix) -> NDArray[np.complex128]:
    """Current per volt along the axis at the frequencies, `(n,)` complex: (s + alpha) / (L_sigma (s^2 + a1 s + a0))."""
    r_s, r_r, l_s, l_m = machine.as_tuple()
    s = 2j * np.pi * np.asarray(frequency_hz)
    alpha = r_r / l_m
    return np.asarray((s + alpha) / (l_s * (s * s + ((r_s + r_r) / l_s + alpha) * s + alpha * r_s / l_s)))
