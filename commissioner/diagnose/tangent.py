"""Derivatives of the terminal current along a trajectory of the extended model, for many parameters in one compiled pass.

The tangent of (1)-(7) of `trajectory` is linear in (d psi_s, d psi_R, d q); every parameter only pushes at three
places: into d psi/dt, into the rotor voltage w and into the terminal current. Over one period

    d psi_s' = d psi_s + T/2 V (d i + d i') + T <push>,   d psi_R' = d psi_R - T/2 (d w + d w') + T/2 omega J (...)   (8)

(trapezoidal rule, implicit in the primed end), with V the *secant* slope of the leg curves between the two samples and
<push> of a leg its mean over the path of the current, so that a zero crossing inside the period is seen. The rule errs by
(rate x period)^2 / 12 of the fastest mode, 0.1 to 1 % there and nothing at rest: enough for a search direction and a
score; what is accepted is always judged by the trajectory itself.

Solved for the end, (8) is d psi' = A d psi + N (pushes before and after) with matrices that every parameter shares. They are
made for a block of samples at once; then one parameter after the other is pushed and marched through it.
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
from commissioner.diagnose.spline import blend, curve, place, saturating
from commissioner.diagnose.trajectory import EDDY, ROTOR, SQRT3, branch_current, leg_loss

BLOCK = 256
"""Samples whose matrices are held at once: with a parameter's pushes they stay in the second-level cache."""
SIDE_BY_SIDE = 4
INTO_FLUX = (R_S, PHASE_RESISTANCE, LEGS, LEGS_LINK, VOLTAGE_MOD, OMEGA)
# rows of what the trajectory is at a sample
(
    VOLT_A, VOLT_B, AMP_A, AMP_B, RATE, SPEED, LEAK_A, LEAK_B, IRON_A, IRON_B, MAG_A, MAG_B, MAG_AA, MAG_AB, MAG_BB, PATH_A, PATH_B,
    EXTRA_A, EXTRA_B, EXTRA_AA, EXTRA_AB, EXTRA_BB, CAGE_A, CAGE_B, STEP_AA, STEP_AB, STEP_BB, WIDE_AA, WIDE_AB, WIDE_BB,
    IRON_AT, IRON_U, PATH_AT, PATH_U, ROWS,
) = range(35)  # fmt: skip


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def tilted(cosine, sine, a, b):
    """The tensor [c s; s -c] of an axis times (a, b)."""
    return cosine * a + sine * b, sine * a - cosine * b


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _phases(a, b, out):
    out[0] = a
    out[1] = -0.5 * a + 0.5 * SQRT3 * b
    out[2] = -0.5 * a - 0.5 * SQRT3 * b


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _leg_path(i0, i1, top, knee, intervals, mean):
    """Mean B-spline weights (signed) of a leg along the straight path of its current from i0 to i1, into mean[:]."""
    near = min(abs(i0), abs(i1))
    is_straight = i0 * i1 > 0.0 and (abs(i1 - i0) < 0.3 * (near + knee) or np.arcsinh(near / knee) >= top)
    points = 1 if is_straight else 6
    for m in range(points):
        i = i0 + (i1 - i0) * (m + 0.5) / points
        j, u = place(min(np.arcsinh(abs(i) / knee), top), top, intervals)
        share = (-1.0 if i < 0 else 1.0) / (6.0 * points)
        v = 1.0 - u
        mean[j] += share * v * v * v
        mean[j + 1] += share * ((3.0 * u - 6.0) * u * u + 4.0)
        mean[j + 2] += share * (((3.0 - 3.0 * u) * u + 3.0) * u + 1.0)
        mean[j + 3] += share * u * u * u


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _at_samples(
    start, stop, states, stop_states, voltage_a, voltage_b, voltage_factor, link_factor, phase_factor, rotor_factor, omega,
    base, legs, legs_link, iron, leak, legs_top, legs_knee, iron_top, leak_top, stop_gain, stop_radius, branch_gain, branch_time,
    working, wants_legs, at, before, now, secant, leg_mean, memory,
):
    """(1)-(6) at samples `start` ... `stop` - 1 into columns 1 ... of `at` and rows 1 ... of the others; 0 is the sample before.

    A sample still belongs to the voltage of the period it ends. `before`, `now` (B+1, 3) phase currents at that period's ends,
    `secant` (B+1, 3) resistance of phase and leg between them, `leg_mean` (B+1, 2, width) mean weights of the leg curve, memory
    operators' derivatives in `memory` (B+1, s, 7), of the `working` (s,) ones: factor, by the flux (aa, ab, bb), by the state before.
    """
    rs, gs, gm, nu, g, kappa = base[0], base[2], base[3], base[4], base[5], base[12]
    shrink = 1.0 / (1.0 + g * rs)
    iaa, iab, ibb = gs * (1.0 + base[8]), gs * base[9], gs * (1.0 - base[8])
    has_link = legs_link.shape[0] > 0
    has_legs = has_link or legs.shape[0] > 0
    legs_now = legs_link.copy() if has_link else legs
    width = leg_mean.shape[2]
    mean = np.zeros((3, width))
    linked = -1
    for t in range(start, stop):
        m = t - start + 1
        held = max(t - 1, 0)
        va, vb = voltage_a[held] * voltage_factor[held], voltage_b[held] * voltage_factor[held]
        if t == 0:
            va = vb = 0.0
        x0, x1, x2, x3 = states[t, 0], states[t, 1], states[t, 2], states[t, 3]
        at[VOLT_A, m], at[VOLT_B, m] = va, vb
        at[RATE, m], at[SPEED, m] = base[1] * rotor_factor[held], omega[held]
        # (1), (2)
        pa, pb = (1.0 - nu) * x2 + nu * x0, (1.0 - nu) * x3 + nu * x1
        ja = jb = jaa = jab = jbb = 0.0
        if iron.shape[0] > 0:
            j, at[IRON_U, m], ja, jb, jaa, jab, jbb = saturating(pa, pb, iron, iron_top)
            at[IRON_AT, m] = j
        at[MAG_AA, m], at[MAG_AB, m], at[MAG_BB, m] = jaa, jab, jbb
        at[IRON_A, m], at[IRON_B, m] = pa, pb
        grown_aa = grown_ab = grown_bb = 0.0
        last = max(t - 1, 0)
        ra, rb = (1.0 - nu) * states[last, 2] + nu * states[last, 0], (1.0 - nu) * states[last, 3] + nu * states[last, 1]
        for k, s in enumerate(working):
            f = stop_gain[s] / abs(stop_radius[s, 0])
            za, zb = stop_states[t, s, 0], stop_states[t, s, 1]
            # a loop that widens with flux: its factor grows along the flux (symmetric part)
            grown = f * stop_radius[s, 1]
            grown_aa += 2.0 * grown * za * pa
            grown_ab += grown * (za * pb + zb * pa)
            grown_bb += 2.0 * grown * zb * pb
            f *= widened(pa, pb, stop_radius[s, 1])
            ja += f * za
            jb += f * zb
            naa, nab, nbb, haa, hab, hbb = susceptibility(
                stop_states[last, s, 0], stop_states[last, s, 1], pa - ra, pb - rb, 0.0, 0.0, stop_radius[s, 0]
            )
            jaa += f * naa
            jab += f * nab
            jbb += f * nbb
            memory[m, k, 0], memory[m, k, 1], memory[m, k, 2], memory[m, k, 3] = f, naa, nab, nbb
            memory[m, k, 4], memory[m, k, 5], memory[m, k, 6] = haa, hab, hbb
        at[WIDE_AA, m], at[WIDE_AB, m], at[WIDE_BB, m] = grown_aa, grown_ab, grown_bb
        at[MAG_A, m], at[MAG_B, m] = ja, jb
        jaa, jab, jbb = jaa + grown_aa, jab + grown_ab, jbb + grown_bb
        # (3)
        sa, sb = x0 - x2, x1 - x3
        at[LEAK_A, m], at[LEAK_B, m] = sa, sb
        ia, ib = iaa * sa + iab * sb + nu * ja, iab * sa + ibb * sb + nu * jb
        ea = eb = eaa = eab = ebb = 0.0
        if leak.shape[0] > 0:
            la, lb = x0 - kappa * x2, x1 - kappa * x3
            j, at[PATH_U, m], ea, eb, eaa, eab, ebb = saturating(la, lb, leak, leak_top)
            at[PATH_AT, m] = j
            at[PATH_A, m], at[PATH_B, m] = la, lb
            ia += ea
            ib += eb
        at[EXTRA_A, m], at[EXTRA_B, m] = ea, eb
        at[EXTRA_AA, m], at[EXTRA_AB, m], at[EXTRA_BB, m] = eaa, eab, ebb
        at[STEP_AA, m], at[STEP_AB, m], at[STEP_BB, m] = jaa, jab, jbb
        # (4)
        qa, qb = branch_current(states[t], branch_gain, branch_time, EDDY)
        ta, tb = (ia + g * va + qa) * shrink, (ib + g * vb + qb) * shrink
        at[AMP_A, m], at[AMP_B, m] = ta, tb
        # (6)
        over = kappa - 1.0
        qa, qb = branch_current(states[t], branch_gain, branch_time, ROTOR)
        at[CAGE_A, m] = gm * ((1.0 + base[10]) * x2 + base[11] * x3) + ja - ia - over * ea - qa
        at[CAGE_B, m] = gm * (base[11] * x2 + (1.0 - base[10]) * x3) + jb - ib - over * eb - qb
        # (5): legs between the two samples, in the voltage they lose; the period begins with its own voltage
        _phases(ta, tb, now[m])
        jump = shrink * g
        _phases(at[AMP_A, m - 1] + jump * (va - at[VOLT_A, m - 1]), at[AMP_B, m - 1] + jump * (vb - at[VOLT_B, m - 1]), before[m])
        if t == 0:
            before[m] = now[m]
        if has_link and (linked < 0 or link_factor[held] != link_factor[linked]):
            blend(legs, legs_link, link_factor[held], legs_now)
            linked = held
        for leg in range(3):
            secant[m, leg] = rs * phase_factor[held, leg]
            if has_legs:
                e1, d1 = leg_loss(now[m, leg], legs_now, legs_top, legs_knee)
                e0, d0 = leg_loss(before[m, leg], legs_now, legs_top, legs_knee)
                gap = now[m, leg] - before[m, leg]
                secant[m, leg] += 0.5 * (d0 + d1) if abs(gap) < 1e-3 * legs_knee else (e1 - e0) / gap
        if wants_legs and t > 0:
            mean[:] = 0.0
            for leg in range(3):
                _leg_path(before[m, leg], now[m, leg], legs_top, legs_knee, width - 3, mean[leg])
            for c in range(width):
                leg_mean[m, 0, c] = (2.0 * mean[0, c] - mean[1, c] - mean[2, c]) / 3.0
                leg_mean[m, 1, c] = (mean[1, c] - mean[2, c]) / SQRT3


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _steps_of(start, stop, period, base, beta, at, secant, step, push, amp, cage, cage_push):
    """(8) solved for the end of the period before each sample, of states x = (d psi_s, d psi_R) with pushes into the current
    (t), the rotor voltage (w) and the flux (v):

    x' = `step` x + `push` (t + t', w + w') + T `push_v` v;   d i = `amp` x + t;   d w = `cage` x + `cage_push` (push without K).

    `step`, `push` (B+1, 4, 4) and (4, 8, B+1), the last four columns T push_v; `amp`, `cage` (B+1, 2, 4); `cage_push` (B+1, 7) K
    (2, 2) that takes a current at the magnetizing node to w, and what rotor branches leave of a voltage (aa, ab, bb).
    """
    gs, gm, nu, g, kappa = base[2], base[3], base[4], base[5], base[12]
    shrink = 1.0 / (1.0 + g * base[0])
    half, over = 0.5 * period, kappa - 1.0
    iaa, iab, ibb = gs * (1.0 + base[8]), gs * base[9], gs * (1.0 - base[8])
    back = np.zeros((4, 4))
    v = np.zeros((2, 2))
    whole = np.zeros((4, 4))
    for m in range(1, stop - start + 1):
        jaa, jab, jbb = at[STEP_AA, m], at[STEP_AB, m], at[STEP_BB, m]
        eaa, eab, ebb = at[EXTRA_AA, m], at[EXTRA_AB, m], at[EXTRA_BB, m]
        # d i = shrink (S d psi_s + R d psi_R) + push;  the current into the cage C = M d psi_s + N d psi_R
        s_aa, s_ab, s_bb = iaa + eaa + nu * nu * jaa, iab + eab + nu * nu * jab, ibb + ebb + nu * nu * jbb
        f = nu * (1.0 - nu)
        r_aa, r_ab, r_bb = f * jaa - iaa - kappa * eaa, f * jab - iab - kappa * eab, f * jbb - ibb - kappa * ebb
        m_aa, m_ab, m_bb = nu * jaa - s_aa - over * eaa, nu * jab - s_ab - over * eab, nu * jbb - s_bb - over * ebb
        f, h = 1.0 - nu, over * kappa
        n_aa = gm * (1.0 + base[10]) + f * jaa - r_aa + h * eaa
        n_ab = gm * base[11] + f * jab - r_ab + h * eab
        n_bb = gm * (1.0 - base[10]) + f * jbb - r_bb + h * ebb
        amp[m, 0, 0], amp[m, 0, 1], amp[m, 0, 2], amp[m, 0, 3] = shrink * s_aa, shrink * s_ab, shrink * r_aa, shrink * r_ab
        amp[m, 1, 0], amp[m, 1, 1], amp[m, 1, 2], amp[m, 1, 3] = shrink * s_ab, shrink * s_bb, shrink * r_ab, shrink * r_bb
        # rotor branches at the end of the period: w' = K (... - W (S0 + beta w))
        rr = at[RATE, m]
        waa, wab, wbb = rr * (1.0 + base[6]), rr * base[7], rr * (1.0 - base[6])
        b = beta if start + m > 1 else 0.0
        d = (1.0 + b * waa) * (1.0 + b * wbb) - b * b * wab * wab
        baa, bab, bbb = (1.0 + b * wbb) / d, -b * wab / d, (1.0 + b * waa) / d
        kaa, kab = baa * waa + bab * wab, baa * wab + bab * wbb
        kba, kbb = bab * waa + bbb * wab, bab * wab + bbb * wbb
        cage_push[m, 0], cage_push[m, 1], cage_push[m, 2], cage_push[m, 3] = kaa, kab, kba, kbb
        cage_push[m, 4], cage_push[m, 5], cage_push[m, 6] = baa, bab, bbb
        cage[m, 0, 0], cage[m, 0, 1] = kaa * m_aa + kab * m_ab, kaa * m_ab + kab * m_bb
        cage[m, 1, 0], cage[m, 1, 1] = kba * m_aa + kbb * m_ab, kba * m_ab + kbb * m_bb
        cage[m, 0, 2], cage[m, 0, 3] = kaa * n_aa + kab * n_ab, kaa * n_ab + kab * n_bb
        cage[m, 1, 2], cage[m, 1, 3] = kba * n_aa + kbb * n_ab, kba * n_ab + kbb * n_bb
        if start + m == 1:
            continue
        v[0, 0] = -(4.0 * secant[m, 0] + secant[m, 1] + secant[m, 2]) / 6.0
        v[0, 1] = v[1, 0] = (secant[m, 1] - secant[m, 2]) / (2.0 * SQRT3)
        v[1, 1] = -0.5 * (secant[m, 1] + secant[m, 2])
        om = half * at[SPEED, m]
        _solved(v, amp[m], cage[m], half, om, back)
        # x' = back (x + T/2 V (d i + ...) ...), d i and d w of the sample before
        for c in range(4):
            for i in range(2):
                whole[i, c] = half * (v[i, 0] * amp[m - 1, 0, c] + v[i, 1] * amp[m - 1, 1, c])
                whole[2 + i, c] = -half * cage[m - 1, i, c]
            whole[c, c] += 1.0
        whole[2, 3] -= om
        whole[3, 2] += om
        for r in range(4):
            for c in range(4):
                step[m, r, c] = (
                    back[r, 0] * whole[0, c] + back[r, 1] * whole[1, c] + back[r, 2] * whole[2, c] + back[r, 3] * whole[3, c]
                )
            for c in range(2):
                push[r, c, m] = half * (back[r, 0] * v[0, c] + back[r, 1] * v[1, c])
                push[r, 2 + c, m] = -half * back[r, 2 + c]
            for c in range(4):
                push[r, 4 + c, m] = period * back[r, c]


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _solved(v, amp, cage, half, om, back):
    """Inverse (4, 4) of I - T/2 [V amp; -cage + omega J], by the Schur complement of the rotor block."""
    a00, a01 = 1.0 - half * (v[0, 0] * amp[0, 0] + v[0, 1] * amp[1, 0]), -half * (v[0, 0] * amp[0, 1] + v[0, 1] * amp[1, 1])
    a10, a11 = -half * (v[1, 0] * amp[0, 0] + v[1, 1] * amp[1, 0]), 1.0 - half * (v[1, 0] * amp[0, 1] + v[1, 1] * amp[1, 1])
    b00, b01 = -half * (v[0, 0] * amp[0, 2] + v[0, 1] * amp[1, 2]), -half * (v[0, 0] * amp[0, 3] + v[0, 1] * amp[1, 3])
    b10, b11 = -half * (v[1, 0] * amp[0, 2] + v[1, 1] * amp[1, 2]), -half * (v[1, 0] * amp[0, 3] + v[1, 1] * amp[1, 3])
    c00, c01, c10, c11 = half * cage[0, 0], half * cage[0, 1], half * cage[1, 0], half * cage[1, 1]
    d00, d01 = 1.0 + half * cage[0, 2], half * cage[0, 3] + om
    d10, d11 = half * cage[1, 2] - om, 1.0 + half * cage[1, 3]
    det = 1.0 / (d00 * d11 - d01 * d10)
    i00, i01, i10, i11 = d11 * det, -d01 * det, -d10 * det, d00 * det
    g00, g01 = b00 * i00 + b01 * i10, b00 * i01 + b01 * i11
    g10, g11 = b10 * i00 + b11 * i10, b10 * i01 + b11 * i11
    e00, e01 = a00 - g00 * c00 - g01 * c10, a01 - g00 * c01 - g01 * c11
    e10, e11 = a10 - g10 * c00 - g11 * c10, a11 - g10 * c01 - g11 * c11
    det = 1.0 / (e00 * e11 - e01 * e10)
    h00, h01, h10, h11 = e11 * det, -e01 * det, -e10 * det, e00 * det
    back[0, 0], back[0, 1], back[1, 0], back[1, 1] = h00, h01, h10, h11
    back[0, 2], back[0, 3] = -(h00 * g00 + h01 * g10), -(h00 * g01 + h01 * g11)
    back[1, 2], back[1, 3] = -(h10 * g00 + h11 * g10), -(h10 * g01 + h11 * g11)
    for c in range(4):
        ya = (1.0 if c == 2 else 0.0) - c00 * back[0, c] - c01 * back[1, c]
        yb = (1.0 if c == 3 else 0.0) - c10 * back[0, c] - c11 * back[1, c]
        back[2, c], back[3, c] = i00 * ya + i01 * yb, i10 * ya + i11 * yb


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _pushes(
    kind, n, start, stop, states, stop_states, voltage_a, voltage_b, link_factor, phase_factor, channels, base, branch_time,
    stop_radius, legs_vectors, iron_vectors, leak_vectors, at, before, now, leg_mean, magnetizing, current, terminal, flux, rotor,
):
    """What one parameter pushes at each sample: into the `magnetizing` and the stator `current`, straight into the `terminal`

    current and into w (`rotor`), each (2, B+1), and into d psi_s/dt and d psi_R/dt over the period before (`flux` (4, B+1)).
    """
    rs, r_r, gs, gm, g = base[0], base[1], base[2], base[3], base[5]
    las, lbs, mas, mbs = base[8], base[9], base[10], base[11]
    kappa, leak_ratio, coupled, splits_a, splits_b = base[12], base[13], base[14], base[15], base[16]
    shrink, over = 1.0 / (1.0 + g * rs), kappa - 1.0
    volts = np.zeros(3)
    for m in range(1, stop - start + 1):
        t = start + m - 1
        held = max(t - 1, 0)
        rr = at[RATE, m]
        waa, wab, wbb = rr * (1.0 + base[6]), rr * base[7], rr * (1.0 - base[6])
        ca, cb = at[CAGE_A, m], at[CAGE_B, m]
        if kind in (R_S, PHASE_RESISTANCE):
            for leg in range(3):
                share = phase_factor[held, leg] if kind == R_S else rs * channels[held, n + leg]
                volts[leg] = -0.5 * share * (before[m, leg] + now[m, leg])
            flux[0, m], flux[1, m] = (2.0 * volts[0] - volts[1] - volts[2]) / 3.0, (volts[1] - volts[2]) / SQRT3
            if kind == R_S:
                terminal[0, m], terminal[1, m] = -g * at[AMP_A, m] * shrink, -g * at[AMP_B, m] * shrink
        elif kind in (R_R, ROTOR_MOD):
            f = rr / r_r if kind == R_R else r_r * channels[held, n]
            rotor[0, m] = f * ((1.0 + base[6]) * ca + base[7] * cb)
            rotor[1, m] = f * (base[7] * ca + (1.0 - base[6]) * cb)
        elif kind == GAMMA_SIGMA:
            sa, sb = at[LEAK_A, m], at[LEAK_B, m]
            current[0, m], current[1, m] = (1.0 + las) * sa + lbs * sb, lbs * sa + (1.0 - las) * sb
        elif kind == GAMMA_M:
            x2, x3 = states[t, 2], states[t, 3]
            qa, qb = (1.0 + mas) * x2 + mbs * x3, mbs * x2 + (1.0 - mas) * x3
            rotor[0, m], rotor[1, m] = waa * qa + wab * qb, wab * qa + wbb * qb
        elif kind == NU:
            sa, sb = at[LEAK_A, m], at[LEAK_B, m]
            jaa, jab, jbb = at[MAG_AA, m] + at[WIDE_AA, m], at[MAG_AB, m] + at[WIDE_AB, m], at[MAG_BB, m] + at[WIDE_BB, m]
            magnetizing[0, m], magnetizing[1, m] = jaa * sa + jab * sb, jab * sa + jbb * sb
            current[0, m], current[1, m] = at[MAG_A, m], at[MAG_B, m]
        elif kind in (LEGS, LEGS_LINK):
            if t > 0:
                fa = fb = 0.0
                for c in range(leg_mean.shape[2]):
                    fa -= legs_vectors[n, c] * leg_mean[m, 0, c]
                    fb -= legs_vectors[n, c] * leg_mean[m, 1, c]
                f = link_factor[held] if kind == LEGS_LINK else 1.0
                flux[0, m], flux[1, m] = f * fa, f * fb
        elif kind == IRON_CURVE:
            f = curve(iron_vectors[n], int(at[IRON_AT, m]), at[IRON_U, m])
            magnetizing[0, m], magnetizing[1, m] = f * at[IRON_A, m], f * at[IRON_B, m]
        elif kind == LEAKAGE_CURVE:
            f = curve(leak_vectors[n], int(at[PATH_AT, m]), at[PATH_U, m])
            fa, fb = f * at[PATH_A, m], f * at[PATH_B, m]
            current[0, m], current[1, m] = fa, fb
            rotor[0, m], rotor[1, m] = -over * (waa * fa + wab * fb), -over * (wab * fa + wbb * fb)
        elif kind == LEAK_SPLIT:
            x2, x3 = states[t, 2], states[t, 3]
            eaa, eab, ebb = at[EXTRA_AA, m], at[EXTRA_AB, m], at[EXTRA_BB, m]
            fa, fb = -leak_ratio * (eaa * x2 + eab * x3), -leak_ratio * (eab * x2 + ebb * x3)
            qa, qb = -over * fa - leak_ratio * at[EXTRA_A, m], -over * fb - leak_ratio * at[EXTRA_B, m]
            current[0, m], current[1, m] = fa, fb
            rotor[0, m], rotor[1, m] = waa * qa + wab * qb, wab * qa + wbb * qb
        elif kind == STOP:
            f = widened(at[IRON_A, m], at[IRON_B, m], stop_radius[n, 1]) / abs(stop_radius[n, 0])
            magnetizing[0, m], magnetizing[1, m] = f * stop_states[t, n, 0], f * stop_states[t, n, 1]
        elif kind == BRANCH:
            qa, qb = states[t, 4 + 2 * n], states[t, 5 + 2 * n]
            if branch_time[n] > 0.0:
                rotor[0, m], rotor[1, m] = -(waa * qa + wab * qb), -(wab * qa + wbb * qb)
            else:
                terminal[0, m], terminal[1, m] = shrink * qa, shrink * qb
        elif kind == IRON_LOSS:
            terminal[0, m] = (at[VOLT_A, m] - rs * at[AMP_A, m]) * shrink
            terminal[1, m] = (at[VOLT_B, m] - rs * at[AMP_B, m]) * shrink
        elif kind == VOLTAGE_MOD:
            if t > 0:
                flux[0, m], flux[1, m] = voltage_a[held] * channels[held, n], voltage_b[held] * channels[held, n]
        elif kind == OMEGA:
            if t > 0:
                f = 0.5 * channels[held, n]
                flux[2, m], flux[3, m] = -f * (states[held, 3] + states[t, 3]), f * (states[held, 2] + states[t, 2])
        elif kind == ROTOR_ANISOTROPY:
            rotor[0, m], rotor[1, m] = tilted(rr * (1.0 - n), rr * n, ca, cb)
        elif kind == LEAKAGE_ANISOTROPY:
            current[0, m], current[1, m] = tilted(gs * (1.0 - n), gs * n, at[LEAK_A, m], at[LEAK_B, m])
            rotor[0, m], rotor[1, m] = tilted(coupled * rr * (1.0 - n), coupled * rr * n, ca, cb)
        elif kind == MAGNETIZING_ANISOTROPY:
            fa, fb = tilted(gm * (1.0 - n), gm * n, states[t, 2], states[t, 3])
            qa, qb = tilted(coupled * rr * (1.0 - n), coupled * rr * n, ca, cb)
            rotor[0, m], rotor[1, m] = waa * fa + wab * fb - qa, wab * fa + wbb * fb - qb
        elif kind == ANISOTROPY_SPLIT:
            rotor[0, m], rotor[1, m] = tilted(rr * splits_a, rr * splits_b, ca, cb)


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _starts(kinds, indices, flux_before, coupled, splits_a, splits_b, x):
    """Derivatives (P, 4) of the state that a segment begins with."""
    fa, fb, ta, tb = flux_before[0, 0], flux_before[0, 1], flux_before[1, 0], flux_before[1, 1]
    for p in range(kinds.shape[0]):
        kind, n = kinds[p], indices[p]
        qa = qb = 0.0
        if kind == CARRY:
            qa, qb = fa if n == 0 else -fb, fb if n == 0 else fa
        elif kind == ROTOR_ANISOTROPY:
            qa, qb = tilted(1.0 - n, n, ta, tb)
        elif kind == LEAKAGE_ANISOTROPY:
            qa, qb = tilted(coupled * (1.0 - n), coupled * n, ta, tb)
        elif kind == MAGNETIZING_ANISOTROPY:
            qa, qb = tilted((1.0 - coupled) * (1.0 - n), (1.0 - coupled) * n, ta, tb)
        elif kind == ANISOTROPY_SPLIT:
            qa, qb = tilted(splits_a, splits_b, ta, tb)
        elif kind == INITIAL_FLUX and n < 2:
            qa, qb = 1.0 - n, n
        # a flux without current is in stator and rotor alike
        x[p, 0], x[p, 1], x[p, 2], x[p, 3] = qa, qb, qa, qb
        if kind == INITIAL_FLUX and n >= 2:
            x[p, n - 2] = 1.0


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _through_the_circuit(last, nu, shrink, cage_push, magnetizing, current, terminal, rotor):
    """What pushes inside the machine are at its terminals and in w, added to `terminal` and in place of `rotor`."""
    for m in range(1, last):
        ua, ub = current[0, m] + nu * magnetizing[0, m], current[1, m] + nu * magnetizing[1, m]
        terminal[0, m] += shrink * ua
        terminal[1, m] += shrink * ub
        qa, qb = magnetizing[0, m] - ua, magnetizing[1, m] - ub
        fa, fb = rotor[0, m], rotor[1, m]
        rotor[0, m] = cage_push[m, 4] * fa + cage_push[m, 5] * fb + cage_push[m, 0] * qa + cage_push[m, 1] * qb
        rotor[1, m] = cage_push[m, 5] * fa + cage_push[m, 6] * fb + cage_push[m, 2] * qa + cage_push[m, 3] * qb


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _forced(last, jump, has_flux, has_more, push, at, terminal, flux, rotor, both, force):
    """What the pushes before and after each period do to the states at its end, (4, B+1); `both` (4, B+1) is room to work in."""
    for c in range(2):
        for m in range(1, last):
            both[c, m] = terminal[c, m - 1] + terminal[c, m] + jump * (at[VOLT_A + c, m] - at[VOLT_A + c, m - 1])
            both[2 + c, m] = rotor[c, m - 1] + rotor[c, m]
    for r in range(4):
        force[r] = 0.0
        if has_more:
            for m in range(1, last):
                force[r, m] = push[r, 0, m] * both[0, m] + push[r, 1, m] * both[1, m]
            for m in range(1, last):
                force[r, m] += push[r, 2, m] * both[2, m] + push[r, 3, m] * both[3, m]
        if has_flux:
            for m in range(1, last):
                force[r, m] += push[r, 4, m] * flux[0, m] + push[r, 5, m] * flux[1, m]
            for m in range(1, last):
                force[r, m] += push[r, 6, m] * flux[2, m] + push[r, 7, m] * flux[3, m]


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _marched(first, last, x, step, amp, force, terminal, out):
    """States (4,) marched through rows `first` ... `last` - 1, derivatives of the current into `out` (2, rows)."""
    x0, x1, x2, x3 = x[0], x[1], x[2], x[3]
    for m in range(1, last):
        if m >= first:
            y0 = step[m, 0, 0] * x0 + step[m, 0, 1] * x1 + step[m, 0, 2] * x2 + step[m, 0, 3] * x3 + force[0, m]
            y1 = step[m, 1, 0] * x0 + step[m, 1, 1] * x1 + step[m, 1, 2] * x2 + step[m, 1, 3] * x3 + force[1, m]
            y2 = step[m, 2, 0] * x0 + step[m, 2, 1] * x1 + step[m, 2, 2] * x2 + step[m, 2, 3] * x3 + force[2, m]
            y3 = step[m, 3, 0] * x0 + step[m, 3, 1] * x1 + step[m, 3, 2] * x2 + step[m, 3, 3] * x3 + force[3, m]
            x0, x1, x2, x3 = y0, y1, y2, y3
        out[0, m - 1] = amp[m, 0, 0] * x0 + amp[m, 0, 1] * x1 + amp[m, 0, 2] * x2 + amp[m, 0, 3] * x3 + terminal[0, m]
        out[1, m - 1] = amp[m, 1, 0] * x0 + amp[m, 1, 1] * x1 + amp[m, 1, 2] * x2 + amp[m, 1, 3] * x3 + terminal[1, m]
    x[0], x[1], x[2], x[3] = x0, x1, x2, x3


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def _marched_with_memory(
    first, last, own, nu, shrink, beta, branch, x, z, q, flux, rate, fed, step, push, amp, cage, cage_push, at, memory,
    force, terminal, rotor, out,
):
    """As `_marched`, a few parameters side by side (a processor overlaps them), where memory operators (derivatives `z`

    (p, s, 2), of the `flux` before) and rotor branches (`q` (p, b, 2), fed by the w before, `rate`) push on top; `fed` (p, 4) is
    what they pushed into current and w at the sample before. `own` (p,): 1 where the iron's flux itself depends on the parameter.
    `branch` (b, 3): what a branch takes from w, keeps of itself over a period, and takes up.
    """
    stops, branches = z.shape[1], q.shape[1]
    for m in range(1, last):
        for p in range(x.shape[0]):
            own_a, own_b = own[p] * at[LEAK_A, m], own[p] * at[LEAK_B, m]
            ja = jb = ca = cb = 0.0
            fa, fb = own_a - flux[p, 0], own_b - flux[p, 1]
            for s in range(stops):
                ya, yb = z[p, s, 0], z[p, s, 1]
                za = memory[m, s, 4] * ya + memory[m, s, 5] * yb + memory[m, s, 1] * fa + memory[m, s, 2] * fb
                zb = memory[m, s, 5] * ya + memory[m, s, 6] * yb + memory[m, s, 2] * fa + memory[m, s, 3] * fb
                z[p, s, 0], z[p, s, 1] = za, zb
                ja += memory[m, s, 0] * za
                jb += memory[m, s, 0] * zb
            for n in range(branches):
                ca += branch[n, 0] * q[p, n, 0]
                cb += branch[n, 0] * q[p, n, 1]
            if m >= first:
                ca += beta * rate[p, 0]
                cb += beta * rate[p, 1]
            ta, tb = shrink * nu * ja, shrink * nu * jb
            qa, qb = (1.0 - nu) * ja - ca, (1.0 - nu) * jb - cb
            wa, wb = cage_push[m, 0] * qa + cage_push[m, 1] * qb, cage_push[m, 2] * qa + cage_push[m, 3] * qb
            x0, x1, x2, x3 = x[p, 0], x[p, 1], x[p, 2], x[p, 3]
            if m >= first:
                f0, f1, f2, f3 = fed[p, 0] + ta, fed[p, 1] + tb, fed[p, 2] + wa, fed[p, 3] + wb
                y0 = step[m, 0, 0] * x0 + step[m, 0, 1] * x1 + step[m, 0, 2] * x2 + step[m, 0, 3] * x3 + force[p, 0, m]
                y1 = step[m, 1, 0] * x0 + step[m, 1, 1] * x1 + step[m, 1, 2] * x2 + step[m, 1, 3] * x3 + force[p, 1, m]
                y2 = step[m, 2, 0] * x0 + step[m, 2, 1] * x1 + step[m, 2, 2] * x2 + step[m, 2, 3] * x3 + force[p, 2, m]
                y3 = step[m, 3, 0] * x0 + step[m, 3, 1] * x1 + step[m, 3, 2] * x2 + step[m, 3, 3] * x3 + force[p, 3, m]
                x0 = y0 + push[0, 0, m] * f0 + push[0, 1, m] * f1 + push[0, 2, m] * f2 + push[0, 3, m] * f3
                x1 = y1 + push[1, 0, m] * f0 + push[1, 1, m] * f1 + push[1, 2, m] * f2 + push[1, 3, m] * f3
                x2 = y2 + push[2, 0, m] * f0 + push[2, 1, m] * f1 + push[2, 2, m] * f2 + push[2, 3, m] * f3
                x3 = y3 + push[3, 0, m] * f0 + push[3, 1, m] * f1 + push[3, 2, m] * f2 + push[3, 3, m] * f3
                x[p, 0], x[p, 1], x[p, 2], x[p, 3] = x0, x1, x2, x3
            fed[p, 0], fed[p, 1], fed[p, 2], fed[p, 3] = ta, tb, wa, wb
            ta += terminal[p, 0, m]
            tb += terminal[p, 1, m]
            out[0, p, m - 1] = amp[m, 0, 0] * x0 + amp[m, 0, 1] * x1 + amp[m, 0, 2] * x2 + amp[m, 0, 3] * x3 + ta
            out[1, p, m - 1] = amp[m, 1, 0] * x0 + amp[m, 1, 1] * x1 + amp[m, 1, 2] * x2 + amp[m, 1, 3] * x3 + tb
            if branches > 0:
                wa += cage[m, 0, 0] * x0 + cage[m, 0, 1] * x1 + cage[m, 0, 2] * x2 + cage[m, 0, 3] * x3 + rotor[p, 0, m]
                wb += cage[m, 1, 0] * x0 + cage[m, 1, 1] * x1 + cage[m, 1, 2] * x2 + cage[m, 1, 3] * x3 + rotor[p, 1, m]
                if m >= first:
                    for n in range(branches):
                        q[p, n, 0] = branch[n, 1] * q[p, n, 0] + branch[n, 2] * (rate[p, 0] + wa)
                        q[p, n, 1] = branch[n, 1] * q[p, n, 1] + branch[n, 2] * (rate[p, 1] + wb)
                rate[p, 0], rate[p, 1] = wa, wb
            fa, fb = (1.0 - nu) * x2 + nu * x0, (1.0 - nu) * x3 + nu * x1
            for s in range(stops):
                z[p, s, 0] += memory[m, s, 1] * fa + memory[m, s, 2] * fb
                z[p, s, 1] += memory[m, s, 2] * fa + memory[m, s, 3] * fb
            flux[p, 0], flux[p, 1] = fa + own_a, fb + own_b


@njit(cache=True, fastmath=True, error_model="numpy", nogil=True)
def sensitivities(
    states, stop_states, voltage_a, voltage_b, voltage_factor, link_factor, phase_factor, rotor_factor,
    omega_rad_per_s, channels, period,
    base, legs, legs_link, iron, leak, legs_top, legs_knee, iron_top, leak_top,
    stop_gain, stop_radius, branch_gain, branch_time,
    kinds, indices, legs_vectors, iron_vectors, leak_vectors, flux_before, out,
):
    """Fills `out` (2, P, n): d i / d parameter at every sample, for the `kinds` and `indices` (P,) listed.

    `states`, `stop_states` and everything before `kinds` are the trajectory's. `legs_vectors` (K, width) are B-spline weights,
    `iron_vectors` and `leak_vectors` (K, intervals, 4) cells; empty where no listed parameter needs them. `flux_before` (2, 2):
    the flux that the segment before left, and what of it decays more per tilt of R_R / L_M.
    """
    samples, count = voltage_a.shape[0], kinds.shape[0]
    working = np.flatnonzero(stop_gain)
    bars = np.flatnonzero((branch_gain != 0.0) & (branch_time > 0.0))
    nu, half = base[4], 0.5 * period
    shrink = 1.0 / (1.0 + base[5] * base[0])
    wants_legs = legs_vectors.shape[0] > 0
    beta, branch = 0.0, np.zeros((bars.shape[0], 3))
    for k, n in enumerate(bars):
        h = half / branch_time[n]
        beta += branch_gain[n] * h / (1.0 + h)
        branch[k, 0], branch[k, 1], branch[k, 2] = branch_gain[n] * (1.0 - h) / (1.0 + h), (1.0 - h) / (1.0 + h), h / (1.0 + h)
    has_memory = working.shape[0] + bars.shape[0] > 0

    # row 0 is the sample before the block
    rows = BLOCK + 1
    at, memory = np.zeros((ROWS, rows)), np.zeros((rows, working.shape[0], 7))
    before, now, secant = np.zeros((rows, 3)), np.zeros((rows, 3)), np.zeros((rows, 3))
    leg_mean = np.zeros((rows, 2, legs_vectors.shape[1]))
    step, push = np.zeros((rows, 4, 4)), np.zeros((4, 8, rows))
    amp, cage, cage_push = np.zeros((rows, 2, 4)), np.zeros((rows, 2, 4)), np.zeros((rows, 7))
    magnetizing, current, flux = np.zeros((2, rows)), np.zeros((2, rows)), np.zeros((4, rows))
    terminal, rotor = np.zeros((SIDE_BY_SIDE, 2, rows)), np.zeros((SIDE_BY_SIDE, 2, rows))
    both, force = np.zeros((4, rows)), np.zeros((SIDE_BY_SIDE, 4, rows))

    # what a parameter takes from block to block: state, pushes into current and w, and those of what remembers
    x, pushed, fed = np.zeros((count, 4)), np.zeros((count, 4)), np.zeros((count, 4))
    z, q = np.zeros((count, working.shape[0], 2)), np.zeros((count, bars.shape[0], 2))
    moved, rate = np.zeros((count, 2)), np.zeros((count, 2))
    own = (kinds == NU).astype(np.float64)
    _starts(kinds, indices, flux_before, base[14], base[15], base[16], x)
    for p in range(count):
        for c in range(2):
            moved[p, c] = (1.0 - nu) * x[p, 2 + c] + nu * x[p, c]

    for start in range(0, samples, BLOCK):
        stop = min(start + BLOCK, samples)
        last = stop - start + 1
        # the first sample of all ends no period
        first = 2 if start == 0 else 1
        _at_samples(
            start, stop, states, stop_states, voltage_a, voltage_b, voltage_factor, link_factor, phase_factor, rotor_factor,
            omega_rad_per_s, base, legs, legs_link, iron, leak, legs_top, legs_knee, iron_top, leak_top, stop_gain, stop_radius,
            branch_gain, branch_time, working, wants_legs, at, before, now, secant, leg_mean, memory,
        )
        _steps_of(start, stop, period, base, beta, at, secant, step, push, amp, cage, cage_push)
        for group in range(0, count, SIDE_BY_SIDE):
            end = min(group + SIDE_BY_SIDE, count)
            for p in range(group, end):
                kind, here = kinds[p], p - group
                magnetizing[:], current[:], flux[:], terminal[here], rotor[here] = 0.0, 0.0, 0.0, 0.0, 0.0
                _pushes(
                    kind, indices[p], start, stop, states, stop_states, voltage_a, voltage_b, link_factor, phase_factor, channels,
                    base, branch_time, stop_radius, legs_vectors, iron_vectors, leak_vectors, at, before, now, leg_mean,
                    magnetizing, current, terminal[here], flux, rotor[here],
                )
                has_flux, has_more = kind in INTO_FLUX, kind == R_S or kind not in INTO_FLUX
                if has_more:
                    _through_the_circuit(last, nu, shrink, cage_push, magnetizing, current, terminal[here], rotor[here])
                for c in range(2):
                    terminal[here, c, 0], rotor[here, c, 0] = pushed[p, c], pushed[p, 2 + c]
                    pushed[p, c], pushed[p, 2 + c] = terminal[here, c, last - 1], rotor[here, c, last - 1]
                # the part of an iron-loss current that follows the voltage at once
                jump = shrink if kind == IRON_LOSS else 0.0
                _forced(last, jump, has_flux, has_more, push, at, terminal[here], flux, rotor[here], both, force[here])
                if not has_memory:
                    _marched(first, last, x[p], step, amp, force[here], terminal[here], out[:, p, start:stop])
            if has_memory:
                _marched_with_memory(
                    first, last, own[group:end], nu, shrink, beta, branch, x[group:end], z[group:end], q[group:end],
                    moved[group:end], rate[group:end], fed[group:end], step, push, amp, cage, cage_push, at, memory,
                    force, terminal, rotor, out[:, group:end, start:stop],
                )
        for table in (before, now, secant):
            table[0] = table[last - 1]
        at[:, 0] = at[:, last - 1]
        amp[0], cage[0] = amp[last - 1], cage[last - 1]
