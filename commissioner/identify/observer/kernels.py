"""Compiled inner loops of the parallel adaptive observer, in the paper's symbols.

Discrete Kreisselmeier form of the machine behind a zero-order hold, exact for any sample period. With
A(z) = z^2 + a1 z + a0, B(z) = b1 z + b0 the pulse transfer of the machine and Lambda(z) = (z - f1)(z - f2) the
filter, y = ((Lambda - A)/Lambda) y + (B/Lambda) u, in partial fractions

    zeta_y[k+1] = F zeta_y[k] + g y[k],   zeta_u[k+1] = F zeta_u[k] + g u[k],   g_i = 1 - f_i
    y[k] = theta_1^T zeta_y[k] + theta_2^T zeta_u[k]

The parallel observer replaces y by its own yhat (zhat for zeta_y). Its exact sensitivity is Lambda/A applied to the
regressor w = (zhat, zeta_u): the same two filters driven by p = yhat + theta_1^T phi_y and q = u + theta_1^T phi_u.
Sources: G. Kreisselmeier, IEEE TAC 22(1), 1977; Castaldi & Tilli 2005; L. Ljung, System Identification, ch. 11;
G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, ch. V (UD update).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit

Array = NDArray[np.float64]

# Offsets into the state vector.
ZHAT, ZETA_U, PHI_Y, PHI_U = 0, 2, 4, 6
FREE = 8  # dzhat / d(initial zhat), (2, 2) row-major
NOISE, NOISE_LAG, LAST_ERROR = 12, 13, 14
LAST_VOLTAGE, LAST_EXTRA = 16, 17
LOOP = 22  # the loss fed back through the predicted current: per parameter two filter states of y, two of u, (4, 4)
ABSORBING = 18  # 1 while the unknown initial state is still being estimated
REJECTED, COUNT, SQUARES = 19, 20, 21
DEVIATION = 38  # of the initial state, the offset and theta from those the observer runs with (`REVIEW`)
STATE_SIZE = 45

# Initial state first: dropping it then leaves the factor of the marginal covariance. Then the sensor's offset, then
# theta.
OFFSET, THETA, PARAMETERS = 2, 3, 7

FAST, LYAPUNOV, FROZEN, REVIEW = 0, 1, 2, 3
"""`REVIEW`: the fast law's recursion along the trajectory of held parameters, a Gauss-Newton step. What it finds is left in
the state at `DEVIATION`."""


class Samples(NamedTuple):
    """One block: held voltages, V, and sampled currents, A, NaN where none was measured, (n,) each, `period` s apart."""

    u: Array
    y: Array
    period: float


class Adaptation(NamedTuple):
    """`law` and what it goes by: poles `f` (2,) of the filters, samples over which the noise is known, dead zone, A, and gain `gamma` (4, 4) of the
    Lyapunov law, and the least variance of the noise, A^2."""

    law: int
    f: Array
    gamma: Array
    noise_memory: float
    dead_zone: float
    noise_floor: float


class TakenOff(NamedTuple):
    """Of the plain machine: delay of the voltage in periods; the inverter's voltage error along the axis over current 0 ... `lost_span`; the
    magnetizing current beyond the linear one over stator flux 0 ... `extra_span`. Tables of size 1: none."""

    delay: float
    lost_v: Array
    lost_span: float
    extra_a: Array
    extra_span: float


class Memory(NamedTuple):
    """What a block leaves to the next: the state; theta and the offset (5,); Bierman's UD factors of the covariance, `upper` (7, 7) and
    `diagonal` (7,); the machine (4,)."""

    state: Array
    theta: Array
    upper: Array
    diagonal: Array
    machine: Array


class Course(NamedTuple):
    """What the observer says, (n,): current, A, rotor and stator flux, Wb."""

    current: Array
    rotor_flux: Array
    stator_flux: Array


class Held(NamedTuple):
    """The linear machine between two samples: held-input model `matrix` (2, 2), `gain` (2,) of (i, psi_R); its R_s and leakage; the inverter's
    loss F tabulated over current 0 ... `lost_span`."""

    matrix: Array
    gain: Array
    r_s: float
    leakage: float
    lost_v: Array
    lost_span: float


@njit()
def machine_from_theta(theta: Array, f: Array, period: float, out: Array) -> bool:
    """(R_s, R_R, L_sigma, L_M) into `out`; False (and `out` untouched) where theta is no passive machine."""
    g1, g2 = 1.0 - f[0], 1.0 - f[1]
    a1 = -(f[0] + f[1]) - theta[0] * g1 - theta[1] * g2
    a0 = f[0] * f[1] + theta[0] * g1 * f[1] + theta[1] * g2 * f[0]
    b1 = theta[2] * g1 + theta[3] * g2
    b0 = -theta[2] * g1 * f[1] - theta[3] * g2 * f[0]
    half = -0.5 * a1
    root = half * half - a0
    if not (root > 0.0 and a0 > 0.0):
        return False
    slow_z = half + math.sqrt(root)
    fast_z = a0 / slow_z
    if not (0.0 < fast_z < slow_z < 1.0):
        return False
    slow, fast = math.log(slow_z) / period, math.log(fast_z) / period
    slow_r = (b1 * slow_z + b0) / (slow_z - fast_z) * slow / (slow_z - 1.0)
    fast_r = (b1 * fast_z + b0) / (fast_z - slow_z) * fast / (fast_z - 1.0)
    if not (slow_r > 0.0 and fast_r > 0.0):
        return False
    total = slow_r + fast_r
    alpha = -(slow_r * fast + fast_r * slow) / total
    r_s = slow * fast / (total * alpha)
    r_r = (-(slow + fast) - alpha) / total - r_s
    if not (alpha > 0.0 and r_s > 0.0 and r_r > 0.0):
        return False
    out[0], out[1], out[2], out[3] = r_s, r_r, 1.0 / total, r_r / alpha
    return True


@njit()
def flux_gains(machine: Array, period: float) -> tuple[float, float]:
    """(Ad00, Ad01) of the held-input model: i[k+1] without voltage = Ad00 i[k] + Ad01 psi_R[k]."""
    r_s, r_r, l_s, l_m = machine[0], machine[1], machine[2], machine[3]
    alpha = r_r / l_m
    half = 0.5 * ((r_s + r_r) / l_s + alpha)
    fast = -(half + math.sqrt(max(half * half - alpha * r_s / l_s, 0.0)))
    slow = alpha * r_s / l_s / fast
    rise = (math.exp(slow * period) - math.exp(fast * period)) / (slow - fast)
    return math.exp(fast * period) + rise * (-(r_s + r_r) / l_s - fast), rise * alpha / l_s


@njit()
def lookup(table: Array, span: float, x: float) -> float:
    """Odd function tabulated at 0 ... span; constant beyond."""
    a = abs(x) * (table.size - 1) / span
    if a >= table.size - 1:
        value = float(table[-1])
    else:
        k = int(a)
        value = table[k] + (a - k) * (table[k + 1] - table[k])
    return value if x >= 0.0 else -value


@njit()
def lookup_with_slope(table: Array, span: float, x: float) -> tuple[float, float]:
    """`lookup` and its derivative."""
    per = (table.size - 1) / span
    a = abs(x) * per
    if a >= table.size - 1:
        return (table[-1] if x >= 0.0 else -table[-1]), 0.0
    k = int(a)
    rise = table[k + 1] - table[k]
    value = table[k] + (a - k) * rise
    return (value if x >= 0.0 else -value), rise * per


@njit()
def implicit_loss(table: Array, span: float, known: float, b: float) -> tuple[float, float]:
    """(F(i), F'(i)) where i + b F(i) = known, F odd and tabulated as for `lookup`."""
    size = abs(known)
    last = table.size - 1
    step = span / last
    if b <= 0.0 or step * last + b * table[last] <= size:
        found: tuple[float, float] = lookup_with_slope(table, span, known)
        return found
    low, high = 0, last
    while high - low > 1:
        middle = (low + high) // 2
        if step * middle + b * table[middle] <= size:
            low = middle
        else:
            high = middle
    slope = (table[low + 1] - table[low]) / step
    value = table[low] + slope * (size - step * low - b * table[low]) / (1.0 + b * slope)
    return (value if known >= 0.0 else -value), slope


@njit()
def forecast(
    u: Array, period: float, held: Held, start: tuple[float, float, float], most: tuple[float, float]
) -> tuple[float, float]:
    """(largest |stator flux|, largest |current|) under the voltages u, `(n,)`, held for `period` each: of the linear
    machine from `start`, (i, psi_R, free); the flux also of `free`, which integrates u - F(i) - R_s i. It ends where either is no
    longer below the `most`.

    F is taken at the end of each period: i' + g F(i') = i' without loss.
    """
    matrix, gain, r_s, leakage = held.matrix, held.gain, held.r_s, held.leakage
    lost_v, lost_span = held.lost_v, held.lost_span
    i, psi_r, free = start
    top, top_a = abs(free), abs(i)
    for k in range(u.size):
        known = matrix[0, 0] * i + matrix[0, 1] * psi_r + gain[0] * u[k]
        loss, _ = implicit_loss(lost_v, lost_span, known, gain[0])
        free += period * (u[k] - loss - r_s * i)
        psi_r = matrix[1, 0] * i + matrix[1, 1] * psi_r + gain[1] * (u[k] - loss)
        i = known - gain[0] * loss
        top, top_a = max(top, abs(psi_r + leakage * i), abs(free)), max(top_a, abs(i))
        if top >= most[0] or top_a >= most[1]:
            break
    return top, top_a


# Inlined, for a call per sample would cost `advance` half as much again.
@njit(inline="always")
def has_stable_real_poles(theta_1: float, theta_2: float, f1: float, f2: float) -> bool:
    """Whether A(z) keeps two different real poles between 0 and 1, as every machine has."""
    g1, g2 = 1.0 - f1, 1.0 - f2
    half = 0.5 * (f1 + f2 + theta_1 * g1 + theta_2 * g2)
    a0 = f1 * f2 + theta_1 * g1 * f2 + theta_2 * g2 * f1
    return half * half > a0 > 0.0 and half < 1.0 and 1.0 - 2.0 * half + a0 > 0.0


@njit(inline="always")
def weigh(psi: Array, first: int, r: float, upper: Array, diagonal: Array, ff: Array, v: Array, k_gain: Array) -> float:
    """Bierman's first half: f = U^T psi and v = D f, the gain U v (not yet divided), and its divisor, the variance of the error.

    Numbers before `first` take no part.
    """
    for j in range(first, PARAMETERS):
        s = psi[j]
        for i in range(first, j):
            s += upper[i, j] * psi[i]
        ff[j] = s
        v[j] = diagonal[j] * s
    alpha = r
    for j in range(first, PARAMETERS):
        alpha = alpha + ff[j] * v[j]
    for i in range(first, PARAMETERS):
        s = v[i]
        for j in range(i + 1, PARAMETERS):
            s += upper[i, j] * v[j]
        k_gain[i] = s
    return alpha


@njit(inline="always")
def update_factors(first: int, r: float, ff: Array, v: Array, upper: Array, diagonal: Array, k_gain: Array) -> None:
    """Bierman's second half: the factors after the sample that `weigh` was given, column by column (`k_gain` is scratch)."""
    alpha = r
    for j in range(first, PARAMETERS):
        alpha_last = alpha
        alpha = alpha_last + ff[j] * v[j]
        diagonal[j] *= alpha_last / alpha
        low = -ff[j] / alpha_last
        k_gain[j] = v[j]
        for i in range(first, j):
            old = upper[i, j]
            upper[i, j] = old + k_gain[i] * low
            k_gain[i] += v[j] * old


@njit(inline="always")
def worth_of_white_noise(c0: float, c1: float, beta: float) -> float:
    """Variance times the (AR(1)) length of its correlation, so that an error of the model, which is coloured, is not taken for
    information. `c0`, `c1`: mean square and lagged product of the error; 1 / `beta` the samples they remember.
    """
    rho = c1 / (c0 + 1e-300) - 2.0 * math.sqrt(beta)
    rho = 0.0 if rho < 0.0 else (0.999 if rho > 0.999 else rho)
    return c0 * (1.0 + rho) / (1.0 - rho)


@njit(inline="always")
def feed_back(
    loop: Array,
    open_loop: float,
    seen: float,
    slopes: tuple[float, float],
    t: tuple[float, float, float, float],
    f: tuple[float, float],
) -> None:
    """The inverter's loss follows the predicted current: what that adds to the current's derivative by one number of theta.

    `loop` (4,) filters that derivative's feedback, two states of y and two of u; `open_loop` is its filter without it, `seen`
    the derivative at this sample; `slopes` the loss's at both ends of the period; `t` theta, `f` the filters' poles.
    """
    (t1, t2, t3, t4), (f1, f2), (slope_now, slope_next) = t, f, slopes
    g1, g2 = 1.0 - f1, 1.0 - f2
    gain = t3 * g1 + t4 * g2
    held = t1 * loop[0] + t2 * loop[1] + t3 * loop[2] + t4 * loop[3]
    loop[0] = f1 * loop[0] + g1 * held
    loop[1] = f2 * loop[1] + g2 * held
    free = open_loop + (t1 * loop[0] + t2 * loop[1] + t3 * f1 * loop[2] + t4 * f2 * loop[3])
    back = -0.5 * (slope_now * seen + slope_next * free) / (1.0 + 0.5 * gain * slope_next)
    loop[2] = f1 * loop[2] + g1 * back
    loop[3] = f2 * loop[3] + g2 * back


@njit()
def advance(samples: Samples, how: Adaptation, taken_off: TakenOff, memory: Memory, course: Course) -> None:
    """Run the observer over one block, updating all of `memory`. A current that is NaN was not measured: the observer runs on
    without it.
    """
    u, y, period = samples.u, samples.y, samples.period
    law, f, gamma, dead_zone, noise_floor = how.law, how.f, how.gamma, how.dead_zone, how.noise_floor
    delay, lost_v, lost_span = taken_off.delay, taken_off.lost_v, taken_off.lost_span
    extra_a, extra_span = taken_off.extra_a, taken_off.extra_span
    state, theta_in, machine = memory.state, memory.theta, memory.machine
    upper, diagonal = memory.upper, memory.diagonal
    current, rotor_flux, stator_flux = course.current, course.rotor_flux, course.stator_flux
    f1, f2 = f[0], f[1]
    g1, g2 = 1.0 - f1, 1.0 - f2
    z1, z2, x1, x2 = state[0], state[1], state[2], state[3]
    py1, py2, pu1, pu2 = state[4], state[5], state[6], state[7]
    d11, d12, d21, d22 = state[8], state[9], state[10], state[11]
    c0, c1, e_last = state[12], state[13], state[14]
    u_last, extra_last = state[16], state[17]
    absorbing = state[18] > 0.5
    rejected, squares = state[19], 0.0
    t1, t2, t3, t4, offset = theta_in[0], theta_in[1], theta_in[2], theta_in[3], theta_in[4]
    theta = np.empty(4)
    ad00, ad01 = flux_gains(machine, period)
    beta = 1.0 / how.noise_memory
    psi = np.zeros(PARAMETERS)
    v = np.zeros(PARAMETERS)
    ff = np.zeros(PARAMETERS)
    k_gain = np.zeros(PARAMETERS)
    has_lost, has_extra = lost_v.size > 1, extra_a.size > 1
    loop = state[LOOP:DEVIATION].reshape(4, 4)
    deviation = state[DEVIATION:]
    recurses = law in (FAST, REVIEW)
    seen = np.zeros(4)  # d(current)/d(theta) with the loop closed
    slope_now, slope_next = 0.0, 0.0

    for k in range(u.size):
        # Present machine, for the flux and for the resistance in the saturation's voltage.
        if k & 63 == 0:
            theta[0], theta[1], theta[2], theta[3] = t1, t2, t3, t4
            if machine_from_theta(theta, f, period, machine):
                ad00, ad01 = flux_gains(machine, period)

        # Output and flux a priori.
        yl = t1 * z1 + t2 * z2 + t3 * x1 + t4 * x2
        extra = 0.0
        if has_extra:
            free = t1 * (f1 * z1 + g1 * yl) + t2 * (f2 * z2 + g2 * yl) + t3 * f1 * x1 + t4 * f2 * x2
            extra = lookup(extra_a, extra_span, (free - ad00 * yl) / ad01 + machine[2] * yl)
        e = y[k] - offset - extra - yl

        # Noise level.
        is_seen = not np.isnan(e)
        if law != FROZEN and is_seen:
            c0 += beta * (e * e - c0)
            c1 += beta * (e * e_last - c1)
            e_last = e
            squares += e * e

        if recurses:
            r = worth_of_white_noise(c0, c1, beta) + noise_floor
            psi[2], psi[3], psi[4], psi[5], psi[6] = 1.0, py1, py2, pu1, pu2
            if has_lost:
                for j in range(4):
                    psi[3 + j] += t1 * loop[j, 0] + t2 * loop[j, 1] + t3 * loop[j, 2] + t4 * loop[j, 3]
                    seen[j] = psi[3 + j]
            first = 2
            if absorbing:
                first = 0
                psi[0] = t1 * d11 + t2 * d21
                psi[1] = t1 * d12 + t2 * d22
            if law == REVIEW:
                for j in range(first, PARAMETERS):
                    e -= psi[j] * deviation[j]
            step = 0.0
            if is_seen:
                step = e / weigh(psi, first, r, upper, diagonal, ff, v, k_gain)
            n1, n2 = t1 + k_gain[3] * step, t2 + k_gain[4] * step
            if not is_seen:
                pass
            elif law == REVIEW or has_stable_real_poles(n1, n2, f1, f2):
                if law == REVIEW:
                    for j in range(first, PARAMETERS):
                        deviation[j] += k_gain[j] * step
                else:
                    t1, t2 = n1, n2
                    t3 += k_gain[5] * step
                    t4 += k_gain[6] * step
                    offset += k_gain[2] * step
                    if absorbing:
                        s1, s2 = k_gain[0] * step, k_gain[1] * step
                        z1 += d11 * s1 + d12 * s2
                        z2 += d21 * s1 + d22 * s2
                update_factors(first, r, ff, v, upper, diagonal, k_gain)
            else:
                rejected += 1.0
        elif law == LYAPUNOV and is_seen:
            err = e - dead_zone if e > dead_zone else (e + dead_zone if e < -dead_zone else 0.0)
            if err != 0.0:
                for i in range(4):
                    ff[i] = gamma[i, 0] * z1 + gamma[i, 1] * z2 + gamma[i, 2] * x1 + gamma[i, 3] * x2
                power = ff[0] * z1 + ff[1] * z2 + ff[2] * x1 + ff[3] * x2
                step = err / (1.0 + power)
                n1, n2 = t1 + ff[0] * step, t2 + ff[1] * step
                if has_stable_real_poles(n1, n2, f1, f2):
                    t1, t2 = n1, n2
                    t3 += ff[2] * step
                    t4 += ff[3] * step
                else:
                    rejected += 1.0

        # Output and flux a posteriori: what the observer goes on with, and what the caller sees.
        yl = t1 * z1 + t2 * z2 + t3 * x1 + t4 * x2
        free = t1 * (f1 * z1 + g1 * yl) + t2 * (f2 * z2 + g2 * yl) + t3 * f1 * x1 + t4 * f2 * x2
        psi_r = (free - ad00 * yl) / ad01
        psi_s = psi_r + machine[2] * yl
        extra = lookup(extra_a, extra_span, psi_s) if has_extra else 0.0
        i_now = yl + extra
        current[k] = i_now + offset
        rotor_flux[k] = psi_r
        stator_flux[k] = psi_s

        # The voltage that drives the linear machine over this period.
        drive = u[k] - delay * (u[k] - u_last)
        u_last = u[k]
        if has_extra:
            drive -= machine[0] * (1.5 * extra - 0.5 * extra_last)
        if has_lost:
            # Mean of the loss at both ends of the period; the far end implicitly, i + b/2 F(i) = known, so that a
            # current caught at zero does not chatter.
            lost_now, slope_now = lookup_with_slope(lost_v, lost_span, i_now)
            b = t3 * g1 + t4 * g2
            ahead = t1 * (f1 * z1 + g1 * yl) + t2 * (f2 * z2 + g2 * yl) + t3 * f1 * x1 + t4 * f2 * x2
            known = ahead + b * (drive - 0.5 * lost_now) + 2.0 * extra - extra_last
            lost_next, slope_next = implicit_loss(lost_v, lost_span, known, 0.5 * b)
            drive -= 0.5 * (lost_now + lost_next)
        extra_last = extra

        # Filters: regressor, sensitivity, and the response to the unknown initial state.
        p = yl + t1 * py1 + t2 * py2
        q = drive + t1 * pu1 + t2 * pu2
        z1, z2 = f1 * z1 + g1 * yl, f2 * z2 + g2 * yl
        x1, x2 = f1 * x1 + g1 * drive, f2 * x2 + g2 * drive
        py1, py2 = f1 * py1 + g1 * p, f2 * py2 + g2 * p
        pu1, pu2 = f1 * pu1 + g1 * q, f2 * pu2 + g2 * q
        if has_lost and recurses:
            for j in range(4):
                open_loop = py1 if j == 0 else (py2 if j == 1 else (pu1 if j == 2 else pu2))
                feed_back(loop[j], open_loop, seen[j], (slope_now, slope_next), (t1, t2, t3, t4), (f1, f2))
        if absorbing:
            s1, s2 = t1 * d11 + t2 * d21, t1 * d12 + t2 * d22
            d11, d12 = f1 * d11 + g1 * s1, f1 * d12 + g1 * s2
            d21, d22 = f2 * d21 + g2 * s1, f2 * d22 + g2 * s2
            if abs(d11) + abs(d12) + abs(d21) + abs(d22) < 1e-5:
                absorbing = False

    state[0], state[1], state[2], state[3] = z1, z2, x1, x2
    state[4], state[5], state[6], state[7] = py1, py2, pu1, pu2
    state[8], state[9], state[10], state[11] = d11, d12, d21, d22
    state[12], state[13], state[14] = c0, c1, e_last
    state[16], state[17] = u_last, extra_last
    state[18] = 1.0 if absorbing else 0.0
    state[19] = rejected
    state[20] += u.size
    state[21] = squares
    theta_in[0], theta_in[1], theta_in[2], theta_in[3], theta_in[4] = t1, t2, t3, t4, offset
    theta[0], theta[1], theta[2], theta[3] = t1, t2, t3, t4
    machine_from_theta(theta, f, period, machine)
