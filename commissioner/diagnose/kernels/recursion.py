"""One step after the other of (8) of `tangent`: derivatives of states and current from pushes, compiled."""

from __future__ import annotations

from commissioner.compiled import borrowing
from commissioner.diagnose.kernels import samples as row


@borrowing
def forced(last, jump, has_flux, has_more, push, at, into, both, force):
    """What the pushes before and after each period do to the states at its end, (4, B+1); `both` (4, B+1) is room to work in."""
    terminal, flux, rotor = into.terminal, into.flux, into.rotor
    for c in range(2):
        for m in range(1, last):
            both[c, m] = (
                terminal[c, m - 1] + terminal[c, m] + jump * (at[row.VOLT_A + c, m] - at[row.VOLT_A + c, m - 1])
            )
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


@borrowing
def marched(first, last, x, matrices, force, terminal, out):
    """States (4,) marched through rows `first` ... `last` - 1, derivatives of the current into `out` (2, rows)."""
    step, amp = matrices.step, matrices.amp
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


@borrowing
def marched_with_memory(first, last, circuit, branch, carried, matrices, samples, pushed, out):
    """As `marched`, a few parameters side by side (a processor overlaps them), where memory operators and rotor branches push on top.

    `circuit`: nu, shrink, beta; `branch` (b, 3): what a branch takes from w, keeps of itself over a period, and takes up. `pushed`:
    force (p, 4, B+1), and pushes into the terminal current and w (p, 2, B+1).
    """
    nu, shrink, beta = circuit
    own, x, z, q, flux, rate, fed = carried
    step, push, amp, cage, cage_push = matrices
    at, memory = samples.at, samples.memory
    force, terminal, rotor = pushed
    stops, branches = z.shape[1], q.shape[1]
    for m in range(1, last):
        for p in range(x.shape[0]):
            own_a, own_b = own[p] * at[row.LEAK_A, m], own[p] * at[row.LEAK_B, m]
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
