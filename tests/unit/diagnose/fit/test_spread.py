"""How sure a resistance is beside a leg's loss that rises in its tail, in a linear problem whose truth is known."""

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.diagnosis import _not_fixed
from commissioner.diagnose.fit.gauss_newton import Fit, inverse
from commissioner.diagnose.fit.normal_equations import Normal
from commissioner.diagnose.fit.spread import covariance_of
from commissioner.diagnose.plant.model import Model
from commissioner.motor.circuit import PARAMETERS, Quantity
from tests.unit.diagnose.conftest import NOMINAL

KNOWN, HARDLY = 1e8, 0.02
"""Information on resistance and rises together; on each rise alone, in rises as large as was guessed."""


@pytest.fixture
def fitted(setting):
    """The optimum of exact data whose leg rises by `rise` guessed ones at every knot of its tail; by how much ln R_s is off there."""

    def made(rise):
        terms = [t for t in CATALOGUE["dead_time"].terms(setting) if setting.layout.penalty([t]).any()]
        prior = setting.layout.penalty(terms)
        guess = 1.0 / np.sqrt(np.diag(prior)[4:])
        true = np.array([*np.log(NOMINAL), *(rise * guess)])
        together = np.array([1.0, 0.0, 0.0, 0.0, *(0.01 / guess)])
        data = KNOWN * np.outer(together, together) + np.diag([0.0, 1e4, 1e4, 1e4, *(HARDLY / guess**2)])
        rows = np.array([0.0] * 4 + [1.0] * len(terms)) * true
        off = -inverse(data + prior) @ prior @ rows
        at = true + off
        steps = np.array([t.step for t in terms])
        model = Model(tuple(np.exp(at[:4])), tuple(terms), tuple(at[4:] * steps))
        normal = Normal((data + prior)[None], np.zeros((1, at.size)), np.zeros(1), np.array([1000.0]))
        return Fit(model, normal, True, 1), off[0]

    return made


def test_where_the_loss_rises_more_than_was_guessed_the_error_of_the_resistance_says_so(fitted, setting):
    fit, off = fitted(20.0)
    guessed = np.sqrt(inverse(fit.normal.total_gram)[0, 0])
    told = np.sqrt(covariance_of(fit, setting.layout)[0, 0])
    assert abs(off) > 10.0 * guessed
    assert 0.5 * abs(off) < told < 2.0 * abs(off)


def test_where_the_loss_rises_as_was_guessed_the_error_is_that_of_the_fit(fitted, setting):
    fit, off = fitted(0.5)
    expected = inverse(fit.normal.total_gram)
    assert covariance_of(fit, setting.layout) == pytest.approx(expected, rel=1e-9, abs=1e-300)
    assert abs(off) < 2.0 * np.sqrt(expected[0, 0])


def test_numbers_that_rest_have_no_spread(fitted, setting):
    fit, _ = fitted(20.0)
    movable = np.array([True] * 4 + [False] * len(fit.model.terms))
    assert not covariance_of(fit, setting.layout, movable)[4:].any()


def test_what_identify_would_not_give_is_said_not_to_be_fixed():
    fixed = {n: Quantity(v, 0.2 * v) for n, v in zip(PARAMETERS, NOMINAL, strict=True)}
    assert _not_fixed(fixed) == ()
    (sentence,) = _not_fixed(fixed | {"stator_resistance_ohm": Quantity(2.39, 2.1)})
    assert sentence.startswith("The excitation does not fix R_s (relative standard error 88%), limit 25%")
