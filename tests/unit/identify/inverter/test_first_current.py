"""A first small current: the inductance that a step between two held levels tells, and how surely. Closed form: one R-L path."""

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.identify.inverter.first_current import HeldLevel, first_current
from commissioner.identify.inverter.settling import Approach, settle

OHM, HENRY, PERIOD_S = 10.0, 2.0, 5e-4
SLOW_S = HENRY / OHM
LARGE_V, SMALL_V = 4.0, 2.0


def seen(held_s, noise_a, seed, *, sign=1.0, shown=1.0):
    """What a path of OHM and HENRY draws at 4, 2 and 4 V, each held for so long, through a sensor with so much noise; `shown`: of the voltage, in the
    samples."""
    rng, levels, approaches = np.random.default_rng(seed), [], []
    time_s = np.arange(0.0, held_s, PERIOD_S)
    before_a = LARGE_V / OHM
    for volts in (LARGE_V, SMALL_V, LARGE_V):
        end_a = volts / OHM
        true_a = end_a + (before_a - end_a) * np.exp(-time_s / SLOW_S)
        before_a = true_a[-1]
        current = sign * true_a + rng.normal(0.0, noise_a, time_s.size)
        levels.append(HeldLevel(volts, np.full(time_s.size, shown * volts), current))
        approaches.append(Approach(time_s, current))
    return first_current(levels, settle(approaches, SLOW_S), PERIOD_S)


@pytest.mark.parametrize("held_s", [0.26, 0.4, 1.0])
def test_a_path_of_known_resistance_and_inductance_is_found(held_s):
    found = seen(held_s, 0.0, 1)
    assert found.stator_inductance_h == pytest.approx(HENRY, rel=0.01)
    assert found.slope_ohm == pytest.approx(OHM, rel=0.01)
    assert found.stator_inductance_std_h < 0.02 * HENRY


@pytest.mark.parametrize("held_s", [0.26, 0.6])
@pytest.mark.parametrize("noise_a", [0.002, 0.02])
def test_the_stated_error_covers_the_scatter(held_s, noise_a):
    found = [seen(held_s, noise_a, seed) for seed in range(60)]
    off = np.array([(f.stator_inductance_h - HENRY) / f.stator_inductance_std_h for f in found])
    assert np.mean(np.abs(off) < 2.0) >= 0.93
    assert np.sqrt(np.mean(off**2)) > 0.25, "an error that says nothing covers all"


def test_brief_levels_and_much_noise_are_less_sure():
    sure, brief, noisy = seen(0.6, 0.002, 3), seen(0.26, 0.002, 3), seen(0.6, 0.02, 3)
    assert sure.stator_inductance_std_h < 0.5 * min(brief.stator_inductance_std_h, noisy.stator_inductance_std_h)


def test_a_current_against_the_voltage_is_refused():
    with pytest.raises(DataRefused, match="does not follow"):
        seen(0.4, 0.0, 1, sign=-1.0)


@pytest.mark.parametrize("shown", [10.0, 0.1, 1.5, 0.5])
def test_samples_of_another_voltage_than_was_asked_for_are_named_as_that(shown):
    """A scale wrong by ten in the drive file was called another motor's inductance."""
    with pytest.raises(DataRefused) as caught:
        seen(0.6, 0.002, 1, shown=shown)
    assert caught.value.what == "the samples show another voltage than the drive was asked for"
    assert str(caught.value.value) == f"{shown * LARGE_V:.4g} V" and "items.voltage_scale_v" in caught.value.remedy
