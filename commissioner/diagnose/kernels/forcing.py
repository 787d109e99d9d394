"""Where each number of the extended model pushes: into fluxes, magnetizing current, stator current and rotor voltage; compiled."""

from __future__ import annotations

from commissioner.compiled import borrowing
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels import samples as row
from commissioner.diagnose.kernels.memory import loop_width
from commissioner.diagnose.kernels.spline import curve
from commissioner.diagnose.kernels.trajectory import SQRT3

INTO_FLUX = (
    kinds.R_S,
    kinds.PHASE_RESISTANCE,
    kinds.LEGS,
    kinds.LEGS_LINK,
    kinds.LEG_SHARE,
    kinds.VOLTAGE_MOD,
    kinds.OMEGA,
)


@borrowing
def tilted(cosine, sine, a, b):
    """The tensor [c s; s -c] of an axis times (a, b)."""
    return cosine * a + sine * b, sine * a - cosine * b


@borrowing
def pushes(kind, n, span, trajectory, drive, channels, machine, asked, samples, into):
    """What one parameter, number `n` of its `kind`, pushes at each sample of `span` (start, stop); `trajectory`: states and stops."""
    start, stop = span
    states, stop_states = trajectory
    voltage_a, voltage_b, link_factor, phase_factor = (
        drive.voltage_a,
        drive.voltage_b,
        drive.link_factor,
        drive.phase_factor,
    )
    base, branch_time, stop_radius = machine.base, machine.branch_time, machine.stop_radius
    legs_vectors, iron_vectors, leak_vectors = asked.legs, asked.iron, asked.leak
    at, before, now, leg_mean, lost = samples.at, samples.before, samples.now, samples.leg_mean, samples.lost
    magnetizing, current, terminal, flux, rotor = into.magnetizing, into.current, into.terminal, into.flux, into.rotor
    rs, r_r, gs, gm, g = base[0], base[1], base[2], base[3], base[5]
    las, lbs, mas, mbs = base[8], base[9], base[10], base[11]
    kappa, leak_ratio, coupled, splits_a, splits_b = base[12], base[13], base[14], base[15], base[16]
    shrink, over = 1.0 / (1.0 + g * rs), kappa - 1.0
    for m in range(1, stop - start + 1):
        t = start + m - 1
        held = max(t - 1, 0)
        rr = at[row.RATE, m]
        waa, wab, wbb = rr * (1.0 + base[6]), rr * base[7], rr * (1.0 - base[6])
        ca, cb = at[row.CAGE_A, m], at[row.CAGE_B, m]
        if kind in (kinds.R_S, kinds.PHASE_RESISTANCE):
            if kind == kinds.R_S:
                ru, rv, rw = phase_factor[held, 0], phase_factor[held, 1], phase_factor[held, 2]
            else:
                ru, rv, rw = rs * channels[held, n], rs * channels[held, n + 1], rs * channels[held, n + 2]
            vu, vv = -0.5 * ru * (before[m, 0] + now[m, 0]), -0.5 * rv * (before[m, 1] + now[m, 1])
            vw = -0.5 * rw * (before[m, 2] + now[m, 2])
            flux[0, m], flux[1, m] = (2.0 * vu - vv - vw) / 3.0, (vv - vw) / SQRT3
            if kind == kinds.R_S:
                terminal[0, m], terminal[1, m] = -g * at[row.AMP_A, m] * shrink, -g * at[row.AMP_B, m] * shrink
        elif kind in (kinds.R_R, kinds.ROTOR_MOD):
            f = rr / r_r if kind == kinds.R_R else r_r * channels[held, n]
            rotor[0, m] = f * ((1.0 + base[6]) * ca + base[7] * cb)
            rotor[1, m] = f * (base[7] * ca + (1.0 - base[6]) * cb)
        elif kind == kinds.GAMMA_SIGMA:
            sa, sb = at[row.LEAK_A, m], at[row.LEAK_B, m]
            current[0, m], current[1, m] = (1.0 + las) * sa + lbs * sb, lbs * sa + (1.0 - las) * sb
        elif kind == kinds.GAMMA_M:
            x2, x3 = states[t, 2], states[t, 3]
            qa, qb = (1.0 + mas) * x2 + mbs * x3, mbs * x2 + (1.0 - mas) * x3
            rotor[0, m], rotor[1, m] = waa * qa + wab * qb, wab * qa + wbb * qb
        elif kind == kinds.NU:
            sa, sb = at[row.LEAK_A, m], at[row.LEAK_B, m]
            jaa, jab, jbb = (
                at[row.MAG_AA, m] + at[row.WIDE_AA, m],
                at[row.MAG_AB, m] + at[row.WIDE_AB, m],
                at[row.MAG_BB, m] + at[row.WIDE_BB, m],
            )
            magnetizing[0, m], magnetizing[1, m] = jaa * sa + jab * sb, jab * sa + jbb * sb
            current[0, m], current[1, m] = at[row.MAG_A, m], at[row.MAG_B, m]
        elif kind in (kinds.LEGS, kinds.LEGS_LINK):
            if t > 0:
                fa = fb = 0.0
                for c in range(leg_mean.shape[2]):
                    fa -= legs_vectors[n, c] * leg_mean[m, 0, c]
                    fb -= legs_vectors[n, c] * leg_mean[m, 1, c]
                f = link_factor[held] if kind == kinds.LEGS_LINK else 1.0
                flux[0, m], flux[1, m] = f * fa, f * fb
        elif kind == kinds.LEG_SHARE:
            if t > 0:
                eu, en = lost[m, 0], lost[m, n]
                flux[0, m], flux[1, m] = (2.0 * eu + en) / 3.0, en / SQRT3 * (1.0 if n == 2 else -1.0)
        elif kind == kinds.IRON_CURVE:
            f = curve(iron_vectors[n], int(at[row.IRON_AT, m]), at[row.IRON_U, m])
            magnetizing[0, m], magnetizing[1, m] = f * at[row.IRON_A, m], f * at[row.IRON_B, m]
        elif kind == kinds.LEAKAGE_CURVE:
            f = curve(leak_vectors[n], int(at[row.PATH_AT, m]), at[row.PATH_U, m])
            fa, fb = f * at[row.PATH_A, m], f * at[row.PATH_B, m]
            current[0, m], current[1, m] = fa, fb
            rotor[0, m], rotor[1, m] = -over * (waa * fa + wab * fb), -over * (wab * fa + wbb * fb)
        elif kind == kinds.LEAK_SPLIT:
            x2, x3 = states[t, 2], states[t, 3]
            eaa, eab, ebb = at[row.EXTRA_AA, m], at[row.EXTRA_AB, m], at[row.EXTRA_BB, m]
            fa, fb = -leak_ratio * (eaa * x2 + eab * x3), -leak_ratio * (eab * x2 + ebb * x3)
            qa, qb = -over * fa - leak_ratio * at[row.EXTRA_A, m], -over * fb - leak_ratio * at[row.EXTRA_B, m]
            current[0, m], current[1, m] = fa, fb
            rotor[0, m], rotor[1, m] = waa * qa + wab * qb, wab * qa + wbb * qb
        elif kind == kinds.STOP:
            f = loop_width(at[row.IRON_A, m], at[row.IRON_B, m], stop_radius[n, 1])[0] / abs(stop_radius[n, 0])
            magnetizing[0, m], magnetizing[1, m] = f * stop_states[t, n, 0], f * stop_states[t, n, 1]
        elif kind == kinds.BRANCH:
            qa, qb = states[t, 4 + 2 * n], states[t, 5 + 2 * n]
            if branch_time[n] > 0.0:
                rotor[0, m], rotor[1, m] = -(waa * qa + wab * qb), -(wab * qa + wbb * qb)
            else:
                terminal[0, m], terminal[1, m] = shrink * qa, shrink * qb
        elif kind == kinds.IRON_LOSS:
            terminal[0, m] = (at[row.VOLT_A, m] - rs * at[row.AMP_A, m]) * shrink
            terminal[1, m] = (at[row.VOLT_B, m] - rs * at[row.AMP_B, m]) * shrink
        elif kind == kinds.VOLTAGE_MOD:
            if t > 0:
                flux[0, m], flux[1, m] = voltage_a[held] * channels[held, n], voltage_b[held] * channels[held, n]
        elif kind == kinds.OMEGA:
            if t > 0:
                f = 0.5 * channels[held, n]
                flux[2, m], flux[3, m] = -f * (states[held, 3] + states[t, 3]), f * (states[held, 2] + states[t, 2])
        elif kind == kinds.ROTOR_ANISOTROPY:
            rotor[0, m], rotor[1, m] = tilted(rr * (1.0 - n), rr * n, ca, cb)
        elif kind == kinds.LEAKAGE_ANISOTROPY:
            current[0, m], current[1, m] = tilted(gs * (1.0 - n), gs * n, at[row.LEAK_A, m], at[row.LEAK_B, m])
            rotor[0, m], rotor[1, m] = tilted(coupled * rr * (1.0 - n), coupled * rr * n, ca, cb)
        elif kind == kinds.MAGNETIZING_ANISOTROPY:
            fa, fb = tilted(gm * (1.0 - n), gm * n, states[t, 2], states[t, 3])
            qa, qb = tilted(coupled * rr * (1.0 - n), coupled * rr * n, ca, cb)
            rotor[0, m], rotor[1, m] = waa * fa + wab * fb - qa, wab * fa + wbb * fb - qb
        elif kind == kinds.ANISOTROPY_SPLIT:
            rotor[0, m], rotor[1, m] = tilted(rr * splits_a, rr * splits_b, ca, cb)


@borrowing
def through_the_circuit(last, nu, shrink, cage_push, into):
    """What pushes inside the machine are at its terminals and in w, added to `terminal` and in place of `rotor`."""
    magnetizing, current, terminal, rotor = into.magnetizing, into.current, into.terminal, into.rotor
    for m in range(1, last):
        ua, ub = current[0, m] + nu * magnetizing[0, m], current[1, m] + nu * magnetizing[1, m]
        terminal[0, m] += shrink * ua
        terminal[1, m] += shrink * ub
        qa, qb = magnetizing[0, m] - ua, magnetizing[1, m] - ub
        fa, fb = rotor[0, m], rotor[1, m]
        rotor[0, m] = cage_push[m, 4] * fa + cage_push[m, 5] * fb + cage_push[m, 0] * qa + cage_push[m, 1] * qb
        rotor[1, m] = cage_push[m, 5] * fa + cage_push[m, 6] * fb + cage_push[m, 2] * qa + cage_push[m, 3] * qb
