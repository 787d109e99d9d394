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

from commissioner.compiled import borrowing
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels import samples as row
from commissioner.diagnose.kernels.forcing import INTO_FLUX, pushes, through_the_circuit
from commissioner.diagnose.kernels.recursion import forced, marched, marched_with_memory
from commissioner.diagnose.kernels.samples import at_samples
from commissioner.diagnose.kernels.structures import Array, Asked, Carried, Drive, Machine, Matrices, Pushes, Samples
from commissioner.diagnose.kernels.trajectory import SQRT3

BLOCK = 256
"""Samples whose matrices are held at once: with a parameter's pushes they stay in the second-level cache."""
SIDE_BY_SIDE = 4
"""Parameters marched at once where something remembers: one waits for its own sum, four fill the processor."""


@borrowing
def _steps_of(start, stop, period, base, beta, at, secant, matrices, room):
    """(8) solved for the end of the period before each sample, into `matrices`; `room`: (4, 4), (2, 2), (4, 4)."""
    step, push, amp, cage, cage_push = matrices
    gs, gm, nu, g, kappa = base[2], base[3], base[4], base[5], base[12]
    shrink = 1.0 / (1.0 + g * base[0])
    half, over = 0.5 * period, kappa - 1.0
    iaa, iab, ibb = gs * (1.0 + base[8]), gs * base[9], gs * (1.0 - base[8])
    back, v, whole = room
    for m in range(1, stop - start + 1):
        jaa, jab, jbb = at[row.STEP_AA, m], at[row.STEP_AB, m], at[row.STEP_BB, m]
        eaa, eab, ebb = at[row.EXTRA_AA, m], at[row.EXTRA_AB, m], at[row.EXTRA_BB, m]
        # d i = shrink (S d psi_s + R d psi_R) + push;  the current into the cage C = M d psi_s + N d psi_R
        s_aa, s_ab, s_bb = iaa + eaa + nu * nu * jaa, iab + eab + nu * nu * jab, ibb + ebb + nu * nu * jbb
        f = nu * (1.0 - nu)
        r_aa, r_ab, r_bb = f * jaa - iaa - kappa * eaa, f * jab - iab - kappa * eab, f * jbb - ibb - kappa * ebb
        m_aa, m_ab, m_bb = nu * jaa - s_aa - over * eaa, nu * jab - s_ab - over * eab, nu * jbb - s_bb - over * ebb
        f, h = 1.0 - nu, over * kappa
        n_aa = gm * (1.0 + base[10]) + f * jaa - r_aa + h * eaa
        n_ab = gm * base[11] + f * jab - r_ab + h * eab
        n_bb = gm * (1.0 - base[10]) + f * jbb - r_bb + h * ebb
        amp[m, 0, 0], amp[m, 0, 1], amp[m, 0, 2], amp[m, 0, 3] = (
            shrink * s_aa,
            shrink * s_ab,
            shrink * r_aa,
            shrink * r_ab,
        )
        amp[m, 1, 0], amp[m, 1, 1], amp[m, 1, 2], amp[m, 1, 3] = (
            shrink * s_ab,
            shrink * s_bb,
            shrink * r_ab,
            shrink * r_bb,
        )
        # rotor branches at the end of the period: w' = K (... - W (S0 + beta w))
        rr = at[row.RATE, m]
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
        om = half * at[row.SPEED, m]
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
                    back[r, 0] * whole[0, c]
                    + back[r, 1] * whole[1, c]
                    + back[r, 2] * whole[2, c]
                    + back[r, 3] * whole[3, c]
                )
            for c in range(2):
                push[r, c, m] = half * (back[r, 0] * v[0, c] + back[r, 1] * v[1, c])
                push[r, 2 + c, m] = -half * back[r, 2 + c]
            for c in range(4):
                push[r, 4 + c, m] = period * back[r, c]


@borrowing
def _solved(v, amp, cage, half, om, back):
    """Inverse (4, 4) of I - T/2 [V amp; -cage + omega J], by the Schur complement of the rotor block."""
    a00, a01 = (
        1.0 - half * (v[0, 0] * amp[0, 0] + v[0, 1] * amp[1, 0]),
        -half * (v[0, 0] * amp[0, 1] + v[0, 1] * amp[1, 1]),
    )
    a10, a11 = (
        -half * (v[1, 0] * amp[0, 0] + v[1, 1] * amp[1, 0]),
        1.0 - half * (v[1, 0] * amp[0, 1] + v[1, 1] * amp[1, 1]),
    )
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


def sensitivities(
    trajectory: tuple[Array, Array],
    drive: Drive,
    channels: Array,
    period: float,
    machine: Machine,
    asked: Asked,
    out: Array,
) -> None:
    """Fills `out` (2, P, n): d i / d parameter at every sample, for what is `asked`; `trajectory`: states and stops of `propagate`."""
    working = np.flatnonzero(machine.stop_gain)
    bars = np.flatnonzero((machine.branch_gain != 0.0) & (machine.branch_time > 0.0))
    half, count, width = 0.5 * period, asked.kinds.size, asked.legs.shape[1]
    h = half / machine.branch_time[bars]
    gain = machine.branch_gain[bars]
    beta, branch = float(np.sum(gain * h / (1.0 + h))), np.empty((bars.size, 3))
    branch[:, 0], branch[:, 1], branch[:, 2] = gain * (1.0 - h) / (1.0 + h), (1.0 - h) / (1.0 + h), h / (1.0 + h)
    circuit = machine.base[4], 1.0 / (1.0 + machine.base[5] * machine.base[0]), beta

    # row 0 is the sample before the block
    rows = BLOCK + 1
    at, memory = np.zeros((row.ROWS, rows)), np.zeros((rows, working.size, 7))
    before, now, secant, lost = (np.zeros((rows, 3)) for _ in range(4))
    known = Samples(at, before, now, secant, np.zeros((rows, 2, width)), lost, memory)
    amp, cage = np.zeros((rows, 2, 4)), np.zeros((rows, 2, 4))
    matrices = Matrices(np.zeros((rows, 4, 4)), np.zeros((4, 8, rows)), amp, cage, np.zeros((rows, 7)))
    magnetizing, current, flux = np.zeros((2, rows)), np.zeros((2, rows)), np.zeros((4, rows))
    terminal, rotor = np.zeros((SIDE_BY_SIDE, 2, rows)), np.zeros((SIDE_BY_SIDE, 2, rows))
    pushing = magnetizing, current, flux, terminal, rotor
    room = np.zeros((4, rows)), np.zeros((SIDE_BY_SIDE, 4, rows)), np.zeros((4, 4)), np.zeros((2, 2)), np.zeros((4, 4))
    of_legs = machine.legs_link.copy(), np.zeros((3, width))

    # what a parameter takes from block to block: state, pushes into current and w, and those of what remembers
    x, pushed = asked.start.copy(), np.zeros((count, 4))
    carried = Carried(
        own=(asked.kinds == kinds.NU).astype(np.float64), x=x, z=np.zeros((count, working.size, 2)), q=np.zeros((count, bars.size, 2)),
        flux=(1.0 - circuit[0]) * x[:, 2:] + circuit[0] * x[:, :2], rate=np.zeros((count, 2)), fed=np.zeros((count, 4)),
    )  # fmt: skip
    given, made = (trajectory, drive, channels, machine, asked), (known, matrices, pushing, carried, pushed)
    _sensitivities(given, period, (working, branch, circuit), made, room, of_legs, out)


@borrowing
def _sensitivities(given, period, remembering, made, room, of_legs, out):
    """`remembering`: the memory operators at work (s,), of rotor branches what `marched_with_memory` says, and of the circuit; `made`: what is
    known of a block, and of each parameter from block to block; the rest to work in."""
    (trajectory, drive, channels, machine, asked), (working, branch, circuit) = given, remembering
    known, matrices, (magnetizing, current, flux, terminal, rotor), carried, pushed = made
    (states, stop_states), (both, force, back, v, whole), (nu, shrink, beta) = trajectory, room, circuit
    at, amp, cage, x, base = known.at, matrices.amp, matrices.cage, carried.x, machine.base
    samples, count, wants_legs = drive.voltage_a.shape[0], asked.kinds.shape[0], asked.legs.shape[0] > 0
    has_memory = working.shape[0] + branch.shape[0] > 0
    for start in range(0, samples, BLOCK):
        stop = min(start + BLOCK, samples)
        last = stop - start + 1
        # the first sample of all ends no period
        first = 2 if start == 0 else 1
        at_samples(start, stop, states, stop_states, drive, machine, working, wants_legs, known, of_legs)
        _steps_of(start, stop, period, base, beta, at, known.secant, matrices, (back, v, whole))
        for group in range(0, count, SIDE_BY_SIDE):
            end = min(group + SIDE_BY_SIDE, count)
            for p in range(group, end):
                kind, here = asked.kinds[p], p - group
                into = Pushes(magnetizing, current, terminal[here], flux, rotor[here])
                magnetizing[:], current[:], flux[:], terminal[here], rotor[here] = 0.0, 0.0, 0.0, 0.0, 0.0
                span = (start, stop)
                pushes(kind, asked.indices[p], span, trajectory, drive, channels, machine, asked, known, into)
                has_flux, has_more = kind in INTO_FLUX, kind == kinds.R_S or kind not in INTO_FLUX
                if has_more:
                    through_the_circuit(last, nu, shrink, matrices.cage_push, into)
                for c in range(2):
                    terminal[here, c, 0], rotor[here, c, 0] = pushed[p, c], pushed[p, 2 + c]
                    pushed[p, c], pushed[p, 2 + c] = terminal[here, c, last - 1], rotor[here, c, last - 1]
                # the part of an iron-loss current that follows the voltage at once
                jump = shrink if kind == kinds.IRON_LOSS else 0.0
                forced(last, jump, has_flux, has_more, matrices.push, at, into, both, force[here])
                if not has_memory:
                    marched(first, last, x[p], matrices, force[here], terminal[here], out[:, p, start:stop])
            if has_memory:
                these = slice(group, end)
                of_these = Carried(
                    carried.own[these], x[these], carried.z[these], carried.q[these], carried.flux[these], carried.rate[these],
                    carried.fed[these],
                )  # fmt: skip
                more = force, terminal, rotor
                marched_with_memory(
                    first, last, circuit, branch, of_these, matrices, known, more, out[:, group:end, start:stop]
                )
        for r in range(row.ROWS):
            at[r, 0] = at[r, last - 1]
        for r in range(2):
            for c in range(4):
                amp[0, r, c], cage[0, r, c] = amp[last - 1, r, c], cage[last - 1, r, c]
