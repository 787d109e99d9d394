"""The switching's ripple behind a sensor's filter, against a filter stepped through the pulses themselves."""

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.plant.ripple import Pulses
from tests.unit.diagnose.conftest import central_slope

LINK_V, PERIOD_S, L_SIGMA = 560.0, 2e-4, 0.02
FINE = 4000


def stepped(legs_v, lag, shape, carriers):
    """(3, n) current minus that of the mean voltages, behind 1 / (1 + s S + s^2 q S^2), by small steps through every pulse."""
    h = PERIOD_S / FINE
    s, q, length = lag * PERIOD_S, shape, PERIOD_S / carriers
    y, rate = np.zeros(3), np.zeros(3)
    seen = np.zeros(legs_v.shape)
    for k in range(legs_v.shape[1]):
        seen[:, k] = y
        duty = 0.5 + legs_v[:, k] / LINK_V
        for t in (np.arange(FINE) + 0.5) * h % length:
            pole_vs = LINK_V * (np.clip(t - 0.5 * length * (1.0 - duty), 0.0, duty * length) - duty * t)
            current = (pole_vs - pole_vs.mean()) / L_SIGMA
            if q > 0.0:
                rate = rate + h * (current - y - s * rate) / (q * s * s)
                y = y + h * rate
            else:
                y = y + h * (current - y) / s
    return seen


@pytest.mark.parametrize(("lag", "shape", "carriers"), [(0.06, 0.0, 1), (0.5, 0.0, 1), (0.1, 0.5, 1), (0.2, 0.0, 2)])
def test_it_is_what_a_filter_makes_of_the_pulses(lag, shape, carriers):
    legs_v = np.random.default_rng(1).uniform(-120.0, 120.0, (3, 5))
    legs_v -= legs_v.mean(axis=0)
    seen = Pulses(legs_v, LINK_V, carriers, PERIOD_S).behind(lag, shape) / L_SIGMA
    expected = stepped(legs_v, lag, shape, carriers)
    assert np.abs(seen - expected).max() < 0.01 * np.abs(expected).max()


def test_derivatives_by_lag_and_shape_hold(setting, nominal):
    terms = [t for t in CATALOGUE["sensor_lag"].terms(setting) if t.symbol in ("rippled", "shape")]
    model = Model(nominal.nominal, tuple(terms), tuple(2.5e-5 if t.symbol == "rippled" else 0.1 for t in terms))
    jacobian = predict(model, setting.record, 1, setting.layout, wanted=terms).jacobian
    for row in (2, 4, 5):
        slope = central_slope(model, setting, row, 1e-3)
        assert np.sqrt(np.mean((jacobian[row] - slope) ** 2)) < 0.02 * np.sqrt(np.mean(slope**2))
