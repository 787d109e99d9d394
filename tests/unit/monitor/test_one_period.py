"""A recording of one supply period is refused in words."""

import numpy as np
import pytest

from commissioner.monitor.signals.supply import follow_supply

PERIOD_S, HZ = 2e-4, 50.0


@pytest.mark.parametrize("samples", [64, 100, 199, 200, 1000])
def test_the_supply_of_a_period_or_less_is_followed(samples):
    """100 samples at 5 kHz ended in a defect: a spline asks for two means."""
    time = np.arange(samples) * PERIOD_S
    supply = follow_supply(325.0 * np.exp(2j * np.pi * HZ * time), PERIOD_S, HZ)
    np.testing.assert_allclose(np.exp(1j * supply.angle_rad(time)), np.exp(2j * np.pi * HZ * time), atol=1e-6)
    np.testing.assert_allclose(supply.frequency_rad_per_s(time), 2.0 * np.pi * HZ, rtol=1e-6)
