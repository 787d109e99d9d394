"""The flux that saturates is the air gap's: neither the stator's nor the rotor's, and nothing else is named for the difference."""

from dataclasses import replace

import pytest

from commissioner.running.diagnosis import diagnose
from sim.motoring.machine import Effect
from tests.running_effects.cases import Case, taken
from tests.running_effects.start import PLATE, started

SATURATED = {"gap_saturation_2": 0.1, "gap_saturation_3": 0.15, "leakage_split": 0.9}


def test_it_is_named_alone_with_its_size():
    """By the stator's or the rotor's flux heat of the stator, iron loss or a gain were named beside it, and the size was far off."""
    seen = diagnose([started(PLATE, **SATURATED)], PLATE)
    assert [(c.name, c.form) for c in seen.causes] == [("magnetizing_saturation", "air-gap flux")]
    size, std, _ = seen.causes[0].sizes["extra_at_rated_flux"]
    assert abs(size - 0.25) < 3.0 * std < 0.1


def test_with_a_leakage_that_saturates_both_are_named():
    """Alone the leakage makes the part that was held out worse, for want of the other."""
    seen = diagnose([started(PLATE, leakage_softness=0.25, **SATURATED)], PLATE)
    assert {c.name for c in seen.causes} == {"magnetizing_saturation", "leakage_saturation"}
    assert seen.verdict == "explained"


@pytest.mark.parametrize("winding", ["uv", "wu"])
def test_shorted_turns_of_a_delta_lie_between_two_lines(winding):
    """By a loop on one phase of the equivalent star a gain of the voltages and an iron loss were named."""
    delta = replace(PLATE, connection="delta")
    seen = diagnose([started(delta, **{f"loop_conductance_{winding}": 0.03})], delta)
    assert [(c.name, c.form) for c in seen.causes] == [("stator_asymmetry", f"phase {winding}")]
    assert seen.causes[0].sizes[f"current_in_{winding}_of_rated"][0] == pytest.approx(0.03, rel=0.05)


@pytest.mark.parametrize(("phase", "winding"), [(-0.25, "uv"), (1.75, "wu")])
def test_a_deltas_winding_lies_where_another_author_puts_it(phase, winding):
    scenario = replace(Case(5003, "null").scenario(), effects=(Effect("stator_asymmetry", 0.04, phase),))
    recording, plate, _ = taken(scenario, 5003)
    seen = diagnose([recording], replace(plate, connection="delta"))
    assert [(c.name, c.form) for c in seen.causes] == [("stator_asymmetry", f"phase {winding}")]
    assert seen.causes[0].sizes[f"current_in_{winding}_of_rated"][0] == pytest.approx(0.04, rel=0.1)


def test_behind_a_strong_cage_it_is_named_where_it_explains_all_that_is_left():
    """It gains 0.5 % of what the bars do: less than their law could have left, were it not for the noise that alone remains."""
    seen = diagnose([started(PLATE, bar_resistance=3.0, **SATURATED | {"gap_saturation_3": 0.03})], PLATE)
    assert {c.name for c in seen.causes} == {"rotor_skin_effect", "magnetizing_saturation"}
    size, std, _ = next(c for c in seen.causes if c.name == "magnetizing_saturation").sizes["extra_at_rated_flux"]
    assert abs(size - 0.13) < 4.0 * std < 0.05
