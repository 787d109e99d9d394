"""Normal equations are the products of what is whitened, and hold no copy of all of its sensitivities."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.fit.normal_equations import NormalEquations, whiten
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.plant.prediction import predict

WHITE = Noise(np.full(3, 0.01), np.array([1.0, 1000.0]), np.ones((3, 2)), "given", True, 0.0, True)


def of_dead_time(setting, nominal, block=1):
    terms = CATALOGUE["dead_time"].terms(setting)
    return terms, NormalEquations(nominal.with_terms(terms), setting.record, setting.layout, terms, WHITE).normal(block)


@pytest.mark.parametrize("share_lost", [0.0, 0.01])
def test_they_are_the_products_of_what_is_whitened(setting, nominal, share_lost):
    drawn = np.random.default_rng(2)
    segments = tuple(
        replace(
            s,
            currents_a=s.currents_a + 0.01 * drawn.standard_normal(s.currents_a.shape),
            is_good=drawn.random(s.count) >= share_lost,
        )
        for s in setting.record.segments
    )
    record = replace(setting.record, segments=segments)
    terms = CATALOGUE["dead_time"].terms(setting)
    model, noise = nominal.with_terms(terms), replace(WHITE, sigma_a=np.array([0.01, 0.02, 0.03]))
    normal = NormalEquations(model, record, setting.layout, terms, noise).normal()
    for k, segment in enumerate(segments):
        seen = predict(model, record, k, setting.layout, terms)
        rows, left = (
            whiten(x, segment.is_good, noise, record.facts.sample_period_s)
            for x in (seen.jacobian, segment.currents_a - seen.currents_a)
        )
        scale = np.maximum(np.linalg.norm(rows, axis=1), 1e-9)
        assert np.abs((normal.gram[k] - rows @ rows.T) / np.outer(scale, scale)).max() < 1e-12
        assert normal.slope[k] / scale == pytest.approx(rows @ left / scale, abs=1e-9 * np.linalg.norm(left))
        assert normal.chi2[k] == pytest.approx(left @ left, rel=1e-12)


@pytest.mark.parametrize("block", [3, 4])
def test_neighbours_averaged_hold_what_moves_slowly(setting, nominal, block):
    """The four parameters' slow directions lose a hundredth of their information in blocks of a few samples."""
    whole, averaged = (of_dead_time(setting, nominal, n)[1].total_gram for n in (1, block))
    assert np.diag(averaged)[[0, 1, 3]] == pytest.approx(np.diag(whole)[[0, 1, 3]], rel=0.05)


def test_no_second_copy_of_the_sensitivities_is_held(setting, nominal):
    record = setting.record.subset((0,))
    terms = CATALOGUE["dead_time"].terms(setting)
    model = nominal.with_terms(terms)
    NormalEquations(model, record, setting.layout, terms, WHITE).normal()
    tracemalloc.start()
    NormalEquations(model, record, setting.layout, terms, WHITE).normal()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    numbers, signals = 4 + len(terms), 60
    assert peak < record.samples * 8 * (5 * numbers + signals)
