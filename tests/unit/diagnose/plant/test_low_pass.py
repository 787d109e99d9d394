"""Lags of the current channel, against a simulation on a grid a thousand times finer."""

import numpy as np
import pytest
from scipy.signal import lfilter

from commissioner.diagnose.plant.low_pass import Between, behind, by_lag, by_shape, low_pass

FINE = 1000


def zigzag(count=60):
    return np.cumsum(np.random.default_rng(4).normal(size=count))[None]


def smooth(tone, turn):
    values, slopes = (np.stack([x.real, x.imag]) for x in (tone, 1j * turn * tone))
    return Between(values, slopes, slopes, 0.0 * values)


def finely_lagged(current, lags):
    """Backward differences on the straight lines between the samples."""
    at = np.arange((current.shape[1] - 1) * FINE + 1) / FINE
    out = np.interp(at, np.arange(current.shape[1]), current[0])
    for lag in lags:
        share = 1.0 - np.exp(-1.0 / (lag * FINE))
        out = lfilter([0.5 * share, 0.5 * share], [1.0, share - 1.0], out - out[0]) + out[0]
    return at, out


@pytest.mark.parametrize("lags", [(0.3,), (2.5,), (1.2, 0.4), (0.8, 0.8), (2.0, 0.01)])
def test_a_lagged_current_is_right_between_the_samples_too(lags):
    current = zigzag() - zigzag()[:, :1]
    at, fine = finely_lagged(current, lags)
    shape = np.prod(lags) / sum(lags) ** 2 if len(lags) > 1 else 0.0
    late = np.where(np.arange(60) % 2, 0.2, 1.7)
    value, slope = behind(Between.straight(current, 0.0 * current), sum(lags), shape, late)
    wanted = np.interp(np.arange(60) - late, at, fine)
    inner = slice(3, None)
    assert np.abs(value[0] - wanted)[inner].max() < 2e-3 * np.abs(current).max()
    step = 1e-3
    again = behind(Between.straight(current, 0.0 * current), sum(lags), shape, late - step)[0]
    assert np.abs((again - value)[0] / step - slope[0])[inner].max() < 2e-2 * np.abs(slope).max()


@pytest.mark.parametrize("shape", [0.0, 0.1, 0.25, 0.5])
def test_a_tone_behind_the_filter_has_its_amplitude_and_phase(shape):
    lag, turn = 6.0, 0.03
    response = 1.0 / (1.0 + 1j * turn * lag - shape * (turn * lag) ** 2)
    tone = np.exp(1j * turn * np.arange(4000))
    late = np.full(4000, 0.4)
    value, slope = behind(smooth(tone, turn), lag, shape, late)
    wanted = response * np.exp(1j * turn * (np.arange(4000) - 0.4))
    late_part = slice(1000, None)
    assert np.abs((value[0] + 1j * value[1]) - wanted)[late_part].max() < 1e-7
    assert np.abs((slope[0] + 1j * slope[1]) - 1j * turn * wanted)[late_part].max() < 1e-5 * turn


@pytest.mark.parametrize("shape", [1e-300, 1e-20, 1e-9, 1e-4])
def test_a_shape_of_next_to_nothing_is_one_lag(shape):
    between = Between.straight(zigzag(), 0.0 * zigzag())
    late = np.full(60, 0.3)
    (value, slope), (once, once_slope) = (behind(between, 0.4, q, late) for q in (shape, 0.0))
    assert np.abs(value - once).max() < 1e-3 and np.abs(slope - once_slope).max() < 1e-2
    assert np.abs(low_pass(zigzag(), 0.4, shape) - low_pass(zigzag(), 0.4, 0.0)).max() < 1e-3
    assert np.isfinite(by_shape(between, 0.4, shape, late)).all()


def test_derivatives_by_sum_and_shape_are_those_of_the_response():
    lag, shape, turn = 6.0, 0.2, 0.03
    tone = np.exp(1j * turn * np.arange(4000))
    rows, late = smooth(tone, turn), np.zeros(4000)
    s = 1j * turn
    response = 1.0 / (1.0 + s * lag + shape * (s * lag) ** 2)
    for derivative, wanted in (
        (by_lag(rows, lag, shape, late), -(s + 2.0 * shape * lag * s**2) * response**2),
        (by_shape(rows, lag, shape, late), -((s * lag) ** 2) * response**2),
        (by_shape(rows, lag, 0.0, late), -((s * lag) ** 2) / (1.0 + s * lag) ** 2),
    ):
        seen = (derivative[0] + 1j * derivative[1])[1000:]
        assert np.abs(seen - (wanted * tone)[1000:]).max() < 1e-2 * abs(wanted)


def test_a_steady_ramp_lags_by_the_sum_of_its_time_constants():
    ramp = np.arange(200.0)[None]
    value, slope = behind(Between.straight(ramp, 0.0 * ramp), 4.5, 2.0 / 9.0, np.zeros(200))
    assert value[0, -1] == pytest.approx(199.0 - 4.5, abs=1e-9)
    assert slope[0, -1] == pytest.approx(1.0, abs=1e-9)
    assert low_pass(ramp, 4.5, 2.0 / 9.0)[0, -1] == pytest.approx(199.0 - 4.5, abs=1e-6)
