"""A diagnosis that is told to stop does so in the midst of a fit, says so, and names nothing."""

import numpy as np
import pytest

from commissioner.compiled import threads
from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.diagnosis import diagnose
from commissioner.diagnose.document import as_document
from commissioner.diagnose.fit.gauss_newton import fit
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.search.journal import Accepted, Screened
from commissioner.estimation.cancelling import TimeOver, given_up_by
from tests.unit.diagnose.conftest import NOMINAL, WHITE, recording


class Patience:
    """Says yes so many times, and counts how often it is asked."""

    def __init__(self, times):
        self.times, self.asked = times, 0

    def __call__(self):
        self.asked += 1
        return self.asked <= self.times


def test_a_fit_is_given_up_between_two_segments(setting):
    start = Model(tuple(1.3 * x for x in NOMINAL))
    whole = Patience(np.inf)
    with given_up_by(whole):
        assert fit(start, setting.record, setting.layout, WHITE).has_converged
    assert whole.asked >= 2 * len(setting.record.segments)
    for times in (0, 1, whole.asked - 1):
        patience = Patience(times)
        with given_up_by(patience), pytest.raises(TimeOver):
            fit(start, setting.record, setting.layout, WHITE)
        assert patience.asked - times <= len(setting.record.segments) + threads()._max_workers


def test_outside_nothing_is_given_up(setting):
    with given_up_by(lambda: False):
        pass
    assert fit(Model(NOMINAL), setting.record, setting.layout, WHITE).has_converged


@pytest.fixture(scope="module")
def with_legs(setting, nominal):
    """Currents of a machine whose inverter loses voltage, with noise."""
    legs = [t for t in CATALOGUE["dead_time"].terms(setting) if t.symbol.startswith("leg_")]
    model = Model(nominal.nominal, tuple(legs), tuple(3.0 * t.step for t in legs))
    parts = [predict(model, setting.record, k, setting.layout).currents_a for k in range(len(setting.record.segments))]
    currents = np.concatenate(parts, axis=1)
    return recording(currents=currents + 0.01 * np.random.default_rng(1).standard_normal(currents.shape))


@pytest.mark.parametrize("when", [Screened, Accepted])
def test_a_search_given_up_says_so_and_names_nothing(with_legs, when):
    steps = []
    excluded = [n for n in CATALOGUE if n not in ("dead_time", "sensor_offset", "sensor_gain_mismatch")]
    seen = diagnose(
        [with_legs],
        excluded=excluded,
        report=steps.append,
        go_on=lambda: not any(isinstance(step, when) for step in steps),
    )
    document = as_document(seen)
    assert isinstance(steps[-1], when) and list(seen.steps) == steps
    assert seen.verdict == "unexplained" and not document["is_complete"] and document["causes"] == []
    assert document["reason"].startswith("Not finished") and document["parameters_after"] == {}
    on_the_way = any("dead_time" in remark for remark in document["remarks"])
    assert on_the_way == (when is Accepted)
