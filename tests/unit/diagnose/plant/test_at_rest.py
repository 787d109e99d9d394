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
    """Impedance of R_R and its branches, ohm."""
    s = 2j * np.pi * hz
    times = [setting.layout.branch_time_s[t.index] for t in model.terms]
    return 1.0 / (1.0 / model.nominal[1] + sum(g / (1.0 + s * t) for g, t in zip(model.values, times, strict=True)))


def _terminals(rotor, leakage, magnetizing, hz):
    s = 2j * np.pi * hz
    return s * leakage + 1.0 / (1.0 / (s * magnetizing) + 1.0 / rotor)


def test_slow_currents_see_the_circuit_at_rest(with_branches, setting):
    """Between the terminals, L_M beside the rotor: the bars' own inductance at rest lies behind it, not before."""
    hz = 0.02
    (_, r_r, l_sigma, l_m), _ = with_branches.at_rest(setting.layout)
    seen = _terminals(_rotor(with_branches, setting, hz), *with_branches.nominal[2:], hz)
    said = _terminals(r_r, l_sigma, l_m, hz)
    assert seen.real == pytest.approx(said.real, rel=1e-5)
    assert seen.imag == pytest.approx(said.imag, rel=1e-6)


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
    assert _rotor(moved, setting, 0.0).real == pytest.approx(NOMINAL[1], rel=1e-9)
    assert moved.nominal[1] == pytest.approx(NOMINAL[1] / 0.2, rel=1e-9)
    assert moved.without("rotor_skin_effect").nominal[1] == pytest.approx(NOMINAL[1], rel=1e-9)


def test_without_branches_nothing_differs(setting):
    values, derivatives = Model(NOMINAL).at_rest(setting.layout)
    assert tuple(values) == NOMINAL and np.array_equal(derivatives, np.diag(NOMINAL))
