"""A test that the model of the test before does not describe is fitted as if it were the first, and still shares one inverter with it."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.identify.estimate.axis import fit_axis, segments
from commissioner.identify.estimate.leg_family import one_inverter, pairs_of
from commissioner.identify.estimate.leg_refit import with_known_law
from commissioner.identify.intake.stretches import Stretch
from commissioner.motor.space_vector import phase_cosines
from tests.support.standstill import multitone, saturating_block, usable_motors

PERIOD_S, NOISE_A, PLATEAU_V, KNEE_A, ORDER = 2e-4, 0.01, 6.0, 0.1, 7.0
MOTOR = next(m for m in usable_motors() if m.name == "sps_5hp_400v_50hz")
TONES = ((14.0, 0.7, 0.0), (12.0, 6.0, 3.2), (4.0, 24.0, 1.0), (4.0, 80.0, 2.0))


def a_test(axis_deg, share, bend_per_wb, seed):
    """Tones at this share of their voltages; the inductance bends by the iron's flux times `bend_per_wb`."""
    r_s, r_r, l_sigma, l_m = MOTOR.truth
    ratio = 1.0 + l_sigma / l_m
    machine = np.array([r_s, ratio**2 * r_r, ratio * l_sigma, l_sigma + l_m, bend_per_wb, ORDER])
    voltage = share * multitone(list(TONES), 4.0, PERIOD_S)
    current, flux = np.empty_like(voltage), np.empty_like(voltage)
    legs = np.array(phase_cosines(axis_deg))
    saturating_block(voltage, PERIOD_S, np.zeros(2), machine, PLATEAU_V, KNEE_A, legs, current, flux)
    noise = NOISE_A * np.random.default_rng(seed).standard_normal(voltage.size)
    stretch = Stretch(0, axis_deg, voltage, current + noise, np.zeros_like(current), "multitone", True, 0, 0.0)
    return [stretch], float(np.max(np.abs(flux)))


@pytest.fixture(scope="module")
def tests():
    first, second = a_test(0.0, 0.7, 1.3, 1), a_test(60.0, 1.0, 1.3, 2)
    assert second[1] > 1.3 * first[1]
    fit = fit_axis(first[0], MOTOR.plate, PERIOD_S, None, None, None)
    return fit, fit_axis(second[0], MOTOR.plate, PERIOD_S, None, None, fit)


def test_the_second_test_is_described_as_well_as_the_first(tests):
    assert [fit.batch.noise_a for fit in tests] == pytest.approx([NOISE_A, NOISE_A], rel=0.03)


def test_models_that_differ_are_one_inverter_and_tell_one_resistance(tests):
    first, second = (fit.batch for fit in tests)
    assert (first.model.extra_powers, first.model.with_split) != (second.model.extra_powers, second.model.with_split)
    pairs = pairs_of([first, second])
    assert pairs
    drawn = one_inverter([first, second], pairs)
    known = with_known_law([first, second], [segments(fit.stretches) for fit in tests], drawn, pairs)
    for fit in known:
        std = np.sqrt(fit.covariance[0, 0])
        assert std < 0.01 * MOTOR.truth[0] and abs(fit.theta[0] - MOTOR.truth[0]) < 3.5 * std
