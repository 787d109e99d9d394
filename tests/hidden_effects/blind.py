"""One blind diagnosis for the suite: short segments, the key only after the verdict."""

from __future__ import annotations

import dataclasses

from commissioner.diagnose.diagnosis import Diagnosis, diagnose
from commissioner.diagnose.search.journal import replayed
from sim.scenario import Scenario
from tests.hidden_effects.cases import Case, recording_of

SECONDS = 1.0
ONE_OF_EACH = (0, 2, 3, 5)
"""Segments of the protocol's eight: each axis once, one bias. The others show most causes a second time, for twice the computing."""


def diagnosed(case: Case, seconds: float = SECONDS, *, is_short: bool = False) -> tuple[Diagnosis, Scenario]:
    """The diagnosis of the recording alone, and the scenario for whoever scores it. `is_short`: one segment of each kind."""
    scenario = case.scenario(seconds)
    if is_short:
        scenario = dataclasses.replace(scenario, segments=tuple(scenario.segments[k] for k in ONE_OF_EACH))
    seen = diagnose([recording_of(scenario, case.seed)], excluded=case.excluded)
    if seen.found is not None:
        again = replayed(seen.steps)
        assert again.accepted == seen.found.accepted and not again.differs, "the journal decides the same again"
    return seen, scenario


def hidden_names(scenario: Scenario) -> set[str]:
    return {e.name for e in scenario.plant.effects}
