"""What a fit's sensitivities tell beyond what the noise of its own input makes of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
TOLD, LEAST_SHARE = 0.5, 0.05
"""Share of what a direction tells that must be the motor's, else noise of the input makes more of it; the smallest that one draw of noise tells
from none. One steady load without a speed column has one direction with a share of -0.1 to 0.2, R_s against R_R, and R_R came out 30 to 70 % off
with stated errors of 3 to 7 %; with a speed column, or a start, shares are 0.99 and more."""
LEAST_SEEN = 1e-10
"""Eigenvalue of the Gram matrix in units of each column's size: less does nothing."""


@dataclass(frozen=True)
class Told:
    """Covariances of least squares with a noisy input: `covariance` in all, `open` of it along what is not told."""

    covariance: Array
    open: Array


def inverse(gram: Array) -> Array:
    """In units of each column's size, so that none is lost beside an enormous one; a column that does nothing makes no singular matrix."""
    size = np.sqrt(np.maximum(np.diag(gram), 1e-30))
    scaled = gram / np.outer(size, size)
    scaled += np.diag(1e-12 * np.maximum(np.diag(scaled), 1e-30))
    return np.asarray(np.linalg.pinv(scaled, hermitian=True) / np.outer(size, size))


class Slopes:
    """Whitened sensitivities of a fit (columns, samples), made when they are first asked for: many a fit is left before that."""

    def __init__(self, make: Callable[[], Array]) -> None:
        self._make = make

    @classmethod
    def known(cls, jacobian: Array) -> Slopes:
        """Those that stand."""
        return cls(lambda: jacobian)

    @cached_property
    def jacobian(self) -> Array:
        """(columns, samples)."""
        made = self._make()
        self._make = lambda: made  # what it was made from may go
        return made

    @cached_property
    def gram(self) -> Array:
        """(columns, columns): their products."""
        return np.asarray(self.jacobian @ self.jacobian.T)

    @cached_property
    def influence(self) -> Array:
        """The inverse of the Gram matrix."""
        return inverse(self.gram)

    def apart(self, rows: Array) -> Array:
        """What these rows (k, samples) have that the sensitivities do not take up: by the Gram matrix, which costs a fifth of an orthogonal basis; the
        second time takes what rounding left."""
        for _ in range(2):
            rows = rows - (rows @ self.jacobian.T @ self.influence) @ self.jacobian
        return rows


def told(gram: Array, by_noise: Array | float) -> Told:
    """`gram` (n, n): J J'; `by_noise`: the part of it that noise of the input makes, 0 for none.

    X'X of regressors X = X0 + E holds E'E, which tells nothing of the numbers: the covariance is that of X'X - E'E on either side of X'X (Fuller,
    Measurement Error Models, Wiley 1987, section 2.2), as far as E'E leaves anything.
    """
    if not np.any(by_noise):
        plain = inverse(gram)
        return Told(plain, np.zeros_like(plain))
    size = np.sqrt(np.maximum(np.diag(gram), 1e-30))
    seen, vectors = np.linalg.eigh(gram / np.outer(size, size))
    white = vectors[:, seen > LEAST_SEEN] / np.sqrt(seen[seen > LEAST_SEEN])
    share, turned = np.linalg.eigh(np.eye(white.shape[1]) - white.T @ (by_noise / np.outer(size, size)) @ white)
    longer = (white @ turned) / size[:, None] / np.maximum(share, LEAST_SHARE)
    is_open = share < TOLD
    return Told(longer @ longer.T, longer[:, is_open] @ longer[:, is_open].T)
