"""Every effect alone, blind: the diagnosis sees the recording only, the key is opened afterwards."""

import pytest

from sim.physics.effects import CATALOGUE
from sim.truth import answer_key
from tests.hidden_effects.blind import SECONDS, diagnosed, hidden_names
from tests.hidden_effects.cases import Case, class_of

SEED = 40
SEEN_FROM = {"dc_link_sag": (58, SECONDS), "rotor_heating": (122, SECONDS), "stator_heating": (122, 3.0)}
"""Seed and seconds of a segment where seed 40 draws less than a tenth of the noise."""
IN_THE_VALUES = ("dc_link_ripple", "sensor_gain_mismatch", "device_drop", "magnetic_hysteresis")
"""What scales every voltage or current, or is taken for its equivalent, moves the values: terminals tell no more."""
WHOLE = ("leakage_saturation",)
"""Needs all segments."""


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_a_single_cause_is_named_in_its_class_and_nothing_else_is(name, is_short):
    seed, seconds = SEEN_FROM.get(name, (SEED, SECONDS))
    seen, scenario = diagnosed(Case("one", seed, name, noise="white"), seconds, is_short=is_short and name not in WHOLE)
    assert hidden_names(scenario) == {name}
    assert seen.causes, seen.reason
    for cause in seen.causes:
        assert class_of(name) & {cause.name, *cause.equivalent}, (cause.name, cause.confidence)
    if name not in IN_THE_VALUES:
        for parameter, true in answer_key(scenario)["inverse_gamma"]["unsaturated"].items():
            if parameter in seen.parameters_after:
                found = seen.parameters_after[parameter]
                assert abs(found.value - true) < 4.0 * found.std, (parameter, found, true)
