"""The rms of coloured noise over a stretch of samples, against the closed form of an autoregression."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from commissioner.diagnose.intake.audit import prepare
from commissioner.diagnose.intake.noise import Noise, _without_unlike_gains, measure_noise
from tests.unit.diagnose.conftest import recording

PERIOD_S = 2e-4


@pytest.mark.parametrize("memory", [0.0, 0.5, -0.3, 0.95])
@pytest.mark.parametrize("samples", [20_000, 20_001])
def test_rms_of_an_autoregression(memory, samples):
    """x_k = memory x_(k-1) + e_k has sigma / sqrt(1 - memory^2)."""
    frequency = np.geomspace(0.25, 2500.0, 400)
    density = 1.0 / np.abs(1.0 - memory * np.exp(-2j * np.pi * frequency * PERIOD_S)) ** 2
    sigma = np.array([0.01, 0.02, 0.02])
    noise = Noise(sigma, frequency, np.tile(density, (3, 1)), "given", True, 0.0, memory == 0.0)
    expected = np.sqrt(np.mean(sigma**2) / (1.0 - memory**2))
    assert noise.rms_a(samples, PERIOD_S) == pytest.approx(expected, rel=0.01)


def test_a_few_spikes_are_not_noise():
    """Ten of 40 A had made a noise of 10 mA ten times as large."""
    blank = recording(axes=(0.0, 60.0, 120.0, 0.0))
    random = np.random.default_rng(1)
    rows = 0.01 * random.standard_normal((3, blank.time_s.size)) + 0.1 * blank.voltage_axis_v * np.cos(
        np.deg2rad([[0.0], [120.0], [240.0]] - blank.axis_deg)
    )
    rows[1, [500, 3000, 19000]] = 40.0
    noise = measure_noise(prepare([replace(blank, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])])[0])
    assert noise.source == "repeated segments" and noise.sigma_a == pytest.approx(0.01, rel=0.05)


def test_hum_in_a_short_rest_is_not_noise():
    """Its skirts fill the neighbourhood of 50 Hz there: hum of 0.3 of the noise had been whitened away, and nothing named."""
    quiet, hummed = (_resting(hum_a) for hum_a in (0.0, 0.006))
    assert quiet.is_white and hummed.is_white
    assert hummed.sigma_a == pytest.approx(0.01, rel=0.05)


def test_noise_that_rises_slowly_is_no_hum():
    rising = _resting(0.0, memory=0.97)
    at = np.searchsorted(rising.frequency_hz, [20.0, 50.0, 120.0])
    assert not rising.is_white and np.all(np.diff(rising.density[0, at]) < 0.0)


@pytest.mark.parametrize(
    ("gains", "lag_us"),
    [((1, 1, 1), 0), ((0.98, 1, 1), 0), ((1.03, 0.97, 1), 0), ((1, 1, 1), 40), ((0.95, 1, 1.04), 60)],
)
def test_what_unlike_sensors_leave_in_the_sum_of_the_currents_is_not_noise(gains, lag_us):
    """A gain 2 % low had made the noise of 13 mA a coloured one of 19 mA, more than all that was left of the currents."""
    blank = recording(axes=(0.0, 60.0, 120.0))
    volts = blank.voltage_axis_v + 0.5
    angles = np.deg2rad([[0.0], [120.0], [240.0]] - blank.axis_deg)
    rows = np.array(gains)[:, None] * 0.3 * volts * np.cos(angles)
    rows[1] -= 1e-6 * lag_us / PERIOD_S * np.gradient(rows[1])
    rows += 0.01 * np.random.default_rng(6).standard_normal(rows.shape)
    record, _ = prepare(
        [replace(blank, voltage_axis_v=volts, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])]
    )
    noise = measure_noise(record)
    assert noise.source == "sum of the three currents" and noise.is_white
    assert noise.sigma_a == pytest.approx(0.01, rel=0.03)
    sums = [s.currents_a.sum(axis=0) for s in record.segments]
    assert (_without_unlike_gains(record, sums) is sums) == (gains == (1, 1, 1) and not lag_us)


def _resting(hum_a, memory=0.0):
    """Measured on four tests that begin with 0.3 s at zero voltage, none a repeat."""
    blank = recording(axes=(0.0, 60.0, 120.0, 30.0))
    random = np.random.default_rng(4)
    rows = (
        0.01 * np.sqrt(1.0 - memory**2) * lfilter([1.0], [1.0, -memory], random.standard_normal((3, blank.time_s.size)))
    )
    rows += hum_a * np.sin(2.0 * np.pi * 49.97 * blank.time_s + np.array([[0.3], [1.1], [2.0]]))
    volts = blank.voltage_axis_v * (blank.time_s % 2.2 > 0.3)
    rows += 0.1 * volts * np.cos(np.deg2rad([[0.0], [120.0], [240.0]] - blank.axis_deg))
    noise = measure_noise(
        prepare([replace(blank, voltage_axis_v=volts, current_u_a=rows[0], current_v_a=rows[1], current_w_a=rows[2])])[
            0
        ]
    )
    assert noise.source == "zero voltage"
    return noise
