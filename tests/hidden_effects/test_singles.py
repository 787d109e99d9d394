"""Every effect alone, blind: the diagnosis sees the recording only, the key is opened afterwards.

All of them: `pytest tests/hidden_effects/test_singles.py -m "campaign or not campaign"`.
"""

import pytest

from sim.effects import CATALOGUE
from tests.hidden_effects.blind import diagnosed, hidden_names
from tests.hidden_effects.cases import Case, class_of

SEED = 40
IN_THE_SUITE = ("cable_capacitance", "dc_link_ripple", "device_drop", "leakage_saturation", "lost_samples")
LONG = sorted(set(CATALOGUE) - set(IN_THE_SUITE))


@pytest.mark.parametrize("name", [*IN_THE_SUITE, *(pytest.param(name, marks=pytest.mark.campaign) for name in LONG)])
def test_a_single_cause_is_named_in_its_class_and_nothing_else_is(name):
    seen, scenario = diagnosed(Case("one", SEED, name, noise="white"))
    assert hidden_names(scenario) == {name}
    assert seen.causes, seen.reason
    for cause in seen.causes:
        assert class_of(name) & {cause.name, *cause.equivalent}, (cause.name, cause.confidence)
