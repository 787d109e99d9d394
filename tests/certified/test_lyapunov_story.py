"""The seed's story (Castaldi & Tilli 2005, section IV): 180 s, averages over 150-180 s, noise in per cent of rms
current."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.identify.batch.whiteness import whiteness
from commissioner.identify.observer.observer import ParallelObserver
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import prior
from tests.support.standstill import linear_current, multitone, usable_motors

PERIOD_S = 3e-4
MOTOR = next(m for m in usable_motors() if m.name == "abb_2k2")
TONES = [(9.0, 0.5, 0.0), (6.0, 2.3, 1.0), (9.0, 9.7, 2.0), (12.0, 41.9, 3.0)]
NOISE_PERCENT = (0.0, 2.5, 5.0, 10.0, 15.0)


def story(noise_percent: float) -> tuple[float, float, float]:
    """(E% of the averages, whiteness over the last 30 s, largest relative error)."""
    voltage = multitone(TONES, 180.0, PERIOD_S)
    current = linear_current(MOTOR.truth, voltage, PERIOD_S)
    rng = np.random.default_rng(int(10 * noise_percent))
    measured = current + noise_percent / 100 * np.std(current) * rng.standard_normal(current.size)
    start = InverseGamma(*(np.array(MOTOR.truth) * [1.5, 0.6, 1.4, 0.6]))
    observer = ParallelObserver(
        prior(MOTOR.plate),
        PERIOD_S,
        MOTOR.plate.rated_current_peak_a,
        law="lyapunov",
        start=start,
        dead_zone_a=0.025 if noise_percent else 0.0,
        expected_voltage_v=voltage[:60000],
    )
    averages, residual = [], []
    for part in np.array_split(np.arange(voltage.size), 180):
        block = observer.advance(voltage[part], measured[part])
        if part[-1] * PERIOD_S > 150.0:
            averages.append(block.parameters.as_tuple())
            residual.append(measured[part] - block.current_a)
    found, truth = np.mean(averages, axis=0), np.array(MOTOR.truth)
    error_percent = 100 * np.linalg.norm(found - truth) / np.linalg.norm(truth)
    return (
        float(error_percent),
        whiteness([np.concatenate(residual)]).statistic,
        float(np.max(np.abs(found / truth - 1))),
    )


@pytest.mark.parametrize("noise_percent", NOISE_PERCENT)
def test_the_seeds_accuracy_at_each_noise_level(noise_percent):
    error_percent, statistic, largest = story(noise_percent)
    assert error_percent < (0.01 if noise_percent == 0.0 else 0.02 + 0.06 * noise_percent)
    assert largest < (1e-3 if noise_percent == 0.0 else 0.02)
    if noise_percent:
        assert statistic < 20.1
