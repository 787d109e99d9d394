"""Normal equations gathered in slices are those of the whole segment, and hold no copy of its sensitivities."""

import tracemalloc

import numpy as np
import pytest

from commissioner.diagnose import trial as module
from commissioner.diagnose.effects import CATALOGUE
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.trial import Trial

WHITE = Noise(np.full(3, 0.01), np.array([1.0, 1000.0]), np.ones((3, 2)), "given", True, 0.0, True)


def of_dead_time(setting, nominal, block=1):
    terms = CATALOGUE["dead_time"].terms(setting)
    return terms, Trial(nominal.with_terms(terms), setting.record, setting.layout, terms, WHITE).normal(block)


@pytest.mark.parametrize("block", [1, 3, 4])
def test_slices_add_up_to_the_whole(setting, nominal, monkeypatch, block):
    whole = of_dead_time(setting, nominal, block)[1]
    monkeypatch.setattr(module, "SLICE", 12 * 20)
    sliced = of_dead_time(setting, nominal, block)[1]
    scale = np.maximum(np.sqrt(np.diag(whole.total_gram)), 1e-9)
    assert np.abs((sliced.total_gram - whole.total_gram) / np.outer(scale, scale)).max() < 1e-12
    assert sliced.total_chi2 == pytest.approx(whole.total_chi2, rel=1e-12, abs=1e-9)


def test_no_second_copy_of_the_sensitivities_is_held(setting, nominal, monkeypatch):
    monkeypatch.setattr(module, "SLICE", 12 * 20)
    record = setting.record.subset((0,))
    terms = CATALOGUE["dead_time"].terms(setting)
    model = nominal.with_terms(terms)
    Trial(model, record, setting.layout, terms, WHITE).normal()
    tracemalloc.start()
    Trial(model, record, setting.layout, terms, WHITE).normal()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    numbers, signals = 4 + len(terms), 60
    assert peak < record.samples * 8 * (5 * numbers + signals)
