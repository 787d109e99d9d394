"""Currents read late and behind a filter, against a machine with iron loss that is stepped exactly on a finer grid."""

import numpy as np
import pytest
from scipy.linalg import expm

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.plant.resample import step_shown
from tests.unit.diagnose.conftest import NOMINAL, PERIOD_S, central_slope

FINE = 100
CONDUCTANCE_S = 3e-3


def machine(lags_s):
    """State derivative and current of (psi_s, psi_R, behind the first lag, behind the second, held voltage)."""
    r_s, r_r, l_sigma, l_m = NOMINAL
    current = np.array([1.0 / l_sigma, -1.0 / l_sigma, 0.0, 0.0, CONDUCTANCE_S]) / (1.0 + CONDUCTANCE_S * r_s)
    rate = np.zeros((5, 5))
    rate[0] = -r_s * current
    rate[0, 4] += 1.0
    rate[1, :2] = r_r / l_sigma, -r_r / l_sigma - r_r / l_m
    previous = current
    for row, lag in zip((2, 3), lags_s, strict=True):
        rate[row] = previous / lag
        rate[row, row] -= 1.0 / lag
        previous = np.eye(5)[row]
    return rate, current


def truly_read(voltage, lags_s, late):
    """Current of one axis at `k - late` periods, `late` a whole number of fine steps."""
    rate, current = machine(lags_s or (1.0, 1.0))
    step, shown = expm(rate * PERIOD_S / FINE), current if not lags_s else np.eye(5)[3]
    state, out = np.zeros(5), []
    for held in voltage:
        state[4] = held
        for _ in range(FINE):
            state = step @ state
            out.append(shown @ state)
    at = np.arange(voltage.size) * FINE - round(late * FINE) - 1
    return np.where(at < 0, 0.0, np.array(out)[np.clip(at, 0, None)])


@pytest.mark.parametrize(
    ("lags_s", "late"), [((), 0.37), ((), 1.0), ((9e-5, 1e-9), 0.0), ((9e-5, 1e-9), 0.37), ((6e-5, 6e-5), 0.2)]
)
def test_what_iron_draws_steps_with_the_voltage_however_late_it_is_read(nominal, setting, lags_s, late):
    segment = setting.record.segments[0]
    values = {
        "conductance": CONDUCTANCE_S, "lag": sum(lags_s), "delay": late * PERIOD_S,
        "shape": lags_s[0] * lags_s[1] / sum(lags_s) ** 2 if lags_s else 0.0,
    }  # fmt: skip
    terms = [t for name in ("iron_loss", "sensor_lag", "sampling_delay") for t in CATALOGUE[name].terms(setting)]
    model = Model(nominal.nominal, tuple(terms), tuple(values.get(t.symbol, 0.0) for t in terms))
    seen = predict(model, setting.record, 0, setting.layout).currents_a[0]
    wanted = truly_read(segment.voltage_ab_v[0], lags_s, late)
    drawn = CONDUCTANCE_S * np.abs(np.diff(segment.voltage_ab_v[0])).max()
    assert np.abs(seen - wanted)[5:].max() < 1e-3 * drawn


def test_the_sensitivity_to_iron_loss_holds_behind_a_late_lag(nominal, setting):
    terms = [t for name in ("iron_loss", "sensor_lag", "sampling_delay") for t in CATALOGUE[name].terms(setting)]
    values = {"lag": 9e-5, "delay": 5e-5, "shape": 0.2, "conductance": 1e-3}
    model = Model(nominal.nominal, tuple(terms), tuple(values.get(t.symbol, 0.0) for t in terms))
    jacobian = predict(model, setting.record, 0, setting.layout, wanted=terms).jacobian
    for symbol in ("conductance", "lag", "shape", "delay"):
        row = 4 + next(k for k, t in enumerate(terms) if t.symbol == symbol)
        slope = central_slope(model, setting, row, 1e-2, segment=0)
        assert np.abs(jacobian[row] - slope).max() < 0.03 * np.abs(slope).max(), symbol


def test_a_clock_that_comes_back_to_the_edge_stays_on_its_side_and_one_that_crosses_does_not():
    turn = np.linspace(0.0, 2.0 * np.pi, 5001)
    after = np.arange(5001)
    comes_back = -0.1 * (1.0 - np.cos(turn))
    assert np.count_nonzero(step_shown(comes_back) != after) <= 1
    for graze in (3e-4, -3e-4):
        assert np.count_nonzero(step_shown(comes_back + graze * turn / turn[-1]) != after) <= 1
    crosses = 0.1 * np.sin(turn) + 1.0
    np.testing.assert_array_equal(after - step_shown(crosses), np.where(np.sin(turn) < 0.0, 1, 2))
    for constant in (0.0, 1e-4, -1e-4, 0.4, -0.4):
        assert set(after - step_shown(np.full(5001, constant))) == {0 if constant < 0.0 else 1}
    alternating = np.where(after % 2, 0.01, -0.01)
    np.testing.assert_array_equal(after - step_shown(alternating), after % 2)
