"""The extended two-axis standstill model and its exact parameter sensitivities, in one compiled pass.

States: stator flux psi_s, rotor flux psi_R (inverse-Gamma scale), one lagged rotor voltage q_k per extra rotor branch,
all as (alpha, beta) pairs. With fluxes as states every nonlinearity is explicit:

    psi_0  = (1 - nu) psi_R + nu psi_s              flux of the iron: nu = 0 inverse-Gamma, nu = 1 Gamma     (1)
    j      = G(|psi_0|) psi_0 + sum h_k z_k / r_k   extra magnetizing current, z_k stop operator of radius r_k (2)
    i_s    = (1/L_sigma + S(|psi_sigma|) + A_sigma) psi_sigma + nu j,     psi_sigma = psi_s - psi_R          (3)
    i      = (i_s + g v) / (1 + g R_s)              iron-loss conductance g across d psi_s/dt                (4)
    d psi_s/dt = v + v_legs(i) - R_uvw i                                                                     (5)
    w      = R_R (psi_R / L_M + j - i_s - sum g_k q_k)                                                       (6)
    d psi_R/dt = -w + omega J psi_R,     T_k d q_k/dt = w - q_k                                              (7)

(1)-(3) and (6) follow from the T circuit with a saturating branch, rotor side scaled by L_m/L_r: an extra current j
drawn at the magnetizing node gives psi_s = L_sigma i_s + psi_R - mu j, psi_m = psi_R + mu (i_s - j),
i_R = psi_R/L_M - i_s + j, with mu = nu L_sigma the rotor-side share of the leakage (linear case: G. R. Slemon,
IEEE Trans. Ind. Appl. 25(6), 1989).

Classical fourth-order Runge-Kutta with the voltage held over the sample; the tangent of the same scheme is propagated
alongside, so the sensitivities are exact derivatives of what is computed.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# What a parameter multiplies (column `kind`); `index` picks the channel, spline vector, branch or component.
R_S, R_R, GAMMA_SIGMA, GAMMA_M, NU = 0, 1, 2, 3, 4
LEGS, IRON_CURVE, LEAKAGE_CURVE, STOP, BRANCH, IRON_LOSS = 5, 6, 7, 8, 9, 10
VOLTAGE_MOD, OMEGA, PHASE_RESISTANCE, ROTOR_MOD = 11, 12, 13, 14
ROTOR_ANISOTROPY, LEAKAGE_ANISOTROPY, MAGNETIZING_ANISOTROPY, INITIAL_FLUX = 15, 16, 17, 18
CARRY = 20  # share of the flux at the end of the segment before that is left at the start
LEGS_LINK = 19  # as LEGS, scaled with the link voltage and switching frequency (dead time, not device threshold)

SQRT3 = np.sqrt(3.0)


@njit(cache=True, fastmath=True, error_model="numpy")
def spline_weights(y, top, intervals, weights, row):
    """Uniform cubic B-spline weights on [0, top], linear beyond. `weights[row, 0:4]` values, `[4:8]` slopes; first index."""
    h = top / intervals
    beyond = 0.0
    if y > top:
        beyond = y - top
        y = top
    j = int(y / h)
    j = min(j, intervals - 1)
    u = y / h - j
    m = 1.0 - u
    weights[row, 0] = m * m * m / 6.0
    weights[row, 1] = (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0
    weights[row, 2] = (-3.0 * u * u * u + 3.0 * u * u + 3.0 * u + 1.0) / 6.0
    weights[row, 3] = u * u * u / 6.0
    weights[row, 4] = -0.5 * m * m / h
    weights[row, 5] = (1.5 * u * u - 2.0 * u) / h
    weights[row, 6] = (-1.5 * u * u + u + 0.5) / h
    weights[row, 7] = 0.5 * u * u / h
    if beyond > 0.0:
        for k in range(4):
            weights[row, k] += weights[row, 4 + k] * beyond
    return j


@njit(cache=True, fastmath=True, error_model="numpy")
def _curve(coefficients, j, weights, row, offset):
    return (
        coefficients[j] * weights[row, offset]
        + coefficients[j + 1] * weights[row, offset + 1]
        + coefficients[j + 2] * weights[row, offset + 2]
        + coefficients[j + 3] * weights[row, offset + 3]
    )


@njit(cache=True, fastmath=True, error_model="numpy")
def _slope(
    x, dx, k, dk, stage, with_tangent,
    va, vb, voltage_raw_a, voltage_raw_b, link,
    ru, rv, rw, rr, omega, channels, t,
    base, legs, iron, leak, legs_top, legs_knee, iron_top, leak_top,
    stop_gain, stop_radius, z, z_ref, dz, dz_ref, branch_gain, branch_time,
    kinds, indices, legs_vectors, iron_vectors, leak_vectors,
    fj, fi, ft, fv, fw, dzt, wts, out,
):
    """Right-hand side (1)-(7) at x into k, its tangent into dk, the terminal current into out[0:2]."""
    rs, r_r, gs, gm, nu, g = base[0], base[1], base[2], base[3], base[4], base[5]
    ras, rbs = base[6], base[7]          # rotor resistance anisotropy, cos and sin
    las, lbs = base[8], base[9]          # leakage
    mas, mbs = base[10], base[11]        # magnetizing
    branches = branch_gain.shape[0]
    stops = stop_gain.shape[0]
    count = kinds.shape[0]

    # (1)
    pa = (1.0 - nu) * x[2] + nu * x[0]
    pb = (1.0 - nu) * x[3] + nu * x[1]
    size = np.sqrt(pa * pa + pb * pb) + 1e-12
    jm = 0
    big_g = slope_g = 0.0
    if iron_vectors.shape[0] > 0:
        jm = spline_weights(size, iron_top, iron.shape[0] - 3, wts, 0)
        big_g = _curve(iron, jm, wts, 0, 0)
        slope_g = _curve(iron, jm, wts, 0, 4) / size
    # (2)
    ja = big_g * pa
    jb = big_g * pb
    jaa = big_g + slope_g * pa * pa
    jab = slope_g * pa * pb
    jbb = big_g + slope_g * pb * pb
    for s in range(stops):
        r = stop_radius[s]
        ya = z[s, 0] + pa - z_ref[0]
        yb = z[s, 1] + pb - z_ref[1]
        length = np.sqrt(ya * ya + yb * yb)
        if length > r:
            out[2 + 2 * s] = ya * r / length
            out[3 + 2 * s] = yb * r / length
        else:
            out[2 + 2 * s] = ya
            out[3 + 2 * s] = yb
        ja += stop_gain[s] * out[2 + 2 * s] / r
        jb += stop_gain[s] * out[3 + 2 * s] / r
    # (3)
    sa = x[0] - x[2]
    sb = x[1] - x[3]
    leak_size = np.sqrt(sa * sa + sb * sb) + 1e-12
    jl = 0
    big_s = slope_s = 0.0
    if leak_vectors.shape[0] > 0:
        jl = spline_weights(leak_size, leak_top, leak.shape[0] - 3, wts, 1)
        big_s = _curve(leak, jl, wts, 1, 0)
        slope_s = _curve(leak, jl, wts, 1, 4) / leak_size
    ia = (gs + big_s) * sa + gs * (las * sa + lbs * sb) + nu * ja
    ib = (gs + big_s) * sb + gs * (lbs * sa - las * sb) + nu * jb
    iaa = gs + big_s + slope_s * sa * sa + gs * las
    iab = slope_s * sa * sb + gs * lbs
    ibb = gs + big_s + slope_s * sb * sb - gs * las
    # (4)
    shrink = 1.0 / (1.0 + g * rs)
    ta = (ia + g * va) * shrink
    tb = (ib + g * vb) * shrink
    out[0] = ta
    out[1] = tb
    # (5): legs, each an odd function of its own current
    iu = ta
    iv = -0.5 * ta + 0.5 * SQRT3 * tb
    iw = -0.5 * ta - 0.5 * SQRT3 * tb
    intervals_i = legs.shape[0] - 3
    has_legs = legs_vectors.shape[0] > 0
    eu = ev = ew = du = dv = dw = 0.0
    ju = jv = jw = 0
    su = sv = sw = 1.0
    if has_legs:
        su = -1.0 if iu < 0 else 1.0
        sv = -1.0 if iv < 0 else 1.0
        sw = -1.0 if iw < 0 else 1.0
        yu = min(np.arcsinh(abs(iu) / legs_knee), legs_top)
        yv = min(np.arcsinh(abs(iv) / legs_knee), legs_top)
        yw = min(np.arcsinh(abs(iw) / legs_knee), legs_top)
        ju = spline_weights(yu, legs_top, intervals_i, wts, 2)
        jv = spline_weights(yv, legs_top, intervals_i, wts, 3)
        jw = spline_weights(yw, legs_top, intervals_i, wts, 4)
        eu = -su * _curve(legs, ju, wts, 2, 0)
        ev = -sv * _curve(legs, jv, wts, 3, 0)
        ew = -sw * _curve(legs, jw, wts, 4, 0)
        knee2 = legs_knee * legs_knee
        du = 0.0 if yu >= legs_top else -_curve(legs, ju, wts, 2, 4) / np.sqrt(iu * iu + knee2)
        dv = 0.0 if yv >= legs_top else -_curve(legs, jv, wts, 3, 4) / np.sqrt(iv * iv + knee2)
        dw = 0.0 if yw >= legs_top else -_curve(legs, jw, wts, 4, 4) / np.sqrt(iw * iw + knee2)
    eu -= ru * iu
    ev -= rv * iv
    ew -= rw * iw
    du -= ru
    dv -= rv
    dw -= rw
    k[stage, 0] = va + (2.0 * eu - ev - ew) / 3.0
    k[stage, 1] = vb + (ev - ew) / SQRT3
    vaa = (4.0 * du + dv + dw) / 6.0
    vab = (dw - dv) / (2.0 * SQRT3)
    vbb = 0.5 * (dv + dw)
    # (6)
    ca = gm * ((1.0 + mas) * x[2] + mbs * x[3]) + ja - ia
    cb = gm * (mbs * x[2] + (1.0 - mas) * x[3]) + jb - ib
    for n in range(branches):
        ca -= branch_gain[n] * x[4 + 2 * n]
        cb -= branch_gain[n] * x[5 + 2 * n]
    waa = rr * (1.0 + ras)
    wab = rr * rbs
    wbb = rr * (1.0 - ras)
    wa = waa * ca + wab * cb
    wb = wab * ca + wbb * cb
    # (7)
    k[stage, 2] = -wa - omega * x[3]
    k[stage, 3] = -wb + omega * x[2]
    for n in range(branches):
        k[stage, 4 + 2 * n] = (wa - x[4 + 2 * n]) / branch_time[n]
        k[stage, 5 + 2 * n] = (wb - x[5 + 2 * n]) / branch_time[n]
    # slope of the terminal current while the voltage is held
    qa = (1.0 - nu) * k[stage, 2] + nu * k[stage, 0]
    qb = (1.0 - nu) * k[stage, 3] + nu * k[stage, 1]
    dja = jaa * qa + jab * qb
    djb = jab * qa + jbb * qb
    for s in range(stops):
        r = stop_radius[s]
        ya = z[s, 0] + pa - z_ref[0]
        yb = z[s, 1] + pb - z_ref[1]
        length = np.sqrt(ya * ya + yb * yb)
        if length > r:
            along = (ya * qa + yb * qb) / (length * length)
            dja += stop_gain[s] / length * (qa - along * ya)
            djb += stop_gain[s] / length * (qb - along * yb)
        else:
            dja += stop_gain[s] / r * qa
            djb += stop_gain[s] / r * qb
    ea = k[stage, 0] - k[stage, 2]
    eb = k[stage, 1] - k[stage, 3]
    out[2 + 2 * stops] = (iaa * ea + iab * eb + nu * dja) * shrink
    out[3 + 2 * stops] = (iab * ea + ibb * eb + nu * djb) * shrink
    if not with_tangent:
        return

    # what each parameter pushes, and where: fj into (2), fi into (3), ft into (4), fv into (5), fw into (6)
    for p in range(count):
        kind = kinds[p]
        n = indices[p]
        fj[0, p] = fj[1, p] = fi[0, p] = fi[1, p] = ft[0, p] = ft[1, p] = 0.0
        fv[0, p] = fv[1, p] = fw[0, p] = fw[1, p] = 0.0
        if kind == R_S:
            ft[0, p] = -g * ta * shrink
            ft[1, p] = -g * tb * shrink
            pu, pv, pw = -ru / rs * iu, -rv / rs * iv, -rw / rs * iw
            fv[0, p] = (2.0 * pu - pv - pw) / 3.0
            fv[1, p] = (pv - pw) / SQRT3
        elif kind == R_R:
            fw[0, p] = wa / r_r
            fw[1, p] = wb / r_r
        elif kind == GAMMA_SIGMA:
            fi[0, p] = (1.0 + las) * sa + lbs * sb
            fi[1, p] = lbs * sa + (1.0 - las) * sb
        elif kind == GAMMA_M:
            pu = (1.0 + mas) * x[2] + mbs * x[3]
            pv = mbs * x[2] + (1.0 - mas) * x[3]
            fw[0, p] = waa * pu + wab * pv
            fw[1, p] = wab * pu + wbb * pv
        elif kind == NU:
            fj[0, p] = jaa * sa + jab * sb
            fj[1, p] = jab * sa + jbb * sb
            fi[0, p] = ja
            fi[1, p] = jb
        elif kind in (LEGS, LEGS_LINK):
            f = link if kind == LEGS_LINK else 1.0
            pu = -su * f * _curve(legs_vectors[n], ju, wts, 2, 0)
            pv = -sv * f * _curve(legs_vectors[n], jv, wts, 3, 0)
            pw = -sw * f * _curve(legs_vectors[n], jw, wts, 4, 0)
            fv[0, p] = (2.0 * pu - pv - pw) / 3.0
            fv[1, p] = (pv - pw) / SQRT3
        elif kind == IRON_CURVE:
            pu = _curve(iron_vectors[n], jm, wts, 0, 0)
            fj[0, p] = pu * pa
            fj[1, p] = pu * pb
        elif kind == LEAKAGE_CURVE:
            pu = _curve(leak_vectors[n], jl, wts, 1, 0)
            fi[0, p] = pu * sa
            fi[1, p] = pu * sb
        elif kind == STOP:
            fj[0, p] = out[2 + 2 * n] / stop_radius[n]
            fj[1, p] = out[3 + 2 * n] / stop_radius[n]
        elif kind == BRANCH:
            fw[0, p] = -(waa * x[4 + 2 * n] + wab * x[5 + 2 * n])
            fw[1, p] = -(wab * x[4 + 2 * n] + wbb * x[5 + 2 * n])
        elif kind == IRON_LOSS:
            ft[0, p] = (va - rs * ta) * shrink
            ft[1, p] = (vb - rs * tb) * shrink
        elif kind == VOLTAGE_MOD:
            fv[0, p] = voltage_raw_a * channels[t, n]
            fv[1, p] = voltage_raw_b * channels[t, n]
        elif kind == OMEGA:
            fw[0, p] = channels[t, n] * x[3]
            fw[1, p] = -channels[t, n] * x[2]
        elif kind == PHASE_RESISTANCE:
            pu = -rs * channels[t, n] * iu
            pv = -rs * channels[t, n + 1] * iv
            pw = -rs * channels[t, n + 2] * iw
            fv[0, p] = (2.0 * pu - pv - pw) / 3.0
            fv[1, p] = (pv - pw) / SQRT3
        elif kind == ROTOR_MOD:
            fw[0, p] = r_r * channels[t, n] * (wa / rr)
            fw[1, p] = r_r * channels[t, n] * (wb / rr)
        elif kind == ROTOR_ANISOTROPY:
            fw[0, p] = rr * ca if n == 0 else rr * cb
            fw[1, p] = -rr * cb if n == 0 else rr * ca
        elif kind == LEAKAGE_ANISOTROPY:
            fi[0, p] = gs * sa if n == 0 else gs * sb
            fi[1, p] = -gs * sb if n == 0 else gs * sa
        elif kind == MAGNETIZING_ANISOTROPY:
            pu = gm * (x[2] if n == 0 else x[3])
            pv = gm * (-x[3] if n == 0 else x[2])
            fw[0, p] = waa * pu + wab * pv
            fw[1, p] = wab * pu + wbb * pv

    for s in range(stops):
        r = stop_radius[s]
        gain = stop_gain[s] / r
        if gain == 0.0:
            continue
        ya = z[s, 0] + pa - z_ref[0]
        yb = z[s, 1] + pb - z_ref[1]
        length = np.sqrt(ya * ya + yb * yb)
        naa, nab, nbb = 1.0, 0.0, 1.0
        if length > r:
            f = r / length
            ua, ub = ya / length, yb / length
            naa, nab, nbb = f * (1.0 - ua * ua), -f * ua * ub, f * (1.0 - ub * ub)
        for p in range(count):
            qa = dz[s, 0, p] + (1.0 - nu) * dx[2, p] + nu * dx[0, p] - dz_ref[0, p]
            qb = dz[s, 1, p] + (1.0 - nu) * dx[3, p] + nu * dx[1, p] - dz_ref[1, p]
            if kinds[p] == NU:
                qa += sa
                qb += sb
            dzt[s, 0, p] = naa * qa + nab * qb
            dzt[s, 1, p] = nab * qa + nbb * qb
            fj[0, p] += gain * dzt[s, 0, p]
            fj[1, p] += gain * dzt[s, 1, p]

    for p in range(count):
        qa = (1.0 - nu) * dx[2, p] + nu * dx[0, p]
        qb = (1.0 - nu) * dx[3, p] + nu * dx[1, p]
        dja = jaa * qa + jab * qb + fj[0, p]
        djb = jab * qa + jbb * qb + fj[1, p]
        ea = dx[0, p] - dx[2, p]
        eb = dx[1, p] - dx[3, p]
        dia = iaa * ea + iab * eb + nu * dja + fi[0, p]
        dib = iab * ea + ibb * eb + nu * djb + fi[1, p]
        dta = dia * shrink + ft[0, p]
        dtb = dib * shrink + ft[1, p]
        out_a = vaa * dta + vab * dtb + fv[0, p]
        out_b = vab * dta + vbb * dtb + fv[1, p]
        dca = gm * ((1.0 + mas) * dx[2, p] + mbs * dx[3, p]) + dja - dia
        dcb = gm * (mbs * dx[2, p] + (1.0 - mas) * dx[3, p]) + djb - dib
        dk[stage, 0, p] = out_a
        dk[stage, 1, p] = out_b
        fj[0, p] = dca
        fj[1, p] = dcb
        fi[0, p] = dta
        fi[1, p] = dtb
    for n in range(branches):
        if branch_gain[n] != 0.0:
            for p in range(count):
                fj[0, p] -= branch_gain[n] * dx[4 + 2 * n, p]
                fj[1, p] -= branch_gain[n] * dx[5 + 2 * n, p]
    for p in range(count):
        dwa = waa * fj[0, p] + wab * fj[1, p] + fw[0, p]
        dwb = wab * fj[0, p] + wbb * fj[1, p] + fw[1, p]
        dk[stage, 2, p] = -dwa - omega * dx[3, p]
        dk[stage, 3, p] = -dwb + omega * dx[2, p]
        is_motion = kinds[p] == OMEGA
        fw[0, p] = dwa - (fw[0, p] if is_motion else 0.0)
        fw[1, p] = dwb - (fw[1, p] if is_motion else 0.0)
    for n in range(branches):
        if branch_gain[n] != 0.0:
            for p in range(count):
                dk[stage, 4 + 2 * n, p] = (fw[0, p] - dx[4 + 2 * n, p]) / branch_time[n]
                dk[stage, 5 + 2 * n, p] = (fw[1, p] - dx[5 + 2 * n, p]) / branch_time[n]


@njit(cache=True, fastmath=True, error_model="numpy")
def propagate(
    voltage_a, voltage_b, voltage_factor, link_factor, phase_factor, rotor_factor, omega_rad_per_s, channels,
    period, substeps, crossing_substeps,
    base, legs, legs_link, iron, leak, legs_top, legs_knee, iron_top, leak_top,
    stop_gain, stop_radius, branch_gain, branch_time,
    kinds, indices, legs_vectors, iron_vectors, leak_vectors,
    initial_state, flux_before, with_tangent,
):
    """Terminal current and its derivatives with respect to the listed parameters at every sample of one segment.

    `voltage_*` (n,) commanded alpha/beta; `voltage_factor`, `link_factor`, `rotor_factor`, `omega_rad_per_s` (n,),
    `phase_factor` (n, 3) and `channels` (n, c) known functions of time; the segment starts in
    `initial_state` (psi_s, psi_R). Returns current (2, n), slope after and before each sample (2, n), sensitivities (n, 2, P) and
    rotor current and iron flux (2, n) each, and the rotor flux at the end (2,).
    """
    samples = voltage_a.shape[0]
    count = kinds.shape[0] if with_tangent else 0
    branches = branch_gain.shape[0]
    stops = stop_gain.shape[0]
    order = 4 + 2 * branches
    current = np.zeros((2, samples))
    slope_after = np.zeros((2, samples))
    slope_before = np.zeros((2, samples))
    rotor_current = np.zeros((2, samples))
    iron_flux = np.zeros((2, samples))
    tangent = np.zeros((samples, 2, count))
    x = np.zeros(order)
    dx = np.zeros((order, count))
    y = np.zeros(order)
    dy = np.zeros((order, count))
    k, dk = np.zeros((4, order)), np.zeros((4, order, count))
    fj, fi, ft = np.zeros((2, count)), np.zeros((2, count)), np.zeros((2, count))
    fv, fw = np.zeros((2, count)), np.zeros((2, count))
    z = np.zeros((stops, 2))
    dz = np.zeros((stops, 2, count))
    dzt = np.zeros((stops, 2, count))
    z_ref = np.zeros(2)
    dz_ref = np.zeros((2, count))
    wts = np.zeros((5, 8))
    out = np.zeros(4 + 2 * stops)
    legs_now = np.zeros(legs.shape[0])
    nu, g, rs, r_r = base[4], base[5], base[0], base[1]
    for c in range(4):
        x[c] = initial_state[c]
    for p in range(count):
        if kinds[p] == CARRY:
            for c in range(2):
                dx[c, p] = flux_before[c]
                dx[2 + c, p] = flux_before[c]
        if kinds[p] == INITIAL_FLUX:
            n = indices[p]
            if n < 2:
                dx[n, p] = 1.0
                dx[2 + n, p] = 1.0
            else:
                dx[n - 2, p] = 1.0
    for c in range(2):
        z_ref[c] = (1.0 - nu) * x[2 + c] + nu * x[c]
        for p in range(count):
            dz_ref[c, p] = (1.0 - nu) * dx[2 + c, p] + nu * dx[c, p]
    is_active_leg = False
    has_loss_tangent = with_tangent and g != 0.0
    for c in range(legs.shape[0]):
        if legs[c] != 0.0 or legs_link[c] != 0.0:
            is_active_leg = True

    last_a = 0.0
    last_b = 0.0
    for t in range(samples):
        now_a = voltage_a[t] * voltage_factor[t]
        now_b = voltage_b[t] * voltage_factor[t]
        link = link_factor[t]
        for c in range(legs.shape[0]):
            legs_now[c] = legs[c] + link * legs_link[c]
        ru = rs * phase_factor[t, 0]
        rv = rs * phase_factor[t, 1]
        rw = rs * phase_factor[t, 2]
        rr = r_r * rotor_factor[t]
        om = omega_rad_per_s[t]

        steps = substeps
        h = period / steps
        # evaluation -1: the state at the sample still belongs to the voltage of the period before
        e = -1
        while e < 4 * steps:
            stage = e % 4 if e >= 0 else 0
            f = 0.0
            if stage == 3:
                f = h
            elif stage > 0:
                f = 0.5 * h
            if stage == 0:
                for c in range(order):
                    y[c] = x[c]
                    for p in range(count):
                        dy[c, p] = dx[c, p]
            else:
                for c in range(order):
                    y[c] = x[c] + f * k[stage - 1, c]
                    for p in range(count):
                        dy[c, p] = dx[c, p] + f * dk[stage - 1, c, p]
            va = last_a if e < 0 else now_a
            vb = last_b if e < 0 else now_b
            wants = with_tangent if e >= 0 else has_loss_tangent
            _slope(
                y, dy, k, dk, stage, wants, va, vb, voltage_a[t], voltage_b[t], link,
                ru, rv, rw, rr, om, channels, t, base, legs_now, iron, leak, legs_top, legs_knee, iron_top, leak_top,
                stop_gain, stop_radius, z, z_ref, dz, dz_ref, branch_gain, branch_time,
                kinds, indices, legs_vectors, iron_vectors, leak_vectors, fj, fi, ft, fv, fw, dzt, wts, out,
            )
            if e < 0:
                for c in range(2):
                    current[c, t] = out[c]
                    slope_before[c, t] = out[2 + 2 * stops + c]
                    iron_flux[c, t] = (1.0 - nu) * x[2 + c] + nu * x[c]
                    rotor_current[c, t] = -k[0, 2 + c] / rr
                if has_loss_tangent:
                    for p in range(count):
                        tangent[t, 0, p] = fi[0, p]
                        tangent[t, 1, p] = fi[1, p]
                if is_active_leg:
                    # steps fine enough for the steepest part of the leg curve the currents may meet in this period
                    steep = 0.0
                    for leg in range(3):
                        il, sl = out[0], slope_before[0, t]
                        if leg > 0:
                            side = 0.5 * SQRT3 if leg == 1 else -0.5 * SQRT3
                            il = -0.5 * out[0] + side * out[1]
                            sl = -0.5 * slope_before[0, t] + side * slope_before[1, t]
                        turn = base[2] * (abs(now_a - last_a) + abs(now_b - last_b))
                        low = max(abs(il) - 1.2 * period * (abs(sl) + turn), 0.0)
                        at = np.arcsinh(low / legs_knee)
                        if at < legs_top:
                            j = spline_weights(at, legs_top, legs_now.shape[0] - 3, wts, 2)
                            bend = abs(_curve(legs_now, j, wts, 2, 4)) / np.sqrt(low * low + legs_knee * legs_knee)
                            steep = max(steep, bend)
                    steps = max(substeps, min(crossing_substeps, int(steep * base[2] * period / 0.3) + 1))
                    h = period / steps
            elif e == 0:
                slope_after[0, t] = out[2 + 2 * stops]
                slope_after[1, t] = out[3 + 2 * stops]
                if g == 0.0:
                    for p in range(count):
                        is_loss = 1.0 if kinds[p] == IRON_LOSS else 0.0
                        tangent[t, 0, p] = fi[0, p] + is_loss * (last_a - now_a)
                        tangent[t, 1, p] = fi[1, p] + is_loss * (last_b - now_b)
            e += 1
            if stage < 3 or e == 0:
                continue
            for c in range(order):
                x[c] += h / 6.0 * (k[0, c] + 2.0 * k[1, c] + 2.0 * k[2, c] + k[3, c])
            for c in range(order):
                for p in range(count):
                    dx[c, p] += h / 6.0 * (dk[0, c, p] + 2.0 * dk[1, c, p] + 2.0 * dk[2, c, p] + dk[3, c, p])
            if stops > 0:
                pa = (1.0 - nu) * x[2] + nu * x[0]
                pb = (1.0 - nu) * x[3] + nu * x[1]
                for s in range(stops):
                    r = stop_radius[s]
                    ya = z[s, 0] + pa - z_ref[0]
                    yb = z[s, 1] + pb - z_ref[1]
                    length = np.sqrt(ya * ya + yb * yb)
                    naa, nab, nbb = 1.0, 0.0, 1.0
                    if length > r:
                        f = r / length
                        ua, ub = ya / length, yb / length
                        naa, nab, nbb = f * (1.0 - ua * ua), -f * ua * ub, f * (1.0 - ub * ub)
                        ya *= f
                        yb *= f
                    z[s, 0] = ya
                    z[s, 1] = yb
                    if stop_gain[s] != 0.0:
                        for p in range(count):
                            qa = dz[s, 0, p] + (1.0 - nu) * dx[2, p] + nu * dx[0, p] - dz_ref[0, p]
                            qb = dz[s, 1, p] + (1.0 - nu) * dx[3, p] + nu * dx[1, p] - dz_ref[1, p]
                            if kinds[p] == NU:
                                qa += x[0] - x[2]
                                qb += x[1] - x[3]
                            dz[s, 0, p] = naa * qa + nab * qb
                            dz[s, 1, p] = nab * qa + nbb * qb
                z_ref[0] = pa
                z_ref[1] = pb
                for p in range(count):
                    dz_ref[0, p] = (1.0 - nu) * dx[2, p] + nu * dx[0, p]
                    dz_ref[1, p] = (1.0 - nu) * dx[3, p] + nu * dx[1, p]
                    if kinds[p] == NU:
                        dz_ref[0, p] += x[0] - x[2]
                        dz_ref[1, p] += x[1] - x[3]
        last_a = now_a
        last_b = now_b
    return current, slope_after, slope_before, tangent, rotor_current, iron_flux, x[2:4].copy()
