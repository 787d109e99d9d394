"""What averages over a pulse do not show: recordings in which every switch is simulated."""

import pytest

from commissioner.diagnose.diagnosis import diagnose
from tests.hidden_effects.generators.switched import LINK_V, PLATE, Drive, switched


def named(drive):
    seen = diagnose([switched(drive)])
    return seen, {c.name for c in seen.causes}


def test_ideal_pulses_are_their_averages():
    seen, names = named(Drive())
    assert seen.verdict == "nothing_significant" and not names, seen.reason


@pytest.mark.parametrize("lag_us", [12.0, 40.0])
def test_a_filter_before_the_converter_has_its_lag(lag_us):
    """The slope at the converter's instant is that of the zero vector: taken for that of the mean voltage, a lag of 12.5 us was
    2.1 us and something `unexplained`.
    """
    seen, names = named(Drive(lag_s=1e-6 * lag_us))
    assert names == {"sensor_lag"} and seen.left.sigma < 0.1
    assert seen.causes[0].sizes["time_constant_us"][0] == pytest.approx(lag_us, rel=0.01)


def test_a_charging_resistor_that_was_left_in_is_a_sag_as_large_as_the_link_shows():
    ohms = 80.0
    seen, names = named(Drive(charging_ohm=ohms, knows_link=True))
    assert names == {"dc_link_sag"} and seen.left.sigma < 0.1
    # S = R P / V^2 of the stiff source, small powers
    at_rated = ohms * PLATE["rated_power_w"] / LINK_V**2
    assert seen.causes[0].sizes["sag_at_rated_power"][0] == pytest.approx(at_rated, rel=0.05)


def test_a_real_dead_time_is_named_though_what_ripple_makes_of_it_is_left():
    """24 times the noise, of which its curve leaves 1.4: nothing had been named, and all of it called unknown."""
    seen, names = named(Drive(dead_s=2e-6))
    assert names == {"dead_time"} and seen.causes[0].confidence >= 0.9
    assert seen.left.sigma < 0.1 * seen.causes[0].strength_sigma
    if seen.verdict == "unexplained":
        assert "consistent with dead_time" in seen.reason
