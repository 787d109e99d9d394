"""Whitening is the moving average of a filter, each row by itself; what no number can say is cut."""

import numpy as np
import pytest
from scipy.signal import lfilter

from commissioner.estimation.kernels.whitening import AT_ONCE, LARGEST, NO_ROW
from commissioner.estimation.noise import Noise


@pytest.mark.parametrize("has_zero", [False, True])
@pytest.mark.parametrize("order", [0, 3, 30])
def test_rows_are_those_of_a_filter(order, has_zero):
    rng = np.random.default_rng(1)
    noise = Noise(np.concatenate([[1.0], rng.standard_normal(order)]), 0.3, 0.7, has_zero)
    x = rng.standard_normal((3, AT_ONCE + 37, 3))
    found = noise.white(x, np.array([2, NO_ROW, 0]))
    for row, own in ((2, found[0]), (0, found[2])):
        told = lfilter(noise.coefficients, [1.0], x[row, :, :2], axis=0) / 0.3
        assert np.abs(own[:, :2] - told).max() < 1e-11
        assert not has_zero or np.abs(own[:, 2] - x[row, :, 2] / 0.7).max() < 1e-14
    assert not found[1].any()
    assert found.shape[2] == (3 if has_zero else 2)


def test_a_run_that_flies_away_is_cut():
    x = np.zeros((1, 40, 3))
    x[0, 5:8, 0] = np.nan, np.inf, -np.inf
    found = Noise(np.array([1.0]), 1.0, 1.0, has_zero=False).white(x)
    assert found[0, 5:8, 0].tolist() == [0.0, LARGEST, -LARGEST]
    assert not found[0, 8:].any()
