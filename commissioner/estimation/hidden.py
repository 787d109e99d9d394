"""Causes that are in every motor and not among the fitted numbers: how far they may have drawn those aside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.fit import Column, Fit, Problem, jacobian
from commissioner.estimation.numbers import AT

Array = NDArray[np.float64]
EVERY_MOTOR = {"iron_conductance": 0.02, "bar_resistance": 1.0}
"""Usual sizes: a loss of 2 % of rated apparent power, bars that double R_R at starting slip. In one steady load nothing is left of either: with a second
cage and an iron loss R_s was 15 % off at a stated 0.3 %, R_R of an iron loss alone 4.6 % at 0.02 %, and the residual white."""


def drawn_aside(problem: Problem, fit: Fit) -> Array:
    """(causes, columns): one standard deviation of the columns' numbers by each cause.

    Its size is what a usual one and the residual tell together (a Gaussian prior, and what its sensitivity has that the columns do not
    take up): a start tells the bars, one steady load leaves them as they are usual.
    """
    along = jacobian(problem, fit.machine, [Column("p", AT[name]) for name in EVERY_MOTOR])
    taken = along @ fit.jacobian.T @ fit.influence()
    own = along - taken @ fit.jacobian
    usual = np.array(list(EVERY_MOTOR.values()))
    told = np.sum(own**2, axis=1) / fit.scale
    size2 = 1.0 / (1.0 / usual**2 + told)
    found = size2 * (own @ fit.rest) / fit.scale
    return np.asarray(np.sqrt(found**2 + size2)[:, None] * taken)
