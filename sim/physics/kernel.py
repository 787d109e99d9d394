"""The compiled machine: Gamma-form induction machine at standstill behind an averaged three-leg inverter.

Stator and rotor flux linkage in stator coordinates are the states (Slemon, IEEE Trans. Ind. Appl. 25(6), 1989):

    d psi_s/dt = u_s - R_s i_s,    d psi_r/dt = -R_r i_r + omega J psi_r,
    i_r = (psi_r - psi_s)/L_leak,  i_s = psi_s/L_s(|psi_s|) - i_r   (+ iron-loss, eddy and hysteresis currents)

so that a saturating L_s needs no inner solve. Legs, dead time and device drops act on the three phase currents and
come back to alpha-beta by the amplitude-invariant Clarke transformation; the star point floats.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from sim.physics import layout as at
from sim.physics.compiled import kernel, piece
from sim.physics.laws import leakage_excess, saturation_excess, sign_law

HALF_SQRT3 = 0.5 * math.sqrt(3.0)
PLAYS = 3


class Model(NamedTuple):
    """The packed parameters as named scalars, so that the compiler keeps them in registers."""

    is_extended: bool
    per_leak_h: float
    per_lin_h: float
    per_flux_squared: float
    saturation: float
    saturation_order: float
    saturation_shape: float
    salient_c: float
    salient_s: float
    leak_saturation: float
    per_leak_knee_wb: float
    leak_shape: float
    aniso_c: float
    aniso_s: float
    cage_c: float
    cage_s: float
    iron_s: float
    dead_fraction: float
    dead_per_a: float
    dead_shape: float
    drop_v: float
    drop_per_a: float
    drop_shape: float


class Now(NamedTuple):
    """What stands still within one control period: voltage (V), hot resistance tensor (ohm), shaft speed, link (V)."""

    v_a: float
    v_b: float
    r_aa: float
    r_ab: float
    r_bb: float
    r_r: float
    speed: float
    link_v: float


@piece
def load(p):
    """The Model in a packed parameter array."""
    return Model(
        p[at.P_ORDER] > 4.0,
        1.0 / p[at.P_LEAK_H],
        1.0 / p[at.P_LIN_H],
        1.0 / (p[at.P_FLUX_N] * p[at.P_FLUX_N]),
        p[at.P_SAT],
        p[at.P_SAT_ORDER],
        p[at.P_SAT_SHAPE],
        p[at.P_SALIENT_C],
        p[at.P_SALIENT_S],
        p[at.P_LEAKSAT],
        1.0 / p[at.P_LEAKSAT_WB] if p[at.P_LEAKSAT_WB] > 0.0 else 0.0,
        p[at.P_LEAKSAT_SHAPE],
        p[at.P_ANISO_C],
        p[at.P_ANISO_S],
        p[at.P_RR_C],
        p[at.P_RR_S],
        p[at.P_IRON_S],
        p[at.P_DEAD_FRACTION],
        p[at.P_DEAD_PER_A],
        p[at.P_DEAD_SHAPE],
        p[at.P_DROP_V],
        p[at.P_DROP_PER_A],
        p[at.P_DROP_SHAPE],
    )


@piece
def _leg_drop(i, link_v, m):
    """Mean voltage one leg loses to dead time and device threshold while it carries `i` (V, sign of the current)."""
    drop = 0.0
    if m.dead_fraction != 0.0:
        drop += m.dead_fraction * link_v * sign_law(i * m.dead_per_a, m.dead_shape)
    if m.drop_v != 0.0:
        drop += m.drop_v * sign_law(i * m.drop_per_a, m.drop_shape)
    return drop


@piece
def magnetizing_slope(flux_squared, m):
    """i_M / psi_s in 1/H at this squared stator flux (secant)."""
    y = flux_squared * m.per_flux_squared
    return m.per_lin_h * (1.0 + saturation_excess(y, m.saturation, m.saturation_order, m.saturation_shape))


@piece
def rotor_current(flux_a, flux_b, m):
    """Rotor current (A) of a leakage flux psi_r - psi_s: the path saturates and may be anisotropic."""
    stiffness = m.per_leak_h
    if m.leak_saturation != 0.0:
        x = math.sqrt(flux_a * flux_a + flux_b * flux_b) * m.per_leak_knee_wb
        stiffness *= 1.0 + m.leak_saturation * leakage_excess(x, m.leak_shape)
    c, s = m.aniso_c, m.aniso_s
    return stiffness * (flux_a + c * flux_a + s * flux_b), stiffness * (flux_b + s * flux_a - c * flux_b)


@kernel
def _memory_current(x, y, a, b, p):
    """Eddy-branch and hysteresis current (A): extra states of `y`, or the vector plays of `x` seen from flux (a, b)."""
    i_a, i_b = y[at.X_EDDY], y[at.X_EDDY + 1]
    if p[at.P_HYST_A] == 0.0:
        return i_a, i_b
    if p[at.P_HYST_SHAPE] != 1.0:
        return i_a + y[at.X_HYST], i_b + y[at.X_HYST + 1]
    for j in range(PLAYS):
        radius = p[at.P_HYST_WB] * (0.5 + 1.0 * j)
        d_a = a - x[at.X_PLAY + 2 * j]
        d_b = b - x[at.X_PLAY + 2 * j + 1]
        share = p[at.P_HYST_A] / PLAYS / max(radius, math.hypot(d_a, d_b))
        i_a += share * d_a
        i_b += share * d_b
    return i_a, i_b


@kernel
def _move_plays(x, p):
    """Drag each play's centre so that the flux stays within its radius."""
    for j in range(PLAYS):
        radius = p[at.P_HYST_WB] * (0.5 + 1.0 * j)
        d_a = x[at.X_FLUX_S] - x[at.X_PLAY + 2 * j]
        d_b = x[at.X_FLUX_S + 1] - x[at.X_PLAY + 2 * j + 1]
        size = math.hypot(d_a, d_b)
        if size > radius:
            x[at.X_PLAY + 2 * j] += d_a * (1.0 - radius / size)
            x[at.X_PLAY + 2 * j + 1] += d_b * (1.0 - radius / size)


@piece
def _currents(a, b, ra, rb, extra_a, extra_b, m):
    """(i_s, i_r) alpha, beta at stator flux (a, b) and rotor flux (ra, rb), without the pure iron-loss conductance.

    `extra` is what eddies and hysteresis ask for on top.
    """
    slope = magnetizing_slope(a * a + b * b, m)
    ir_a, ir_b = rotor_current(ra - a, rb - b, m)
    is_a = slope * (a + m.salient_c * a + m.salient_s * b) - ir_a + extra_a
    is_b = slope * (b + m.salient_s * a - m.salient_c * b) - ir_b + extra_b
    return is_a, is_b, ir_a, ir_b


@piece
def _back_emf(is_a, is_b, now, m):
    """d psi_s/dt (V): voltage minus resistive drop minus the three legs' errors, in alpha-beta."""
    e_a = now.v_a - now.r_aa * is_a - now.r_ab * is_b
    e_b = now.v_b - now.r_ab * is_a - now.r_bb * is_b
    if m.dead_fraction == 0.0 and m.drop_v == 0.0:
        return e_a, e_b
    drop_u = _leg_drop(is_a, now.link_v, m)
    drop_v = _leg_drop(-0.5 * is_a + HALF_SQRT3 * is_b, now.link_v, m)
    drop_w = _leg_drop(-0.5 * is_a - HALF_SQRT3 * is_b, now.link_v, m)
    return e_a - (2.0 * drop_u - drop_v - drop_w) / 3.0, e_b - (drop_v - drop_w) / (2.0 * HALF_SQRT3)


@piece
def _standing(v_a, v_b, t, link, x, p):
    """The Now of a period: phase resistances as warm as they are, as one symmetric tensor, devices' slope included."""
    r_u = p[at.P_RSA] * (1.0 + x[at.X_HEAT_A]) + p[at.P_SLOPE_OHM]
    r_v = p[at.P_RSB] * (1.0 + x[at.X_HEAT_B]) + p[at.P_SLOPE_OHM]
    r_w = p[at.P_RSC] * (1.0 + x[at.X_HEAT_C]) + p[at.P_SLOPE_OHM]
    return Now(
        v_a,
        v_b,
        (4.0 * r_u + r_v + r_w) / 6.0,
        (r_w - r_v) / (4.0 * HALF_SQRT3),
        0.5 * (r_v + r_w),
        p[at.P_RR] * (1.0 + x[at.X_HEAT_R]),
        _shaft_speed(t, p),
        link,
    )


@piece
def _cage_drop(ir_a, ir_b, r_r, m):
    """Voltage (V) that the rotor current loses in the cage, whose resistance may differ between directions."""
    return r_r * (ir_a + m.cage_c * ir_a + m.cage_s * ir_b), r_r * (ir_b + m.cage_s * ir_a - m.cage_c * ir_b)


@piece
def _stage(ra, rb, is_a, is_b, ir_a, ir_b, now, m):
    """(d psi_s/dt, d psi_r/dt without what deep bars take, i_s), alpha and beta each. Scalars only."""
    e_a, e_b = _back_emf(is_a, is_b, now, m)
    if m.iron_s != 0.0:  # the loss current sits in parallel: terminal current and EMF are found together
        core_a, core_b = is_a, is_b
        for _ in range(6):
            is_a, is_b = core_a + m.iron_s * e_a, core_b + m.iron_s * e_b
            e_a, e_b = _back_emf(is_a, is_b, now, m)
    drop_a, drop_b = _cage_drop(ir_a, ir_b, now.r_r, m)
    d_a = -drop_a - now.speed * rb
    d_b = -drop_b + now.speed * ra
    return e_a, e_b, d_a, d_b, is_a, is_b


@kernel
def _extra_states(y, ir_a, ir_b, a, b, e_a, e_b, p, out):
    """Deep-bar cells (R parallel L, twice), eddy branch (R series L), Dahl hysteresis; returns the cells' voltage."""
    drop_a, drop_b = 0.0, 0.0
    for j in range(4, 12):
        out[j] = 0.0
    for cell in range(2):
        ohm = p[at.P_SKIN1_OHM + 2 * cell]
        if ohm != 0.0:
            henry = p[at.P_SKIN1_H + 2 * cell]
            k = 4 + 2 * cell
            out[k] = ohm * (ir_a - y[k] / henry)
            out[k + 1] = ohm * (ir_b - y[k + 1] / henry)
            drop_a += out[k]
            drop_b += out[k + 1]
    if p[at.P_EDDY_H] != 0.0:
        out[8] = (e_a - p[at.P_EDDY_OHM] * y[8]) / p[at.P_EDDY_H]
        out[9] = (e_b - p[at.P_EDDY_OHM] * y[9]) / p[at.P_EDDY_H]
    if p[at.P_HYST_A] != 0.0 and p[at.P_HYST_SHAPE] != 1.0:
        ceiling = p[at.P_HYST_A]
        if p[at.P_HYST_SHAPE] == 2.0:  # the loop widens with flux, as a measured one does
            ceiling *= 0.6 + 0.4 * (a * a + b * b) / (p[at.P_FLUX_N] * p[at.P_FLUX_N])
        speed = math.hypot(e_a, e_b)
        out[10] = (ceiling * e_a - speed * y[10]) / p[at.P_HYST_WB]
        out[11] = (ceiling * e_b - speed * y[11]) / p[at.P_HYST_WB]
    return drop_a, drop_b


@piece
def link_voltage(t, sag_v, p):
    """DC link (V) at time `t`: rectifier ripple on what the load has left of it."""
    ripple = 0.0
    if p[at.P_RIPPLE] != 0.0:
        turn = 2.0 * math.pi * p[at.P_RIPPLE_HZ] * t + p[at.P_RIPPLE_RAD]
        if p[at.P_RIPPLE_SHAPE] == 0.0:
            ripple = math.cos(turn)
        else:  # a capacitor discharging between pulses
            saw = turn / (2.0 * math.pi)
            saw -= math.floor(saw)
            ripple = 1.0 - 2.0 * saw if saw < 0.85 else -0.7 + 1.7 * (saw - 0.85) / 0.15
    return p[at.P_LINK_V] * (1.0 + p[at.P_RIPPLE] * ripple) - sag_v


@piece
def _shaft_speed(t, p):
    """Electrical shaft speed (rad/s): steady creep, a decaying turn, or a pendulum."""
    if p[at.P_SPEED] == 0.0:
        return 0.0
    if p[at.P_SPEED_SHAPE] == 0.0:
        return p[at.P_SPEED]
    if p[at.P_SPEED_SHAPE] == 1.0:
        return p[at.P_SPEED] * math.exp(-p[at.P_SPEED_RATE] * t)
    return p[at.P_SPEED] * math.cos(p[at.P_SPEED_RATE] * t)


@kernel
def _lag(x, slot, i0, im, i1, p):
    """First-order filter over one substep, exact for a current that is a parabola in it; returns (middle, end)."""
    y0 = x[slot]
    middle = p[at.P_LAG_HALF] * y0 + p[at.P_LAG_H0] * i0 + p[at.P_LAG_HM] * im + p[at.P_LAG_H1] * i1
    end = p[at.P_LAG_KEEP] * y0 + p[at.P_LAG_W0] * i0 + p[at.P_LAG_WM] * im + p[at.P_LAG_W1] * i1
    x[slot] = end
    return middle, end


@kernel
def _sensed(x, axis, i0, im, i1, p):
    """Current behind the anti-alias filter at middle and end of a substep, component `axis` (0 alpha, 1 beta)."""
    start = x[at.X_LAG1 + axis]
    middle, end = _lag(x, at.X_LAG1 + axis, i0, im, i1, p)
    if p[at.P_LAG_ORDER] == 2.0:
        middle, end = _lag(x, at.X_LAG2 + axis, start, middle, end, p)
    return middle, end


@piece
def _warm(x, is_a, is_b, ir_a, ir_b, p):
    """Relative resistance rise of the three phases and the cage after one control period."""
    if p[at.P_HEAT_S] == 0.0 and p[at.P_HEAT_R] == 0.0:
        return
    dt = p[at.P_PERIOD]
    i_b = -0.5 * is_a + HALF_SQRT3 * is_b
    i_c = -0.5 * is_a - HALF_SQRT3 * is_b
    mean = (is_a * is_a + i_b * i_b + i_c * i_c) / 3.0
    for j, i in enumerate((is_a, i_b, i_c)):
        dose = i * i if p[at.P_HEAT_S_SHAPE] == 0.0 else mean
        wall = x[at.X_HEAT_IRON]
        x[at.X_HEAT_A + j] += dt * (p[at.P_HEAT_S] * dose - (x[at.X_HEAT_A + j] - wall) / p[at.P_HEAT_S_TAU])
    x[at.X_HEAT_IRON] += (
        dt
        * ((x[at.X_HEAT_A] + x[at.X_HEAT_B] + x[at.X_HEAT_C]) / 3.0 - 2.0 * x[at.X_HEAT_IRON])
        / (8.0 * p[at.P_HEAT_S_TAU])
    )
    power = ir_a * ir_a + ir_b * ir_b
    x[at.X_HEAT_R] += dt * (p[at.P_HEAT_R] * power - x[at.X_HEAT_R] / p[at.P_HEAT_R_TAU])


@piece
def _peaks(x, is_a, is_b, m):
    """Keep the largest stator flux, inverse-Gamma rotor flux (Wb) and phase current (A) seen."""
    q = x[0] * x[0] + x[1] * x[1]
    ratio = m.per_leak_h / (m.per_leak_h + magnetizing_slope(q, m))
    x[at.X_PEAK_S] = max(x[at.X_PEAK_S], math.sqrt(q))
    x[at.X_PEAK_R] = max(x[at.X_PEAK_R], ratio * math.sqrt(x[2] * x[2] + x[3] * x[3]))
    i_b = abs(-0.5 * is_a + HALF_SQRT3 * is_b)
    i_c = abs(-0.5 * is_a - HALF_SQRT3 * is_b)
    x[at.X_PEAK_A] = max(x[at.X_PEAK_A], abs(is_a), i_b, i_c)


@kernel
def _extra_forward(x, work, reach):
    """Extra states of a Runge-Kutta stage: row 0 = x + reach * row 1."""
    for j in range(4, at.X_ODE):
        work[0, j] = x[j] + reach * work[1, j]


@kernel
def _extra_gather(work, weight):
    """Add a stage's derivative to the step: row 2 += weight * row 1."""
    for j in range(4, at.X_ODE):
        work[2, j] += weight * work[1, j]


@kernel
def _extra_finish(x, work, a, b, p):
    """Extra states at the end of a step, the plays dragged along."""
    for j in range(4, at.X_ODE):
        x[j] += work[2, j]
        work[1, j] = work[2, j] = 0.0
    x[0], x[1] = a, b
    if p[at.P_HYST_SHAPE] == 1.0 and p[at.P_HYST_A] != 0.0:
        _move_plays(x, p)


@kernel
def scratch():
    """Working memory of `advance_period`: stage, derivative and sum of the extra states."""
    return np.zeros((3, at.X_ODE))


@piece
def advance_period(x, p, m, voltage_v, axis, work, points, known):
    """One control period with the leg commands of `voltage_v` along `axis` (cos, sin); fills `points` (POINTS, 2).

    `m` is the Model of `p`, `known` are the `all_currents` of the state `x`; those of the state it leaves are returned.

    Classical Runge-Kutta in P_SUBSTEPS (1 or even) steps; `points` are sensed currents at 0, 1/4 .. 1 of the period, the first
    one just after the voltage has stepped: a loss resistance across the terminals draws its new current at once.
    The link voltage and the hot resistances stand still within the period. `work` is `scratch()`.
    """
    has_lag = p[at.P_LAG_ORDER] != 0.0
    steps = int(p[at.P_SUBSTEPS])
    h = p[at.P_PERIOD] / steps
    t = x[at.X_TIME]
    link = link_voltage(t + 0.5 * p[at.P_PERIOD], x[at.X_SAG], p)
    x[at.X_LINK] = link
    scaled = voltage_v * link / p[at.P_LINK_NOMINAL_V]
    along, across = scaled * axis[0], scaled * axis[1]
    now = _standing(along, across, t, link, x, p)
    points[0, 0] = points[at.POINTS - 1, 0]
    points[0, 1] = points[at.POINTS - 1, 1]
    a, b, ra, rb = x[0], x[1], x[2], x[3]
    squares, mean_a, mean_b = 0.0, 0.0, 0.0
    extra_a, extra_b, i1a, i1b = 0.0, 0.0, 0.0, 0.0
    core_a, core_b, ir_a, ir_b = known
    for step in range(steps):
        e_a, e_b, d_a, d_b, i0a, i0b, ima, imb = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        sum_a, sum_b, sum_c, sum_d = 0.0, 0.0, 0.0, 0.0
        for stage in range(4):
            reach = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            weight = h / 6.0 if stage in (0, 3) else h / 3.0
            ya, yb = a + reach * e_a, b + reach * e_b
            yc, yd = ra + reach * d_a, rb + reach * d_b
            if m.is_extended:
                _extra_forward(x, work, reach)
                extra_a, extra_b = _memory_current(x, work[0], ya, yb, p)
            if stage > 0:
                core_a, core_b, ir_a, ir_b = _currents(ya, yb, yc, yd, extra_a, extra_b, m)
            e_a, e_b, d_a, d_b, is_a, is_b = _stage(yc, yd, core_a, core_b, ir_a, ir_b, now, m)
            if m.is_extended:
                bar_a, bar_b = _extra_states(work[0], ir_a, ir_b, ya, yb, e_a, e_b, p, work[1])
                d_a -= bar_a
                d_b -= bar_b
                _extra_gather(work, weight)
            sum_a, sum_b = sum_a + weight * e_a, sum_b + weight * e_b
            sum_c, sum_d = sum_c + weight * d_a, sum_d + weight * d_b
            if stage == 0:
                i0a, i0b = is_a, is_b
            elif stage == 2:
                ima, imb = is_a, is_b
        a, b, ra, rb = a + sum_a, b + sum_b, ra + sum_c, rb + sum_d
        if m.is_extended:
            _extra_finish(x, work, a, b, p)
            extra_a, extra_b = _memory_current(x, x, a, b, p)
        core_a, core_b, ir_a, ir_b = _currents(a, b, ra, rb, extra_a, extra_b, m)
        i1a, i1b = core_a, core_b
        if m.iron_s != 0.0:
            _, _, _, _, i1a, i1b = _stage(ra, rb, core_a, core_b, ir_a, ir_b, now, m)
            if step == 0 and not has_lag:
                points[0, 0], points[0, 1] = i0a, i0b
        mid_a, mid_b, end_a, end_b = ima, imb, i1a, i1b
        if has_lag:
            mid_a, end_a = _sensed(x, 0, i0a, ima, i1a, p)
            mid_b, end_b = _sensed(x, 1, i0b, imb, i1b, p)
        _keep_points(points, steps, step, mid_a, mid_b, end_a, end_b)
        mean_a += i0a + 4.0 * ima + i1a
        mean_b += i0b + 4.0 * imb + i1b
        squares += i0a * i0a + i0b * i0b + 4.0 * (ima * ima + imb * imb) + i1a * i1a + i1b * i1b
    x[0], x[1], x[2], x[3] = a, b, ra, rb
    _warm(x, i1a, i1b, ir_a, ir_b, p)
    _peaks(x, i1a, i1b, m)
    power = 1.5 * (along * mean_a + across * mean_b) / (6.0 * steps)
    copper = 0.5 * (now.r_aa + now.r_bb) * squares / (6.0 * steps) + now.r_r * (ir_a * ir_a + ir_b * ir_b)
    x[at.X_ENERGY_IN] += power * p[at.P_PERIOD]
    x[at.X_ENERGY_LOSS] += 1.5 * copper * p[at.P_PERIOD]
    _load_link(x, power, p)
    x[at.X_TIME] = t + p[at.P_PERIOD]
    return core_a, core_b, ir_a, ir_b


@piece
def _keep_points(points, steps, step, mid_a, mid_b, end_a, end_b):
    """Store the sensed currents of a substep's middle and end where they fall on a quarter of the period."""
    if steps == 1:  # a machine this slow: the parabola through start, middle and end tells the quarters
        for c, mid, end in ((0, mid_a, end_a), (1, mid_b, end_b)):
            start = points[0, c]
            points[1, c] = 0.375 * start + 0.75 * mid - 0.125 * end
            points[2, c] = mid
            points[3, c] = -0.125 * start + 0.75 * mid + 0.375 * end
            points[4, c] = end
        return
    for half_step, a, b in ((2 * step + 1, mid_a, mid_b), (2 * step + 2, end_a, end_b)):
        for j in range(1, at.POINTS):
            if 2 * half_step == j * steps:
                points[j, 0] = a
                points[j, 1] = b


@piece
def _load_link(x, power, p):
    """Move the link's sag towards what the drawn power (W) leaves; a soft source sags like its root."""
    if p[at.P_SAG_V_PER_W] == 0.0:
        return
    drawn = max(power, 0.0)
    target = p[at.P_SAG_V_PER_W] * drawn
    if p[at.P_SAG_SHAPE] == 1.0:
        target = p[at.P_SAG_V_PER_W] * 50.0 * (math.sqrt(1.0 + drawn / 25.0) - 1.0)
    x[at.X_SAG] += (target - x[at.X_SAG]) * (1.0 - math.exp(-p[at.P_PERIOD] / p[at.P_SAG_TAU]))


@kernel
def _open_flux(rotor_flux, m):
    """Stator flux size (Wb) at open terminals for a rotor flux size: i_M = i_r, by bisection."""
    low, high = 0.0, rotor_flux
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle * magnetizing_slope(middle * middle, m) > (rotor_flux - middle) * m.per_leak_h:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@kernel
def _open_terminals(x, m):
    """Stator circuit open: flux follows the rotor, no current, memory of plays and filters at rest."""
    size = math.hypot(x[2], x[3])
    flux = _open_flux(size, m)
    x[0], x[1] = x[2], x[3]
    if size > 1e-12:  # S psi_s = L (psi_r - psi_s), both tensors at that flux
        slope = magnetizing_slope(flux * flux, m)
        l_aa, l_ab, l_bb = m.per_leak_h * (1.0 + m.aniso_c), m.per_leak_h * m.aniso_s, m.per_leak_h * (1.0 - m.aniso_c)
        push_a, push_b = l_aa * x[2] + l_ab * x[3], l_ab * x[2] + l_bb * x[3]
        s_aa, s_bb = slope * (1.0 + m.salient_c) + l_aa, slope * (1.0 - m.salient_c) + l_bb
        s_ab = slope * m.salient_s + l_ab
        whole = s_aa * s_bb - s_ab * s_ab
        x[0], x[1] = (s_bb * push_a - s_ab * push_b) / whole, (s_aa * push_b - s_ab * push_a) / whole
    for j in range(4, 12):
        x[j] = 0.0
    for j in range(PLAYS):
        x[at.X_PLAY + 2 * j] = x[0]
        x[at.X_PLAY + 2 * j + 1] = x[1]
    for j in range(at.X_LAG1, at.X_LAG2 + 2):
        x[j] = 0.0


@kernel
def coast(x, p, seconds):
    """Blocked output for a time: the diodes drive the current out against the link, then the rotor flux decays.

    Returns the time (s) until the stator current was zero.
    """
    h = 1e-5
    spent = 0.0
    m = load(p)
    push = p[at.P_LINK_V] * 2.0 / 3.0
    now = _standing(0.0, 0.0, x[at.X_TIME], 0.0, x, p)
    while spent < seconds:
        is_a, is_b, ir_a, ir_b = _currents(x[0], x[1], x[2], x[3], 0.0, 0.0, m)
        e_a, e_b, d_a, d_b, _, _ = _stage(x[2], x[3], is_a, is_b, ir_a, ir_b, now, m)
        size = math.hypot(is_a, is_b)
        if size * p[at.P_LEAK_H] <= push * h:
            break
        x[0] += h * (e_a - push * is_a / size)
        x[1] += h * (e_b - push * is_b / size)
        x[2] += h * d_a
        x[3] += h * d_b
        spent += h
    until_zero = spent
    _open_terminals(x, m)
    while spent < seconds:
        step = min(1e-3, seconds - spent)
        size = math.hypot(x[2], x[3])
        rate = p[at.P_RR] * (size - _open_flux(size, m)) * m.per_leak_h
        keep = math.exp(-step * rate / size) if size > 1e-12 else 0.0
        ir_a, ir_b = rotor_current(x[2] - x[0], x[3] - x[1], m)
        lost_a, lost_b = _cage_drop(ir_a, ir_b, p[at.P_RR], m)
        share = rate / size if size > 1e-12 else 0.0
        side_a, side_b = (
            step * (share * x[2] - lost_a),
            step * (share * x[3] - lost_b),
        )  # what a direction keeps more than the mean
        turn = step * _shaft_speed(x[at.X_TIME] + spent, p)  # the rotor takes its flux along
        c, s = math.cos(turn), math.sin(turn)
        left_a, left_b = keep * (x[2] + side_a), keep * (x[3] + side_b)
        x[2], x[3] = c * left_a - s * left_b, s * left_a + c * left_b
        _open_terminals(x, m)
        spent += step
    _cool(x, p, seconds)
    x[at.X_TIME] += seconds
    return until_zero


@kernel
def _cool(x, p, seconds):
    """Temperatures and link sag after a de-energised stretch."""
    fade = math.exp(-seconds / p[at.P_HEAT_S_TAU])
    for j in range(at.X_HEAT_A, at.X_HEAT_C + 1):
        x[j] = x[at.X_HEAT_IRON] + (x[j] - x[at.X_HEAT_IRON]) * fade
    x[at.X_HEAT_R] *= math.exp(-seconds / p[at.P_HEAT_R_TAU])
    x[at.X_SAG] *= math.exp(-seconds / max(p[at.P_SAG_TAU], 1e-6))
    x[at.X_LINK] = p[at.P_LINK_V]


@kernel
def all_currents(x, p):
    """(i_s, i_r) of a state, alpha and beta each (A), without a parallel iron-loss current."""
    extra_a, extra_b = _memory_current(x, x, x[0], x[1], p)
    return _currents(x[0], x[1], x[2], x[3], extra_a, extra_b, load(p))


@kernel
def play_voltages(x, p, voltage_v, axis_rad, out_points, out_link):
    """Apply a row of axis voltages (V), one per control period; (n, POINTS, 2) sensed currents and (n,) link volts."""
    work = scratch()
    axis = (math.cos(axis_rad), math.sin(axis_rad))
    points = np.zeros((at.POINTS, 2))
    known, m = all_currents(x, p), load(p)
    points[at.POINTS - 1, 0], points[at.POINTS - 1, 1] = known[0], known[1]
    for k in range(voltage_v.shape[0]):
        known = advance_period(x, p, m, voltage_v[k], axis, work, points, known)
        for j in range(at.POINTS):
            out_points[k, j, 0] = points[j, 0]
            out_points[k, j, 1] = points[j, 1]
        out_link[k] = x[at.X_LINK]
