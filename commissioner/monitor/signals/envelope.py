"""How much of each harmonic is load and how much is noise: the least-squares (Wiener) share of each order of a comb.

The torque of a load is bounded and its harmonics decay, the noise of the inversion grows with the order (the current answers a
torque at order h with 1 / h^2). So the orders of a comb are not judged one by one: their power is exponential around
S_h + N_h with S_h = A k^(-2a), N_h known from the scatter between blocks. Marginal likelihood on a grid of (A, a), and the mean
over that grid: an order that only noise reaches is drawn down to what its neighbours make likely, and what is thereby
left out is stated as a variance. Multiples of the strongest order (pulses of cylinders, vanes) and the rest have an envelope each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.records import Signal

DECAYS = np.linspace(0.5, 5.0, 19)
DECAY, DECAY_STD = 2.0, 0.75
"""Torque amplitude ~ k^-a: a = 1 for a torque that jumps, 2 for one with corners (cam, vane, crank), more for smooth ones."""
AMPLITUDES = 60
STANDS_OUT = 16.0
"""Power over variance at which an order is kept against its envelope: P = (1 + 16/24)^-24 = 5e-6 on noise whose variance
24 blocks gave."""
BEYOND = 3
"""Orders up to so many times the highest one, and those on lines of others, are counted in what is left out."""


@dataclass(frozen=True)
class Share:
    """`share[k]` of each harmonic is kept; `missing[k]` is the expected |error|^2 besides the noise that `share` lets through, in
    the units of the power given; `beyond` what orders that could not be seen (too high, or on a line of the mains) are
    expected to hold: the sums of their powers and of power over order squared. `strongest` is the pulses' order.
    """

    share: Signal
    missing: Signal
    beyond: Signal
    strongest: int = 1


def shares(orders: NDArray[np.int64], power: Signal, variance: Signal) -> Share:
    """Of `|x_h|^2` and its noise variance, both `(m,)` and of the load's own kind (acceleration, torque): see the module."""
    share, missing, beyond = np.zeros(orders.size), np.zeros(orders.size), np.zeros(2)
    if orders.size == 0:
        return Share(share, missing, beyond)
    clear = np.where(power > STANDS_OUT * variance, power, 0.0)
    strongest = int(orders[int(np.argmax(clear))]) if clear.any() else 1
    is_pulse = orders % strongest == 0
    every = np.arange(1, BEYOND * int(orders.max()) + 1)
    unseen = every[~np.isin(every, orders)]
    for own, unit, hidden in (
        (is_pulse, strongest, unseen[unseen % strongest == 0]),
        (~is_pulse, 1, unseen[unseen % strongest != 0]),
    ):
        if own.any():
            share[own], missing[own], likely = _family(orders[own] / unit, power[own], variance[own], hidden / unit)
            beyond += np.array([np.sum(likely), np.sum(likely / hidden**2)])
    stands = np.where(power > STANDS_OUT * variance, 1 - variance / np.maximum(power, 1e-300), 0.0)
    missing = np.where(stands > share, (1 - stands) ** 2 * power, missing)
    return Share(np.maximum(share, stands), missing, beyond, strongest)


def _family(place: Signal, power: Signal, variance: Signal, hidden: Signal) -> tuple[Signal, Signal, Signal]:
    """(shares, missing powers, powers expected at the places `hidden`) of orders on one envelope A place^(-2a)."""
    noise = np.maximum(variance, 1e-300)
    low = np.log(1e-3 * float(np.min(noise * place**2)))
    high = np.log(10.0 * float(np.max(power + noise) * np.max(place) ** 2))
    level = np.linspace(low, high, AMPLITUDES)
    expected = np.exp(level[:, None, None] - 2 * DECAYS[:, None] * np.log(place))
    total = expected + noise
    fit = -np.sum(np.log(total) + power / total, axis=2) - 0.5 * ((DECAYS - DECAY) / DECAY_STD) ** 2
    weight = np.exp(fit - fit.max())
    weight /= weight.sum()
    factor = expected / total
    share = np.einsum("ad,adm->m", weight, factor)
    spread = np.einsum("ad,adm->m", weight, factor**2) - share**2
    left = np.einsum("ad,adm->m", weight, factor * noise) - share**2 * noise + np.maximum(spread, 0.0) * power
    likely = np.einsum("ad,adm->m", weight, np.exp(level[:, None, None] - 2 * DECAYS[:, None] * np.log(hidden)))
    return share, np.maximum(left, 0.0), likely
