"""Where one iron lies between rotor and stator, as several causes say: how far a fit may move it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.fit.gauss_newton import fit, limits
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.prediction import predict

WHITE = Noise(np.full(3, 0.01), np.array([1.0, 1000.0]), np.ones((3, 2)), "given", True, 0.0, True)
IRON = ("magnetizing_saturation", "magnetic_hysteresis")


def bent(setting, nominal, names, *, splits=(), height=2.0):
    """The conftest machine with these causes of the iron, every curve and loop `height` steps high, at these places."""
    terms = [t for name in names for t in CATALOGUE[name].terms(setting)]
    places = iter(splits)
    values = [next(places, 0.0) if t.kind == kinds.NU else height * t.step for t in terms]
    return replace(nominal, terms=tuple(terms), values=tuple(values))


def reach(model, layout):
    """(n, 2) of every number that says where the iron lies: how far it may go to the rotor's side and to the stator's."""
    rows = [k for k, t in enumerate(model.terms, 4) if t.kind == kinds.NU]
    ends = np.array(limits(model, layout)) - model.theta
    return 0.1 * ends[:, rows].T


@pytest.mark.parametrize("splits", [(0.0, 0.0), (0.3, 0.1), (0.2, 0.3), (-0.7, 0.1)])
def test_causes_that_place_one_iron_share_what_is_left_to_either_side(setting, nominal, splits):
    low, high = reach(bent(setting, nominal, IRON, splits=splits), setting.layout).sum(axis=0)
    assert sum(splits) + np.array([low, high]) == pytest.approx([-0.5, 0.5])


def test_one_cause_has_all_of_it(setting, nominal):
    assert reach(bent(setting, nominal, IRON[:1], splits=[0.3]), setting.layout) == pytest.approx(
        np.array([[-0.8, 0.2]])
    )


def test_a_fit_ends_on_the_stators_side_and_not_beyond(setting, nominal):
    """Each of two might go to the end alone: beyond it nothing moved any more, and no step kept what it promised."""
    layout, record = setting.layout, setting.record
    truth = bent(setting, nominal, IRON, splits=[0.5, 0.0])
    noise = np.random.default_rng(5)
    currents = [predict(truth, record, k, layout).currents_a for k in range(len(record.segments))]
    segments = tuple(
        replace(s, currents_a=i + 0.01 * noise.standard_normal(i.shape))
        for s, i in zip(record.segments, currents, strict=True)
    )
    seen = Record(segments, record.facts, record.channel_names, record.channels)
    found = fit(bent(setting, nominal, IRON, splits=[0.2, 0.28], height=1.0), seen, layout, WHITE)
    assert found.has_converged and found.rounds <= 6
    assert found.model.total(kinds.NU) == pytest.approx(0.5, abs=0.02) and found.model.total(kinds.NU) <= 0.5 + 1e-9
    assert found.chi2 < found.normal.count.sum() * 1.02
