"""The Cramer-Rao bound: what no unbiased estimator can beat."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from commissioner.identify.batch.model import Matrix
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.standstill import held_input
from commissioner.records import Signal


def cramer_rao(machine: InverseGamma, voltage_v: Signal, sample_period_s: float, noise_a: float) -> Matrix:
    """(4, 4): the bound on the covariance of (R_s, R_R, L_sigma, L_M) from this voltage, white noise, known start at
    rest."""
    columns = []
    for j, value in enumerate(machine.as_tuple()):
        pair = []
        for sign in (1.0, -1.0):
            moved = list(machine.as_tuple())
            moved[j] = value * (1.0 + sign * 1e-5)
            matrix, gain = held_input(InverseGamma(*moved), sample_period_s)
            b = [0.0, gain[0], matrix[0, 1] * gain[1] - matrix[1, 1] * gain[0]]
            a = [1.0, -float(np.trace(matrix)), float(np.linalg.det(matrix))]
            pair.append(lfilter(b, a, voltage_v))
        columns.append((pair[0] - pair[1]) / (2e-5 * value))
    jacobian = np.column_stack(columns)
    return np.asarray(noise_a**2 * np.linalg.inv(jacobian.T @ jacobian))
