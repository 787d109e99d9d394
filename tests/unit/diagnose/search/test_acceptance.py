"""What no sound cause does: a clock's delay that stands still, a sag that the recorded link does not show."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.causes.sampling.clock_drift import LEAST_INCONSTANT, RATES, constancy
from commissioner.diagnose.plant.sampling import clock_courses
from commissioner.diagnose.search.acceptance import guard, is_plausible


def test_clocks_pass_and_what_imitates_a_delay_does_not(setting):
    record = setting.record
    forms = np.concatenate([clock_courses(s) for s in record.segments], axis=1)
    moves = np.concatenate([np.gradient(s.voltage_axis_v) for s in record.segments])
    like_a_delay = np.linalg.lstsq((forms * moves).T, moves, rcond=None)[0]
    constant = 1.0 - LEAST_INCONSTANT * (1.0 - constancy({"drift": 1.0}, record))
    assert 0.95 < constant < 1.0
    assert constancy(dict(zip(RATES, like_a_delay, strict=True)), record) > constant
    for rates in ({"drift": 3.0}, {"wander_cos": 1.0}, {"wander_sin": 2.0}, {"running": 1.0}, {}):
        assert constancy(rates, record) < min(constant, 0.95) - 0.1
    assert constancy(dict(zip(RATES, -like_a_delay, strict=True)), record) > constant  # early alike: a conductance
    both = [constancy({"drift": 1.0, "wander_sin": x}, record) for x in np.linspace(-10.0, 10.0, 81)]
    assert max(both) < min(constant, 0.95)


def test_constancy_is_a_share(setting):
    for rates in np.random.default_rng(3).normal(size=(20, len(RATES))):
        assert 0.0 <= constancy(dict(zip(RATES, rates, strict=True)), setting.record) <= 1.0


def recorded_link(setting, swing):
    """The setting with a DC link that was recorded: `swing(segment, channels)` over its median."""
    record = setting.record
    segments = tuple(replace(s, link_swing=swing(s, c)) for s, c in zip(record.segments, record.channels, strict=True))
    return replace(setting, record=replace(record, segments=segments))


@pytest.mark.parametrize(("shown", "is_sound"), [(1.0, True), (0.6, True), (0.0, False), (-1.0, False)])
def test_a_recorded_link_is_a_witness_against_a_sag_that_it_does_not_show(setting, nominal, shown, is_sound):
    terms = CATALOGUE["dc_link_sag"].terms(setting)
    model = replace(nominal, terms=terms, values=tuple(0.05 * (t.symbol == "sag_10ms") for t in terms))
    column = setting.record.channel("sag_10ms")
    random = np.random.default_rng(2)

    def swing(segment, channels):
        return shown * 0.05 * channels[:, column] + 1e-4 * random.standard_normal(segment.count)

    assert is_plausible(model, "dc_link_sag", setting)
    assert is_plausible(model, "dc_link_sag", recorded_link(setting, swing)) is is_sound


def test_a_link_recorded_too_coarsely_to_show_it_is_no_witness(setting, nominal):
    terms = CATALOGUE["dc_link_sag"].terms(setting)
    model = replace(nominal, terms=terms, values=tuple(1e-3 * (t.symbol == "sag_10ms") for t in terms))
    random = np.random.default_rng(2)
    assert is_plausible(
        model, "dc_link_sag", recorded_link(setting, lambda s, c: 0.05 * random.standard_normal(s.count))
    )


def test_no_link_gives_its_rated_power_while_it_loses_more_than_half(setting, nominal):
    terms = CATALOGUE["dc_link_sag"].terms(setting)
    for size, is_sound in ((0.4, True), (0.7, False)):
        model = replace(nominal, terms=terms, values=tuple(size * (t.symbol == "sag_10ms") for t in terms))
        assert is_plausible(model, "dc_link_sag", setting) is is_sound


def test_a_link_that_was_recorded_may_lose_as_much_as_it_shows(setting, nominal):
    """A charging resistor of 80 ohm left in: a sag of 6 % in the test, 0.8 of the link at rated power, had been `unexplained`."""
    terms = CATALOGUE["dc_link_sag"].terms(setting)
    model = replace(nominal, terms=terms, values=tuple(0.8 * (t.symbol == "sag_10ms") for t in terms))
    column = setting.record.channel("sag_10ms")
    for shown, is_sound in ((0.8, True), (0.0, False)):
        seen = recorded_link(setting, lambda s, c, shown=shown: shown * c[:, column])
        assert is_plausible(model, "dc_link_sag", seen) is is_sound


@pytest.mark.parametrize("accepted", ["rotor_skin_effect", "sensor_lag", "iron_loss"])
def test_a_curve_beside_a_linear_cause_may_be_weaker_than_a_memory(accepted):
    """What a linear cause of another form leaves is in proportion to the command, as no curve is; a memory is below its radius."""
    left = {accepted: 1e6}
    for curve in ("magnetizing_saturation", "leakage_saturation", "dead_time"):
        assert 0.0 < guard(left, curve) < 0.2 * guard(left, "magnetic_hysteresis")
