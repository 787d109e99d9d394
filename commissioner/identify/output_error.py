"""Compiled output-error simulation of one segment with its exact sensitivities, for the batch fit.

Gamma circuit at standstill, everything nonlinear in it taken as extra voltage on the stator flux:

    d psi_s/dt = u - R_s i_lin + n,      n = -F(i) - R_s g(psi_s)
    d psi_R/dt = R_r (psi_s - psi_R) / L_l
    i_lin = psi_s / L_0 + (psi_s - psi_R) / L_l,    i = i_lin + g(psi_s)

g(psi) is the magnetizing current beyond psi / L_0, F(i) the inverter's voltage error along the axis, both linear in
their coefficients. Linear part exact for held u and for n linear over the period (first-order hold); the steep F is
solved implicitly at the end of each period (A-stable), so that currents caught at zero do not chatter. Sensitivities
differentiate this very scheme. Order of the parameters: R_s, R_r, L_l, L_0, delay, g_1..g_m, F_1..F_k, then the
segment's own: offset, psi_s(0), psi_R(0).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

CIRCUIT = 4
DELAY = 4
SHARED = 5
OWN = 3


@njit(cache=True, fastmath={"contract", "reassoc", "nsz", "arcp"})
def simulate(
    u: Array,
    y: Array,
    weight: Array,
    u_before: float,
    ad: Array,
    b1: Array,
    b2: Array,
    dad: Array,
    db1: Array,
    db2: Array,
    theta: Array,
    extra_powers: int,
    flux_scale: float,
    basis: Array,
    current_span: float,
    own: Array,
    delay: float,
    wanted: Array,
    information: Array,
    score: Array,
    block: int,
    block_scores: Array,
    residual: Array,
    flux: Array,
) -> float:
    """Residuals y - i into `residual`, stator flux into `flux`, J^T W J and J^T W e added to `information`, `score`.

    `ad` (2, 2), `b1`, `b2` (2,): held-input and ramp response; `dad` (4, 2, 2), `db1`, `db2` (4, 2) their derivatives
    by the circuit's four. `basis` (rows, k) tabulates the coefficients' F over current 0 ... current_span. `wanted`
    (p,) is 1 where a sensitivity is to be carried. `block_scores` (blocks, p) collects J^T W e by stretches of `block`
    samples. `weight` is 0 for samples that were lost. Returns sum W e^2.
    """
    p = wanted.size
    k_f = basis.shape[1]
    first_g, first_f = SHARED, SHARED + extra_powers
    first_own = first_f + k_f
    rows = basis.shape[0]
    per_a = (rows - 1) / current_span
    r_s, l_l, l_0 = theta[0], theta[2], theta[3]
    h_s, h_r = 1.0 / l_0 + 1.0 / l_l, -1.0 / l_l
    s1, s2 = np.zeros(p), np.zeros(p)  # d(psi_s, psi_R)
    dn, si, dc1, dc2 = np.zeros(p), np.zeros(p), np.zeros(p), np.zeros(p)
    lost = np.zeros(rows)
    for r in range(rows):
        for c in range(k_f):
            lost[r] += basis[r, c] * theta[first_f + c]
    beta = h_s * b2[0] + h_r * b2[1]
    dbeta = np.zeros(p)
    for j in range(CIRCUIT):
        dbeta[j] = h_s * db2[j, 0] + h_r * db2[j, 1]
    dbeta[2] += (b2[1] - b2[0]) / (l_l * l_l)
    dbeta[3] -= b2[0] / (l_0 * l_0)

    x1, x2 = own[1], own[2]
    s1[first_own + 1] = 1.0
    s2[first_own + 2] = 1.0
    v, n, cell = 0.0, 0.0, 0
    total = 0.0
    g_power = np.zeros(extra_powers + 1)
    v_last = u_before
    for k in range(-1, u.size):
        # Flux at the end of the period without the change of n; k = -1 evaluates the initial state.
        if k >= 0:
            # A late step inside the period: its mean, and its first moment as a centred ramp of that moment.
            jump = u[k] - v_last
            tilt = 6.0 * delay * (1.0 - delay) * jump
            v = u[k] - delay * jump + n
            c1 = ad[0, 0] * x1 + ad[0, 1] * x2 + b1[0] * (v - 0.5 * tilt) + b2[0] * (tilt - n)
            c2 = ad[1, 0] * x1 + ad[1, 1] * x2 + b1[1] * (v - 0.5 * tilt) + b2[1] * (tilt - n)
            for j in range(p):
                dc1[j] = ad[0, 0] * s1[j] + ad[0, 1] * s2[j] + (b1[0] - b2[0]) * dn[j]
                dc2[j] = ad[1, 0] * s1[j] + ad[1, 1] * s2[j] + (b1[1] - b2[1]) * dn[j]
            for j in range(CIRCUIT):
                held, ramp = v - 0.5 * tilt, tilt - n
                dc1[j] += dad[j, 0, 0] * x1 + dad[j, 0, 1] * x2 + db1[j, 0] * held + db2[j, 0] * ramp
                dc2[j] += dad[j, 1, 0] * x1 + dad[j, 1, 1] * x2 + db1[j, 1] * held + db2[j, 1] * ramp
            steep = 6.0 * (1.0 - 2.0 * delay) * jump
            dc1[DELAY] += b2[0] * steep - b1[0] * (jump + 0.5 * steep)
            dc2[DELAY] += b2[1] * steep - b1[1] * (jump + 0.5 * steep)
            v_last = u[k]
        else:
            c1, c2 = x1, x2
            for j in range(p):
                dc1[j], dc2[j] = s1[j], s2[j]

        # Magnetizing current beyond the linear one, at the predicted flux.
        live = 1.0 if k >= 0 else 0.0
        flux_s = c1 + live * b2[0] * n
        g, slope_g = 0.0, 0.0
        if extra_powers > 0:
            rel = flux_s / flux_scale
            square = rel * rel
            power = rel
            for m in range(extra_powers):
                order = 2 * m + 3
                slope_g += theta[first_g + m] * order * power * rel / flux_scale
                power *= square
                g_power[m] = power
                g += theta[first_g + m] * power

        # Current at the end of the period: i + beta F(i) = known, F piecewise linear and rising.
        b_live = beta * live
        known = h_s * c1 + h_r * c2 + g - b_live * r_s * g
        size = abs(known)
        i_abs, slope_f, f_abs, fraction = size, 0.0, 0.0, 0.0
        if k_f > 0:
            for _ in range(64):  # concave F: from the left monotone, at most one knot a step
                lower = lost[cell]
                s_cell = (lost[cell + 1] - lower) * per_a
                i_abs = (size - b_live * (lower - s_cell * cell / per_a)) / (1.0 + b_live * s_cell)
                new = int(i_abs * per_a) if i_abs > 0.0 else 0
                new = min(new, rows - 2)
                if new == cell:
                    break
                cell = new
            i_abs = max(i_abs, 0.0)
            fraction = i_abs * per_a - cell
            if fraction > 1.0 and cell == rows - 2:
                fraction, slope_f = 1.0, 0.0
                i_abs = size - b_live * lost[rows - 1]
            else:
                slope_f = (lost[cell + 1] - lost[cell]) * per_a
            f_abs = lost[cell] + fraction * (lost[cell + 1] - lost[cell])
        sign = 1.0 if known >= 0.0 else -1.0
        i = sign * i_abs
        n_new = -sign * f_abs - r_s * g

        # Sensitivities of the current, then of n and of the state.
        scale = 1.0 / (1.0 + b_live * slope_f)
        for j in range(p):
            dg = slope_g * (dc1[j] + live * b2[0] * dn[j])
            si[j] = h_s * dc1[j] + h_r * dc2[j] + dg * (1.0 - b_live * r_s) + dbeta[j] * live * n_new
            dn[j] = -r_s * dg
        si[2] += (c2 - c1) / (l_l * l_l)
        si[3] -= c1 / (l_0 * l_0)
        si[0] -= b_live * g
        dn[0] -= g
        for j in range(CIRCUIT):
            dg = slope_g * live * db2[j, 0] * n
            si[j] += dg * (1.0 - b_live * r_s)
            dn[j] -= r_s * dg
        for m in range(extra_powers):
            si[first_g + m] += g_power[m] * (1.0 - b_live * r_s)
            dn[first_g + m] -= r_s * g_power[m]
        for c in range(k_f):
            at = sign * (basis[cell, c] + fraction * (basis[cell + 1, c] - basis[cell, c]))
            si[first_f + c] -= b_live * at
            dn[first_f + c] -= at
        for j in range(p):
            si[j] *= scale * wanted[j]
            dn[j] -= slope_f * si[j]
        if k >= 0:
            x1, x2 = c1 + b2[0] * n_new, c2 + b2[1] * n_new
            for j in range(p):
                s1[j] = dc1[j] + b2[0] * dn[j]
                s2[j] = dc2[j] + b2[1] * dn[j]
            for j in range(CIRCUIT):
                s1[j] += db2[j, 0] * n_new
                s2[j] += db2[j, 1] * n_new
        n = n_new

        # The sample at the end of this period is y[k + 1].
        at_sample = k + 1
        if at_sample >= u.size:
            break
        e = y[at_sample] - i - own[0]
        residual[at_sample] = e
        flux[at_sample] = x1
        w = weight[at_sample]
        if w > 0.0:
            total += w * e * e
            si[first_own] = wanted[first_own]
            row = at_sample // block
            for a in range(p):
                if wanted[a] > 0.0:
                    wa = w * si[a]
                    score[a] += wa * e
                    block_scores[row, a] += wa * e
                    for b in range(a + 1):
                        information[a, b] += wa * si[b]
    return total
