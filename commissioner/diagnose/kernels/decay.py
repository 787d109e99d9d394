"""Rotor flux of a machine whose terminals are open, compiled."""

from __future__ import annotations

import numpy as np

from commissioner.compiled import kernel
from commissioner.diagnose.kernels.spline import curve, place

STEP = 0.02
"""Of the flux's logarithm."""
LEAST_SHARE = 1e-3
"""Of a straight iron's flux: from there on bent iron loses as straight iron does, its flux being small."""
LEAST_RATE = 0.05


@kernel
def decayed(size, share, l_m, iron, iron_top, vectors):
    """How a flux `size` decays in bent iron, d psi/dt = -R_R (1/L_M + G(psi)) psi, over the time in which straight iron keeps `share`.

    Returns what bent iron keeps over what straight iron does; the logarithmic slope of that by `share`; and its logarithmic
    derivatives by 1/L_M and by each of `vectors` (K, intervals, 4) of G, (1 + K,). `iron` (intervals, 4) cells of G, none: straight.
    """
    derivatives = np.zeros(1 + vectors.shape[0])
    if iron.shape[0] == 0 or size <= 0.0 or share >= 1.0:
        return 1.0, 0.0, derivatives
    intervals = iron.shape[0]
    whole = -np.log(max(share, LEAST_SHARE))
    spent, height = 0.0, np.log(size)
    while spent < whole:
        j, u = place(np.exp(height - 0.5 * STEP), iron_top, intervals)
        bend = curve(iron, j, u)
        rate = max(1.0 + l_m * bend, LEAST_RATE)
        fall = min(STEP, rate * (whole - spent))
        derivatives[0] += l_m * l_m * bend / (rate * rate) * fall
        for k in range(vectors.shape[0]):
            derivatives[1 + k] -= l_m * curve(vectors[k], j, u) / (rate * rate) * fall
        height -= fall
        spent += STEP / rate
    j, u = place(np.exp(height), iron_top, intervals)
    rate = max(1.0 + l_m * curve(iron, j, u), LEAST_RATE)
    derivatives *= rate
    return np.exp(height + whole) / size, rate - 1.0 if share > LEAST_SHARE else 0.0, derivatives
