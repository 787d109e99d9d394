"""The machine that a pulse transfer belongs to: the way back from `motor.standstill`."""

from __future__ import annotations

import math

import numpy as np

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import Matrix, pulse_transfers


def pulse_transfer(machine: InverseGamma, period_s: float) -> Matrix:
    """(a1, a0, b1, b0) of one machine."""
    return pulse_transfers(np.array([machine.as_tuple()]), period_s)[0]


def from_pulse_transfer(transfer: Matrix, period_s: float) -> InverseGamma | None:
    """The machine with exactly this pulse transfer (a1, a0, b1, b0); None where no passive machine has it."""
    a1, a0, b1, b0 = map(float, transfer)
    half = -0.5 * a1
    root = half * half - a0
    if not (root > 0.0 and a0 > 0.0):
        return None
    slow_z = half + math.sqrt(root)
    fast_z = a0 / slow_z
    if not 0.0 < fast_z < slow_z < 1.0:
        return None
    slow, fast = math.log(slow_z) / period_s, math.log(fast_z) / period_s
    residue_slow = (b1 * slow_z + b0) / (slow_z - fast_z) * slow / (slow_z - 1.0)
    residue_fast = (b1 * fast_z + b0) / (fast_z - slow_z) * fast / (fast_z - 1.0)
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
