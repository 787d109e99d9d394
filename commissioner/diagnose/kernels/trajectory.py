"""The extended two-axis standstill model, compiled: its trajectory under a recorded voltage command.

States: stator flux psi_s, rotor flux psi_R (inverse-Gamma scale), one lagged voltage q_k per extra branch, all as
(alpha, beta) pairs: rotor branches (T_k > 0) and eddy-current paths of the iron (T_k < 0), fed by the stator flux. With
fluxes as states every nonlinearity is explicit:

    psi_0  = (1 - nu) psi_R + nu psi_s              flux of the iron: nu = 0 inverse-Gamma, nu = 1 Gamma     (1)
    j      = G(|psi_0|) psi_0 + sum h_k w_k z_k / r_k   extra magnetizing current, z_k memory operator of scale r_k,
                                                    w_k = 1 or, where loops widen with flux, |psi_0|^2 / top^2 (2)
    i_s    = (1/L_sigma + A_sigma) psi_sigma + e + nu j,                  psi_sigma = psi_s - psi_R          (3)
    e      = S(|phi|) phi,   phi = psi_s - kappa psi_R          extra current of the saturating leakage path (3a)
    i      = (i_s + g v + sum g_k q_k) / (1 + g R_s)    iron-loss conductance g across d psi_s/dt, and eddy paths  (4)
    d psi_s/dt = v + v_legs(i) - R_uvw i                                                                     (5)
    w      = R_R (psi_R / L_M + j - i_s - (kappa - 1) e - sum g_k q_k)                                       (6)
    d psi_R/dt = -w + omega J psi_R,     T_k d q_k/dt = w - q_k    (eddy paths: |T_k| d q_k/dt = d psi_s/dt - q_k)  (7)

(1)-(3) and (6) follow from the T circuit with a saturating branch, rotor side scaled by L_m/L_r: an extra current j
drawn at the magnetizing node gives psi_s = L_sigma i_s + psi_R - mu j, psi_m = psi_R + mu (i_s - j),
i_R = psi_R/L_M - i_s + j, with mu = nu L_sigma the rotor-side share of the leakage (linear case: G. R. Slemon,
IEEE Trans. Ind. Appl. 25(6), 1989). In the same way kappa = 1 + x L_sigma/L_M carries a leakage that saturates with the
stator current (x = 0), with the rotor current (x = 1, the Gamma circuit) or with both.

Classical fourth-order Runge-Kutta with the voltage held over the sample, in steps fine enough for the leg curve; a
model without nonlinearity is stepped by the Taylor series of its matrix exponential, the four-parameter one exactly.
"""

from __future__ import annotations

import numpy as np

from commissioner.compiled import borrowing, inlined, kernel
from commissioner.diagnose.kernels.memory import loop_width, remembered, susceptibility
from commissioner.diagnose.kernels.spline import blend, curve, place, rise, saturating
from commissioner.diagnose.kernels.structures import Array, Course, Drive, Machine

SQRT3 = np.sqrt(3.0)
ROTOR, EDDY = 1.0, -1.0
"""Sign of the time constants of rotor branches, and of eddy-current paths fed by the stator flux."""


@borrowing
def branch_current(x, branch_gain, branch_time, side):
    """Current (or its slope) of all branches on that `side`, from a state `x` (or its derivative)."""
    qa = qb = 0.0
    for n in range(branch_gain.shape[0]):
        if branch_time[n] * side > 0.0:
            qa += branch_gain[n] * x[4 + 2 * n]
            qb += branch_gain[n] * x[5 + 2 * n]
    return qa, qb


@borrowing
def leg_loss(i, legs, top, knee):
    """Voltage a leg loses at current i (odd), and its slope: cells over asinh(|i|/knee)."""
    size = abs(i) / knee
    root = np.sqrt(size * size + 1.0)
    y = np.log(size + root)
    intervals = legs.shape[0]
    j, u = place(min(y, top), top, intervals)
    sign = -1.0 if i < 0 else 1.0
    slope = 0.0 if y >= top else rise(legs, j, u) * (intervals / top) / (knee * root)
    return sign * curve(legs, j, u), slope


@inlined
def _memory_current(pa, pb, moved_a, moved_b, z, stop_gain, stop_radius):
    """Current of the memory operators at flux (pa, pb), moved so far since their states `z`."""
    ja = jb = 0.0
    for s in range(stop_gain.shape[0]):
        if stop_gain[s] != 0.0:
            ya, yb = remembered(z[s, 0], z[s, 1], moved_a, moved_b, stop_radius[s, 0])
            f = stop_gain[s] / abs(stop_radius[s, 0]) * loop_width(pa, pb, stop_radius[s, 1])[0]
            ja += f * ya
            jb += f * yb
    return ja, jb


@inlined
def _rotor_rates(x, k, ca, cb, rr, omega, base, branch_time):
    """(6), (7) from the current (ca, cb) into the cage, into k from 2 on; k[0:2] is d psi_s/dt."""
    wa = rr * ((1.0 + base[6]) * ca + base[7] * cb)
    wb = rr * (base[7] * ca + (1.0 - base[6]) * cb)
    k[2] = -wa - omega * x[3]
    k[3] = -wb + omega * x[2]
    for n in range(branch_time.shape[0]):
        fed_a, fed_b = (wa, wb) if branch_time[n] > 0.0 else (k[0], k[1])
        k[4 + 2 * n] = (fed_a - x[4 + 2 * n]) / abs(branch_time[n])
        k[5 + 2 * n] = (fed_b - x[5 + 2 * n]) / abs(branch_time[n])


@inlined
def _rates(x, k, voltage, resistance, rr, omega, machine, legs, memory):
    """Right-hand side (1)-(7) at x into k, with `voltage`, `memory` current (alpha, beta) and `resistance` (u, v, w); `legs` are those at
    the link's voltage. Returns the terminal current and the paths' derivatives.
    """
    base, iron, leak = machine.base, machine.iron, machine.leak
    branch_gain, branch_time = machine.branch_gain, machine.branch_time
    legs_top, legs_knee = machine.legs_top, machine.legs_knee
    has_legs = machine.legs.shape[0] > 0 or machine.legs_link.shape[0] > 0
    va, vb = voltage
    ru, rv, rw = resistance
    ma, mb = memory
    gs, gm, nu, g, kappa = base[2], base[3], base[4], base[5], base[12]
    # (1), (2)
    ja, jb, jaa, jab, jbb = ma, mb, 0.0, 0.0, 0.0
    if iron.shape[0] > 0:
        pa, pb = (1.0 - nu) * x[2] + nu * x[0], (1.0 - nu) * x[3] + nu * x[1]
        _, _, qa, qb, jaa, jab, jbb = saturating(pa, pb, iron, machine.iron_top)
        ja += qa
        jb += qb
    # (3)
    sa, sb = x[0] - x[2], x[1] - x[3]
    ea = eb = eaa = eab = ebb = 0.0
    if leak.shape[0] > 0:
        _, _, ea, eb, eaa, eab, ebb = saturating(x[0] - kappa * x[2], x[1] - kappa * x[3], leak, machine.leak_top)
    ia = gs * ((1.0 + base[8]) * sa + base[9] * sb) + ea + nu * ja
    ib = gs * (base[9] * sa + (1.0 - base[8]) * sb) + eb + nu * jb
    # (4)
    shrink = 1.0 / (1.0 + g * base[0])
    qa, qb = branch_current(x, branch_gain, branch_time, EDDY)
    ta, tb = (ia + g * va + qa) * shrink, (ib + g * vb + qb) * shrink
    # (5)
    iv = -0.5 * ta + 0.5 * SQRT3 * tb
    iw = -0.5 * ta - 0.5 * SQRT3 * tb
    eu, ev, ew = ru * ta, rv * iv, rw * iw
    if has_legs:
        eu += base[17] * leg_loss(ta, legs, legs_top, legs_knee)[0]
        ev += base[18] * leg_loss(iv, legs, legs_top, legs_knee)[0]
        ew += base[19] * leg_loss(iw, legs, legs_top, legs_knee)[0]
    k[0] = va - (2.0 * eu - ev - ew) / 3.0
    k[1] = vb - (ev - ew) / SQRT3
    # (6), (7)
    qa, qb = branch_current(x, branch_gain, branch_time, ROTOR)
    ca = gm * ((1.0 + base[10]) * x[2] + base[11] * x[3]) + ja - ia - (kappa - 1.0) * ea - qa
    cb = gm * (base[11] * x[2] + (1.0 - base[10]) * x[3]) + jb - ib - (kappa - 1.0) * eb - qb
    _rotor_rates(x, k, ca, cb, rr, omega, base, branch_time)
    return ta, tb, (jaa, jab, jbb, eaa, eab, ebb)


@inlined
def _current_slope(x, k, machine, paths, z):
    """Slope of the terminal current while the voltage is held, from the rates k at x and the paths' derivatives there."""
    base, stop_gain, stop_radius = machine.base, machine.stop_gain, machine.stop_radius
    branch_gain, branch_time = machine.branch_gain, machine.branch_time
    jaa, jab, jbb, eaa, eab, ebb = paths
    gs, nu, kappa = base[2], base[4], base[12]
    qa, qb = (1.0 - nu) * k[2] + nu * k[0], (1.0 - nu) * k[3] + nu * k[1]
    dja, djb = jaa * qa + jab * qb, jab * qa + jbb * qb
    pa, pb = (1.0 - nu) * x[2] + nu * x[0], (1.0 - nu) * x[3] + nu * x[1]
    for s in range(stop_gain.shape[0]):
        if stop_gain[s] != 0.0:
            naa, nab, nbb, _, _, _ = susceptibility(z[s, 0], z[s, 1], 0.0, 0.0, qa, qb, stop_radius[s, 0])
            f = stop_gain[s] / abs(stop_radius[s, 0])
            wide, growth = loop_width(pa, pb, stop_radius[s, 1])
            growth *= 2.0 * (pa * qa + pb * qb)
            dja += f * (wide * (naa * qa + nab * qb) + growth * z[s, 0])
            djb += f * (wide * (nab * qa + nbb * qb) + growth * z[s, 1])
    ua, ub = k[0] - k[2], k[1] - k[3]
    fa, fb = k[0] - kappa * k[2], k[1] - kappa * k[3]
    qa, qb = branch_current(k, branch_gain, branch_time, EDDY)
    shrink = 1.0 / (1.0 + base[5] * base[0])
    da = gs * ((1.0 + base[8]) * ua + base[9] * ub) + eaa * fa + eab * fb + nu * dja + qa
    db = gs * (base[9] * ua + (1.0 - base[8]) * ub) + eab * fa + ebb * fb + nu * djb + qb
    return da * shrink, db * shrink


@borrowing
def _steps_for_legs(current, rate, turn, period, machine, legs, fewest, most):
    """Steps fine enough for the steepest part of the leg curve that the currents (alpha, beta; with their slope) may meet in this period."""
    ia, ib = current
    slope_a, slope_b = rate
    slope_gain, legs_top, legs_knee = machine.base[2], machine.legs_top, machine.legs_knee
    steep = 0.0
    for leg in range(3):
        i, slope = ia, slope_a
        if leg > 0:
            side = 0.5 * SQRT3 if leg == 1 else -0.5 * SQRT3
            i = -0.5 * ia + side * ib
            slope = -0.5 * slope_a + side * slope_b
        low = max(abs(i) - 1.2 * period * (abs(slope) + turn), 0.0)
        steep = max(steep, abs(leg_loss(low, legs, legs_top, legs_knee)[1]))
    return max(fewest, min(most, int(steep * slope_gain * period / 0.3) + 1))


def propagate(
    drive: Drive,
    period: float,
    substeps: int,
    crossing_substeps: int,
    machine: Machine,
    initial_state: Array,
    initial_memory: Array,
) -> Course:
    """`Course` of one segment from `initial_state` (psi_s, psi_R) and what its iron remembers, `initial_memory` (s, 2)."""
    order = 4 + 2 * machine.branch_gain.size
    course = _course(drive.voltage_a.size, order, machine.stop_gain.size)
    x, z, legs_now = np.zeros(order), initial_memory.copy(), machine.legs_link.copy()
    x[:4] = initial_state
    room = x, np.zeros(order), np.zeros(order), np.zeros(order), z, legs_now
    _march(drive, period, (substeps, crossing_substeps), machine, room, course)
    return course


def _course(samples: int, order: int, stops: int) -> Course:
    both = [np.zeros((2, samples)) for _ in range(4)]
    return Course(np.zeros((samples + 1, order)), np.zeros((samples + 1, stops, 2)), *both)


@borrowing
def _kept(t, x, z, states, stop_states):
    for c in range(x.shape[0]):
        states[t, c] = x[c]
    for s in range(z.shape[0]):
        stop_states[t, s, 0], stop_states[t, s, 1] = z[s, 0], z[s, 1]


@borrowing
def _march(drive, period, steps_range, machine, room, course):
    """`propagate` with its steps, fewest and most; `room`: state, three more of its size and the memory's, which are carried on, and cells of the
    legs at the link's voltage."""
    voltage_a, voltage_b, voltage_factor, link_factor = (
        drive.voltage_a,
        drive.voltage_b,
        drive.voltage_factor,
        drive.link_factor,
    )
    phase_factor, rotor_factor, omega_rad_per_s = drive.phase_factor, drive.rotor_factor, drive.omega
    base, legs, legs_link = machine.base, machine.legs, machine.legs_link
    stop_gain, stop_radius = machine.stop_gain, machine.stop_radius
    states, stop_states, current, slope_after, slope_before, rotor_current = course
    (substeps, crossing_substeps), (x, y, k, total, z, blended) = steps_range, room
    samples, stops, order = voltage_a.shape[0], stop_gain.shape[0], x.shape[0]
    nu, rs, r_r = base[4], base[0], base[1]
    has_link = legs_link.shape[0] > 0
    has_legs = has_link or legs.shape[0] > 0
    legs_now = blended if has_link else legs
    last_a = last_b = 0.0
    for t in range(samples):
        now_a, now_b = voltage_a[t] * voltage_factor[t], voltage_b[t] * voltage_factor[t]
        if has_link and (t == 0 or link_factor[t] != link_factor[t - 1]):
            blend(legs, legs_link, link_factor[t], legs_now)
        ru, rv, rw = rs * phase_factor[t, 0], rs * phase_factor[t, 1], rs * phase_factor[t, 2]
        rr, om = r_r * rotor_factor[t], omega_rad_per_s[t]
        steps, h = 1, period
        step, stage = 0, -1
        _kept(t, x, z, states, stop_states)
        from_a, from_b = (1.0 - nu) * x[2] + nu * x[0], (1.0 - nu) * x[3] + nu * x[1]
        while step < steps:
            # stage -1: the state at the sample still belongs to the voltage of the period before
            if stage < 1:
                for c in range(order):
                    y[c] = x[c]
            pa, pb = (1.0 - nu) * y[2] + nu * y[0], (1.0 - nu) * y[3] + nu * y[1]
            ma, mb = _memory_current(pa, pb, pa - from_a, pb - from_b, z, stop_gain, stop_radius)
            va, vb = (last_a, last_b) if stage < 0 else (now_a, now_b)
            ia, ib, paths = _rates(y, k, (va, vb), (ru, rv, rw), rr, om, machine, legs_now, (ma, mb))
            if step == 0 and stage < 1:
                da, db = _current_slope(y, k, machine, paths, z)
                if stage < 0:
                    current[0, t], current[1, t] = ia, ib
                    slope_before[0, t], slope_before[1, t] = da, db
                    rotor_current[0, t], rotor_current[1, t] = -k[2] / rr, -k[3] / rr
                    steps = substeps
                    if has_legs:
                        turn = base[2] * (abs(now_a - last_a) + abs(now_b - last_b))
                        steps = _steps_for_legs(
                            (ia, ib), (da, db), turn, period, machine, legs_now, substeps, crossing_substeps
                        )
                    h = period / steps
                    stage = 0
                    continue
                slope_after[0, t], slope_after[1, t] = da, db
            # classical Runge-Kutta: weights 1 2 2 1
            weight = h / 3.0 if 0 < stage < 3 else h / 6.0
            ahead = h if stage == 2 else 0.5 * h
            for c in range(order):
                total[c] = weight * k[c] + (total[c] if stage > 0 else 0.0)
                y[c] = x[c] + ahead * k[c]
            stage += 1
            if stage == 4:
                for c in range(order):
                    x[c] += total[c]
                pa, pb = (1.0 - nu) * x[2] + nu * x[0], (1.0 - nu) * x[3] + nu * x[1]
                for s in range(stops):
                    z[s, 0], z[s, 1] = remembered(z[s, 0], z[s, 1], pa - from_a, pb - from_b, stop_radius[s, 0])
                from_a, from_b = pa, pb
                step, stage = step + 1, 0
        last_a, last_b = now_a, now_b
    _kept(samples, x, z, states, stop_states)


def propagate_linear(
    voltage_a: Array,
    voltage_b: Array,
    transition: Array,
    gain: Array,
    output: Array,
    slope: Array,
    initial_state: Array,
) -> Course:
    """The four-parameter model stepped exactly, as `propagate`; no rotor current is told.

    `transition` (2, 2) and `gain` (2,) of (psi_s, psi_R) over one period; `output` (2,) gives i, `slope` (3,) di/dt from
    (psi_s, psi_R, v).
    """
    course = _course(voltage_a.size, 4, 0)
    _march_linear(voltage_a, voltage_b, (transition, gain, output, slope), initial_state, course)
    return course


@borrowing
def _march_linear(voltage_a, voltage_b, exact, initial_state, course):
    transition, gain, output, slope = exact
    states, _, current, slope_after, slope_before, _ = course
    samples = voltage_a.shape[0]
    for c in range(2):
        s, r = initial_state[c], initial_state[2 + c]
        last = 0.0
        for t in range(samples):
            now = voltage_a[t] if c == 0 else voltage_b[t]
            states[t, c] = s
            states[t, 2 + c] = r
            current[c, t] = output[0] * s + output[1] * r
            bare = slope[0] * s + slope[1] * r
            slope_before[c, t] = bare + slope[2] * last
            slope_after[c, t] = bare + slope[2] * now
            s, r = (
                transition[0, 0] * s + transition[0, 1] * r + gain[0] * now,
                transition[1, 0] * s + transition[1, 1] * r + gain[1] * now,
            )
            last = now
        states[samples, c] = s
        states[samples, 2 + c] = r


@borrowing
def _rate(x, k, voltage, a, rr, omega, machine, current):
    """(3)-(7) without nonlinear terms: d x/dt into k, terminal current into `current`; `a` resistances aa, ab, bb."""
    base, branch_gain, branch_time = machine.base, machine.branch_gain, machine.branch_time
    va, vb = voltage
    gs, gm, g = base[2], base[3], base[5]
    sa, sb = x[0] - x[2], x[1] - x[3]
    ia = gs * ((1.0 + base[8]) * sa + base[9] * sb)
    ib = gs * (base[9] * sa + (1.0 - base[8]) * sb)
    shrink = 1.0 / (1.0 + g * base[0])
    qa, qb = branch_current(x, branch_gain, branch_time, EDDY)
    ta, tb = (ia + g * va + qa) * shrink, (ib + g * vb + qb) * shrink
    current[0], current[1] = ta, tb
    k[0] = va - a[0] * ta - a[1] * tb
    k[1] = vb - a[1] * ta - a[2] * tb
    ca = gm * ((1.0 + base[10]) * x[2] + base[11] * x[3]) - ia
    cb = gm * (base[11] * x[2] + (1.0 - base[10]) * x[3]) - ib
    qa, qb = branch_current(x, branch_gain, branch_time, ROTOR)
    ca -= qa
    cb -= qb
    _rotor_rates(x, k, ca, cb, rr, omega, base, branch_time)


@borrowing
def _add_eddy_slope(k, branch_gain, branch_time, shrink, slope, t):
    qa, qb = branch_current(k, branch_gain, branch_time, EDDY)
    slope[0, t] += shrink * qa
    slope[1, t] += shrink * qb


@kernel
def rates_of_unit_states(phase_factor, rotor_factor, omega, machine):
    """(size, size + 2): d x/dt of `propagate_varying` for each state alone and each voltage alone, at constant factors."""
    base, size = machine.base, 4 + 2 * machine.branch_gain.shape[0]
    out, x, k, unused, a = np.zeros((size, size + 2)), np.zeros(size), np.zeros(size), np.zeros(2), np.zeros(3)
    _resistances(base, phase_factor, a)
    for c in range(size + 2):
        x[:] = 0.0
        if c < size:
            x[c] = 1.0
        va, vb = 1.0 if c == size else 0.0, 1.0 if c == size + 1 else 0.0
        _rate(x, k, (va, vb), a, base[1] * rotor_factor, omega, machine, unused)
        out[:, c] = k
    return out


@inlined
def _resistances(base, phase_factor, a):
    """Stator resistance tensor aa, ab, bb of three phases into `a`."""
    ru, rv, rw = base[0] * phase_factor[0], base[0] * phase_factor[1], base[0] * phase_factor[2]
    a[0], a[1], a[2] = (4.0 * ru + rv + rw) / 6.0, (rw - rv) / (2.0 * SQRT3), 0.5 * (rv + rw)


def propagate_varying(
    drive: Drive, period: float, steps: int, order: int, whole_step: Array, machine: Machine, initial_state: Array
) -> Course:
    """As `propagate` for a model that is linear at every instant: Taylor series of the exact step, `order` terms; or where nothing
    varies the exact step itself, `whole_step` (size, size + 2) of states and held voltage (empty otherwise).
    """
    size = 4 + 2 * machine.branch_gain.size
    course = _course(drive.voltage_a.size, size, machine.stop_gain.size)
    x = np.zeros(size)
    x[:4] = initial_state
    room = x, np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(3), np.zeros(2), np.zeros(2)
    _march_varying(drive, period, steps, order, whole_step, machine, room, course)
    return course


@borrowing
def _march_varying(drive, period, steps, order, whole_step, machine, room, course):
    """`room`: state, two rates and a state to move to, resistances, two currents."""
    voltage_a, voltage_b, voltage_factor = drive.voltage_a, drive.voltage_b, drive.voltage_factor
    phase_factor, rotor_factor, omega_rad_per_s = drive.phase_factor, drive.rotor_factor, drive.omega
    base, branch_gain, branch_time = machine.base, machine.branch_gain, machine.branch_time
    states, _, current, slope_after, slope_before, rotor_current = course
    x, k, k_next, moved, a, i_now, unused = room
    samples, size = voltage_a.shape[0], x.shape[0]
    h, is_exact = period / steps, whole_step.shape[0] > 0
    gs, shrink = base[2], 1.0 / (1.0 + base[5] * base[0])
    iaa, iab, ibb = gs * (1.0 + base[8]) * shrink, gs * base[9] * shrink, gs * (1.0 - base[8]) * shrink
    last_a = last_b = 0.0
    for t in range(samples):
        va, vb = voltage_a[t] * voltage_factor[t], voltage_b[t] * voltage_factor[t]
        _resistances(base, phase_factor[t], a)
        rr, omega = base[1] * rotor_factor[t], omega_rad_per_s[t]
        for c in range(size):
            states[t, c] = x[c]
        _rate(x, k, (last_a, last_b), a, rr, omega, machine, i_now)
        for c in range(2):
            current[c, t] = i_now[c]
            rotor_current[c, t] = -k[2 + c] / rr
        ua, ub = k[0] - k[2], k[1] - k[3]
        slope_before[0, t], slope_before[1, t] = iaa * ua + iab * ub, iab * ua + ibb * ub
        _add_eddy_slope(k, branch_gain, branch_time, shrink, slope_before, t)
        for step in range(steps):
            _rate(x, k, (va, vb), a, rr, omega, machine, unused)
            if step == 0:
                ua, ub = k[0] - k[2], k[1] - k[3]
                slope_after[0, t], slope_after[1, t] = iaa * ua + iab * ub, iab * ua + ibb * ub
                _add_eddy_slope(k, branch_gain, branch_time, shrink, slope_after, t)
            if is_exact:
                for r in range(size):
                    moved[r] = whole_step[r, size] * va + whole_step[r, size + 1] * vb
                    for c in range(size):
                        moved[r] += whole_step[r, c] * x[c]
                for c in range(size):
                    x[c] = moved[c]
                break
            factor = h
            for j in range(order):
                for c in range(size):
                    x[c] += factor * k[c]
                if j + 1 < order:
                    _rate(k, k_next, (0.0, 0.0), a, rr, omega, machine, unused)
                    k, k_next = k_next, k
                    factor *= h / (j + 2.0)
        last_a, last_b = va, vb
    for c in range(size):
        states[samples, c] = x[c]
