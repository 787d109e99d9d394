"""Compiled simulation of the near future: what a known voltage will make of a machine behind its inverter."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from commissioner.identify.kernels import implicit_loss

Array = NDArray[np.float64]


@njit(cache=True)
def forecast(
    u: Array,
    period: float,
    matrix: Array,
    gain: Array,
    r_s: float,
    leakage: float,
    lost_v: Array,
    lost_span: float,
    i: float,
    psi_r: float,
    free: float,
) -> float:
    """The largest |stator flux| under the voltages u, `(n,)`, held for `period` each: of the linear machine from
    (i, psi_R), and of the flux `free` that integrates u - F(i) - R_s i.

    `matrix`, `gain`: held-input model of (i, psi_R). F, the inverter's loss, tabulated over 0 ... `lost_span`, is taken
    at the end of each period: i' + g F(i') = i' without loss.
    """
    top = abs(free)
    for k in range(u.size):
        known = matrix[0, 0] * i + matrix[0, 1] * psi_r + gain[0] * u[k]
        loss, _ = implicit_loss(lost_v, lost_span, known, gain[0])
        free += period * (u[k] - loss - r_s * i)
        psi_r = matrix[1, 0] * i + matrix[1, 1] * psi_r + gain[1] * (u[k] - loss)
        i = known - gain[0] * loss
        top = max(top, abs(psi_r + leakage * i), abs(free))
    return top
