"""Curves of sensors: their slopes, and that a form of more numbers holds the one of fewer."""

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.plant import sensor_curve
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import predict
from tests.unit.diagnose.conftest import central_slope

SENSOR = CATALOGUE["sensor_nonlinearity"]


@pytest.mark.parametrize("of", [sensor_curve.even, sensor_curve.odd])
def test_slopes_are_those_of_the_error(of):
    share = np.linspace(-0.9, 0.9, 37)
    h = 1e-6
    slopes = ((share + h) * of(share + h)[0] - (share - h) * of(share - h)[0]) / (2.0 * h)
    assert of(share)[1] == pytest.approx(slopes, abs=1e-6)


def test_even_errors_are_even_and_odd_ones_odd():
    share = np.linspace(0.01, 0.9, 11)
    assert -share * sensor_curve.even(-share)[0] == pytest.approx(share * sensor_curve.even(share)[0])
    assert -share * sensor_curve.odd(-share)[0] == pytest.approx(-share * sensor_curve.odd(share)[0])


def test_the_form_with_bends_holds_the_one_without(setting):
    plain, rich = SENSOR.forms(SENSOR.terms(setting))
    assert set(plain) < set(rich) and len(plain) == 6 and len(rich) == 6 * sensor_curve.COUNT
    assert SENSOR.form_of({t.symbol for t in plain}, SENSOR.terms(setting)) == plain
    assert SENSOR.form_of({t.symbol for t in rich}, SENSOR.terms(setting)) == rich


def test_sensitivities_of_bends_hold_on_a_bent_curve(nominal, setting):
    terms = SENSOR.terms(setting)
    model = Model(nominal.nominal, terms, tuple(0.01 * (k % 3 - 1) for k in range(len(terms))))
    jacobian = predict(model, setting.record, 1, setting.layout, wanted=terms).jacobian
    for row in (0, 2, *range(4, 4 + len(terms), 5)):
        slope = central_slope(model, setting, row, 1e-3)
        assert np.sqrt(np.mean((jacobian[row] - slope) ** 2)) < 0.01 * np.sqrt(np.mean(slope**2))


def test_the_size_is_that_of_the_cubic_that_errs_as_much_at_the_largest_current(setting):
    peak = setting.layout.channel_ends_a / setting.layout.nonlinearity_scale_a
    knee = sensor_curve.KNEES[-1]
    bent = {f"odd_{p}_bend_{sensor_curve.COUNT - 1}": 0.01 for p in "uvw"}
    values = {t.symbol: bent.get(t.symbol, 0.0) for t in SENSOR.terms(setting)}
    expected = np.mean(0.01 / (peak**2 + knee**2))
    assert SENSOR.sizes(setting, values)["odd_at_full_scale"][0] == pytest.approx(expected)
    assert SENSOR.sizes(setting, values)["even_at_full_scale"][0] == 0.0
