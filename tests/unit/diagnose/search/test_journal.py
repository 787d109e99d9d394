"""The search's records: every choice follows again from their numbers, without a fit, and otherwise under other rules."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.rules import RULES, Rules
from commissioner.diagnose.search import journal
from commissioner.diagnose.search.journal import (
    Accepted,
    Began,
    Beside,
    Dropped,
    Exchanged,
    Screened,
    Tried,
    candidates,
    next_candidate,
    read,
    replayed,
    written,
)
from tests.unit.diagnose.conftest import recording

TAUGHT = Beside({}, 0.0, 1e5, 10.0)


@pytest.fixture(scope="module")
def seen(nominal, setting):
    """An offset and an iron loss in noise, diagnosed with few causes to look for."""
    terms = CATALOGUE["iron_loss"].terms(setting)
    model = replace(nominal.with_terms(terms), values=(5e-4, *(0.0 for _ in terms[1:])))
    currents = np.concatenate([predict(model, setting.record, k, setting.layout).currents_a for k in range(3)], axis=1)
    noise = 0.01 * np.random.default_rng(5).standard_normal(currents.shape)
    offset = np.array([[0.02], [-0.01], [0.0]])
    names = {"iron_loss", "sensor_offset", "cable_capacitance", "sampling_delay"}
    return diagnose([recording(currents=currents + noise + offset)], excluded=[n for n in CATALOGUE if n not in names])


def test_a_journal_makes_the_same_choices_again_without_a_fit(seen, monkeypatch):
    rows = json.loads(json.dumps(written(seen.steps)))
    monkeypatch.setattr("commissioner.diagnose.fit.gauss_newton.fit", None)
    again = replayed(read(rows))
    assert again.accepted == seen.found.accepted and set(again.accepted) == {"iron_loss", "sensor_offset"}
    assert again.differs == ()


def test_records_come_back_as_they_were_written(seen):
    assert read(json.loads(json.dumps(written(seen.steps)))) == seen.steps
    endless = Dropped("remanence", np.inf, 50.0, "materiality", is_sound=False, is_taken=False)
    failed = Exchanged("says", ("a",), ("b",), -np.inf, 3.0, is_sound=False, is_taken=False)
    assert read(written([endless, failed])) == (endless, failed)


def test_other_rules_say_what_they_would_have_chosen(seen):
    strict = replayed(seen.steps, replace(RULES, floor_chi2=1e12))
    assert strict.differs and "in place of" in strict.differs[0]
    assert replayed(seen.steps, replace(RULES, most_looks=7)).differs == ()


def test_a_search_that_begins_again_forgets_what_it_had():
    steps = (Began((), 100), Accepted("remanence", 1.0), Began((), 300), Accepted("dead_time", 1.0))
    assert [replayed(steps[:k]).accepted for k in (2, 3)] == [("remanence",), ()]
    assert replayed((*steps, Began(("remanence",), 300))).accepted == ("remanence",)


def test_every_try_says_what_it_would_have_had_to_gain_and_why(seen):
    tried = [s for s in seen.steps if isinstance(s, Tried)]
    assert tried and all(t.wanted_chi2 >= RULES.required_chi2(t.numbers) and t.wanted_by for t in tried)
    named = [s.name for s in seen.steps if isinstance(s, Accepted)]
    assert {t.name for t in tried if t.is_enough} >= set(named)


def test_a_doctored_gain_is_another_choice(seen):
    steps = [replace(s, gained_chi2=1.0) if isinstance(s, Tried) and s.name == "iron_loss" else s for s in seen.steps]
    assert any("iron_loss" in d for d in replayed(steps).differs)


def test_the_best_promises_are_tried_until_none_can_reach_the_best_gain():
    screened = Screened({"iron_loss": (1e4, 4), "sensor_offset": (9e3, 3), "clock_drift": (100.0, 4)}, TAUGHT)
    assert candidates(screened) == ["iron_loss", "sensor_offset", "clock_drift"]
    assert candidates(replace(screened, refused=("iron_loss",))) == ["sensor_offset", "clock_drift"]
    first = Tried("iron_loss", 1e4, 4, 2e4, 80.0, "")
    assert next_candidate(screened, []) == "iron_loss"
    assert next_candidate(screened, [first]) == "sensor_offset"
    assert next_candidate(screened, [replace(first, gained_chi2=1e6)]) is None


def test_what_asks_for_most_is_named():
    assert TAUGHT.wanted("sensor_offset", 3, RULES) == (70.0, "the price of its numbers")
    assert replace(TAUGHT, material_chi2=500.0).wanted("sensor_offset", 3, RULES) == (500.0, "materiality")
    legs = replace(TAUGHT, losses={"dead_time": 1e9})
    assert legs.wanted("shaft_motion", 3, RULES) == (pytest.approx(2e4), "what dead_time may leave")


def test_every_rule_says_what_it_decides_and_what_sets_it():
    assert len(RULES.table()) == len(fields(Rules)) > 40
    assert all(decides and source for _, _, decides, _, source in RULES.table())


def test_every_kind_of_record_is_known_by_its_name():
    assert sorted(journal.KINDS) == [
        "accepted",
        "began",
        "dropped",
        "exchanged",
        "nominal",
        "refined",
        "said",
        "screened",
        "tried",
    ]
