"""What every motor has and a steady load hides: the stated errors hold it."""

from __future__ import annotations

import pytest

from commissioner.running.identification import identify
from tests.running_effects.cases import Case, taken


@pytest.mark.parametrize("course", ["steady", "start"])
@pytest.mark.parametrize("seed", [4, 5])
def test_an_iron_loss_is_in_the_errors_of_the_four(course: str, seed: int) -> None:
    """Under one steady load the residual is white, and R_R had been 200 of its stated errors off."""
    recording, plate, truth = taken(Case(seed, "one", course, only="iron_loss").scenario(), seed)
    found = identify([recording], plate)
    for name, value in truth["inverse_gamma"].items():
        own = found.parameters[name]
        assert abs(own.value - value) < 3.0 * own.std, (name, own, value)
