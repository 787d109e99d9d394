"""Fourth-order Runge-Kutta of the Gamma machine with its effects, rotor in rotor coordinates, many steps a sample.

States: psi_s (2), psi_r (2, rotor coordinates), currents of two bar sections (4), shaft speed, angle, heat of stator and
rotor, current of a shorted loop.
"""

from __future__ import annotations

import math

import numpy as np

from sim.physics.compiled import kernel, piece

(
    R_S, R_R, LEAK, L_S, INERTIA, PAIRS, FLUX, CURRENT,
    SATURATION, SATURATION_STEEPNESS, LEAKAGE_DROP, LEAKAGE_KNEE, BAR_1, BAR_2, CORNER_1, CORNER_2, IRON, HEAT_S, HEAT_R,
    BROKEN, LOOP, LOOP_TAU, LOOP_PHASE, LINE, LINE_PHASE, DEAD, DEAD_KNEE, SLOT, SLOTS, BEND, HYST, MACHINE_SIZE,
) = range(32)  # fmt: skip
(
    AMPLITUDE, OMEGA, UNBALANCE, UNBALANCE_RAD, FIFTH, SEVENTH, WANDER, WANDER_RATE, PHASE, RAMP, BOOST, SUPPLY_SIZE,
) = range(12)  # fmt: skip
CONSTANT, FAN, RIPPLE_1, RIPPLE_2, SWING, SWING_TURNS, STEPS = range(7)
STATES = 13


@piece
def _voltage(s, t):
    """(alpha, beta): mains, or a filtered inverter whose frequency and voltage rise together."""
    if s[RAMP] > 0.0:
        share = min(t / s[RAMP], 1.0)
        angle = s[OMEGA] * (0.5 * share * min(t, s[RAMP]) + max(t - s[RAMP], 0.0)) + s[PHASE]
        size = s[AMPLITUDE] * (s[BOOST] + (1.0 - s[BOOST]) * share)
        return size * math.cos(angle), size * math.sin(angle)
    angle = s[OMEGA] * t + s[PHASE]
    size = s[AMPLITUDE] * (1.0 + s[WANDER] * math.sin(s[WANDER_RATE] * t))
    a = math.cos(angle) + s[UNBALANCE] * math.cos(angle - s[UNBALANCE_RAD])
    b = math.sin(angle) - s[UNBALANCE] * math.sin(angle - s[UNBALANCE_RAD])
    a += s[FIFTH] * math.cos(5.0 * angle + 0.7) + s[SEVENTH] * math.cos(7.0 * angle - 1.1)
    b += -s[FIFTH] * math.sin(5.0 * angle + 0.7) + s[SEVENTH] * math.sin(7.0 * angle - 1.1)
    return size * a, size * b


@piece
def _load(course, t, speed, angle, synchronous):
    share = speed / synchronous
    torque = course[CONSTANT] * math.tanh(speed / (0.01 * synchronous)) + course[FAN] * share * abs(share)
    for k in range((course.shape[0] - STEPS) // 2):
        late = (t - course[STEPS + 2 * k]) / 2e-3
        if late > -20.0:
            torque += course[STEPS + 2 * k + 1] / (1.0 + math.exp(-min(late, 40.0)))
    ripple = course[RIPPLE_1] * math.cos(angle) + course[RIPPLE_2] * math.cos(2.0 * angle + 0.6)
    if course[SWING] != 0.0:
        ripple += course[SWING] * math.cos(course[SWING_TURNS] * angle + 1.1)
    return torque * (1.0 + ripple)


@piece
def _leakage_current(m, flux):
    """Current of the leakage path at its flux: psi = L i (1 - d + d / sqrt(1 + (i/i0)^2)), by fixed point from above."""
    linear = flux / m[LEAK]
    if m[LEAKAGE_DROP] == 0.0 or linear == 0.0:
        return linear
    current = linear
    for _ in range(12):
        z = current / m[LEAKAGE_KNEE]
        current = linear / (1.0 - m[LEAKAGE_DROP] + m[LEAKAGE_DROP] / math.sqrt(1.0 + z * z))
    return current


@kernel
def slope(m, s, course, t, x, out, seen):
    """Derivatives into `out`; terminal voltage, stator current, torque, load into `seen`."""
    pairs = m[PAIRS]
    c, n = math.cos(pairs * x[9]), math.sin(pairs * x[9])
    va, vb = _voltage(s, t)
    # stator and rotor flux in stator coordinates
    ra, rb = c * x[2] - n * x[3], n * x[2] + c * x[3]
    la, lb = x[0] - ra, x[1] - rb
    leak = math.sqrt(la * la + lb * lb)
    factor = _leakage_current(m, leak) / leak if leak > 1e-12 else 1.0 / m[LEAK]
    ia_r, ib_r = -factor * la, -factor * lb  # rotor current, stator coordinates
    psi = math.sqrt(x[0] * x[0] + x[1] * x[1]) / m[FLUX]
    k = m[SATURATION_STEEPNESS]
    excess = 0.0
    if m[SATURATION] != 0.0 and psi > 1e-9:
        shape = math.sinh(min(k * psi, 30.0)) / (k * psi) - 1.0
        excess = m[SATURATION] * shape / (math.sinh(k) / k - 1.0)
    gap = m[SLOT] * math.cos(m[SLOTS] * x[9]) + m[BEND] * math.cos(x[9])
    main = (1.0 + excess + gap) / m[L_S]
    ia, ib = main * x[0] - ia_r, main * x[1] - ib_r
    # iron beside the magnetising inductance: its voltage is d psi_s / dt
    r_s = m[R_S] * (1.0 + m[HEAT_S] * x[10])
    ia, ib = (ia + m[IRON] * va) / (1.0 + m[IRON] * r_s), (ib + m[IRON] * vb) / (1.0 + m[IRON] * r_s)
    # shorted turns of one phase: the terminals feed what they take, the winding's magnetomotive force and its resistance's
    # drop are those of what is left (Tallam, Habetler, Harley 2002)
    turn = 2.0 * math.pi / 3.0 * m[LOOP_PHASE]
    ct, nt = math.cos(turn), math.sin(turn)
    wound_a, wound_b = ia, ib
    ia, ib = ia + x[12] * ct, ib + x[12] * nt
    ua, ub = va, vb
    if m[LINE] != 0.0:
        at = 2.0 * math.pi / 3.0 * m[LINE_PHASE]
        drop = 2.0 / 3.0 * m[LINE] * (ia * math.cos(at) + ib * math.sin(at))
        ua, ub = ua - drop * math.cos(at), ub - drop * math.sin(at)
    if m[DEAD] != 0.0:
        for j in range(3):
            at = 2.0 * math.pi / 3.0 * j
            lost = 2.0 / 3.0 * m[DEAD] * math.tanh((ia * math.cos(at) + ib * math.sin(at)) / m[DEAD_KNEE])
            ua, ub = ua - lost * math.cos(at), ub - lost * math.sin(at)
    ea, eb = ua - r_s * wound_a, ub - r_s * wound_b
    out[0], out[1] = ea, eb
    ea, eb = ea + r_s * ia, eb + r_s * ib
    out[12] = (m[LOOP] * (ea * ct + eb * nt) - x[12]) / m[LOOP_TAU]
    # rotor in its own coordinates: bars with two sections, an asymmetry, heat
    xr, yr = c * ia_r + n * ib_r, -n * ia_r + c * ib_r
    r_r = m[R_R] * (1.0 + m[HEAT_R] * x[11])
    out[2] = -r_r * (xr * (1.0 + m[BROKEN]) + m[BAR_1] * (xr - x[4]) + m[BAR_2] * (xr - x[6]))
    out[3] = -r_r * (yr * (1.0 - m[BROKEN]) + m[BAR_1] * (yr - x[5]) + m[BAR_2] * (yr - x[7]))
    out[4], out[5] = m[CORNER_1] * (xr - x[4]), m[CORNER_1] * (yr - x[5])
    out[6], out[7] = m[CORNER_2] * (xr - x[6]), m[CORNER_2] * (yr - x[7])
    torque = 1.5 * pairs * (x[0] * -ib_r - x[1] * -ia_r)
    load = _load(course, t, x[8], x[9], s[OMEGA] / pairs)
    out[8] = (torque - load) / m[INERTIA]
    out[9] = x[8]
    hot = 9.0 * m[CURRENT] * m[CURRENT]
    out[10] = (ia * ia + ib * ib) / hot
    out[11] = (ia_r * ia_r + ib_r * ib_r) / hot
    seen[0], seen[1], seen[2], seen[3], seen[4], seen[5] = va, vb, ia, ib, torque, load


@kernel
def march(m, s, course, x, t0, closed, steps, h):
    """`(steps, 8)`: u alpha, beta, i alpha, beta, torque, load, speed, angle; the contactor closes at time `closed`."""
    y, k1, k2, k3, k4 = np.empty(STATES), np.empty(STATES), np.empty(STATES), np.empty(STATES), np.empty(STATES)
    seen, spare = np.zeros(6), np.zeros(6)
    out = np.zeros((steps, 8))
    for q in range(steps):
        t = t0 + q * h
        if t < closed - 0.5 * h:
            out[q, 6], out[q, 7] = x[8], x[9]
            continue
        t -= closed
        slope(m, s, course, t, x, k1, seen)
        for j in range(6):
            out[q, j] = seen[j]
        out[q, 6], out[q, 7] = x[8], x[9]
        for j in range(STATES):
            y[j] = x[j] + 0.5 * h * k1[j]
        slope(m, s, course, t + 0.5 * h, y, k2, spare)
        for j in range(STATES):
            y[j] = x[j] + 0.5 * h * k2[j]
        slope(m, s, course, t + 0.5 * h, y, k3, spare)
        for j in range(STATES):
            y[j] = x[j] + h * k3[j]
        slope(m, s, course, t + h, y, k4, spare)
        for j in range(STATES):
            x[j] += h / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j])
    return out
