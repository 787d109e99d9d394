"""Every effect alone, blind: the diagnosis sees the recording only, the key is opened afterwards."""

import pytest

from sim.effects import CATALOGUE
from tests.hidden_effects.blind import diagnosed, hidden_names
from tests.hidden_effects.cases import Case, class_of

SEEDS = dict.fromkeys(sorted(CATALOGUE), 40)


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_a_single_cause_is_named_in_its_class_and_nothing_else_is(name):
    case = Case("one", SEEDS[name], name, noise="white")
    seen, scenario = diagnosed(case)
    assert seen.causes, seen.reason
    assert hidden_names(scenario) == {name}
    for cause in seen.causes:
        assert class_of(name) & {cause.name, *cause.equivalent}, (cause.name, cause.confidence)
