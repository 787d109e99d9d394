"""Coarse converter steps in the noise: what repeats and a current at rest hide of the rounding error is added."""

import numpy as np
import pytest

from commissioner.diagnose.intake.noise import Noise

RATIOS = [0.05, 0.2, 0.3, 0.4, 0.6, 0.9]


def measured(values, source):
    sigma = np.full(3, float(np.sqrt(np.mean(np.square(values)))))
    return Noise(sigma, np.array([1.0, 1000.0]), np.ones((3, 2)), source, True, 0.01, True)


def true_error(ratio, random):
    """RMS, in steps, of noise and rounding together upon a signal that moves over many steps."""
    signal = np.linspace(0.0, 4000.0, 400_000)
    return signal, float(np.std(np.round(signal + ratio * random.standard_normal(signal.size)) - signal))


@pytest.mark.parametrize("ratio", RATIOS)
def test_two_recordings_of_one_test_give_the_noise_of_a_moving_signal(ratio):
    random = np.random.default_rng(2)
    signal, wanted = true_error(ratio, random)
    a, b = (np.round(signal + ratio * random.standard_normal(signal.size)) for _ in range(2))
    noise = measured((a - b) / np.sqrt(2.0), "repeated segments").with_converter_step(np.ones(3))
    assert noise.sigma_a == pytest.approx(wanted, rel=0.02)
    repeating = 0.5 * (a + b) - signal
    share = max(float(np.var(repeating)) - 0.5 * float(np.var(a - b)) / 2.0, 0.0) / wanted**2
    assert noise.rounding_share == pytest.approx(share, abs=0.03)


@pytest.mark.parametrize("ratio", RATIOS[2:])
def test_a_current_at_rest_gives_the_noise_of_a_moving_one(ratio):
    random = np.random.default_rng(2)
    _, wanted = true_error(ratio, random)
    still = np.round(ratio * random.standard_normal(400_000))
    noise = measured(still, "zero voltage").with_converter_step(np.ones(3))
    assert noise.sigma_a == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("ratio", [0.05, 0.1, 0.2])
def test_a_current_that_rests_at_the_edge_of_a_step_toggles_by_half_a_step(ratio):
    """As zero is to a converter that cuts off: there the error is +-1/2, where the current moves 1/sqrt(12)."""
    random = np.random.default_rng(2)
    signal = np.r_[np.zeros(100_000), np.linspace(0.0, 4000.0, 300_000)]
    a, b = (np.floor(signal + ratio * random.standard_normal(signal.size)) for _ in range(2))
    wanted = float(np.std(a - signal))
    one = measured((a - b)[100_000:] / np.sqrt(2.0), "repeated segments")
    one.by_source["zero voltage"] = [float(np.std(a[:100_000]))] * 3
    assert one.with_converter_step(np.ones(3), 0.25).sigma_a == pytest.approx(wanted, rel=0.02)
    assert one.with_converter_step(np.ones(3)).sigma_a.max() < 0.9 * wanted
    one.by_source["zero voltage"] = [30.0] * 3  # a flux that decays
    assert one.with_converter_step(np.ones(3), 0.25).sigma_a == pytest.approx(wanted, rel=0.05)


def test_fine_steps_change_nothing():
    noise = measured(np.random.default_rng(2).standard_normal(10_000), "repeated segments")
    assert noise.with_converter_step(np.full(3, 0.02)).sigma_a == pytest.approx(noise.sigma_a, rel=1e-9)
    assert noise.with_converter_step(np.zeros(3)) == noise
