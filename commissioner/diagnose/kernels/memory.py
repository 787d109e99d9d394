"""Operators that remember, compiled: what a hysteresis current of the iron is made of.

A positive radius r is the stop operator, |z| <= r (Prandtl-Ishlinskii: M. Brokate, J. Sprekels, Hysteresis and Phase
Transitions, 1996); a negative one the exponential operator of scale |r|, dz = d psi - |d psi| z / |r| (P. R. Dahl, 1968;
Bouc-Wen with n = 1, and the irreversible part of Jiles-Atherton): turning points close differently in the two.
"""

from __future__ import annotations

import math

import numpy as np

from commissioner.compiled import borrowing, kernel

MOST_STEPS_TO_REST, AT_REST_WB = 2000, 1e-9


@borrowing
def remembered(za, zb, da, db, radius):
    """State z after the input has moved straight by (da, db)."""
    if radius > 0.0:
        ya, yb = za + da, zb + db
        length = np.sqrt(ya * ya + yb * yb)
        f = radius / length if length > radius else 1.0
        return ya * f, yb * f
    length = np.sqrt(da * da + db * db) + 1e-30
    forgotten = -math.expm1(length / radius)
    f = -radius * forgotten / length
    return za * (1.0 - forgotten) + f * da, zb * (1.0 - forgotten) + f * db


@kernel
def replayed(path, radius):
    """States (s, 2) of operators of these `radius` (s,) after a flux `path` (2, m), from none at its beginning."""
    z = np.zeros((radius.shape[0], 2))
    for m in range(1, path.shape[1]):
        for s in range(radius.shape[0]):
            z[s, 0], z[s, 1] = remembered(
                z[s, 0], z[s, 1], path[0, m] - path[0, m - 1], path[1, m] - path[1, m - 1], radius[s]
            )
    return z


@kernel
def at_rest(pa, pb, z, stiffness, radius, l_m):
    """Flux at which the memory's current and that of L_M cancel, no voltage and no current being left, from flux (pa, pb) and states
    `z` (s, 2), which follow; `stiffness` (s,) of each operator, A/Wb.
    """
    share = 0.5 / (1.0 + l_m * stiffness.sum())
    for _ in range(MOST_STEPS_TO_REST):
        ja = jb = 0.0
        for s in range(radius.shape[0]):
            ja += stiffness[s] * z[s, 0]
            jb += stiffness[s] * z[s, 1]
        da, db = -share * (pa + l_m * ja), -share * (pb + l_m * jb)
        pa += da
        pb += db
        for s in range(radius.shape[0]):
            z[s, 0], z[s, 1] = remembered(z[s, 0], z[s, 1], da, db, radius[s])
        if da * da + db * db < AT_REST_WB**2:
            break
    return pa, pb


@borrowing
def loop_width(pa, pb, rate):
    """Factor on a memory current at flux (pa, pb), and its derivative by |flux|^2: `rate` |flux|^2 where loops widen with flux, as measured
    ones do below the knee; (1 + `rate` |flux|^2)^2, `rate` < 0, where they narrow, as the branches of a loop meet in saturation; else 1.
    """
    if rate == 0.0:
        return 1.0, 0.0
    power = rate * (pa * pa + pb * pb)
    return (power, rate) if rate > 0.0 else ((1.0 + power) ** 2, 2.0 * rate * (1.0 + power))


@borrowing
def susceptibility(za, zb, da, db, qa, qb, radius):
    """Derivative of `remembered` by (da, db), symmetric aa, ab, bb, and by (za, zb) likewise; (qa, qb) is the direction of
    motion where (da, db) is still zero.
    """
    if radius > 0.0:
        ya, yb = za + da, zb + db
        length = np.sqrt(ya * ya + yb * yb)
        if length <= radius:
            return 1.0, 0.0, 1.0, 1.0, 0.0, 1.0
        ua, ub, f = ya / length, yb / length, radius / length
        naa, nab, nbb = f * (1.0 - ua * ua), -f * ua * ub, f * (1.0 - ub * ub)
        return naa, nab, nbb, naa, nab, nbb
    length = np.sqrt(da * da + db * db)
    keep, f = 1.0, 1.0
    if length > -1e-9 * radius:
        keep = math.exp(length / radius)
        f = radius * math.expm1(length / radius) / length
        ua, ub = da / length, db / length
    else:
        size = np.sqrt(qa * qa + qb * qb) + 1e-30
        ua, ub = qa / size, qb / size
    g = keep / radius
    return (
        f + (keep - f) * ua * ua + g * za * ua,
        (keep - f) * ua * ub + 0.5 * g * (za * ub + zb * ua),
        f + (keep - f) * ub * ub + g * zb * ub,
        keep,
        0.0,
        keep,
    )
