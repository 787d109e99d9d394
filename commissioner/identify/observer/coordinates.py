"""The observer's coordinates: theta of a machine behind given filters, its derivative, its prior, its passivity.

theta are the partial fractions of the machine's pulse transfer over the filters (see `kernels`).
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit
from commissioner.errors import UsageError
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import ParameterBox
from commissioner.motor.standstill import played, poles_per_s, pulse_transfers
from commissioner.records import Signal

Matrix = NDArray[np.float64]

PRIOR_LOG_STD = 0.5
"""Spread of the prior around its typical member: a factor 1.65 either way is one standard deviation."""


def filter_poles(prior: ParameterBox, period_s: float) -> Matrix:
    """Discrete poles (f1, f2) of the filters: left of the typical machine's by 2 (slow) and 1.5 (fast)."""
    slow, fast = poles_per_s(prior.typical)
    return np.exp(np.array([2.0 * slow, 1.5 * fast]) * period_s)


def positive_real_margin(prior: ParameterBox, filter_z: Matrix, period_s: float) -> float:
    """The smallest Re(Lambda/A) over |z| = 1 and the machines of the box's corners and middles, with Lambda/A = 1 at
    z = infinity. The gradient law converges where it is positive (observer error passive), the least-squares law above
    1/2."""
    omega = np.concatenate([[0.0], np.geomspace(1e-3, math.pi / period_s, 400)])
    z = np.exp(1j * omega * period_s)
    top = (z - filter_z[0]) * (z - filter_z[1])
    levels = zip(prior.lower.as_tuple(), prior.typical.as_tuple(), prior.upper.as_tuple(), strict=True)
    worst = math.inf
    for values in itertools.product(*levels):
        slow, fast = poles_per_s(InverseGamma(*values))
        bottom = (z - math.exp(slow * period_s)) * (z - math.exp(fast * period_s))
        worst = min(worst, float(np.min((top / bottom).real)))
    return worst


def require_margin(prior: ParameterBox, filter_z: Matrix, period_s: float) -> None:
    margin = positive_real_margin(prior, filter_z, period_s)
    if not margin > 0.0:
        raise UsageError(
            "the Lyapunov law has no positive-real margin over the machines this nameplate allows",
            step="choose observer gains",
            value=f"margin {margin:.3g}",
            limit="above 0",
            remedy="use the fast law, or correct the nameplate: rated slip and current set the box",
        )


def to_theta(machine: InverseGamma, filter_z: Matrix, period_s: float) -> Matrix:
    """(theta_1, theta_2), `(4,)`: partial fractions of (Lambda - A)/Lambda and B/Lambda at f1 and f2."""
    return np.asarray(_thetas(np.array([machine.as_tuple()]), filter_z, period_s)[0])


@njit()
def _thetas(machines: Matrix, filter_z: Matrix, period_s: float) -> Matrix:
    """(n, 4) of `machines` (n, 4), rows of (R_s, R_R, L_sigma, L_M)."""
    f1, f2 = filter_z[0], filter_z[1]
    spread = f1 - f2
    at_1, at_2 = (1.0 - f1) * spread, (1.0 - f2) * spread
    out: Matrix = pulse_transfers(machines, period_s)
    for k in range(machines.shape[0]):
        a1, a0, b1, b0 = out[k, 0], out[k, 1], out[k, 2], out[k, 3]
        out[k, 0], out[k, 1] = -(f1 * f1 + a1 * f1 + a0) / at_1, (f2 * f2 + a1 * f2 + a0) / at_2
        out[k, 2], out[k, 3] = (b1 * f1 + b0) / at_1, -(b1 * f2 + b0) / at_2
    return out


def ud_factors(covariance: Matrix) -> tuple[Matrix, Matrix]:
    """(U, d) with U unit upper triangular and U diag(d) U^T the covariance."""
    reversed_root = np.linalg.cholesky(covariance[::-1, ::-1])
    upper = reversed_root[::-1, ::-1]
    scale = np.diag(upper)
    return upper / scale, scale**2


def theta_jacobian(machine: InverseGamma, filter_z: Matrix, period_s: float) -> Matrix:
    """d theta / d(R_s, R_R, L_sigma, L_M), (4, 4), by central differences."""
    jacobian: Matrix = _jacobian(np.array(machine.as_tuple()), filter_z, period_s)
    return jacobian


@njit()
def _jacobian(values: Matrix, filter_z: Matrix, period_s: float) -> Matrix:
    beside = np.empty((8, 4))
    for k in range(8):
        beside[k] = values
        beside[k, k % 4] += (1e-4 if k < 4 else -1e-4) * values[k % 4]
    there = _thetas(beside, filter_z, period_s)
    out = np.empty((4, 4))
    for k in range(4):
        out[:, k] = (there[k] - there[4 + k]) / (2e-4 * values[k])
    return out


def prior_covariance(prior: ParameterBox, filter_z: Matrix, period_s: float) -> Matrix:
    """Covariance of theta over log-normal machines around the typical one (a fixed quasi-random set)."""
    log_typical = np.log(prior.typical.as_tuple())
    draws = np.random.default_rng(1).standard_normal((400, 4))
    return np.cov(_thetas(np.exp(log_typical + PRIOR_LOG_STD * draws), filter_z, period_s).T)


def regressor(machine: InverseGamma, filter_z: Matrix, period_s: float, voltage_v: Signal) -> Matrix:
    """w = (zeta_y, zeta_u) of the machine under the voltage, `(n, 4)`."""
    current = played(pulse_transfers(np.array([machine.as_tuple()]), period_s)[0], voltage_v)
    columns = [played(np.array([-f, 0.0, 1.0 - f, 0.0]), x) for x in (current, voltage_v) for f in filter_z]
    return np.column_stack(columns)
