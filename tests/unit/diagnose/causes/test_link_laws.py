"""What a DC link loses: a lag, a capacitor behind diodes, and the form that a sag's numbers take."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.causes.regressors import DRAWN, HELD, ROOT, SWINGING, behind_lag, behind_rectifier

SAG = CATALOGUE["dc_link_sag"]
PERIOD_S = 2e-4


@pytest.mark.parametrize("lag_s", [3e-4, 3e-3])
def test_behind_diodes_is_the_solution_of_its_equation(lag_s):
    power = np.random.default_rng(3).normal(0.05, 1.0, 60)

    def rates(t, x):
        at = power[min(int(t / PERIOD_S), power.size - 1)]
        return [(at - max(x[0], 0.0)) / lag_s, x[0]]

    ends = PERIOD_S * np.arange(power.size + 1)
    area = [0.0]
    x = [0.0, 0.0]
    for begin, end in itertools.pairwise(ends):
        x = solve_ivp(rates, (begin, end - 1e-15), x, rtol=1e-9, atol=1e-12, max_step=2e-6).y[:, -1]
        area.append(x[1])
    (held,) = behind_rectifier([power], PERIOD_S, lag_s)
    assert held == pytest.approx(np.diff(area) / PERIOD_S, abs=1e-5)
    assert held.min() < -0.01, "the capacitor is never charged above the mains here"


def test_a_link_that_gives_only_is_a_lag():
    power = np.abs(np.random.default_rng(4).normal(size=500))
    for law in (behind_lag, behind_rectifier):
        assert law([power], PERIOD_S, 2e-3)[0] == pytest.approx(behind_lag([power], PERIOD_S, 2e-3)[0], abs=1e-12)


def test_power_that_is_neither_drawn_nor_given_back_moves_no_link():
    assert not behind_rectifier([np.zeros(5)], PERIOD_S, 1e-3)[0].any()


def test_a_sag_has_one_law_at_a_time(setting):
    forms = [{t.symbol for t in form} for form in SAG.forms(SAG.terms(setting))]
    assert forms == [set(SWINGING), set(DRAWN), set(HELD), {*DRAWN, *ROOT}]


@pytest.mark.parametrize("symbol", [SWINGING[2], DRAWN[2], HELD[2]])
def test_a_sag_of_one_lag_has_its_size_whatever_its_law(setting, symbol):
    values = {t.symbol: 0.05 * (t.symbol == symbol) for t in SAG.form_of({symbol}, SAG.terms(setting))}
    assert SAG.sizes(setting, values)["sag_at_rated_power"][0] == pytest.approx(0.05, rel=1e-3)
