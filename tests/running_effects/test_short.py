"""The blind protocol, short: what is hidden is named with its size, and nothing is where nothing is."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.estimation.record import prepare
from commissioner.report.running.page import page_of
from commissioner.running.contract import as_document
from commissioner.running.diagnosis import diagnose
from commissioner.running.identification import identify
from commissioner.running.search import Step, least_promise, least_strength, so_far
from tests.running_effects.cases import Case, taken, true_size
from tests.running_effects.protocol import failures, false_names, gains_elsewhere, run, table

NAMED = {
    "magnetizing_saturation": 0.15, "rotor_skin_effect": 0.15, "iron_loss": 0.05, "rotor_asymmetry": 0.05, "stator_asymmetry": 0.05,
    "line_resistance": 0.1, "sensor_gain_mismatch": 0.05, "voltage_gain_mismatch": 0.05, "speed_sensor_gain": 0.05,
    "speed_sensor_lag": 0.1,
}  # fmt: skip
"""Cause and the error that its size may have: of the saturation's and the bars' the law differs from the simulator's."""


@pytest.mark.parametrize("seed", [5000, 5007])
def test_nothing_is_named_where_nothing_is_hidden(seed):
    row = run(Case(seed, "null"))
    assert row["verdict"] == "nothing_significant"
    assert not row["causes"]


@pytest.mark.parametrize("seed", [5004, 5019])
def test_a_healthy_motor_in_steady_state_has_no_name(seed):
    """There the voltage's noise meets the resistances alone: weighted wrongly, it made a shorted loop or a bad line."""
    row = run(Case(seed, "null", "steady"))
    assert row["verdict"] == "nothing_significant"
    assert not row["causes"]


SHORT = ("magnetizing_saturation", "iron_loss", "rotor_asymmetry", "stator_asymmetry", "voltage_gain_mismatch")
"""In the default run; the others under the mark `campaign`."""


@pytest.mark.parametrize("name", [n if n in SHORT else pytest.param(n, marks=pytest.mark.campaign) for n in NAMED])
def test_one_cause_is_named_with_its_size_and_nothing_else_is(name):
    case = Case(77, "one", only=name)
    scenario = case.scenario()
    recording, plate, truth = taken(scenario, case.seed)
    seen = diagnose([recording], plate)
    assert [c.name for c in seen.causes] == [name], seen.reason
    assert seen.verdict in ("explained", "not_distinguishable")
    effect = truth["effects"][0]
    size, std, _ = next(iter(seen.causes[0].sizes.values()))
    assert abs(size / true_size(effect, scenario) - 1.0) < NAMED[name] + 4.0 * std / abs(size)
    if effect["phase"] != "u" and name in (
        "stator_asymmetry",
        "line_resistance",
        "sensor_gain_mismatch",
        "voltage_gain_mismatch",
    ):
        assert effect["phase"] in next(iter(seen.causes[0].sizes)).split("_")
    assert gains_elsewhere(seen, scenario, case)["elsewhere"] > 0.95


def test_leakage_that_saturates_on_the_rotors_side_is_taken_for_nothing_else():
    """By the stator's law the first cycles of a start were left over, and bars or heat were named for them."""
    case = Case(7002, "one", only="leakage_saturation")
    scenario = case.scenario()
    recording, plate, _ = taken(scenario, case.seed)
    seen = diagnose([recording], plate)
    assert [(c.name, c.form) for c in seen.causes] == [("leakage_saturation", "rotor")], seen.reason
    assert seen.verdict == "explained"
    assert gains_elsewhere(seen, scenario, case)["elsewhere"] > 0.95


@pytest.mark.parametrize("name", ["sensor_lag"])
def test_a_delay_and_a_lag_are_one_class(name):
    seen = diagnose(*_one(name))
    assert seen.verdict == "not_distinguishable"
    assert {seen.causes[0].name, *seen.causes[0].equivalent} == {"sampling_delay", "sensor_lag"}
    assert seen.next_experiment is not None


def _one(name):
    case = Case(78, "one", only=name)
    recording, plate, _ = taken(case.scenario(), case.seed)
    return [recording], plate


def test_a_search_that_is_stopped_gives_up_at_its_next_refit_and_names_nothing():
    """It went on to the end of its round, and said of what it had not tried that no cause in the catalogue makes it."""
    steps, refused = [], []

    def go_on():
        refused.extend(steps[:1])
        return not steps

    recordings, plate = _one("rotor_asymmetry")
    seen = diagnose(recordings, plate, observe=steps.append, go_on=go_on)
    assert len(refused) == 1 and [s.what for s in steps] == ["screened"]
    document = as_document(seen)
    assert (document["verdict"], document["causes"], document["is_complete"]) == ("unexplained", [], False)
    page = page_of(seen, document, "recording.parquet")
    for said in (document["reason"], page.headline):
        assert said.startswith("Not finished") and "no cause in the catalogue" not in said
    assert any("diagnose the recording again without a limit" in r for r in document["remarks"])
    assert document["next_experiment"] is None


def test_what_stands_accepted_after_exchanges_and_drops():
    steps = [
        Step("screened", "iron_loss", "", 9.0), Step("accepted", "iron_loss", "", 9.0), Step("accepted", "rotor_heating", "", 5.0),
        Step("exchanged", "iron_loss", "", 2.0, "rotor_asymmetry"), Step("dropped", "rotor_heating", "", 1.0),
    ]  # fmt: skip
    assert so_far(steps) == ("rotor_asymmetry",)


def test_slots_that_no_catalogue_names_are_called_unexplained():
    row = run(Case(6008, "absent"))
    assert row["truth"][0]["name"] == "slot_modulation"
    assert row["verdict"] == "unexplained"


def test_a_start_is_identified_as_well_as_its_noise_allows():
    """Errors of the four over their bound (Cramer-Rao), six machines: root mean square at most 1.3, with white chi-square."""
    ratios, inertia = [], []
    for seed in range(6):
        recording, plate, truth = taken(Case(seed, "null").scenario(), seed)
        found = identify([recording], plate)
        for (key, bound), true in zip(list(found.bound.items())[:4], truth["inverse_gamma"].values(), strict=True):
            ratios.append((found.parameters[key].value - true) / bound)
        if found.inertia is not None:  # a load step within the run-up: not given
            inertia.append(found.inertia.value / truth["inertia_kg_m2"] - 1.0)
        assert found.chi2 < 1.06
    assert np.sqrt(np.mean(np.square(ratios))) < 1.3
    assert len(inertia) >= 5
    assert np.max(np.abs(inertia)) < 0.01


def test_a_start_without_speed_gives_the_four_and_the_inertia():
    recording, plate, truth = taken(Case(1, "null", has_speed=False).scenario(), 1)
    found = identify([recording], plate)
    for key, true in truth["inverse_gamma"].items():
        assert abs(found.parameters[key].value / true - 1.0) < max(4.0 * found.parameters[key].std / true, 0.002)
    assert abs(found.inertia.value / truth["inertia_kg_m2"] - 1.0) < 0.02


def test_the_table_counts_what_the_rows_say():
    base = {"course": "start", "power_w": 1.0, "verdict": "explained", "held_out": 0.9, "cpu_s": 1.0, "seed": 1}
    cause = {"name": "iron_loss", "equivalent": [], "size": ["w", [1.0, 0.1, "W"]], "delta_chi2": 100.0}
    effect = {"name": "iron_loss", "size": 0.02, "in_class": True, "named": True, "strength": 0.5, "size_error": 0.02}
    rows = [
        {**base, "stratum": "one", "truth": [effect], "causes": [cause]},
        {
            **base,
            "stratum": "one",
            "truth": [{**effect, "name": "dead_time", "in_class": False, "named": False}],
            "causes": [cause],
        },
        {**base, "stratum": "null", "truth": [], "causes": [cause]},
    ]
    assert false_names(rows[1]) == ["iron_loss"]
    text = table(rows)
    assert "| nulls with a name | 1 of 1 |" in text
    assert "0.500 (1 false of 2)" in text
    assert len(failures(rows)) == 2


def test_a_name_needs_more_where_nothing_is_held_out():
    """A healthy motor whose load swung once a turn from the start on was a saturation of 0.03 of the noise, without a speed column."""
    start, steady = (
        prepare([recording], plate)
        for recording, plate, _ in (
            taken(Case(5004, "null", course).scenario(), 5004) for course in ("start", "steady")
        )
    )
    assert least_strength(start) < 0.0305 < least_strength(replace(start, has_speed=False)) < least_strength(steady)
    fitted = 75_000
    assert least_promise(start, fitted, 1.0) == pytest.approx(0.6 * 36.0)
    assert 27.0 < least_promise(replace(start, has_speed=False), fitted, 1.0) < 0.2 * 0.1**2 * fitted
