"""The linear machine as two first-order modes: one pass over a record with exact sensitivities, a few ns a sample.

A resistive-inductive circuit has two real poles. With held voltage the current is the sum of two modes

    M_i[k+1] = p_i M_i[k] + g_i u[k],   M_i[0] = c_i,   i = M_1 + M_2

Its derivatives by (p_i, g_i, c_i) are first-order recursions as well: D_i[k+1] = p_i D_i[k] + M_i[k], the unit response U_i
and the free decay Q_i. The normal equations are gathered in these six numbers and the offset, where they are well
conditioned, and taken to the circuit's by the chain rule (complex steps of closed forms).
"""

from __future__ import annotations

import cmath

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit
from commissioner.identify.batch.output_error import Asked

Array = NDArray[np.float64]
MODAL = 7
"""p_1, p_2, g_1, g_2, offset, c_1, c_2; of the circuit: R_s, R_r, L_l, L_0, offset, psi_s(0), psi_R(0)."""
CHUNK = 256
"""Samples whose sensitivities are held at once: they stay in the nearest cache."""
_OFFSET = 4


def modes(circuit: Array, initial_wb: Array, period_s: float) -> tuple[Array, Array, Array]:
    """(p_1, p_2, g_1, g_2, c_1, c_2), stator flux per current of each mode `(2,)`, and the `(MODAL, MODAL)` derivative of
    the modal numbers by the circuit's."""
    point = np.append(circuit, initial_wb).astype(np.complex128)
    values = np.array([x.real for x in _modes(point, period_s)])
    jacobian = np.zeros((MODAL, MODAL))
    jacobian[_OFFSET, _OFFSET] = 1.0
    rows = [0, 1, 2, 3, 5, 6]
    for j, column in enumerate(rows):
        moved = point.copy()
        moved[j] += 1e-30j
        jacobian[rows, column] = [x.imag / 1e-30 for x in _modes(moved, period_s)[:6]]
    return values[:6], values[6:], jacobian


def _modes(point: NDArray[np.complex128], period_s: float) -> tuple[complex, ...]:
    r_s, r_r, l_l, l_0, psi_s, psi_r = map(complex, point)
    h_s, rho = 1.0 / l_0 + 1.0 / l_l, r_r / l_l
    half = -0.5 * (r_s * h_s + rho)
    product = r_s * rho / l_0
    s_2 = half - cmath.sqrt(half * half - product)
    s_1 = product / s_2
    p, g, c, flux = [], [], [], []
    for s, other in ((s_1, s_2), (s_2, s_1)):
        per_state = h_s * s + rho / l_0  # current of the eigenvector (s + rho, rho)
        pole = cmath.exp(s * period_s)
        p.append(pole)
        g.append(per_state / (s - other) * (pole - 1.0) / s)
        c.append(per_state * (psi_s - psi_r - other * psi_r / rho) / (s - other))
        flux.append((s + rho) / per_state)
    return (*p, *g, *c, *flux)


@njit()
def _live(x: float) -> float:
    return x if abs(x) > 1e-200 else 0.0


@njit(fastmath={"contract", "reassoc", "nsz", "arcp"})
def modal_pass(
    u: Array,
    y: Array,
    root_weight: Array,
    mode: Array,
    flux_per_a: Array,
    offset: float,
    asked: Asked,
) -> float:
    """Residuals y - i - offset, the stator's flux and the normal equations (both triangles) as `asked`; sum W e^2 is returned.

    `mode` and the order of columns as `modes`; `root_weight` (n,) is sqrt(W), or (0,) where all are 1. Columns whose
    `wanted` is 0 are left out; no rows are kept.
    """
    wanted, information, score, block = asked.wanted, asked.information, asked.score, asked.block
    block_scores, residual, flux = asked.block_scores, asked.residual, asked.flux
    p1, p2, g1, g2, c1, c2 = mode[0], mode[1], mode[2], mode[3], mode[4], mode[5]
    f1, f2 = flux_per_a[0], flux_per_a[1]
    u1, u2, d1, d2, q1, q2 = 0.0, 0.0, 0.0, 0.0, 1.0, 1.0
    rows = np.ones((MODAL, CHUNK))
    error = np.zeros(CHUNK)
    columns = np.flatnonzero(wanted > 0.0)
    total, begin = 0.0, 0
    while begin < u.size:
        size = min(CHUNK, u.size - begin, block - begin % block)
        # What has died away would be denormal, which is slow.
        u1, u2, d1, d2, q1, q2 = _live(u1), _live(u2), _live(d1), _live(d2), _live(q1), _live(q2)
        for k in range(size):
            m1, m2 = g1 * u1 + c1 * q1, g2 * u2 + c2 * q2
            rows[0, k], rows[1, k], rows[2, k], rows[3, k], rows[5, k], rows[6, k] = d1, d2, u1, u2, q1, q2
            error[k] = y[begin + k] - m1 - m2 - offset
            residual[begin + k] = error[k]
            flux[begin + k] = f1 * m1 + f2 * m2
            d1, d2 = p1 * d1 + m1, p2 * d2 + m2
            v = u[begin + k]
            u1, u2 = p1 * u1 + v, p2 * u2 + v
            q1, q2 = p1 * q1, p2 * q2
        if root_weight.size:
            rows[4, :size] = 1.0
            for k in range(size):
                w = root_weight[begin + k]
                error[k] *= w
                for j in range(MODAL):
                    rows[j, k] *= w
        row = begin // block
        for k in range(size):
            total += error[k] * error[k]
        for a in columns:
            s = 0.0
            for k in range(size):
                s += rows[a, k] * error[k]
            score[a] += s
            block_scores[row, a] += s
            for b in columns:
                if b > a:
                    break
                s = 0.0
                for k in range(size):
                    s += rows[a, k] * rows[b, k]
                information[a, b] += s
        begin += size
    for i in range(MODAL):
        for j in range(i):
            information[j, i] = information[i, j]
    return total
