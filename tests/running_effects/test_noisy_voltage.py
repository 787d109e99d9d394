"""Noise of the voltage, which drives the machine, does not draw the numbers aside."""

from dataclasses import replace

import numpy as np

from commissioner.estimation.fit import fitted_part, residuals
from commissioner.running.diagnosis import diagnose
from commissioner.running.identification import identify
from tests.running_effects.start import FOUR, PLATE, started

RUNNING = 5000
"""Sample from which the motor runs and only its load changes."""


def test_the_four_of_a_motor_without_a_start_hold_the_truth():
    """L_sigma was 0.5 to 0.8 % too large, four standard deviations, from 0.2 % of noise."""
    whole = started(PLATE, voltage_noise_v=1.0)
    part = slice(RUNNING, None)
    seen = identify(
        [
            replace(
                whole,
                time_s=whole.time_s[part],
                currents_a=tuple(x[part] for x in whole.currents_a),
                voltages_v=tuple(x[part] for x in whole.voltages_v),
                speed_rad_per_s=whole.speed_rad_per_s[part],
            )
        ],
        PLATE,
    )
    off = np.log([seen.fit.machine.value(name) / value for name, value in FOUR.items()])
    assert np.all(np.abs(off) < 3.0 * np.sqrt(np.diag(seen.covariance))), off


def test_a_laws_shape_is_not_moved():
    """Knee and bend of a leakage lie in a curved valley: moved straight along it, the machine no longer made the currents."""
    seen = diagnose([started(PLATE, leakage_softness=0.02, leakage_bend=2.0)], PLATE)
    fit, problem = seen.found.fit, seen.found.problem
    rest = fitted_part(problem, residuals(problem, fit.machine))
    assert [c.name for c in seen.causes] == ["leakage_saturation"]
    assert abs(float(rest @ rest) - fit.chi2) < 30.0
