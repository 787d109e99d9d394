"""The rms of coloured noise over a stretch of samples, against the closed form of an autoregression."""

import numpy as np
import pytest

from commissioner.diagnose.noise import Noise

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
