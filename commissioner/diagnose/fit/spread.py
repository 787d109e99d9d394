"""How sure the numbers of a fit are, where a guess went into it beside the data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.fit.gauss_newton import Array, Fit, bounded_step, inverse, limits
from commissioner.diagnose.plant.model import Layout

LOOSER = 2.0 ** np.arange(15)
"""By how much more a leg's loss may rise in its tail than was guessed."""


def covariance_of(found: Fit, layout: Layout, movable: NDArray[np.bool_] | None = None) -> Array:
    """(4 + terms)^2 covariance of the numbers; without `movable` of all, else of those, and zero rows for the others.

    How much a leg's loss rises in its tail is a guess (`Layout.penalty`), and what rises more passes for R_s. The data say by how much
    the guess is to be loosened: as far as makes them likeliest (the evidence; D. J. C. MacKay 1992, doi:10.1162/neco.1992.4.3.415).
    What the numbers would then move by is a part of their error.
    """
    rows = np.flatnonzero(np.ones(found.model.theta.size, dtype=bool) if movable is None else movable)
    gram, moved = _loosened(found, layout)
    out = np.zeros_like(gram)
    here = np.ix_(rows, rows)
    out[here] = inverse(gram[here]) + np.outer(moved[rows], moved[rows])
    return out


def _loosened(found: Fit, layout: Layout) -> tuple[Array, Array]:
    """Information of the numbers with the guess loosened to the greatest evidence, and what they would move by."""
    gram, slope, theta = found.normal.total_gram, found.normal.total_slope, found.model.theta
    prior = layout.penalty(found.model.terms)
    tail = np.flatnonzero(np.diag(prior))
    low, high = limits(found.model, layout)
    best, least = (gram, np.zeros_like(theta)), np.inf
    for looser in LOOSER if tail.size else ():
        less = prior * (1.0 - looser**-2.0)
        here, downhill = gram - less, slope + less @ theta
        step = bounded_step(here, downhill, low - theta, high - theta, 0.0) if looser > 1.0 else np.zeros_like(theta)
        chi2 = step @ here @ step - 2.0 * step @ downhill - theta @ less @ theta
        scale = np.sqrt(np.diag(prior)[tail]) / looser
        told = np.linalg.slogdet(inverse(here)[np.ix_(tail, tail)] * np.outer(scale, scale))[1]
        if chi2 - told < least:
            best, least = (here, step), chi2 - told
    return best
