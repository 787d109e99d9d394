"""Conventions of space vectors, stated once.

Amplitude-invariant: a symmetric sinusoidal phase quantity of peak A gives a vector of length A. The axis angle is
counted from phase u towards phase v. Signals are `(n,)`, SI units.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from commissioner.records import Signal


def axis_current_a(current_u_a: Signal, current_v_a: Signal, current_w_a: Signal | None, axis_deg: float) -> Signal:
    """The current vector's component along the axis."""
    of_u, of_v, of_w = (2.0 / 3.0 * cosine for cosine in phase_cosines(axis_deg))
    if current_w_a is None:
        along = (of_u - of_w) * current_u_a + (of_v - of_w) * current_v_a
    else:
        along = of_u * current_u_a + of_v * current_v_a + of_w * current_w_a
    return np.asarray(along, dtype=np.float64)


def orthogonal_current_a(
    current_u_a: Signal, current_v_a: Signal, current_w_a: Signal | None, axis_deg: float
) -> Signal:
    """The component 90 degrees ahead of the axis: zero in a symmetric machine excited along the axis."""
    return axis_current_a(current_u_a, current_v_a, current_w_a, axis_deg + 90.0)


@lru_cache(maxsize=64)
def phase_cosines(axis_deg: float) -> tuple[float, float, float]:
    """What of an axis current flows in each phase: cos(theta), cos(theta - 120 deg), cos(theta + 120 deg).

    The same numbers times 2/3 weight phase voltages into the axis voltage.
    """
    return tuple(math.cos(math.radians(axis_deg - shift)) for shift in (0.0, 120.0, 240.0))  # type: ignore[return-value]


LEGS_ALIKE_DEG, ASLANT_DEG = 30.0, 0.5
"""Legs of a bridge lose voltage along the axis alone where two of them carry the same current or one carries none: at multiples of the
first. Half a degree beside them is still within the standard errors; at 5 degrees L_M was off by 12 of them, at 15 a sound drive's
current beside the axis was taken for a sensor's fault."""


def is_aslant(axis_deg: float) -> bool:
    """Whether what an inverter's legs lose drives a current beside this axis."""
    return abs((axis_deg + LEGS_ALIKE_DEG / 2) % LEGS_ALIKE_DEG - LEGS_ALIKE_DEG / 2) > ASLANT_DEG
