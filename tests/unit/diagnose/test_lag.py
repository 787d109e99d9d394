"""Lags of the current channel, against a simulation on a grid a thousand times finer."""

import numpy as np
import pytest
from scipy.signal import lfilter

from commissioner.diagnose.lag import behind, low_pass

FINE = 1000


def zigzag(count=60):
    return np.cumsum(np.random.default_rng(4).normal(size=count))[None]


def finely_lagged(current, lags):
    """Backward differences on the straight lines between the samples."""
    at = np.arange((current.shape[1] - 1) * FINE + 1) / FINE
    out = np.interp(at, np.arange(current.shape[1]), current[0])
    for lag in lags:
        share = 1.0 - np.exp(-1.0 / (lag * FINE))
        out = lfilter([0.5 * share, 0.5 * share], [1.0, share - 1.0], out - out[0]) + out[0]
    return at, out


@pytest.mark.parametrize("lags", [(0.3,), (2.5,), (1.2, 0.4), (0.8, 0.8)])
def test_a_lagged_current_is_right_between_the_samples_too(lags):
    current = zigzag() - zigzag()[:, :1]
    at, fine = finely_lagged(current, lags)
    late = np.where(np.arange(60) % 2, 0.2, 1.7)
    value, slope = behind(current, np.array([*lags, 0.0])[:2], late)
    wanted = np.interp(np.arange(60) - late, at, fine)
    inner = slice(3, None)
    assert np.abs(value[0] - wanted)[inner].max() < 2e-3 * np.abs(current).max()
    step = 1e-3
    again = behind(current, np.array([*lags, 0.0])[:2], late - step)[0]
    assert np.abs((again - value)[0] / step - slope[0])[inner].max() < 2e-2 * np.abs(slope).max()


def test_a_steady_ramp_lags_by_the_sum_of_its_time_constants():
    ramp = np.arange(200.0)[None]
    value, slope = behind(ramp, np.array([3.0, 1.5]), np.zeros(200))
    assert value[0, -1] == pytest.approx(199.0 - 4.5, abs=1e-9)
    assert slope[0, -1] == pytest.approx(1.0, abs=1e-9)
    assert low_pass(ramp, np.array([3.0, 1.5]))[0, -1] == pytest.approx(199.0 - 4.5, abs=1e-6)


def test_a_lag_of_nothing_is_the_current_itself():
    current = zigzag()
    assert low_pass(current, np.zeros(2)) is current
