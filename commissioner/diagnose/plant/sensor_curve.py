"""How a current sensor departs from a straight line: relative errors over its current, even and odd, a polynomial each and bends that settle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KNEES = (0.05, 0.15, 0.45)
"""Of full scale: currents about which a bend settles, as a core's or an amplifier's gain that differs between small and large ones."""
COUNT = 1 + len(KNEES)


def even(share: Array) -> tuple[Array, Array]:
    """Relative errors (COUNT, ...) at currents of this share of full scale, odd in it, so that the reported current's error is even;
    and the slopes of that error.
    """
    roots = [np.sqrt(share**2 + knee**2) for knee in KNEES]
    bends = [share / root for root in roots]
    slopes = [bend + share * knee**2 / root**3 for bend, root, knee in zip(bends, roots, KNEES, strict=True)]
    return np.stack([share, *bends]), np.stack([2.0 * share, *slopes])


def odd(share: Array) -> tuple[Array, Array]:
    """The same, even in the current: a gain that depends on its size."""
    power = share**2
    bends = [power / (power + knee**2) for knee in KNEES]
    slopes = [bend * (1.0 + 2.0 * (1.0 - bend)) for bend in bends]
    return np.stack([power, *bends]), np.stack([3.0 * power, *slopes])
