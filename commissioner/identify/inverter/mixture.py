"""The mean of several descriptions of one thing, each believed by how well it describes the data."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from commissioner.records import Signal

Matrix = NDArray[np.float64]


def chances_of(misfits: Sequence[float], temper: float = 0.5) -> Signal:
    """How likely each is: exp(-temper x misfit), with a sum of 1. At 0.5 `misfits` are chi-squares."""
    best = min(misfits)
    chances = np.array([math.exp(-temper * (misfit - best)) for misfit in misfits])
    return np.asarray(chances / chances.sum())


def mixture(chances: Signal, values: Sequence[Signal], covariances: Sequence[Matrix]) -> tuple[Signal, Matrix]:
    """Mean and covariance of all; what they disagree about is part of the covariance."""
    mean = np.sum([c * v for c, v in zip(chances, values, strict=True)], axis=0)
    spread = [s + np.outer(v - mean, v - mean) for v, s in zip(values, covariances, strict=True)]
    return mean, np.sum([c * s for c, s in zip(chances, spread, strict=True)], axis=0)
