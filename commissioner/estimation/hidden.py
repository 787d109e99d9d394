"""Causes that are in every motor: in the fit where they explain all that is left of it, else how far they may have drawn it aside."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.fit import Column, Fit, Problem, jacobian, refine
from commissioner.estimation.numbers import AT, NAMES

Array = NDArray[np.float64]
EVERY_MOTOR = {"iron_conductance": 0.02, "bar_resistance": 1.0}
"""Usual sizes: a loss of 2 % of rated apparent power, bars that double R_R at starting slip. In one steady load nothing is left of either: with a second
cage and an iron loss R_s was 15 % off at a stated 0.3 %, R_R of an iron loss alone 4.6 % at 0.02 %, and the residual white."""

OF_LAW = 0.33
"""Of what an iron loss moved, by one standard deviation: whether it acts on the stator's flux or on the air gap's is not told. (Another simulator's, at
the air gap, fitted behind R_s: R_s 0.9 % low where it had been 2.2 % high, L_M 0.3 % low for 0.5 % high.)"""
LEAST_GAIN = 36.0
"""Of chi-square, for each further number: what a name asks for."""
SURE = 0.2
"""Standard deviation of such a size, of itself, from which the recording tells it."""
ALL_OF_IT, BY_CHANCE = 0.02, 5.0
"""What may be left: a share of what was gained, and standard deviations of the noise's own chi-square."""


def with_told(problem: Problem, fit: Fit) -> Fit:
    """The fit with an iron loss, or with it and bars, where these explain all that the four leave; else as it was.

    What an iron loss leaves tells its size, and only by a straight line how far it drew the four aside (starts of five motors with 2 % of loss: R_R 2.0
    to 2.2 % off so, 0.07 to 0.15 % in the fit). Where more is left another cause may lend them its own size.
    """
    if fit.chi2 < fit.count + LEAST_GAIN or problem.record.has_one_load:
        return fit
    for names in (("iron_conductance",), tuple(EVERY_MOTOR)):
        wide = refine(problem, fit.machine, (*fit.columns, *(Column("p", AT[name]) for name in names)))
        gain, left = fit.chi2 - wide.chi2, wide.chi2 - wide.count
        is_all = left < max(ALL_OF_IT * gain, BY_CHANCE * np.sqrt(2.0 * wide.count))
        is_sure = all(wide.machine.value(name) * SURE > wide.std(name) for name in names)
        if is_all and is_sure and gain > LEAST_GAIN * len(names):
            return wide
    return fit


def drawn_aside(problem: Problem, fit: Fit) -> Array:
    """(causes, columns): one standard deviation of the columns' numbers by each cause that is not in the fit.

    Its size is what a usual one and the residual tell together (a Gaussian prior, and what its sensitivity has that the columns do not
    take up): a start tells the bars, one steady load leaves them as they are usual.
    """
    kept = [c for c in (Column("p", AT[name]) for name in EVERY_MOTOR) if c not in fit.columns]
    if not kept:
        return np.zeros((0, len(fit.columns)))
    along = jacobian(problem, fit.machine, kept)
    taken = along @ fit.jacobian.T @ fit.influence()
    own = along - taken @ fit.jacobian
    usual = np.array([EVERY_MOTOR[NAMES[c.index]] for c in kept])
    told = np.sum(own**2, axis=1) / fit.scale
    size2 = 1.0 / (1.0 / usual**2 + told)
    found = size2 * (own @ fit.rest) / fit.scale
    return np.asarray(np.sqrt(found**2 + size2)[:, None] * taken)
