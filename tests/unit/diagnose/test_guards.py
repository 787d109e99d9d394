"""A clock's delay that stands still is none of a clock."""

import numpy as np

from commissioner.diagnose.guards import CLOCK_RATES, MOST_CONSTANT, constancy
from commissioner.diagnose.reading import clock_courses


def test_clocks_pass_and_what_imitates_a_delay_does_not(setting):
    record = setting.record
    forms = np.concatenate([clock_courses(s) for s in record.segments], axis=1)
    moves = np.concatenate([np.gradient(s.voltage_axis_v) for s in record.segments])
    like_a_delay = np.linalg.lstsq((forms * moves).T, moves, rcond=None)[0]
    assert constancy(dict(zip(CLOCK_RATES, like_a_delay, strict=True)), record) > MOST_CONSTANT
    for rates in ({"drift": 3.0}, {"wander_cos": 1.0}, {"wander_sin": 2.0}, {"running": 1.0}, {}):
        assert constancy(rates, record) < MOST_CONSTANT - 0.1
    assert constancy(dict(zip(CLOCK_RATES, -like_a_delay, strict=True)), record) == 0.0
    both = [constancy({"drift": 1.0, "wander_sin": x}, record) for x in np.linspace(-10.0, 10.0, 81)]
    assert max(both) < MOST_CONSTANT


def test_constancy_is_a_share(setting):
    for rates in np.random.default_rng(3).normal(size=(20, len(CLOCK_RATES))):
        assert 0.0 <= constancy(dict(zip(CLOCK_RATES, rates, strict=True)), setting.record) <= 1.0
