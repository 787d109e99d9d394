"""What the trajectory of the extended model is at every sample, as its derivatives need it, compiled."""

from __future__ import annotations

import numpy as np

from commissioner.compiled import borrowing
from commissioner.diagnose.kernels.memory import loop_width, susceptibility
from commissioner.diagnose.kernels.spline import blend, place, saturating
from commissioner.diagnose.kernels.trajectory import EDDY, ROTOR, SQRT3, branch_current, leg_loss

(
    VOLT_A, VOLT_B, AMP_A, AMP_B, RATE, SPEED, LEAK_A, LEAK_B, IRON_A, IRON_B, MAG_A, MAG_B, MAG_AA, MAG_AB, MAG_BB, PATH_A, PATH_B,
    EXTRA_A, EXTRA_B, EXTRA_AA, EXTRA_AB, EXTRA_BB, CAGE_A, CAGE_B, STEP_AA, STEP_AB, STEP_BB, WIDE_AA, WIDE_AB, WIDE_BB,
    IRON_AT, IRON_U, PATH_AT, PATH_U, ROWS,
) = range(35)  # fmt: skip
"""Rows of what is known at a sample, alpha and beta or a tensor's aa, ab, bb: voltage, terminal current, R_R, speed, flux of the
leakage and of the iron, magnetizing current and its derivative without what remembers, flux of the saturating path, its current and
derivative, current into the cage, derivative of all magnetizing currents, growth of loops that widen; places in the curves.
"""


@borrowing
def _phases(a, b, out):
    out[0] = a
    out[1] = -0.5 * a + 0.5 * SQRT3 * b
    out[2] = -0.5 * a - 0.5 * SQRT3 * b


@borrowing
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


@borrowing
def at_samples(start, stop, states, stop_states, drive, machine, working, wants_legs, samples, room):
    """(1)-(6) at samples `start` ... `stop` - 1 into columns 1 ... of `samples.at` and rows 1 ... of its others; 0 is the sample before.

    A sample still belongs to the voltage of the period it ends. `working` (s,): the memory operators at work. `room`: cells of the legs at a
    link's voltage, and weights (3, width) of a leg's path, to work in.
    """
    voltage_a, voltage_b, voltage_factor = drive.voltage_a, drive.voltage_b, drive.voltage_factor
    link_factor, phase_factor = drive.link_factor, drive.phase_factor
    base, legs, legs_link, iron, leak = machine.base, machine.legs, machine.legs_link, machine.iron, machine.leak
    legs_top, legs_knee, branch_gain, branch_time = (
        machine.legs_top,
        machine.legs_knee,
        machine.branch_gain,
        machine.branch_time,
    )
    stop_gain, stop_radius = machine.stop_gain, machine.stop_radius
    at, before, now, secant = samples.at, samples.before, samples.now, samples.secant
    leg_mean, lost, memory = samples.leg_mean, samples.lost, samples.memory
    rs, gs, gm, nu, g, kappa = base[0], base[2], base[3], base[4], base[5], base[12]
    shrink = 1.0 / (1.0 + g * rs)
    iaa, iab, ibb = gs * (1.0 + base[8]), gs * base[9], gs * (1.0 - base[8])
    has_link = legs_link.shape[0] > 0
    has_legs = has_link or legs.shape[0] > 0
    blended, mean = room
    legs_now = blended if has_link else legs
    width = leg_mean.shape[2]
    linked = -1
    for t in range(start, stop):
        m = t - start + 1
        held = max(t - 1, 0)
        va, vb = voltage_a[held] * voltage_factor[held], voltage_b[held] * voltage_factor[held]
        if t == 0:
            va = vb = 0.0
        x0, x1, x2, x3 = states[t, 0], states[t, 1], states[t, 2], states[t, 3]
        at[VOLT_A, m], at[VOLT_B, m] = va, vb
        at[RATE, m], at[SPEED, m] = base[1] * drive.rotor_factor[held], drive.omega[held]
        # (1), (2)
        pa, pb = (1.0 - nu) * x2 + nu * x0, (1.0 - nu) * x3 + nu * x1
        ja = jb = jaa = jab = jbb = 0.0
        if iron.shape[0] > 0:
            j, at[IRON_U, m], ja, jb, jaa, jab, jbb = saturating(pa, pb, iron, machine.iron_top)
            at[IRON_AT, m] = j
        at[MAG_AA, m], at[MAG_AB, m], at[MAG_BB, m] = jaa, jab, jbb
        at[IRON_A, m], at[IRON_B, m] = pa, pb
        grown_aa = grown_ab = grown_bb = 0.0
        last = max(t - 1, 0)
        ra, rb = (
            (1.0 - nu) * states[last, 2] + nu * states[last, 0],
            (1.0 - nu) * states[last, 3] + nu * states[last, 1],
        )
        for k, s in enumerate(working):
            f = stop_gain[s] / abs(stop_radius[s, 0])
            za, zb = stop_states[t, s, 0], stop_states[t, s, 1]
            # a loop that widens with flux: its factor grows along the flux (symmetric part)
            wide, grown = loop_width(pa, pb, stop_radius[s, 1])
            grown *= f
            grown_aa += 2.0 * grown * za * pa
            grown_ab += grown * (za * pb + zb * pa)
            grown_bb += 2.0 * grown * zb * pb
            f *= wide
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
            j, at[PATH_U, m], ea, eb, eaa, eab, ebb = saturating(la, lb, leak, machine.leak_top)
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
        _phases(
            at[AMP_A, m - 1] + jump * (va - at[VOLT_A, m - 1]),
            at[AMP_B, m - 1] + jump * (vb - at[VOLT_B, m - 1]),
            before[m],
        )
        if t == 0:
            _phases(ta, tb, before[m])
        if has_link and (linked < 0 or link_factor[held] != link_factor[linked]):
            blend(legs, legs_link, link_factor[held], legs_now)
            linked = held
        for leg in range(3):
            secant[m, leg] = rs * phase_factor[held, leg]
            if has_legs:
                e1, d1 = leg_loss(now[m, leg], legs_now, legs_top, legs_knee)
                e0, d0 = leg_loss(before[m, leg], legs_now, legs_top, legs_knee)
                gap = now[m, leg] - before[m, leg]
                secant[m, leg] += base[17 + leg] * (0.5 * (d0 + d1) if abs(gap) < 1e-3 * legs_knee else (e1 - e0) / gap)
                if wants_legs:
                    middle = leg_loss(0.5 * (before[m, leg] + now[m, leg]), legs_now, legs_top, legs_knee)[0]
                    lost[m, leg] = (e0 + 4.0 * middle + e1) / 6.0
        if wants_legs and t > 0:
            mean[:] = 0.0
            for leg in range(3):
                _leg_path(before[m, leg], now[m, leg], legs_top, legs_knee, width - 3, mean[leg])
            for c in range(width):
                leg_mean[m, 0, c] = (2.0 * base[17] * mean[0, c] - base[18] * mean[1, c] - base[19] * mean[2, c]) / 3.0
                leg_mean[m, 1, c] = (base[18] * mean[1, c] - base[19] * mean[2, c]) / SQRT3
