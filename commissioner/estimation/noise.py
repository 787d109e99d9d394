"""What chance does to the residual: white noise of the current, and that of the voltage sent through the machine."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

Array = NDArray[np.float64]
ORDER = 30
"""Of the autoregression; with it nulls have a chi-square of 0.99 to 1.01 a sample."""


@dataclass(frozen=True)
class Noise:
    """Whitening of alpha and beta by one autoregression, of the zero sequence by its own standard deviation."""

    coefficients: Array
    sigma: float
    zero: float
    has_zero: bool
    total: float = 0.0
    """Standard deviation of alpha and beta, not whitened, A."""

    @property
    def channels(self) -> int:
        """Of a current that is whitened: alpha, beta, and the zero sequence where there is one."""
        return 3 if self.has_zero else 2

    @property
    def taps(self) -> Array:
        """Of the moving average that whitens alpha and beta, 1/A."""
        return self.coefficients / self.sigma

    @property
    def per_zero(self) -> float:
        """By which the zero sequence is whitened, 1/A."""
        return 1.0 / self.zero if self.has_zero else 0.0


def plain_noise(sigma_a: tuple[float, float, float], has_zero: bool) -> Noise:
    """Of white currents, before a machine is known."""
    sigma = float(np.hypot(sigma_a[0], sigma_a[1]) / np.sqrt(2))
    return Noise(np.array([1.0]), sigma, sigma_a[2], has_zero, sigma)


def through_machine(
    shown: Array, sigma_a: tuple[float, float, float], has_zero: bool, rng: np.random.Generator
) -> Noise:
    """`shown` (n, 2): what the voltage's noise makes of the current. Autoregression of it with the current's own noise."""
    white = np.hypot(sigma_a[0], sigma_a[1]) / np.sqrt(2)
    x = shown + white * rng.standard_normal(shown.shape)
    n = x.shape[0]
    lags = np.array([np.sum(x[: n - k] * x[k:]) / n for k in range(ORDER + 1)]) / 2.0
    lags[0] *= 1.0 + 1e-9
    taps = solve_toeplitz(lags[:-1], lags[1:])
    return Noise(
        np.concatenate([[1.0], -taps]),
        float(np.sqrt(lags[0] - taps @ lags[1:])),
        sigma_a[2],
        has_zero,
        float(np.sqrt(lags[0])),
    )
