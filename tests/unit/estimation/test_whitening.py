"""Whitening is the moving average of a filter, each row by itself; what no number can say is cut."""

import numpy as np
import pytest
from scipy.signal import lfilter

from commissioner.estimation.kernels.whitening import AT_ONCE, LARGEST, whiten
from commissioner.estimation.noise import Noise


@pytest.mark.parametrize("has_zero", [False, True])
@pytest.mark.parametrize("order", [0, 3, 30])
def test_rows_are_those_of_a_filter(order, has_zero):
    """One begins at once, one late, one never."""
    rng = np.random.default_rng(1)
    noise = Noise(np.concatenate([[1.0], rng.standard_normal(order)]), 0.3, 0.7, has_zero)
    x = rng.standard_normal((3, AT_ONCE + 37, noise.channels))
    x[1, :431], x[2] = 0.0, 0.0
    found = x.copy()
    whiten(found, noise.taps, noise.per_zero)
    told = lfilter(noise.coefficients, [1.0], x[..., :2], axis=1) / 0.3
    assert np.abs(found[..., :2] - told).max() < 1e-11
    assert np.abs(found[..., 2:] - x[..., 2:] / 0.7).max(initial=0.0) < 1e-14


def test_a_run_that_flies_away_is_cut():
    x = np.zeros((1, 40, 3))
    x[0, 5:8, 0] = np.nan, np.inf, -np.inf
    whiten(x, np.array([1.0]), 1.0)
    assert x[0, 5:8, 0].tolist() == [0.0, LARGEST, -LARGEST]
    assert not x[0, 8:].any()
