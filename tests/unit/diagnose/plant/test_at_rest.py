"""What a machine with current displacement is to slow currents, and how R_R and the branches beside it share a conductance."""

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.plant.model import Model
from tests.unit.diagnose.conftest import NOMINAL


@pytest.fixture(scope="module")
def with_branches(setting):
    terms = CATALOGUE["rotor_skin_effect"].terms(setting)
    return Model(NOMINAL, terms, tuple(0.3 / (1.0 + k) for k in range(len(terms))))


def _rotor(model, setting, hz):
    """Impedance of R_R and its branches, ohm, and the leakage in series."""
    s = 2j * np.pi * hz
    times = [setting.layout.branch_time_s[t.index] for t in model.terms]
    admittance = 1.0 / model.nominal[1] + sum(g / (1.0 + s * t) for g, t in zip(model.values, times, strict=True))
    return 1.0 / admittance + s * model.nominal[2]


def test_slow_currents_see_the_resistance_and_leakage_at_rest(with_branches, setting):
    hz = 1e-3
    seen = _rotor(with_branches, setting, hz)
    (_, r_r, l_sigma, _), _ = with_branches.at_rest(setting.layout)
    assert seen.real == pytest.approx(r_r, rel=1e-6)
    assert seen.imag / (2.0 * np.pi * hz) == pytest.approx(l_sigma, rel=1e-6)


def test_derivatives_at_rest_are_exact(with_branches, setting):
    _, derivatives = with_branches.at_rest(setting.layout)
    for row in range(with_branches.theta.size):
        ends = []
        for sign in (1.0, -1.0):
            theta = with_branches.theta.copy()
            theta[row] += sign * 1e-5
            ends.append(with_branches.moved(theta).at_rest(setting.layout)[0])
        assert derivatives[:, row] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-9)


def test_a_step_that_gives_the_branches_what_it_takes_from_r_r_keeps_the_resistance_at_rest(setting):
    terms = CATALOGUE["rotor_skin_effect"].terms(setting)
    start = Model(NOMINAL, terms, tuple(0.0 for _ in terms))
    theta = start.theta.copy()
    theta[1] += 0.8
    theta[4 + 3] += 0.8 / NOMINAL[1] / terms[3].step
    moved = start.moved(theta)
    assert moved.at_rest(setting.layout)[0][1] == pytest.approx(NOMINAL[1], rel=1e-9)
    assert moved.nominal[1] == pytest.approx(NOMINAL[1] / 0.2, rel=1e-9)
    assert moved.without("rotor_skin_effect").nominal[1] == pytest.approx(NOMINAL[1], rel=1e-9)


def test_without_branches_nothing_differs(setting):
    values, derivatives = Model(NOMINAL).at_rest(setting.layout)
    assert tuple(values) == NOMINAL and np.array_equal(derivatives, np.diag(NOMINAL))
