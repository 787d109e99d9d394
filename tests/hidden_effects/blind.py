"""One blind diagnosis for the suite: short segments, the key only after the verdict."""

from __future__ import annotations

from commissioner.diagnose.diagnosis import Diagnosis, diagnose
from commissioner.diagnose.search.journal import replayed
from sim.scenario import Scenario
from tests.hidden_effects.cases import Case, recording_of

SECONDS = 1.0


def diagnosed(case: Case, seconds: float = SECONDS) -> tuple[Diagnosis, Scenario]:
    """The diagnosis of the recording alone, and the scenario for whoever scores it."""
    scenario = case.scenario(seconds)
    seen = diagnose([recording_of(scenario, case.seed)], excluded=case.excluded)
    if seen.found is not None:
        again = replayed(seen.steps)
        assert again.accepted == seen.found.accepted and not again.differs, "the journal decides the same again"
    return seen, scenario


def hidden_names(scenario: Scenario) -> set[str]:
    return {e.name for e in scenario.plant.effects}
