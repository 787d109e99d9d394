"""What is too small to be named moves the parameters, and their standard deviations say so."""

from dataclasses import replace

import pytest

from commissioner.running.contract import as_document
from commissioner.running.diagnosis import diagnose
from sim.motoring.hidden import draw
from tests.running_effects.cases import taken

R_S = "stator_resistance_ohm"


@pytest.mark.parametrize(("seed", "size"), [(3, 0.006), (5, 0.02)])
def test_a_turn_fault_that_one_load_does_not_name_is_in_the_error_of_the_resistance(seed, size):
    """A shorted loop of 0.6 % and 2 % of rated current: R_s was 8 and 68 % off, more than three and 47 stated errors, and no word of it."""
    scenario = draw(seed, "one", "steady", "stator_asymmetry")
    scenario = replace(scenario, effects=(replace(scenario.effects[0], size=size),))
    recording, plate, _ = taken(scenario, seed)
    seen = diagnose([recording], plate)
    off = abs(seen.parameters_after[R_S].value - scenario.machine.stator_resistance_ohm)
    assert off > 3.0 * seen.found.fit.std("stator_resistance")
    assert off < 3.0 * seen.parameters_after[R_S].std
    assert not seen.causes and "stator_asymmetry" in as_document(seen)["below_materiality"]
    assert any("stator resistance is up to -" in remark for remark in seen.remarks)


def test_a_healthy_motor_has_none():
    recording, plate, _ = taken(draw(3, "null", "steady"), 3)
    seen = diagnose([recording], plate)
    assert not seen.found.trifles and as_document(seen)["below_materiality"] == []
    assert seen.parameters_after[R_S].std == pytest.approx(seen.found.fit.std("stator_resistance"))
