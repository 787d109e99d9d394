"""Compiled output-error simulation of one segment with its exact sensitivities, for the batch fit.

Gamma circuit at standstill, everything nonlinear in it taken as extra voltage on the fluxes:

    d psi_s/dt = u - R_s i_lin - F(i) - R_s (1 - x) g(psi_x)
    d psi_R/dt = R_r ((psi_s - psi_R) / L_l - x g(psi_x))
    i_lin = psi_s / L_0 + (psi_s - psi_R) / L_l,    i = i_lin + (1 - x) g(psi_x),    psi_x = (1 - x) psi_s + x psi_R

g(psi) is the magnetizing current beyond psi / L_0, F(i) the inverter's voltage error along the axis, both linear in
their coefficients. The split x says where between stator (0) and rotor (1) the leakage holds the iron that saturates: with it
this is any T circuit of saturating main inductance, whose implicit law of the main flux is explicit in psi_x. Linear part exact for held u. Of F counts its mean over the step, the current taken as straight from
end to end and solved for implicitly (A-stable: currents caught at zero do not chatter); where a current passes zero, and
F with it from one end to the other, the step is a part of the period. One value of F per period at 5 kHz moved L_sigma by
0.1 %. Sensitivities differentiate this very scheme. Order of the parameters: R_s, R_r, L_l, L_0, delay, split, g_1..g_m,
F_1..F_k, then the segment's own: offset, psi_s(0), psi_R(0).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import BORROWED, njit

Array = NDArray[np.float64]
Exponents = NDArray[np.int64]

CIRCUIT = 4
DELAY = 4
SPLIT = 5
SHARED = 6
OWN = 3
PARTS = 4
"""Steps of a period in which the current passes zero. With two while models are compared (7 % of a commissioning's time) a fit behind a staircase came to another:
R_s 0.97 % off at 0.18 stated for 0.66 at 0.88 (`tests.campaigns.inverter 1 318`)."""
_SOLVED = 1e-9
"""Of the current's span: what the implicit step may miss its current by."""
_MOST_STEPS = 40
WIDTH = 32
"""Room for the numbers of one kind, one behind the other in one array: at constant distances the compiler sees that they are apart."""
_S1, _S2, _SI, _DG, _DG_LAST, _PUSHED, _PUSHED_R, _TO_S1, _TO_S2, _TO_I, _TO_G, _WANTED = range(0, 12 * WIDTH, WIDTH)


class Measured(NamedTuple):
    """One segment (n,): voltage as commanded, V, and before its first sample; current, A; weight, 0 for samples that were lost; the
    periods that are done in parts, for the current passes zero in them."""

    u: Array
    u_before: float
    y: Array
    weight: Array
    passes_zero: NDArray[np.bool_]


class Held(NamedTuple):
    """Of the linear circuit over a period and over a part of one, first axis: held-input response `ad` (2, 2, 2), `b1` (2, 2), ramp response
    `b2` (2, 2), response `b_r` (2, 2) to a voltage held on the rotor; their derivatives (2, 4, 2, 2) and (2, 4, 2) by the circuit's four."""

    ad: Array
    b1: Array
    b2: Array
    b_r: Array
    dad: Array
    db1: Array
    db2: Array
    db_r: Array


class Machine(NamedTuple):
    """The shared parameters (p,), and of the magnetizing current beyond the linear one the odd and rising exponents (m,) and the flux, Wb, of
    which powers are taken."""

    theta: Array
    exponents: Exponents
    flux_scale: float


class Loss(NamedTuple):
    """The inverter's voltage error F (rows,), V, over current, its integral in rows, and rows per ampere."""

    table: Array
    integral: Array
    per_a: float


class Shapes(NamedTuple):
    """What F is made of: (rows, k) tables of a unit of each coefficient over current 0 ... `current_span`, A, and their integrals in rows."""

    basis: Array
    integral: Array
    current_span: float


class Asked(NamedTuple):
    """What is asked for, and where it goes: `wanted` (p,) is 1 where a sensitivity is to be carried; J^T W J and J^T W e are added to
    `information` (p, p) and `score` (p,), the latter also by stretches of `block` samples to `block_scores`; `residual`, `flux` of the iron (n,); `rows`
    for the weighted sensitivities: of a sample; or of every one where it has (n, p), and nothing is added: `add_scores` does for any
    residuals, and numpy makes half the product."""

    wanted: Array
    information: Array
    score: Array
    block: int
    block_scores: Array
    residual: Array
    flux: Array
    rows: Array


class Room(NamedTuple):
    """To work in, zeros: F and its integral as in `Loss` (rows,), what is carried on (12 WIDTH,), powers of the iron's flux (m + 1,)."""

    table: Array
    integral: Array
    carried: Array
    power: Array

    @classmethod
    def of(cls, machine: Machine, shapes: Shapes) -> Room:
        table, integral = np.zeros((2, shapes.basis.shape[0]))
        return cls(table, integral, np.zeros(12 * WIDTH), np.zeros(machine.exponents.size + 1))


@njit(**BORROWED)
def _locate(rows: int, per_a: float, i: float) -> tuple[int, float, float]:
    """(cell, fraction inside it, rows beyond the table) of the size of a current."""
    at = abs(i) * per_a
    if at >= rows - 1:
        return rows - 2, 1.0, at - (rows - 1)
    cell = int(at)
    return cell, at - cell, 0.0


@njit(inline="always")
def _mean_loss(
    loss: Loss,
    i0: float,
    i1: float,
    at0: tuple[int, float, float],
    at1: tuple[int, float, float],
) -> tuple[float, float, float]:
    """(mean of F over the currents i0 ... i1, its derivatives by i0 and by i1), `at0` and `at1` where they lie in the table.

    F is odd and constant beyond the table. Within a cell it is straight; further apart areas are counted from the cells' edges,
    since a difference of integrals from zero would lose the digits that the implicit step is solved for.
    """
    table, integral, per_a = loss.table, loss.integral, loss.per_a
    (cell0, in0, out0), (cell1, in1, out1) = at0, at1
    rise0, rise1 = table[cell0 + 1] - table[cell0], table[cell1 + 1] - table[cell1]
    f0, f1 = table[cell0] + in0 * rise0, table[cell1] + in1 * rise1
    sign0, sign1 = (1.0 if i0 >= 0.0 else -1.0), (1.0 if i1 >= 0.0 else -1.0)
    if sign0 != sign1:
        area = integral[cell1] + 0.5 * in1 * (table[cell1] + f1) + out1 * f1
        area -= integral[cell0] + 0.5 * in0 * (table[cell0] + f0) + out0 * f0
    elif cell0 == cell1 and (out0 > 0.0) == (out1 > 0.0):
        slope = 0.0 if out0 > 0.0 else 0.5 * rise0 * per_a
        return 0.5 * sign0 * (f0 + f1), slope, slope
    elif cell1 + in1 + out1 > cell0 + in0 + out0:
        area = 0.5 * (1.0 - in0) * (f0 + table[cell0 + 1]) + integral[cell1] - integral[cell0 + 1]
        area += 0.5 * in1 * (table[cell1] + f1) + (out1 - out0) * f1
    else:
        area = 0.5 * (1.0 - in1) * (f1 + table[cell1 + 1]) + integral[cell0] - integral[cell1 + 1]
        area = -area - 0.5 * in0 * (table[cell0] + f0) - (out0 - out1) * f0
    apart = i1 - i0
    mean = area / (apart * per_a)
    return mean, (mean - sign0 * f0) / apart, (sign1 * f1 - mean) / apart


@njit(**BORROWED)
def _extra(machine: Machine, flux: float, power: Array) -> tuple[float, float]:
    """(g, g') at the iron's flux; the odd powers of the relative flux into `power`."""
    theta, exponents, flux_scale = machine.theta, machine.exponents, machine.flux_scale
    relative = flux / flux_scale
    even, reached, g, slope = 1.0, 1, 0.0, 0.0
    for m in range(exponents.size):
        while reached < exponents[m]:
            even *= relative * relative
            reached += 2
        power[m] = even * relative
        g += theta[SHARED + m] * power[m]
        slope += theta[SHARED + m] * reached * even / flux_scale
    return g, slope


@njit(inline="always")
def _late_share(delay: float, part: int, parts: int) -> tuple[float, float]:
    """Share of this part of the period in which the voltage before still acts, and its derivative by `delay` (in periods)."""
    late, d_late = delay * parts - part, float(parts)
    if 0.0 <= delay <= 1.0 and parts > 1:
        if late < 0.0 or late > 1.0:
            late, d_late = (0.0 if late < 0.0 else 1.0), 0.0
    elif parts > 1:
        late, d_late = delay, 1.0
    return late, d_late


@njit(inline="always")
def _current_at_end(
    machine: Machine,
    loss: Loss,
    free: tuple[float, float],
    by_loss: tuple[float, float],
    i0: float,
    guess: float,
    within: float,
    power: Array,
) -> tuple[float, float, float, float, float, float]:
    """(i, w, dw/di0, dw/di, g, g') with i = free - beta w(i) + on_stator g(c1 - b1 w(i)), w the mean loss from i0 to i; Newton's
    steps, kept inside what is known to hold the root. `free`: the current and the iron's flux without loss, `by_loss`: beta and b1.
    """
    on_stator, (i_free, c1), (beta, b1) = 1.0 - machine.theta[SPLIT], free, by_loss
    rows, per_a = loss.table.size, loss.per_a
    at0 = _locate(rows, per_a, i0)
    i, low, high = guess, -np.inf, np.inf
    mean, by_i0, by_i1, g, slope_g = 0.0, 0.0, 0.0, 0.0, 0.0
    for _ in range(_MOST_STEPS):
        mean, by_i0, by_i1 = _mean_loss(loss, i0, i, at0, _locate(rows, per_a, i))
        g, slope_g = _extra(machine, c1 - b1 * mean, power)
        missed = i - i_free + beta * mean - on_stator * g
        if abs(missed) <= within:
            break
        if missed > 0.0:
            high = i
        else:
            low = i
        i -= missed / (1.0 + (beta + on_stator * slope_g * b1) * by_i1)
        if not low < i < high:
            i = 0.5 * (low + high)
    return i, mean, by_i0, by_i1, g, slope_g


@njit(inline="always")
def _push_of_loss(
    basis: Array, basis_integral: Array, per_a: float, i0: float, i: float, first: int, push: Array
) -> None:
    """What a unit of every shape of F takes off the held voltage over the currents i0 ... i, into `push` from `first` on:

    the mean of `_mean_loss`, whose shares of the tables' rows are the same for every shape.
    """
    (cell0, in0, out0) = _locate(basis.shape[0], per_a, i0)
    (cell1, in1, out1) = _locate(basis.shape[0], per_a, i)
    sign0, sign1 = (1.0 if i0 >= 0.0 else -1.0), (1.0 if i >= 0.0 else -1.0)
    # Shares of the rows cell0, cell0 + 1, cell1, cell1 + 1 of the table, and the rows of the integral that are counted from.
    low0, high0, low1, high1 = 0.0, 0.0, 0.0, 0.0
    from0, from1, share = cell0, cell1, 0.0
    if sign0 == sign1 and cell0 == cell1 and (out0 > 0.0) == (out1 > 0.0):
        low0, high0 = 0.5 * sign0 * (1.0 - in0), 0.5 * sign0 * in0
        low1, high1 = 0.5 * sign0 * (1.0 - in1), 0.5 * sign0 * in1
    else:
        share = 1.0 / ((i - i0) * per_a)
        if sign0 != sign1:
            end0, end1 = -(0.5 * in0 + out0), 0.5 * in1 + out1
            low0, high0 = end0 * (1.0 - in0) - 0.5 * in0, end0 * in0
            low1, high1 = end1 * (1.0 - in1) + 0.5 * in1, end1 * in1
        elif cell1 + in1 + out1 > cell0 + in0 + out0:
            end1 = 0.5 * in1 + out1 - out0
            low0, high0 = 0.5 * (1.0 - in0) * (1.0 - in0), 0.5 * (1.0 - in0) * (1.0 + in0)
            low1, high1 = end1 * (1.0 - in1) + 0.5 * in1, end1 * in1
            from0 = cell0 + 1
        else:
            end0 = -(0.5 * in0 + out0 - out1)
            low0, high0 = end0 * (1.0 - in0) - 0.5 * in0, end0 * in0
            low1, high1 = -0.5 * (1.0 - in1) * (1.0 - in1), -0.5 * (1.0 - in1) * (1.0 + in1)
            from1 = cell1 + 1
        low0, high0, low1, high1 = share * low0, share * high0, share * low1, share * high1
    for c in range(basis.shape[1]):
        push[first + c] = -(
            low0 * basis[cell0, c]
            + high0 * basis[cell0 + 1, c]
            + low1 * basis[cell1, c]
            + high1 * basis[cell1 + 1, c]
            + share * (basis_integral[from1, c] - basis_integral[from0, c])
        )


@njit(inline="always")
def _add_row(row: Array, missed: float, information: Array, score: Array, block_score: Array) -> None:
    """What a sample's weighted sensitivities (p,) and residual add to the normal equations."""
    for i in range(score.size):
        score[i] += missed * row[i]
        block_score[i] += missed * row[i]
        for j in range(score.size):
            information[i, j] += row[i] * row[j]


@njit(inline="always")
def _carry(
    m: Array,
    width: int,
    response: tuple[float, float, float, float, float, float],
    by_rotor: tuple[float, float],
    resistance: tuple[float, float],
    ahead: float,
    by_i: tuple[float, float, float],
    to_current: tuple[float, float],
    to_iron: tuple[float, float],
) -> None:
    """Every sensitivity in `m` over one step. `response`: Ad and b1; of a voltage on the rotor; what g takes off both voltages per ampere;
    dw/di0, dw/di's share in 1 / (1 + ...) and dw/di; current and iron's extra one by the fluxes."""
    a11, a12, a21, a22, b11, b12 = response
    (by_i0, scale, by_i1), (h_g, h_gr), (g_s, g_r) = by_i, to_current, to_iron
    back1, back2 = b11 * by_i1, b12 * by_i1
    for j in range(width):
        dg = m[_DG + j]
        extra = dg + ahead * (dg - m[_DG_LAST + j])
        push = m[_PUSHED + j] - resistance[0] * extra - by_i0 * m[_SI + j]
        push_r = m[_PUSHED_R + j] - resistance[1] * extra
        d1 = a11 * m[_S1 + j] + a12 * m[_S2 + j] + b11 * push + by_rotor[0] * push_r + m[_TO_S1 + j]
        d2 = a21 * m[_S1 + j] + a22 * m[_S2 + j] + b12 * push + by_rotor[1] * push_r + m[_TO_S2 + j]
        si = (h_g * d1 + h_gr * d2 + m[_TO_I + j]) * (scale * m[_WANTED + j])
        s1, s2 = d1 - back1 * si, d2 - back2 * si
        m[_SI + j], m[_S1 + j], m[_S2 + j], m[_DG_LAST + j] = si, s1, s2, dg
        m[_DG + j] = g_s * s1 + g_r * s2 + m[_TO_G + j]


@njit(inline="always")
def _add_directly(
    x1: float,
    x2: float,
    l_l: float,
    l_0: float,
    on_stator: float,
    g: float,
    slope_g: float,
    power: Array,
    to_i: Array,
    to_g: Array,
) -> None:
    """Derivatives of the current, and of the iron's extra one, by the parameters at constant fluxes."""
    to_i[2], to_i[3] = (x2 - x1) / (l_l * l_l), -x1 / (l_0 * l_0)
    to_g[SPLIT] = slope_g * (x2 - x1)
    to_i[SPLIT] = on_stator * to_g[SPLIT] - g
    for m in range(power.size - 1):
        to_g[SHARED + m], to_i[SHARED + m] = power[m], on_stator * power[m]


@njit(fastmath={"contract", "reassoc", "nsz", "arcp"}, **BORROWED)
def simulate(
    measured: Measured,
    held_input: Held,
    machine: Machine,
    shapes: Shapes,
    own: Array,
    delay: float,
    asked: Asked,
    is_linearised: bool,
    room: Room,
) -> float:
    """Residuals y - i and the iron's flux; where `is_linearised`, normal equations and weighted sensitivities too, by the shared parameters
    and the segment's `own` three. `delay` in periods. Returns sum W e^2, infinite where the model runs away.
    """
    theta = machine.theta
    u, y, weight, passes_zero = measured.u, measured.y, measured.weight, measured.passes_zero
    ad, b1, b2, b_r = held_input.ad, held_input.b1, held_input.b2, held_input.b_r
    dad, db1, db2, db_r = held_input.dad, held_input.db1, held_input.db2, held_input.db_r
    basis, basis_integral, current_span = shapes.basis, shapes.integral, shapes.current_span
    wanted, information, score, block = asked.wanted, asked.information, asked.score, asked.block
    block_scores, residual, flux, rows = asked.block_scores, asked.residual, asked.flux, asked.rows
    p = wanted.size
    k_f, extra_powers = basis.shape[1], machine.exponents.size
    first_f = SHARED + extra_powers
    first_own = first_f + k_f
    per_a = (basis.shape[0] - 1) / current_span
    r_s, r_r, l_l, l_0 = theta[0], theta[1], theta[2], theta[3]
    on_stator, on_rotor = 1.0 - theta[SPLIT], theta[SPLIT]
    is_split = extra_powers > 0 and (on_rotor != 0.0 or wanted[SPLIT] > 0.0)
    h_s, h_r = 1.0 / l_0 + 1.0 / l_l, -1.0 / l_l
    loss, furthest = Loss(room.table, room.integral, per_a), 0.0
    for row in range(basis.shape[0]):
        for c in range(k_f):
            loss.table[row] += theta[first_f + c] * basis[row, c]
            loss.integral[row] += theta[first_f + c] * basis_integral[row, c]
        furthest = max(furthest, abs(loss.table[row]))

    x1, x2 = own[1], own[2]
    m, width = room.carried, (p + 3) // 4 * 4  # d(psi_s, psi_R, i), and what they are carried on with
    m[_S1 + first_own + 1], m[_S2 + first_own + 2] = 1.0, 1.0
    for j in range(p):
        m[_WANTED + j] = wanted[j]
    s1, s2, si, dg, pushed = m[_S1:_S2], m[_S2:_SI], m[_SI:_DG], m[_DG:_DG_LAST], m[_PUSHED:_PUSHED_R]
    to_s1, to_s2, to_i, to_g = m[_TO_S1:_TO_S2], m[_TO_S2:_TO_I], m[_TO_I:_TO_G], m[_TO_G:_WANTED]
    power = room.power
    x_iron = on_stator * x1 + on_rotor * x2
    g, slope_g = _extra(machine, x_iron, power)
    g_last = g
    i = h_s * x1 + h_r * x2 + on_stator * g
    _add_directly(x1, x2, l_l, l_0, on_stator, g, slope_g, power, to_i, to_g)
    for j in range(p):
        dg[j] = slope_g * (on_stator * s1[j] + on_rotor * s2[j]) + to_g[j]
        si[j] = h_s * s1[j] + h_r * s2[j] + on_stator * (dg[j] - to_g[j]) + to_i[j]
        m[_DG_LAST + j] = dg[j]
    keeps = rows.shape[0] == u.size
    total, v_last, last_parts = 0.0, measured.u_before, 1
    mean, by_i0, by_i1 = 0.0, 0.0, 0.0
    for k in range(u.size):
        e = y[k] - i - own[0]
        residual[k], flux[k] = e, x_iron
        w = weight[k]
        total += w * e * e if w > 0.0 else 0.0
        if is_linearised:
            root, at = np.sqrt(w), (k if keeps else 0)
            for j in range(p):
                rows[at, j] = root * si[j]
            rows[at, first_own] = root * wanted[first_own]
            if not keeps:
                _add_row(rows[at], root * e if w > 0.0 else 0.0, information, score, block_scores[k // block])
        if k == u.size - 1:
            break
        jump = u[k] - v_last
        v_last = u[k]
        parts, h = (PARTS, 1) if passes_zero[k] else (1, 0)
        beta = h_s * b1[h, 0] + h_r * b1[h, 1]
        a11, a12, a21, a22, b11, b12 = ad[h, 0, 0], ad[h, 0, 1], ad[h, 1, 0], ad[h, 1, 1], b1[h, 0], b1[h, 1]
        b_iron = on_stator * b11 + on_rotor * b12
        for part in range(parts):
            # A late step inside: its mean, and its first moment as a centred ramp of that moment.
            late, d_late = _late_share(delay, part, parts)
            tilt, steep = 6.0 * late * (1.0 - late) * jump, 6.0 * (1.0 - 2.0 * late) * jump
            ahead = 0.5 * last_parts / parts
            last_parts = parts
            extra = g + ahead * (g - g_last)
            held = u[k] - late * jump - 0.5 * tilt - r_s * on_stator * extra
            c1 = a11 * x1 + a12 * x2 + b11 * held + b2[h, 0] * tilt
            c2 = a21 * x1 + a22 * x2 + b12 * held + b2[h, 1] * tilt
            held_r = -r_r * on_rotor * extra
            if is_split:
                c1, c2 = c1 + b_r[h, 0] * held_r, c2 + b_r[h, 1] * held_r
            g_last = g

            # The current at the end, sought from where the loss of the step before would leave it.
            i0 = i
            if k_f > 0:
                free, within = h_s * c1 + h_r * c2, _SOLVED * (current_span + beta * furthest)
                i, mean, by_i0, by_i1, g, slope_g = _current_at_end(
                    machine,
                    loss,
                    (free, on_stator * c1 + on_rotor * c2),
                    (beta, b_iron),
                    i0,
                    free - beta * mean + on_stator * g,
                    within,
                    power,
                )
            if not np.isfinite(i):
                return np.inf
            old1, old2 = x1, x2
            x1, x2 = c1 - b11 * mean, c2 - b12 * mean
            x_iron = on_stator * x1 + on_rotor * x2
            if k_f == 0:
                g, slope_g = _extra(machine, x_iron, power)
                i = h_s * x1 + h_r * x2 + on_stator * g
            held -= mean

            if not is_linearised:
                continue

            # What the parameters add themselves, then every sensitivity; of its own loss the new current's part.
            pushed[0], pushed[SPLIT], pushed[DELAY] = -on_stator * extra, r_s * extra, -(jump + 0.5 * steep) * d_late
            if k_f > 0:
                _push_of_loss(basis, basis_integral, per_a, i0, i, first_f, pushed)
            for j in range(CIRCUIT):
                to_s1[j] = dad[h, j, 0, 0] * old1 + dad[h, j, 0, 1] * old2 + db1[h, j, 0] * held + db2[h, j, 0] * tilt
                to_s2[j] = dad[h, j, 1, 0] * old1 + dad[h, j, 1, 1] * old2 + db1[h, j, 1] * held + db2[h, j, 1] * tilt
            to_s1[DELAY], to_s2[DELAY] = b2[h, 0] * steep * d_late, b2[h, 1] * steep * d_late
            _add_directly(x1, x2, l_l, l_0, on_stator, g, slope_g, power, to_i, to_g)
            scale = 1.0 / (1.0 + (beta + on_stator * slope_g * b_iron) * by_i1)
            h_g, h_gr = h_s + on_stator * on_stator * slope_g, h_r + on_stator * on_rotor * slope_g
            by_rotor = 0.0, 0.0
            if is_split:
                by_rotor = b_r[h, 0], b_r[h, 1]
                m[_PUSHED_R + 1], m[_PUSHED_R + SPLIT] = -on_rotor * extra, -r_r * extra
                for j in range(CIRCUIT):
                    to_s1[j] += db_r[h, j, 0] * held_r
                    to_s2[j] += db_r[h, j, 1] * held_r
            _carry(
                m,
                width,
                (a11, a12, a21, a22, b11, b12),
                by_rotor,
                (r_s * on_stator, r_r * on_rotor),
                ahead,
                (by_i0, scale, by_i1),
                (h_g, h_gr),
                (slope_g * on_stator, slope_g * on_rotor),
            )
    return total


@njit()
def add_scores(rows: Array, weight: Array, residual: Array, score: Array, block: int, block_scores: Array) -> None:
    """J^T W e added to `score` and by stretches of `block` samples to `block_scores`, of the weighted sensitivities `rows` (n, p) that
    `simulate` left there and other residuals `(n,)`; a sample of no weight has none."""
    missed = np.zeros(residual.size)
    for k in range(residual.size):
        if weight[k] > 0.0:
            missed[k] = np.sqrt(weight[k]) * residual[k]
    for first in range(0, residual.size, block):
        last = min(first + block, residual.size)
        added = np.dot(missed[first:last], rows[first:last])
        for j in range(score.size):  # of two arrays at once two seconds more to compile
            score[j] += added[j]
            block_scores[first // block, j] += added[j]
