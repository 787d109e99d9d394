"""Two causes of which one can imitate the other: what the numbers are worth that it takes for it."""

from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.verdict.causes import _more_numbers

SAMPLES = 200_000


def found(name, numbers, setting):
    """What a search that accepted one cause of so many numbers is asked for."""
    terms = [SimpleNamespace(effect=name)] * numbers
    normal = SimpleNamespace(count=np.full(3, SAMPLES / 3))
    return SimpleNamespace(fit=SimpleNamespace(model=SimpleNamespace(terms=terms), normal=normal), setting=setting)


def test_a_bend_named_for_unlike_gains_is_tied_with_them_though_it_fits_a_little_better(setting):
    """The default scenario, whose gains differ by 0.5 %: of six numbers instead of two the bend gained 39 of chi-square, and was named alone."""
    seen = found("sensor_nonlinearity", 6, setting)
    assert _more_numbers(seen, "sensor_nonlinearity", "sensor_gain_mismatch") == pytest.approx(-4 * np.log(SAMPLES))
    assert 38.5 + _more_numbers(seen, "sensor_nonlinearity", "sensor_gain_mismatch") < 0.0


def test_what_imitates_pays_for_its_numbers_and_others_do_not(setting):
    seen = found("sensor_gain_mismatch", 2, setting)
    more = len(CATALOGUE["sensor_nonlinearity"].terms(setting)) - 2
    assert _more_numbers(seen, "sensor_gain_mismatch", "sensor_nonlinearity") == pytest.approx(more * np.log(SAMPLES))
    assert _more_numbers(seen, "sensor_gain_mismatch", "sensor_lag") == 0.0
