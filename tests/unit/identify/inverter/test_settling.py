"""Levels held too briefly end where a closed form says they were heading."""

import numpy as np
import pytest

from commissioner.identify.inverter.settling import Approach, settle

TIME_S = np.arange(0.02, 0.6, 2e-4)
ENDS, STARTS, TRUE_S = (4.8, 2.9, 1.4, -1.4, -2.9, -4.8), (0.0, 4.8, 2.9, 1.4, -1.4, -2.9), 0.8


def approaches(noise_a=0.0, seed=1, time_s=TIME_S):
    rng = np.random.default_rng(seed)
    pairs = zip(ENDS, STARTS, strict=True)
    return [
        Approach(time_s, e + (s - e) * np.exp(-time_s / TRUE_S) + noise_a * rng.standard_normal(time_s.size))
        for e, s in pairs
    ]


@pytest.mark.parametrize("expected_s", [0.4, 0.8, 1.6])
def test_levels_held_for_less_than_a_time_constant_are_extrapolated_whatever_was_expected(expected_s):
    settled = settle(approaches(), expected_s)
    assert settled.current_a == pytest.approx(ENDS, abs=0.03)
    assert settled.time_constant_s == pytest.approx(TRUE_S, rel=0.05)


def test_the_stated_error_covers_the_scatter():
    all_settled = [settle(approaches(0.05, seed), 0.6) for seed in range(60)]
    errors = np.array([s.current_a - np.array(ENDS) for s in all_settled])
    stated = np.array([s.std_a for s in all_settled])
    assert np.mean(np.abs(errors) < 2.0 * stated) > 0.85
    assert np.sqrt(np.mean(errors**2)) < 0.1


def test_settled_levels_are_their_means():
    rng = np.random.default_rng(3)
    held = [Approach(TIME_S, a + 0.05 * rng.standard_normal(TIME_S.size)) for a in ENDS]
    assert settle(held, 0.1).current_a == pytest.approx(ENDS, abs=0.01)
