"""The scores count what they claim to count."""

import numpy as np
import pytest

from sim.physics import kernel
from sim.physics.packing import pack
from tests.hidden_effects import scoring
from tests.hidden_effects.cases import WEIGHTS, Case, class_of, plan
from tests.hidden_effects.sizes import carried_by_memory


def row(stratum, named, true, verdict="explained", **more):
    causes = [
        {
            "name": n,
            "equivalent": list(e),
            "confidence": p,
            "gain_share": 1.0 / (k + 1),
            "from_audit": False,
            "features": [],
        }
        for k, (n, e, p) in enumerate(named)
    ]
    truth = [{"name": n, "shape": "", "strength": s, "size_error": 0.001} for n, s in true]
    given = {"case": stratum, "stratum": stratum, "verdict": verdict, "causes": causes, "truth": truth, "excluded": []}
    return given | {"margin": None, "capture": None, "unlisted_strength": None, "seconds": 1.0, "samples": 100} | more


def value(rows, metric):
    return next(line.value for line in scoring.table(rows) if line.metric == metric)


def test_a_finding_in_null_data_is_counted_and_a_silent_null_is_not():
    rows = [row("null", [], [], "nothing_significant"), row("null", [("dead_time", (), 0.9)], [])]
    assert value(rows, "null: any finding").startswith("1 of 2")


def test_a_class_mate_is_right_in_class_and_wrong_in_name():
    rows = [row("one", [("sensor_lag", (), 0.9)], [("sampling_delay", 1.0)])]
    assert value(rows, "one cause: class correct").startswith("1 of 1")
    assert value(rows, "one cause: name correct where separable").startswith("0 of 1")


def test_a_cause_below_a_tenth_of_the_noise_may_be_missed_but_not_invented():
    weak = [("dead_time", 1.0), ("iron_loss", 0.01)]
    assert scoring.is_exact(row("two", [("dead_time", (), 0.9)], weak))
    assert not scoring.is_exact(row("two", [("dead_time", (), 0.9), ("remanence", (), 0.9)], weak))
    assert not scoring.is_exact(row("two", [("iron_loss", (), 0.9)], weak))


def test_a_case_that_raised_is_a_failure():
    rows = [row("one", [], [("dead_time", 1.0)], error="Traceback\nValueError: x")]
    assert value(rows, "one cause: class correct").startswith("0 of 1")
    assert "ValueError" in scoring.failures(rows)[0]


def test_an_absent_cause_needs_the_verdict_and_no_confident_name():
    rows = [
        row("absent", [("dead_time", (), 0.9)], [], "unexplained", unlisted_strength=1.0),
        row("absent", [], [], "explained", unlisted_strength=1.0),
    ]
    assert value(rows, "absent cause: flagged unexplained").startswith("1 of 2")
    assert value(rows, "absent cause: confident wrong name").startswith("1 of 2")


def test_ties_count_where_the_truth_and_its_twin_fit_alike():
    tied = row("tie", [("dead_time", ("device_drop",), 0.9)], [("device_drop", 1.0)], margin=0.0)
    untied = row("tie", [("sensor_lag", (), 0.9)], [("sampling_delay", 1.0)], margin=2.0)
    assert value([tied, untied], "ties reported as ties").startswith("1 of 2")


def test_the_calibration_error_is_small_for_honest_and_large_for_boasting_confidence():
    random = np.random.default_rng(1)
    sure = random.uniform(0.5, 1.0, 4000)
    honest = (random.uniform(size=4000) < sure).astype(float)
    assert scoring.sweep_error(sure, honest) < 0.03
    boasting = (random.uniform(size=4000) < 0.6).astype(float)
    assert scoring.sweep_error(np.full(4000, 0.95), boasting) > 0.3


def test_noise_of_one_spread_has_the_normal_laws_quantiles_and_a_wide_few_rule_the_tail():
    assert scoring.quantiles_of_noise([0.01] * 5, (0.5, 0.95)) == pytest.approx([0.006745, 0.0196], rel=1e-3)
    drawn = np.abs(np.random.default_rng(1).normal(size=(20_000, 10)) * ([0.001] * 9 + [0.1])).ravel()
    assert scoring.quantiles_of_noise([0.001] * 9 + [0.1], (0.5, 0.95)) == pytest.approx(
        np.quantile(drawn, [0.5, 0.95]), rel=0.03
    )


def test_wilson_contains_the_rate_and_narrows():
    for total in range(1, 200):
        for count in (0, total // 3, total):
            low, high = scoring.wilson(count, total)
            assert 0.0 <= low <= count / total <= high <= 1.0
    assert scoring.wilson(0, 600)[1] < 0.007
    low, high = scoring.wilson(50, 100)
    assert low < 0.5 < high and high - low < 0.2


def test_the_full_plan_has_the_protocols_strata_and_no_case_twice():
    cases = plan(sum(WEIGHTS.values()))
    assert len({c.name for c in cases}) == len(cases) >= 1200
    assert sum(c.stratum == "null" for c in cases) == 600
    assert {c.name for c in plan(100, release=0)}.isdisjoint(c.name for c in cases)


def test_classes_are_those_no_terminal_separates():
    assert class_of("device_drop") == {"dead_time", "device_drop"}
    assert class_of("remanence") == {"remanence"}


@pytest.mark.parametrize(("seed", "shape"), [(0, "dahl"), (4, "widening")])
def test_the_current_of_a_memory_is_what_the_simulator_carries_where_a_wide_loop_turns(seed, shape):
    """Its own differential equation, down and up between the turning points."""
    plant = Case("one", seed, "magnetic_hysteresis", noise="white").scenario(1.0).plant
    (effect,) = plant.effects
    assert effect.shape == shape
    top, (p, _) = 1.4 * plant.nameplate.rated_flux_wb, pack(plant)
    x, rates = np.zeros(16), np.zeros(16)
    flux = top * np.concatenate([np.linspace(1, -1, 20001), np.linspace(-1, 1, 20001)])
    for here, step in zip(flux[:-1], np.diff(flux), strict=True):
        kernel._extra_states(x, 0.0, 0.0, here, 0.0, step, 0.0, p, rates)
        x[10] += rates[10]
    assert x[10] == pytest.approx(carried_by_memory(effect, plant, top), rel=2e-3)
