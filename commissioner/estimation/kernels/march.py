"""The inverse-Gamma machine in stator coordinates with everything that may be added to it, one Runge-Kutta step a sample.

Inverse Gamma after Slemon 1989 (DOI 10.1109/28.44251): psi_s = L_sigma i + psi_R, psi_R = L_M (i + i_R),
d psi_s/dt = u - R_s i, d psi_R/dt = -R_R i_R + j w psi_R. The voltage between samples is cubic: a linear one errs by a tenth
of the noise. The kernel is compiled for real numbers and for complex ones: derivatives by the complex step (Squire, Trapp 1998,
DOI 10.1137/S003614459631241X) are exact to the last digit, from the same lines. Vectors are pairs of numbers, amplitude-invariant.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import forget_stale_kernels, njit
from commissioner.estimation.numbers import AT

forget_stale_kernels(__file__.replace("\\", "/").rpartition("/")[0], "numbers.py")

FAST = {"reassoc", "arcp", "contract", "nsz", "nnan", "ninf"}
_kernel = njit(error_model="numpy", fastmath=FAST, nogil=True)
_inlined = njit(inline="always", error_model="numpy", fastmath=FAST)

STATES = 11
"""psi_s, psi_R, current of the bars' slow part, heat of stator and rotor, electrical speed and angle, voltage behind a loop's leakage."""
UNSET = 1e300
"""Of the last state at a window's first sample: what the steady fundamental makes of it."""
MOST_REACTANCE = 10.0
"""Of a loop over its resistance, by which its harmonics are."""
R_S, R_R, L_SIGMA, L_M = (
    AT["stator_resistance"],
    AT["rotor_resistance"],
    AT["leakage_inductance"],
    AT["magnetizing_inductance"],
)
SAT_S, SAT_R = AT["stator_saturation_1"], AT["rotor_saturation_1"]
SAT_G, SPLIT = AT["gap_saturation_1"], AT["leakage_split"]
SOFT, SOFT_R, BOW, KNEE, BAR, CORNER, IRON = (
    AT["leakage_softness"],
    AT["rotor_leakage_softness"],
    AT["leakage_bend"],
    AT["leakage_knee"],
    AT["bar_resistance"],
    AT["bar_corner"],
    AT["iron_conductance"],
)
HEAT_S, HEAT_R, CAGE, LOOP, LINE = (
    AT["stator_heat"],
    AT["rotor_heat"],
    AT["cage_asymmetry_re"],
    AT["loop_conductance_u"],
    AT["line_re"],
)
DEAD, DEAD_KNEE, V_GAIN, V_OFFSET = AT["dead_voltage"], AT["dead_knee"], AT["voltage_gain_re"], AT["voltage_offset_re"]
W_GAIN, W_LAG, W_RIPPLE, DELAY = AT["speed_gain"], AT["speed_lag"], AT["speed_ripple_cos"], AT["delay"]
GAIN, OFFSET, PAIR = AT["current_gain_v"], AT["current_offset_u"], AT["current_pair_u"]
INERTIA, CONSTANT, LINEAR, FAN = AT["inertia"], AT["load_constant"], AT["load_linear"], AT["load_fan"]
LOADS, RIPPLE, SWING, SWING_TURNS = 11, AT["load_ripple_cos"], AT["load_swing_cos"], AT["load_swing_turns"]
SLOWEST2, SLOW2 = 1e-5, 1e-3
"""Squares of the shares of synchronous speed over which a friction comes to its full torque, and over which that of breaking away is lost."""
MOST_FLUX = 6.0
"""Square of the flux over rated flux beyond which the law of the iron goes on with its last value: a fit on its way."""
HALF_3 = 0.5 * float(np.sqrt(3.0))
LOOP_A = (1.0, -0.5, -0.5, HALF_3, 0.0, -HALF_3)
LOOP_B = (0.0, HALF_3, -HALF_3, -0.5, 1.0, -0.5)
"""Axes of the windings: u, v, w of a star, uv, vw, wu of a delta, which lie 30 degrees behind."""
STEP, BLOCK = 1e-30, 129
"""Of the complex step; samples of a path whose derivatives stand in the cache together, each block's last the next one's first."""
GAP_STEPS = 4
"""Of Newton's method for the flux of the air gap: the saturated current through the leakage moves it by some per cent only."""


class Load(NamedTuple):
    """Load torque, of rated torque, between `knots` (m,), at `places` among them: at samples and between them (2n - 1,), or where each of a step's stages
    has its own (3n - 2,), twice between them."""

    knots: NDArray[Any]
    places: NDArray[np.float64]


class States(NamedTuple):
    """`before` a sample's step and `after` it, (1 or n, STATES): one and the same row, or one a sample. Where there is room (n, 4, 6) `within`, at each
    stage: speed, angle and acceleration of the shaft, torque of the load's laws, its derivatives by speed and angle; `is_known`: there already, so
    that the laws are straight lines."""

    before: NDArray[Any]
    after: NDArray[Any]
    within: NDArray[np.float64]
    is_known: bool


class Directions(NamedTuple):
    """Along which derivatives are taken: of the parameters (C, ...) and of the first state (C, STATES), and then along the first knots of the load.
    `rows` (C + knots,): where each of them is told, or `NO_ROW`."""

    dp: NDArray[np.float64]
    dx: NDArray[np.float64]
    rows: NDArray[np.int64]


NO_ROW = -1
"""Of a direction that nobody asks for."""


@_inlined
def _per(z):
    """1 / z. Of complex numbers to the first order of what is imaginary, which is a derivative's step of 1e-30: their own division costs thrice."""
    whole = 1.0 / z.real
    return whole - (z - z.real) * (whole * whole)


@_inlined
def _root(z):
    """Square root, to the same order."""
    whole = np.sqrt(z.real)
    return whole + (z - z.real) * (0.5 / whole)


@_inlined
def _cos_sin(z):
    """Cosine and sine, to the same order."""
    c, s = np.cos(z.real), np.sin(z.real)
    return c - s * (z - z.real), s + c * (z - z.real)


@_inlined
def _friction_laws(share):
    """What the four numbers from `load_constant` on are multiplied with in the load; `share` of synchronous speed."""
    square = share * share
    dry = share * _per(_root(square + SLOWEST2))
    size = share if share.real > 0.0 else -share
    return dry, share, share * size, dry * SLOW2 * _per(square + SLOW2)


@_inlined
def _ripple_laws(dry, angle):
    """The same of the four from `load_ripple_cos` on; `dry` of friction, `angle` of the shaft."""
    c, s = _cos_sin(angle)
    return dry * c, dry * s, dry * (c * c - s * s), dry * 2.0 * s * c


@_inlined
def _swing_laws(p, dry, angle):
    """The same of the two from `load_swing_cos` on, and what the turns are multiplied with for a small change of theirs."""
    c, s = _cos_sin(p[SWING_TURNS] * angle)
    return dry * c, dry * s, dry * angle * (p[SWING + 1] * c - p[SWING] * s)


@_inlined
def _by_laws(p, share, angle, has_ripple):
    """Torque of friction, fan and ripple, of rated torque."""
    dry, linear, fan, breaking = _friction_laws(share)
    load = p[CONSTANT] * dry + p[CONSTANT + 1] * linear + p[CONSTANT + 2] * fan + p[CONSTANT + 3] * breaking
    if has_ripple:
        c, s, cc, ss = _ripple_laws(dry, angle)
        load += p[RIPPLE] * c + p[RIPPLE + 1] * s + p[RIPPLE + 2] * cc + p[RIPPLE + 3] * ss
    if p[SWING_TURNS] != 0.0 and (p[SWING] != 0.0 or p[SWING + 1] != 0.0):
        c, s, _ = _swing_laws(p, dry, angle)
        load += p[SWING] * c + p[SWING + 1] * s
    return load


@_inlined
def _gap_current(p, both, z0):
    """Extra magnetizing current over psi_0 / L_M, of the flux of the air gap; `z0`: square of psi_0 over rated flux; `both`: k (1 - k).

    In the T circuit with the share k of L_sigma before the air gap (k = 0: stator flux, 1: rotor flux) the saturated current
    i_x divides: (1 - k) i_x comes from the stator, k i_x from the rotor, and psi_m = (1 - k) psi_s + k psi_R - k (1 - k) L_sigma i_x.
    """
    back = both * p[L_SIGMA] * _per(p[L_M])
    share, grown = 1.0 + 0.0 * z0, 0.0 * z0
    for _ in range(GAP_STEPS):
        z = z0 * share * share
        steep = z * (p[SAT_G] + z * (2.0 * p[SAT_G + 1] + 3.0 * z * p[SAT_G + 2]))
        if z.real > MOST_FLUX:
            z = MOST_FLUX + 0.0 * z0
            steep = 0.0 * z0
        grown = z * (p[SAT_G] + z * (p[SAT_G + 1] + z * p[SAT_G + 2]))
        share -= (share * (1.0 + back * grown) - 1.0) * _per(1.0 + back * (grown + 2.0 * steep))
    return share * grown


@_inlined
def _reactance(g, b, least):
    """Of a shorted loop over its resistance, at rated frequency; zero where it has none. `least`: what a step can follow."""
    x = g * 0.0
    if g.real > 0.0 and b.real > 0.0:
        x = b * _per(g)
        if x.real < least:
            x = g * 0.0 + least
        if x.real > MOST_REACTANCE:
            x = g * 0.0 + MOST_REACTANCE
    return x


@_kernel
def march(p, scales, x, voltage, speed, load_torque, period, is_free, out, shaft):
    """Stator current (n, 3: alpha, beta, zero as the sensors show it) into `out`, speed and torque into `shaft` (n, 2).

    `voltage` (2n - 1, 2) and `speed` (2n - 1, 2: electrical speed, its derivative) at samples and between them; with
    `is_free` the speed follows from the shaft and the `load_torque`.
    Where `scales` says that the voltage is held, each step has what stands midway to its end.
    `x` is the state at the first sample and is overwritten. Types follow `p`.
    """
    own = x.reshape((1, STATES))
    states = States(own, own, np.empty((0, 4, 6)), False)
    _steps(p, scales, states, voltage, speed, load_torque, period, is_free, out, shaft)
    _chain(p, scales[0], period, out)


@_kernel
def _steps(p, scales, states, voltage, speed, load_torque, period, is_free, out, shaft):
    """As `march`, the machine's own currents alone: alpha, beta. Of `states` one row goes from sample to sample, or each sample has its own."""
    before, after, within = states.before, states.after, states.within
    is_each, has_own_loads = before.shape[0] > 1, load_torque.places.shape[0] > 2 * out.shape[0] - 1
    knots, places = load_torque.knots, load_torque.places
    current, volt, w_n, torque_n, pairs, holds = scales
    flux2 = 1.0 / (volt / w_n) ** 2
    n = out.shape[0]
    one = p[0] * 0.0
    per_leak, per_main = _per(p[L_SIGMA]), _per(p[L_M])
    has_s = (p[SAT_S] != 0.0) or (p[SAT_S + 1] != 0.0) or (p[SAT_S + 2] != 0.0)
    has_r = (p[SAT_R] != 0.0) or (p[SAT_R + 1] != 0.0) or (p[SAT_R + 2] != 0.0)
    has_g = (p[SAT_G] != 0.0) or (p[SAT_G + 1] != 0.0) or (p[SAT_G + 2] != 0.0)
    to_stator = _per(1.0 + p[SPLIT])
    to_rotor = p[SPLIT] * to_stator
    has_soft, has_soft_r = p[SOFT] != 0.0, p[SOFT_R] != 0.0
    has_bar, has_heat = p[BAR] != 0.0, (p[HEAT_S] != 0.0) or (p[HEAT_R] != 0.0)
    has_cage = (p[CAGE] != 0.0) or (p[CAGE + 1] != 0.0)
    has_loop, x_loops = False, np.empty(len(LOOP_A), dtype=p.dtype)
    for j in range(len(LOOP_A)):
        g, b = p[LOOP + 2 * j], p[LOOP + 2 * j + 1]
        has_loop = has_loop or g != 0.0 or b != 0.0
        x_loops[j] = _reactance(g, b, w_n * period)
    has_line = (p[LINE] != 0.0) or (p[LINE + 1] != 0.0)
    has_dead = p[DEAD] != 0.0
    has_ripple = (p[W_RIPPLE] != 0.0) or (p[W_RIPPLE + 1] != 0.0)
    has_load_ripple = (p[RIPPLE] != 0.0) or (p[RIPPLE + 1] != 0.0) or (p[RIPPLE + 2] != 0.0) or (p[RIPPLE + 3] != 0.0)
    rotor_side = 1.0 + p[L_SIGMA] * per_main
    per_knee2 = _per((p[L_SIGMA] * p[KNEE] * current) ** 2)
    loop_scale, hot = current / volt, 1.0 / (9.0 * current * current)
    iron = p[IRON] * loop_scale
    dead_knee = (p[DEAD_KNEE] * current) ** 2
    per_inertia = pairs * _per(p[INERTIA])
    per_w, per_pairs = 1.0 / w_n, 1.0 / pairs
    h = period
    k = np.empty((4, STATES), dtype=p.dtype)
    y = np.empty(STATES, dtype=p.dtype)
    for q in range(n):
        at = q if is_each else 0
        for stage in range(4):
            if stage == 0:
                m = 2 * q
                for j in range(STATES):
                    y[j] = before[at, j]
            else:
                if q == n - 1:
                    break
                m = 2 * q + (2 if stage == 3 else 1)
                part = h if stage == 3 else 0.5 * h
                for j in range(STATES):
                    y[j] = before[at, j] + part * k[stage - 1, j]
            # speed
            if is_free:
                w = y[8]
                k[stage, 8] = one
            else:
                w = speed[m, 0] * (1.0 - p[W_GAIN]) + p[W_LAG] * speed[m, 1]
                k[stage, 8] = one
                if has_ripple:
                    c, s = _cos_sin(y[9] * per_pairs)
                    w += w_n * (p[W_RIPPLE] * c + p[W_RIPPLE + 1] * s)
            # terminal voltage
            end = m - 1 if stage == 3 and holds else m  # a held voltage ends as it is midway
            ma, mb = voltage[end, 0], voltage[end, 1]
            ua = ma + p[V_GAIN] * ma + p[V_GAIN + 1] * mb + volt * p[V_OFFSET]
            ub = mb - p[V_GAIN] * mb + p[V_GAIN + 1] * ma + volt * p[V_OFFSET + 1]
            # currents
            la, lb = (y[0] - y[2]) * per_leak, (y[1] - y[3]) * per_leak
            if has_soft:
                z = ((y[0] - y[2]) ** 2 + (y[1] - y[3]) ** 2) * per_knee2
                z = z * _per(1.0 + z)
                grown = 1.0 + p[SOFT] * z * (1.0 + p[BOW] * z)
                la, lb = la * grown, lb * grown
            ea, eb = one, one
            if has_soft_r:
                da, db = y[0] - rotor_side * y[2], y[1] - rotor_side * y[3]
                z = (da * da + db * db) * per_knee2
                z = z * _per(1.0 + z)
                grown = per_leak * p[SOFT_R] * z * (1.0 + p[BOW] * z)
                ea, eb = da * grown, db * grown
            main_a, main_b = y[2] * per_main, y[3] * per_main
            if has_r:
                z = (y[2] * y[2] + y[3] * y[3]) * flux2
                if z.real > MOST_FLUX:
                    z = one + MOST_FLUX
                grown = 1.0 + z * (p[SAT_R] + z * (p[SAT_R + 1] + z * p[SAT_R + 2]))
                main_a, main_b = main_a * grown, main_b * grown
            ra, rb = main_a - la - rotor_side * ea, main_b - lb - rotor_side * eb
            ia, ib = la + ea, lb + eb
            if has_s:
                z = (y[0] * y[0] + y[1] * y[1]) * flux2
                if z.real > MOST_FLUX:
                    z = one + MOST_FLUX
                grown = per_main * z * (p[SAT_S] + z * (p[SAT_S + 1] + z * p[SAT_S + 2]))
                ia, ib = ia + y[0] * grown, ib + y[1] * grown
            if has_g:
                ga, gb = to_stator * y[0] + to_rotor * y[2], to_stator * y[1] + to_rotor * y[3]
                grown = _gap_current(p, to_stator * to_rotor, (ga * ga + gb * gb) * flux2) * per_main
                ga, gb = ga * grown, gb * grown
                ia, ib = ia + to_stator * ga, ib + to_stator * gb
                ra, rb = ra + to_rotor * ga, rb + to_rotor * gb
            # shorted turns lie in the winding: R_s takes (i_k - mu i_f), which is the machine's own current without what the terminals
            # take for them (Tallam, Habetler, Harley, IEEE Trans. Ind. Appl. 38(4), 2002)
            shorted_a, shorted_b = one, one
            k[stage, 10] = one
            if has_loop:
                for j in range(len(LOOP_A)):
                    ca, cb = LOOP_A[j], LOOP_B[j]
                    g, b, along = p[LOOP + 2 * j], p[LOOP + 2 * j + 1], ua * ca + ub * cb
                    linked = w_n * (y[0] * ca + y[1] * cb)
                    x_loop = x_loops[j]
                    if x_loop.real > 0.0:
                        # a resistance and a leakage, not a conductance and a susceptance: of the mains' harmonics they take less
                        if y[10].real >= UNSET:
                            y[10] = (along + x_loop * linked) * _per(1.0 + x_loop * x_loop)
                            before[at, 10] = y[10]
                        behind = (1.0 + x_loop * x_loop) * y[10]
                        per_loop = _per(x_loop)
                        one_loop = g * along + b * per_loop * (behind - along)
                        k[stage, 10] = w_n * per_loop * (along - y[10])
                    else:
                        one_loop = g * along + b * linked
                    shorted_a, shorted_b = (
                        shorted_a + loop_scale * one_loop * ca,
                        shorted_b + loop_scale * one_loop * cb,
                    )
            r_s = p[R_S] * (1.0 + p[HEAT_S] * y[6])
            if iron != 0.0:
                shrink = _per(1.0 + iron * r_s)
                ia, ib = (ia + iron * ua) * shrink, (ib + iron * ub) * shrink
            own_a, own_b = ia, ib
            if has_loop:
                ia, ib = ia + shorted_a, ib + shorted_b
            if has_line:
                da = p[R_S] * (p[LINE] * ia + p[LINE + 1] * ib)
                db = p[R_S] * (p[LINE + 1] * ia - p[LINE] * ib)
                ua, ub = ua - da, ub - db
            if has_dead:
                for j in range(3):
                    ca = 1.0 if j == 0 else -0.5
                    cb = 0.0 if j == 0 else (HALF_3 if j == 1 else -HALF_3)
                    own = ia * ca + ib * cb
                    lost = 2.0 / 3.0 * volt * p[DEAD] * own * _per(_root(own * own + dead_knee))
                    ua, ub = ua - lost * ca, ub - lost * cb
            if stage == 0:
                out[q, 0], out[q, 1] = ia, ib
                shaft[q, 0] = w
                shaft[q, 1] = 1.5 * pairs * (y[3] * ra - y[2] * rb)
            # slopes
            k[stage, 0], k[stage, 1] = ua - r_s * own_a, ub - r_s * own_b
            r_r = p[R_R] * (1.0 + p[HEAT_R] * y[7])
            fa, fb = r_r * ra, r_r * rb
            if has_bar:
                fa, fb = fa + p[R_R] * p[BAR] * (ra - y[4]), fb + p[R_R] * p[BAR] * (rb - y[5])
                k[stage, 4] = p[CORNER] * (ra - y[4]) - w * y[5]
                k[stage, 5] = p[CORNER] * (rb - y[5]) + w * y[4]
            else:
                k[stage, 4], k[stage, 5] = one, one
            if has_cage:
                c, s = _cos_sin(2.0 * y[9])
                aa, ab = p[CAGE] * c - p[CAGE + 1] * s, p[CAGE] * s + p[CAGE + 1] * c
                fa, fb = fa + p[R_R] * (aa * ra + ab * rb), fb + p[R_R] * (ab * ra - aa * rb)
            k[stage, 2] = -fa - w * y[3]
            k[stage, 3] = -fb + w * y[2]
            if has_heat:
                k[stage, 6], k[stage, 7] = hot * (ia * ia + ib * ib), hot * (ra * ra + rb * rb)
            else:
                k[stage, 6], k[stage, 7] = one, one
            if is_free:
                torque = 1.5 * pairs * (y[3] * ra - y[2] * rb)
                share = w * per_w
                place = places[3 * q + stage if has_own_loads else m]
                low = min(int(place), knots.shape[0] - 2)
                part = place - low
                load = knots[low] * (1.0 - part) + knots[low + 1] * part
                if states.is_known:
                    load += within[q, stage, 3] + within[q, stage, 4] * (w - within[q, stage, 0])
                    load += within[q, stage, 5] * (y[9] - within[q, stage, 1])
                else:
                    load += _by_laws(p, share, y[9] * per_pairs, has_load_ripple)
                k[stage, 8] = per_inertia * (torque - torque_n * load)
            k[stage, 9] = w
            if within.shape[0] > 0 and not states.is_known:
                within[q, stage, 0], within[q, stage, 1], within[q, stage, 2] = w.real, y[9].real, k[stage, 8].real
        if q < n - 1:
            for j in range(STATES):
                after[at, j] = before[at, j] + h / 6.0 * (k[0, j] + 2.0 * (k[1, j] + k[2, j]) + k[3, j])


@_kernel
def _chain(p, current, period, out):
    """What the current's sensors make of it: age, gains against their mean, offsets; alpha, beta, zero.

    Of two sensors one reads too much by half of what they differ by and the other too little; the phase without one is
    their negative sum."""
    n = out.shape[0]
    if p[DELAY] != 0.0:
        s = p[DELAY] / period
        # cubic through the samples n-2 ... n+1, at n - s
        w0 = s * (s * s - 1.0) / 6.0
        w1 = -(s + 1.0) * s * (s - 2.0) / 2.0
        w2 = (s + 1.0) * (s - 1.0) * (s - 2.0) / 2.0
        w3 = -s * (s - 1.0) * (s - 2.0) / 6.0
        for j in range(2):
            older, old, now = out[0, j], out[0, j], out[0, j]
            for q in range(n):
                ahead = out[q + 1, j] if q < n - 1 else now
                mixed = w0 * older + w1 * old + w2 * now + w3 * ahead
                older, old, now = old, now, ahead
                out[q, j] = mixed
    gv, gw = p[GAIN], p[GAIN + 1]
    ou, ov, ow = current * p[OFFSET], current * p[OFFSET + 1], current * p[OFFSET + 2]
    no_u, no_v, no_w = 0.5 * p[PAIR], 0.5 * p[PAIR + 1], 0.5 * p[PAIR + 2]
    for q in range(n):
        a, b = out[q, 0], out[q, 1]
        iu, iv, iw = a, -0.5 * a + HALF_3 * b, -0.5 * a - HALF_3 * b
        u = iu * (1.0 - gv - gw) + ou + no_w * iu - no_v * iu + no_u * (iw - iv)
        v = iv * (1.0 + gv) + ov + no_u * iv - no_w * iv + no_v * (iu - iw)
        w = iw * (1.0 + gw) + ow + no_v * iw - no_u * iw + no_w * (iv - iu)
        out[q, 0] = (2.0 * u - v - w) * (1.0 / 3.0)
        out[q, 1] = (v - w) * (HALF_3 * 2.0 / 3.0)
        if out.shape[1] > 2:
            out[q, 2] = (u + v + w) * (1.0 / 3.0)


class Moves(NamedTuple):
    """Of each step of a block what moves what: the state at its end (B, STATES, ...) by that at its begin, by numbers, by the load at its
    four stages; the current (B, 2, ...) by state and by numbers."""

    to_state: NDArray[np.float64]
    by_number: NDArray[np.float64]
    by_load: NDArray[np.float64]
    to_current: NDArray[np.float64]
    on_current: NDArray[np.float64]


@_inlined
def _turns_load_alone(p, is_free):
    """Whether the angle does nothing but move the load."""
    return is_free and p[CAGE] == 0.0 and p[CAGE + 1] == 0.0


@_kernel
def _moving(p, period, is_free, w_n):
    """(STATES,): which states move at all and anything with them."""
    moves = np.ones(STATES, dtype=np.bool_)
    moves[4] = moves[5] = p[BAR] != 0.0
    moves[6] = moves[7] = (p[HEAT_S] != 0.0) or (p[HEAT_R] != 0.0)
    moves[8], moves[9] = is_free, (p[CAGE] != 0.0) or (p[CAGE + 1] != 0.0)
    for j in range(4):
        moves[9] = moves[9] or (is_free and p[RIPPLE + j] != 0.0) or (not is_free and j < 2 and p[W_RIPPLE + j] != 0.0)
    moves[10] = False
    for j in range(len(LOOP_A)):
        moves[10] = moves[10] or _reactance(p[LOOP + 2 * j], p[LOOP + 2 * j + 1], w_n * period) > 0.0
    return moves


@_kernel
def _moves(p, scales, states, numbers, voltage, speed, load, period, is_free, moves):
    """`moves` of the block that goes through `states` (before: B, STATES), along every state that moves and the `numbers` (P, COUNT). `load`: at the
    stages of its steps."""
    count, path = states.before.shape[0], states.before
    is_moving = _moving(p, period, is_free, scales[2])
    before, after = np.empty((count, STATES), dtype=np.complex128), np.empty((count, STATES), dtype=np.complex128)
    run, shaft = np.empty((count, 3), dtype=np.complex128), np.empty((count, 2), dtype=np.complex128)
    many, is_by_load = numbers.shape[0], _turns_load_alone(p, is_free)
    moved, level = np.empty(p.size, dtype=np.complex128), np.empty(3 * count - 2, dtype=np.complex128)
    for c in range(STATES + many + (4 if is_free else 0)):
        if c < STATES and (not is_moving[c] or (c == 9 and is_by_load)):
            continue
        number, is_free_number = c - STATES, False
        for i in range(p.size):
            moved[i] = p[i]
            if 0 <= number < many and numbers[number, i] != 0.0:
                moved[i] += 1j * STEP * numbers[number, i]
                is_free_number = True
        for m in range(level.size):
            level[m] = load.knots[m].real
        for q in range(count):
            if 0 <= number < many:
                for i in range(STATES):
                    moves.by_number[q, i, number] = 0.0
            for i in range(STATES):
                before[q, i] = path[q, i].real
        if c < STATES:
            for q in range(count):
                before[q, c] += 1j * STEP
        elif c < STATES + many:
            if not is_free_number:
                continue
        else:  # one step begins where another ends: every other of these, the others, twice what lies between
            first = (0, 3, 1, 2)[c - STATES - many]
            for m in range(first, level.size, 6 if first % 3 == 0 else 3):
                level[m] += 1j * STEP
        _steps(
            moved, scales, States(before, after, states.within, True), voltage, speed, Load(level, load.places), period, is_free, run, shaft,
        )  # fmt: skip
        for q in range(count):
            if c < STATES:
                moves.to_current[q, 0, c], moves.to_current[q, 1, c] = run[q, 0].imag / STEP, run[q, 1].imag / STEP
            elif c < STATES + many:
                moves.on_current[q, 0, c - STATES] = run[q, 0].imag / STEP
                moves.on_current[q, 1, c - STATES] = run[q, 1].imag / STEP
            if q == count - 1:
                break
            for i in range(STATES):
                by = after[q, i].imag / STEP
                if c < STATES:
                    moves.to_state[q, i, c] = by
                elif c < STATES + many:
                    moves.by_number[q, i, c - STATES] = by
                elif c >= STATES + many + 2:
                    moves.by_load[q, i, c - STATES - many - 1] = by
                else:
                    moves.by_load[q, i, 0 if (q % 2 == 0) == (c == STATES + many) else 3] = by
    return is_moving


@_kernel
def tangents(p, scales, x0, along, voltage, speed, load_torque, period, is_free, out):
    """Derivatives `along` directions into their rows of `out` (R, n, 2 or 3: alpha, beta, and zero where it is asked for).

    What moves is one linear machine whose numbers change from sample to sample. These are computed once, by a complex step from each state of
    the path and along each number; every direction goes through that machine.
    """
    knots, places = load_torque.knots, load_torque.places
    n, many, all_ = out.shape[1], along.dp.shape[0], along.rows.size
    bare, numbers, torques = np.empty(p.size), np.zeros((many, p.size)), np.zeros((many, 1 + LOADS))
    whole, is_seen = np.empty(p.size, dtype=np.complex128), np.zeros(many, dtype=np.bool_)
    for k in range(p.size):
        is_of_sensors = DELAY <= k < PAIR + 3  # which move no machine
        bare[k] = 0.0 if is_of_sensors else p[k]
        whole[k] = bare[k]
        for c in range(many):
            if is_of_sensors:
                is_seen[c] = is_seen[c] or along.dp[c, k] != 0.0
            elif INERTIA <= k <= INERTIA + LOADS:  # which move the shaft alone
                torques[c, k - INERTIA] = along.dp[c, k]
            else:
                numbers[c, k] = along.dp[c, k]
                whole[k] += (
                    1j * STEP * abs(numbers[c, k])
                )  # a state that only a number moves which is zero is on the path too
    size = min(n, BLOCK)
    moves = Moves(
        np.zeros((size, STATES, STATES)), np.zeros((size, STATES, many)), np.zeros((size, STATES, 4)),
        np.zeros((size, 2, STATES)), np.zeros((size, 2, many)),
    )  # fmt: skip
    path, own, shaft = (
        np.zeros((size, STATES), dtype=np.complex128),
        np.empty((n, 3)),
        np.empty((size, 2), dtype=np.complex128),
    )
    run, load, within = (
        np.empty((size, 3), dtype=np.complex128),
        np.zeros(3 * size - 2, dtype=np.complex128),
        np.empty((size, 4, 6)),
    )
    shown = np.zeros((size, 2, all_))
    moved, ahead = np.zeros((STATES, all_)), np.zeros((STATES, all_))
    stages = np.empty(3 * size - 2)
    for m in range(stages.size):
        stages[m] = m
    for j in range(STATES):
        path[0, j] = x0[j]
        for c in range(many):
            moved[j, c] = along.dx[c, j]
    begin, begun = 0, many
    while True:
        count = min(size, n - begin)
        end, ends = 2 * (begin + count) - 1, 3 * count - 2
        volts, speeds, level = voltage[2 * begin : end], speed[2 * begin : end], Load(load[:ends], stages[:ends])
        if is_free:
            for m in range(ends):
                place = places[2 * (begin + m // 3) + min(m % 3, 1)]
                low = min(int(place), knots.shape[0] - 2)
                part = place - low
                load[m] = knots[low] * (1.0 - part) + knots[low + 1] * part
        unset = path[0, 10]
        _steps(
            whole, scales, States(path[:count], path[1:count], within, False), volts, speeds, level, period, is_free, run[:count],
            shaft[:count],
        )  # fmt: skip
        if is_free:
            _as_lines(bare, scales, within[: count - 1])
        path[0, 10] = unset  # as it was given, where nothing was known of it
        for q in range(count):
            for e in range(2):
                own[begin + q, e] = run[q, e].real
        own_path = States(path[:count], path, within, False)
        is_moving = _moves(bare, scales, own_path, numbers, volts, speeds, level, period, is_free, moves)
        if is_free:
            _by_shaft(bare, torques, within, scales, count, moves)
            if _turns_load_alone(bare, is_free):
                _by_angle(within, count, moves)
        for q in range(count):
            for e in range(2):
                row = shown[q, e]
                for c in range(all_):
                    row[c] = 0.0
                for j in range(STATES):
                    share = moves.to_current[q, e, j]
                    if is_moving[j] and share != 0.0:
                        for c in range(begun):
                            row[c] += share * moved[j, c]
                for c in range(many):
                    row[c] += moves.on_current[q, e, c]
            if q == count - 1:
                break
            _move(moves, q, is_moving, moved, ahead, begun)
            if is_free:
                for m in range(4):
                    place = places[2 * (begin + q) + (m + 1) // 2]
                    low = min(int(place), knots.shape[0] - 2)
                    for k in range(low, min(low + 2, all_ - many)):
                        part = place - low if k > low else 1.0 - (place - low)
                        for i in range(STATES):
                            ahead[i, many + k] += moves.by_load[q, i, m] * part
                        begun = max(begun, many + k + 1)
            moved, ahead = ahead, moved
        for c in range(all_):
            row = along.rows[c]
            if row != NO_ROW:
                for q in range(count):
                    out[row, begin + q, 0], out[row, begin + q, 1] = shown[q, 0, c], shown[q, 1, c]
        if begin + count == n:
            break
        begin += count - 1
        for j in range(STATES):
            path[0, j] = path[count - 1, j].real
    _shown(p, scales[0], period, along, is_seen, own, out)


@_kernel
def _as_lines(p, scales, within):
    """The laws of the load along a path, and by what they change with speed and angle."""
    per_w, per_pairs = 1.0 / scales[2], 1.0 / scales[4]
    has_ripple = p[RIPPLE] != 0.0 or p[RIPPLE + 1] != 0.0 or p[RIPPLE + 2] != 0.0 or p[RIPPLE + 3] != 0.0
    for q in range(within.shape[0]):
        for stage in range(4):
            at = within[q, stage]
            share, angle = at[0] * per_w + 1j * STEP, at[1] * per_pairs + 1j * STEP
            by_share = _by_laws(p, share, angle.real + 0j, has_ripple)
            by_angle = _by_laws(p, share.real + 0j, angle, has_ripple)
            at[3], at[4], at[5] = by_share.real, by_share.imag / STEP * per_w, by_angle.imag / STEP * per_pairs


@_inlined
def _by_shaft(p, torques, within, scales, count, moves):
    """Numbers of the inertia and the load move the state as a load at the four stages does. `torques` (P, 1 + LOADS)."""
    w_n, torque_n, pairs = scales[2], scales[3], scales[4]
    free, laws = np.empty(torques.shape[0], dtype=np.int64), np.zeros(1 + LOADS)
    many = 0
    for c in range(torques.shape[0]):
        is_told = False
        for j in range(1 + LOADS):
            is_told = is_told or torques[c, j] != 0.0
        if is_told:
            free[many] = c
            many += 1
    for q in range(count - 1 if many else 0):
        for stage in range(4):
            laws[0] = within[q, stage, 2] / (pairs * torque_n)
            laws[1], laws[2], laws[3], laws[4] = _friction_laws(within[q, stage, 0] / w_n)
            laws[5], laws[6], laws[7], laws[8] = _ripple_laws(laws[1], within[q, stage, 1] / pairs)
            if p[SWING_TURNS] != 0.0:
                laws[9], laws[10], laws[11] = _swing_laws(p, laws[1], within[q, stage, 1] / pairs)
            for place in range(many):
                c, load = free[place], 0.0
                for j in range(1 + LOADS):
                    load += torques[c, j] * laws[j]
                for i in range(STATES):
                    moves.by_number[q, i, c] += load * moves.by_load[q, i, stage]


@_inlined
def _by_angle(within, count, moves):
    """The angle moves the state as a load does."""
    for q in range(count - 1):
        for i in range(STATES):
            moves.to_state[q, i, 9] = 1.0 if i == 9 else 0.0
            for stage in range(4):
                moves.to_state[q, i, 9] += within[q, stage, 5] * moves.by_load[q, i, stage]


@_inlined
def _move(moves, q, is_moving, moved, ahead, begun):
    """What is moved goes a step ahead."""
    for i in range(STATES):
        for c in range(begun):
            ahead[i, c] = 0.0 if is_moving[i] else moved[i, c]
        for j in range(STATES):
            share = moves.to_state[q, i, j]
            if is_moving[i] and is_moving[j] and share != 0.0:
                for c in range(begun):
                    ahead[i, c] += share * moved[j, c]
        if is_moving[i]:
            for c in range(moves.by_number.shape[2]):
                ahead[i, c] += moves.by_number[q, i, c]


@_kernel
def _shown(p, current, period, along, is_seen, own, out):
    """What the sensors make of the machine's moved currents `out`, beside which `own` (n, 3) are not moved; numbers of theirs move both."""
    plain, moved = np.empty(p.size), np.empty(p.size, dtype=np.complex128)
    both = np.empty((out.shape[1], out.shape[2]), dtype=np.complex128)
    for k in range(p.size):
        plain[k] = 0.0 if OFFSET <= k < OFFSET + 3 else p[k]
    for c in range(along.rows.size):
        row = along.rows[c]
        if row == NO_ROW:
            continue
        if c < is_seen.size and is_seen[c]:
            for k in range(p.size):
                moved[k] = p[k] + 1j * STEP * along.dp[c, k]
            for q in range(out.shape[1]):
                for e in range(2):
                    both[q, e] = own[q, e] + 1j * STEP * out[row, q, e]
            _chain(moved, current, period, both)
            for q in range(out.shape[1]):
                for e in range(out.shape[2]):
                    out[row, q, e] = both[q, e].imag / STEP
        else:
            _chain(plain, current, period, out[row])
