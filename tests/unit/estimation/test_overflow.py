"""A load that runs to many times the rated torque turns the shaft away: sensitivities beyond any number, a covariance all the same."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.estimation.fit import AT, Fit, columns_of, fitted_part, jacobian, plain_machine, problem_of, residuals
from commissioner.estimation.record import prepare
from commissioner.estimation.told import Slopes
from tests.running_effects.start import PLATE, started


@pytest.mark.parametrize("times_rated", [45.0, -45.0, 1e6])
def test_a_load_that_flies_away_leaves_every_variance_positive(times_rated):
    """They were negative, or the decomposition failed with a traceback."""
    record = prepare([replace(started(PLATE), speed_rad_per_s=None)], PLATE)
    problem, machine = problem_of(record), plain_machine((1.3, 1.0, 0.012, 0.17), record, has_shaft=True)
    away = replace(machine, knots=tuple(np.full_like(k, times_rated * record.scales.torque_nm) for k in machine.knots))
    columns = columns_of(list(AT)[:4], record, away, knots=True)
    rest = fitted_part(problem, residuals(problem, away))
    slopes = jacobian(problem, away, columns)
    found = Fit(away, columns, float(rest @ rest), rest, Slopes.known(slopes), 0.0, 0).covariance()
    assert np.isfinite(found).all()
    assert np.diag(found)[:4].min() > 1e-12
