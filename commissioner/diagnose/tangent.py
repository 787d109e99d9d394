"""Derivatives of the terminal current along a trajectory of the extended model, for many parameters in one compiled pass.

The tangent of (1)-(7) of `trajectory` is linear in (d psi_s, d psi_R, d q); every parameter only pushes at three
places: into d psi_s/dt, into the rotor voltage w and into the terminal current. Over one period

    d psi_s' = d psi_s + T/2 V (d i + d i') + T <push>,   d psi_R' = d psi_R - T/2 (d w + d w') + T/2 omega J (...)

(trapezoidal rule, implicit in the primed end), with V the *secant* slope of the leg curves between the two samples and
<push> of a leg its mean over the path of the current, so that a zero crossing inside the period is seen. The rule errs by
(rate x period)^2 / 12 of the fastest mode, 0.1 to 1 % there and nothing at rest: enough for a search direction and a
score; what is accepted is always judged by the trajectory itself.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from commissioner.diagnose.kinds import (
    ANISOTROPY_SPLIT,
    BRANCH,
    CARRY,
    GAMMA_M,
    GAMMA_SIGMA,
    INITIAL_FLUX,
    IRON_CURVE,
    IRON_LOSS,
    LEAK_SPLIT,
    LEAKAGE_ANISOTROPY,
    LEAKAGE_CURVE,
    LEGS,
    LEGS_LINK,
    MAGNETIZING_ANISOTROPY,
    NU,
    OMEGA,
    PHASE_RESISTANCE,
    R_R,
    R_S,
    ROTOR_ANISOTROPY,
    ROTOR_MOD,
    STOP,
    VOLTAGE_MOD,
)
from commissioner.diagnose.memory import susceptibility, widened
from commissioner.diagnose.spline import curve, saturating, spline_weights
from commissioner.diagnose.trajectory import EDDY, ROTOR, SQRT3, branch_current, leg_loss


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _leg_path(i0, i1, top, knee, intervals, mean, wts):
    """Mean spline weights (signed) of a leg along the straight path of its current from i0 to i1, into mean[:]."""
    near = min(abs(i0), abs(i1))
    is_straight = i0 * i1 > 0.0 and (abs(i1 - i0) < 0.3 * (near + knee) or np.arcsinh(near / knee) >= top)
    points = 1 if is_straight else 6
    for m in range(points):
        i = i0 + (i1 - i0) * (m + 0.5) / points
        y = min(np.arcsinh(abs(i) / knee), top)
        j = spline_weights(y, top, intervals, wts, 2)
        sign = (-1.0 if i < 0 else 1.0) / points
        for c in range(4):
            mean[j + c] += sign * wts[2, c]


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _phases(a, b, out):
    out[0] = a
    out[1] = -0.5 * a + 0.5 * SQRT3 * b
    out[2] = -0.5 * a - 0.5 * SQRT3 * b


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def tilted(cosine, sine, a, b):
    """The tensor [c s; s -c] of an axis times (a, b)."""
    return cosine * a + sine * b, sine * a - cosine * b


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _in_both(dx, p, a, b):
    dx[0, p], dx[1, p] = a, b
    dx[2, p], dx[3, p] = a, b


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def sensitivities(
    states, stop_states, voltage_a, voltage_b, voltage_factor, link_factor, phase_factor, rotor_factor,
    omega_rad_per_s, channels, period,
    base, legs, legs_link, iron, leak, legs_top, legs_knee, iron_top, leak_top,
    stop_gain, stop_radius, branch_gain, branch_time,
    kinds, indices, legs_vectors, iron_vectors, leak_vectors, flux_before, out,
):
    """Fills `out` (2, P, n): d i / d parameter at every sample, for the `kinds` and `indices` (P,) listed.

    `states`, `stop_states` and everything before `kinds` are the trajectory's; the dictionaries may be empty where no
    listed parameter needs them. `flux_before` (2, 2): the flux that the segment before left, and what of it decays more per tilt
    of R_R / L_M.
    """
    samples = voltage_a.shape[0]
    count = kinds.shape[0]
    branches = branch_gain.shape[0]
    stops = stop_gain.shape[0]
    rs, r_r, gs, gm, nu, g = base[0], base[1], base[2], base[3], base[4], base[5]
    ras, rbs, las, lbs, mas, mbs = base[6], base[7], base[8], base[9], base[10], base[11]
    kappa, leak_ratio, coupled, splits_a, splits_b = base[12], base[13], base[14], base[15], base[16]
    shrink = 1.0 / (1.0 + g * rs)
    half = 0.5 * period
    has_legs = bool(np.any(legs != 0.0) or np.any(legs_link != 0.0))
    wants_legs = legs_vectors.shape[0] > 0
    has_iron, wants_iron = bool(np.any(iron != 0.0)), iron_vectors.shape[0] > 0
    has_leak, wants_leak = bool(np.any(leak != 0.0)), leak_vectors.shape[0] > 0
    has_stops, has_branches = bool(np.any(stop_gain != 0.0)), bool(np.any(branch_gain != 0.0))
    width = legs.shape[0]

    dx, dt, dw = np.zeros((4, count)), np.zeros((2, count)), np.zeros((2, count))
    push_s, push_w, push_t = np.zeros((2, count)), np.zeros((2, count)), np.zeros((2, count))
    mean_s, fj = np.zeros((2, count)), np.zeros((2, count))
    old_w = np.zeros((2, count))
    dz, dflux = np.zeros((stops, 2, count)), np.zeros((2, count))
    dq = np.zeros((branches, 2, count))
    still = np.zeros((stops, 3))
    wts = np.zeros((5, 8))
    leg_mean, leg_a, leg_b = np.zeros((3, width)), np.zeros(width), np.zeros(width)
    legs_now = np.zeros(width)
    before, now, volts = np.zeros(3), np.zeros(3), np.zeros(3)
    secant, resistance = np.zeros(3), np.zeros(3)
    whole_beta = 0.0
    for n in range(branches):
        if branch_time[n] > 0.0:
            h = half / branch_time[n]
            whole_beta += branch_gain[n] * h / (1.0 + h)
    for p in range(count):
        n = indices[p]
        fa, fb, ta, tb = flux_before[0, 0], flux_before[0, 1], flux_before[1, 0], flux_before[1, 1]
        # a flux without current is in stator and rotor alike
        if kinds[p] == CARRY:
            _in_both(dx, p, fa if n == 0 else -fb, fb if n == 0 else fa)
        elif kinds[p] in (ROTOR_ANISOTROPY, LEAKAGE_ANISOTROPY, MAGNETIZING_ANISOTROPY):
            share = 1.0
            if kinds[p] != ROTOR_ANISOTROPY:
                share = coupled if kinds[p] == LEAKAGE_ANISOTROPY else 1.0 - coupled
            qa, qb = tilted(1.0 - n, n, ta, tb)
            _in_both(dx, p, share * qa, share * qb)
        elif kinds[p] == ANISOTROPY_SPLIT:
            qa, qb = tilted(splits_a, splits_b, ta, tb)
            _in_both(dx, p, qa, qb)
        elif kinds[p] == INITIAL_FLUX:
            if n < 2:
                dx[n, p] = 1.0
                dx[2 + n, p] = 1.0
            else:
                dx[n - 2, p] = 1.0
        for c in range(2):
            dflux[c, p] = (1.0 - nu) * dx[2 + c, p] + nu * dx[c, p]

    for t in range(samples + 1):
        # the end of period t - 1: its voltage, its known functions of time
        held = max(t - 1, 0)
        beta = whole_beta if t > 0 else 0.0
        va = voltage_a[held] * voltage_factor[held] if t > 0 else 0.0
        vb = voltage_b[held] * voltage_factor[held] if t > 0 else 0.0
        rr = r_r * rotor_factor[held]
        om = omega_rad_per_s[held]
        x0, x1, x2, x3 = states[t, 0], states[t, 1], states[t, 2], states[t, 3]
        # (1), (2)
        pa = (1.0 - nu) * x2 + nu * x0
        pb = (1.0 - nu) * x3 + nu * x1
        ja = jb = jaa = jab = jbb = 0.0
        jm = 0
        if wants_iron or has_iron:
            jm, ja, jb, jaa, jab, jbb = saturating(pa, pb, iron, iron_top, wts, 0)
        for s in range(stops):
            f = stop_gain[s] / abs(stop_radius[s, 0]) * widened(pa, pb, stop_radius[s, 1])
            ja += f * stop_states[t, s, 0]
            jb += f * stop_states[t, s, 1]
        # (3)
        sa, sb = x0 - x2, x1 - x3
        iaa, iab, ibb = gs * (1.0 + las), gs * lbs, gs * (1.0 - las)
        ia, ib = iaa * sa + iab * sb + nu * ja, iab * sa + ibb * sb + nu * jb
        jl = 0
        ea = eb = eaa = eab = ebb = la = lb = 0.0
        if wants_leak or has_leak:
            la, lb = x0 - kappa * x2, x1 - kappa * x3
            jl, ea, eb, eaa, eab, ebb = saturating(la, lb, leak, leak_top, wts, 1)
            ia += ea
            ib += eb
        # (4)
        ta, tb = (ia + g * va) * shrink, (ib + g * vb) * shrink
        qa, qb = branch_current(states[t], branch_gain, branch_time, EDDY)
        ta += shrink * qa
        tb += shrink * qb
        _phases(ta, tb, now)
        if t == 0:
            before[:] = now
        # (5): legs between the two samples, in the voltage they lose
        for leg in range(3):
            resistance[leg] = rs * phase_factor[held, leg]
            secant[leg] = resistance[leg]
        if has_legs:
            for c in range(width):
                legs_now[c] = legs[c] + link_factor[held] * legs_link[c]
            for leg in range(3):
                e1, d1 = leg_loss(now[leg], legs_now, legs_top, legs_knee, wts, 2)
                e0, d0 = leg_loss(before[leg], legs_now, legs_top, legs_knee, wts, 2)
                gap = now[leg] - before[leg]
                secant[leg] += 0.5 * (d0 + d1) if abs(gap) < 1e-3 * legs_knee else (e1 - e0) / gap
        if wants_legs and t > 0:
            leg_mean[:] = 0.0
            for leg in range(3):
                _leg_path(before[leg], now[leg], legs_top, legs_knee, width - 3, leg_mean[leg], wts)
            for c in range(width):
                leg_a[c] = (2.0 * leg_mean[0, c] - leg_mean[1, c] - leg_mean[2, c]) / 3.0
                leg_b[c] = (leg_mean[1, c] - leg_mean[2, c]) / SQRT3
        vaa = -(4.0 * secant[0] + secant[1] + secant[2]) / 6.0
        vab = (secant[1] - secant[2]) / (2.0 * SQRT3)
        vbb = -0.5 * (secant[1] + secant[2])
        # (6)
        over = kappa - 1.0
        ca = gm * ((1.0 + mas) * x2 + mbs * x3) + ja - ia - over * ea
        cb = gm * (mbs * x2 + (1.0 - mas) * x3) + jb - ib - over * eb
        qa, qb = branch_current(states[t], branch_gain, branch_time, ROTOR)
        ca -= qa
        cb -= qb
        waa, wab, wbb = rr * (1.0 + ras), rr * rbs, rr * (1.0 - ras)
        wa, wb = waa * ca + wab * cb, wab * ca + wbb * cb

        # what each parameter pushes: mean_s into psi_s over the period, push_w into w, push_t into the terminal current
        for p in range(count):
            kind = kinds[p]
            n = indices[p]
            fja = fjb = fia = fib = fta = ftb = fva = fvb = fwa = fwb = 0.0
            if kind == R_S:
                fta, ftb = -g * ta * shrink, -g * tb * shrink
                for leg in range(3):
                    volts[leg] = -0.5 * phase_factor[held, leg] * (before[leg] + now[leg])
                fva, fvb = (2.0 * volts[0] - volts[1] - volts[2]) / 3.0, (volts[1] - volts[2]) / SQRT3
            elif kind == R_R:
                fwa, fwb = wa / r_r, wb / r_r
            elif kind == GAMMA_SIGMA:
                fia, fib = (1.0 + las) * sa + lbs * sb, lbs * sa + (1.0 - las) * sb
            elif kind == GAMMA_M:
                qa, qb = (1.0 + mas) * x2 + mbs * x3, mbs * x2 + (1.0 - mas) * x3
                fwa, fwb = waa * qa + wab * qb, wab * qa + wbb * qb
            elif kind == NU:
                fja, fjb = jaa * sa + jab * sb, jab * sa + jbb * sb
                fia, fib = ja, jb
            elif kind in (LEGS, LEGS_LINK):
                if t > 0:
                    f = link_factor[held] if kind == LEGS_LINK else 1.0
                    for c in range(width):
                        fva -= f * legs_vectors[n, c] * leg_a[c]
                        fvb -= f * legs_vectors[n, c] * leg_b[c]
            elif kind == IRON_CURVE:
                f = curve(iron_vectors[n], jm, wts, 0, 0)
                fja, fjb = f * pa, f * pb
            elif kind == LEAKAGE_CURVE:
                f = curve(leak_vectors[n], jl, wts, 1, 0)
                fia, fib = f * la, f * lb
                fwa, fwb = -over * (waa * fia + wab * fib), -over * (wab * fia + wbb * fib)
            elif kind == LEAK_SPLIT:
                fia, fib = -leak_ratio * (eaa * x2 + eab * x3), -leak_ratio * (eab * x2 + ebb * x3)
                qa, qb = -over * fia - leak_ratio * ea, -over * fib - leak_ratio * eb
                fwa, fwb = waa * qa + wab * qb, wab * qa + wbb * qb
            elif kind == STOP:
                f = widened(pa, pb, stop_radius[n, 1]) / abs(stop_radius[n, 0])
                fja, fjb = f * stop_states[t, n, 0], f * stop_states[t, n, 1]
            elif kind == BRANCH:
                qa, qb = states[t, 4 + 2 * n], states[t, 5 + 2 * n]
                if branch_time[n] > 0.0:
                    fwa, fwb = -(waa * qa + wab * qb), -(wab * qa + wbb * qb)
                else:
                    fta, ftb = shrink * qa, shrink * qb
            elif kind == IRON_LOSS:
                fta, ftb = (va - rs * ta) * shrink, (vb - rs * tb) * shrink
            elif kind == VOLTAGE_MOD:
                if t > 0:
                    fva, fvb = voltage_a[held] * channels[held, n], voltage_b[held] * channels[held, n]
            elif kind == OMEGA:
                fwa, fwb = channels[held, n] * x3, -channels[held, n] * x2
            elif kind == PHASE_RESISTANCE:
                for leg in range(3):
                    volts[leg] = -0.5 * rs * channels[held, n + leg] * (before[leg] + now[leg])
                fva, fvb = (2.0 * volts[0] - volts[1] - volts[2]) / 3.0, (volts[1] - volts[2]) / SQRT3
            elif kind == ROTOR_MOD:
                f = r_r * channels[held, n] / rr
                fwa, fwb = f * wa, f * wb
            elif kind == ROTOR_ANISOTROPY:
                fwa, fwb = tilted(rr * (1.0 - n), rr * n, ca, cb)
            elif kind == LEAKAGE_ANISOTROPY:
                fia, fib = tilted(gs * (1.0 - n), gs * n, sa, sb)
                fwa, fwb = tilted(coupled * rr * (1.0 - n), coupled * rr * n, ca, cb)
            elif kind == MAGNETIZING_ANISOTROPY:
                qa, qb = tilted(gm * (1.0 - n), gm * n, x2, x3)
                fwa, fwb = waa * qa + wab * qb, wab * qa + wbb * qb
                qa, qb = tilted(rr * (1.0 - n), rr * n, ca, cb)
                fwa -= coupled * qa
                fwb -= coupled * qb
            elif kind == ANISOTROPY_SPLIT:
                fwa, fwb = tilted(rr * splits_a, rr * splits_b, ca, cb)
            fj[0, p], fj[1, p] = fja, fjb
            push_t[0, p], push_t[1, p] = fia, fib
            push_w[0, p], push_w[1, p] = fwa, fwb
            push_s[0, p], push_s[1, p] = fta, ftb
            mean_s[0, p], mean_s[1, p] = fva, fvb

        # stops: what they carry from the sample before, and their own differential susceptibility
        if has_stops:
            last = max(t - 1, 0)
            ra = (1.0 - nu) * states[last, 2] + nu * states[last, 0]
            rb = (1.0 - nu) * states[last, 3] + nu * states[last, 1]
            for s in range(stops):
                if stop_gain[s] == 0.0:
                    continue
                f = stop_gain[s] / abs(stop_radius[s, 0])
                # a loop that widens with flux: its factor grows along the flux (symmetric part)
                rate = f * stop_radius[s, 1]
                gaa = 2.0 * rate * stop_states[t, s, 0] * pa
                gab = rate * (stop_states[t, s, 0] * pb + stop_states[t, s, 1] * pa)
                gbb = 2.0 * rate * stop_states[t, s, 1] * pb
                f *= widened(pa, pb, stop_radius[s, 1])
                naa, nab, nbb, haa, hab, hbb = susceptibility(
                    stop_states[last, s, 0], stop_states[last, s, 1], pa - ra, pb - rb, 0.0, 0.0, stop_radius[s, 0]
                )
                still[s, 0], still[s, 1], still[s, 2] = naa, nab, nbb
                jaa += f * naa + gaa
                jab += f * nab + gab
                jbb += f * nbb + gbb
                for p in range(count):
                    ya, yb = dz[s, 0, p], dz[s, 1, p]
                    qa, qb = -dflux[0, p], -dflux[1, p]
                    if kinds[p] == NU:
                        qa += sa
                        qb += sb
                        fj[0, p] += gaa * sa + gab * sb
                        fj[1, p] += gab * sa + gbb * sb
                    dz[s, 0, p] = haa * ya + hab * yb + naa * qa + nab * qb
                    dz[s, 1, p] = hab * ya + hbb * yb + nab * qa + nbb * qb
                    fj[0, p] += f * dz[s, 0, p]
                    fj[1, p] += f * dz[s, 1, p]

        # di = shrink (Ds dpsi_s + Dr dpsi_R) + push_t ;  dw = Ws dpsi_s + Wr dpsi_R + push_w
        s_aa, s_ab, s_bb = iaa + eaa + nu * nu * jaa, iab + eab + nu * nu * jab, ibb + ebb + nu * nu * jbb
        f = nu * (1.0 - nu)
        r_aa, r_ab, r_bb = f * jaa - iaa - kappa * eaa, f * jab - iab - kappa * eab, f * jbb - ibb - kappa * ebb
        m_aa = nu * jaa - s_aa - over * eaa
        m_ab = nu * jab - s_ab - over * eab
        m_bb = nu * jbb - s_bb - over * ebb
        f, h = 1.0 - nu, over * kappa
        n_aa = gm * (1.0 + mas) + f * jaa - r_aa + h * eaa
        n_ab = gm * mbs + f * jab - r_ab + h * eab
        n_bb = gm * (1.0 - mas) + f * jbb - r_bb + h * ebb
        # rotor branches at the end of the period: w' = K (... - W (S0 + beta w))
        kaa, kab, kba, kbb = waa, wab, wab, wbb
        if has_branches:
            d = (1.0 + beta * waa) * (1.0 + beta * wbb) - beta * beta * wab * wab
            baa, bab, bbb = (1.0 + beta * wbb) / d, -beta * wab / d, (1.0 + beta * waa) / d
            kaa, kab = baa * waa + bab * wab, baa * wab + bab * wbb
            kba, kbb = bab * waa + bbb * wab, bab * wab + bbb * wbb
        ws00, ws01 = kaa * m_aa + kab * m_ab, kaa * m_ab + kab * m_bb
        ws10, ws11 = kba * m_aa + kbb * m_ab, kba * m_ab + kbb * m_bb
        wr00, wr01 = kaa * n_aa + kab * n_ab, kaa * n_ab + kab * n_bb
        wr10, wr11 = kba * n_aa + kbb * n_ab, kba * n_ab + kbb * n_bb
        for p in range(count):
            qa, qb = fj[0, p], fj[1, p]
            ua, ub = push_t[0, p] + nu * qa, push_t[1, p] + nu * qb
            push_t[0, p] = shrink * ua + push_s[0, p]
            push_t[1, p] = shrink * ub + push_s[1, p]
            qa -= ua
            qb -= ub
            if has_branches:
                fwa, fwb = push_w[0, p], push_w[1, p]
                push_w[0, p], push_w[1, p] = baa * fwa + bab * fwb, bab * fwa + bbb * fwb
                ca, cb = beta * dw[0, p], beta * dw[1, p]
                for n in range(branches):
                    if branch_time[n] < 0.0:
                        continue
                    h = half / branch_time[n]
                    ca += branch_gain[n] * (1.0 - h) / (1.0 + h) * dq[n, 0, p]
                    cb += branch_gain[n] * (1.0 - h) / (1.0 + h) * dq[n, 1, p]
                qa -= ca
                qb -= cb
            push_w[0, p] += kaa * qa + kab * qb
            push_w[1, p] += kba * qa + kbb * qb

        if t > 0:
            # (I - A') dx' = right-hand side, A' = T/2 [[V shrink Ds, V shrink Dr], [-Ws, -Wr + omega J]]
            f = half * shrink
            a00, a01 = 1.0 - f * (vaa * s_aa + vab * s_ab), -f * (vaa * s_ab + vab * s_bb)
            a10, a11 = -f * (vab * s_aa + vbb * s_ab), 1.0 - f * (vab * s_ab + vbb * s_bb)
            b00, b01 = -f * (vaa * r_aa + vab * r_ab), -f * (vaa * r_ab + vab * r_bb)
            b10, b11 = -f * (vab * r_aa + vbb * r_ab), -f * (vab * r_ab + vbb * r_bb)
            c00, c01, c10, c11 = half * ws00, half * ws01, half * ws10, half * ws11
            d00, d01 = 1.0 + half * wr00, half * (wr01 + om)
            d10, d11 = half * (wr10 - om), 1.0 + half * wr11
            # Schur complement of the rotor block
            det = 1.0 / (d00 * d11 - d01 * d10)
            i00, i01, i10, i11 = d11 * det, -d01 * det, -d10 * det, d00 * det
            g00, g01 = b00 * i00 + b01 * i10, b00 * i01 + b01 * i11
            g10, g11 = b10 * i00 + b11 * i10, b10 * i01 + b11 * i11
            e00, e01 = a00 - g00 * c00 - g01 * c10, a01 - g00 * c01 - g01 * c11
            e10, e11 = a10 - g10 * c00 - g11 * c10, a11 - g10 * c01 - g11 * c11
            det = 1.0 / (e00 * e11 - e01 * e10)
            h00, h01, h10, h11 = e11 * det, -e01 * det, -e10 * det, e00 * det
            for p in range(count):
                ua, ub = dt[0, p] + push_t[0, p], dt[1, p] + push_t[1, p]
                qa = dx[0, p] + half * (vaa * ua + vab * ub) + period * mean_s[0, p]
                qb = dx[1, p] + half * (vab * ua + vbb * ub) + period * mean_s[1, p]
                ya = dx[2, p] - half * (dw[0, p] + push_w[0, p] + om * dx[3, p])
                yb = dx[3, p] - half * (dw[1, p] + push_w[1, p] - om * dx[2, p])
                qa -= g00 * ya + g01 * yb
                qb -= g10 * ya + g11 * yb
                sa_, sb_ = h00 * qa + h01 * qb, h10 * qa + h11 * qb
                ya -= c00 * sa_ + c01 * sb_
                yb -= c10 * sa_ + c11 * sb_
                dx[0, p], dx[1, p] = sa_, sb_
                dx[2, p], dx[3, p] = i00 * ya + i01 * yb, i10 * ya + i11 * yb
        for p in range(count):
            y0, y1, y2, y3 = dx[0, p], dx[1, p], dx[2, p], dx[3, p]
            old_w[0, p], old_w[1, p] = dw[0, p], dw[1, p]
            dw[0, p] = ws00 * y0 + ws01 * y1 + wr00 * y2 + wr01 * y3 + push_w[0, p]
            dw[1, p] = ws10 * y0 + ws11 * y1 + wr10 * y2 + wr11 * y3 + push_w[1, p]
            dt[0, p] = shrink * (s_aa * y0 + s_ab * y1 + r_aa * y2 + r_ab * y3) + push_t[0, p]
            dt[1, p] = shrink * (s_ab * y0 + s_bb * y1 + r_ab * y2 + r_bb * y3) + push_t[1, p]
        if t < samples:
            for p in range(count):
                out[0, p, t] = dt[0, p]
                out[1, p, t] = dt[1, p]
        if has_branches and t > 0:
            for n in range(branches):
                if branch_time[n] < 0.0:
                    continue
                h = half / branch_time[n]
                for p in range(count):
                    for c in range(2):
                        dq[n, c, p] = ((1.0 - h) * dq[n, c, p] + h * (old_w[c, p] + dw[c, p])) / (1.0 + h)
        if has_stops:
            for p in range(count):
                qa = (1.0 - nu) * dx[2, p] + nu * dx[0, p]
                qb = (1.0 - nu) * dx[3, p] + nu * dx[1, p]
                for s in range(stops):
                    dz[s, 0, p] += still[s, 0] * qa + still[s, 1] * qb
                    dz[s, 1, p] += still[s, 1] * qa + still[s, 2] * qb
                dflux[0, p] = qa + (sa if kinds[p] == NU else 0.0)
                dflux[1, p] = qb + (sb if kinds[p] == NU else 0.0)
        if t < samples:
            # the next period begins with its own voltage: the part of an iron-loss current that follows it at once
            na, nb = voltage_a[t] * voltage_factor[t], voltage_b[t] * voltage_factor[t]
            for p in range(count):
                if kinds[p] == IRON_LOSS:
                    dt[0, p] += shrink * (na - va)
                    dt[1, p] += shrink * (nb - vb)
            ta += shrink * g * (na - va)
            tb += shrink * g * (nb - vb)
            _phases(ta, tb, before)
