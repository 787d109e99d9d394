"""Points of a climb stand beside the levels held where they can be of the same rising curve."""

from commissioner.identify.inverter.staircase import DcLevel
from commissioner.procedure.energised.staircase import settled_points

HELD = [DcLevel(1.6, 1.5, 0.01), DcLevel(3.1, 13.4, 0.1), DcLevel(-1.6, -1.0, 0.01), DcLevel(-3.1, -10.8, 0.1)]


def test_a_point_with_more_voltage_than_a_larger_current_was_held_with_is_left_out():
    climbed = [DcLevel(0.9, 0.4, 0.0), DcLevel(1.7, 0.9, 0.0), DcLevel(2.8, 4.0, 0.0), DcLevel(12.9, 3.2, 0.0)]
    assert settled_points(climbed, HELD) == (climbed[0], climbed[2])


def test_what_is_above_every_level_is_judged_by_none():
    assert settled_points([DcLevel(9.0, 20.0, 0.0)], HELD) == (DcLevel(9.0, 20.0, 0.0),)
