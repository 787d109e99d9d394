"""Noise of the voltage, which drives the machine, does not draw the numbers aside."""

from dataclasses import replace

import numpy as np

from commissioner.estimation.fit import columns_of, fitted_part, plain_machine, problem_of, refine, residuals
from commissioner.estimation.noisy_input import chi2_by_own_noise, with_noise_of
from commissioner.estimation.record import prepare
from commissioner.running import search
from commissioner.running.causes import CATALOGUE
from commissioner.running.diagnosis import diagnose
from commissioner.running.identification import identify
from tests.running_effects.start import FOUR, PLATE, started

RUNNING, ONE_LOAD = 5000, 7400
"""Samples from which the motor runs and only its load changes, and from which nothing does."""


def part_of(whole, first):
    part = slice(first, None)
    return replace(
        whole,
        time_s=whole.time_s[part],
        currents_a=tuple(x[part] for x in whole.currents_a),
        voltages_v=tuple(x[part] for x in whole.voltages_v),
        speed_rad_per_s=whole.speed_rad_per_s[part],
    )


def test_the_four_of_a_motor_without_a_start_hold_the_truth():
    """L_sigma was 0.5 to 0.8 % too large, four standard deviations, from 0.2 % of noise."""
    seen = identify([part_of(started(PLATE, voltage_noise_v=1.0), RUNNING)], PLATE)
    off = np.log([seen.fit.machine.value(name) / value for name, value in FOUR.items()])
    assert np.all(np.abs(off) < 3.0 * np.sqrt(np.diag(seen.covariance))), off


def test_a_laws_shape_is_not_moved():
    """Knee and bend of a leakage lie in a curved valley: moved straight along it, the machine no longer made the currents."""
    seen = diagnose([started(PLATE, leakage_softness=0.02, leakage_bend=2.0)], PLATE)
    fit, problem = seen.found.fit, seen.found.problem
    rest = fitted_part(problem, residuals(problem, fit.machine))
    assert [c.name for c in seen.causes] == ["leakage_saturation"]
    assert abs(float(rest @ rest) - fit.chi2) < 30.0


def test_a_machine_that_passes_less_of_the_voltages_noise_gains_nothing_by_it():
    """Fitted under the weights of the true machine, R_s comes out 1.3 times the true, and a healthy motor had an asymmetry of 3.0 +- 0.9 %."""
    record = prepare([part_of(started(PLATE, voltage_noise_v=3.0), ONE_LOAD)], PLATE)
    problem = problem_of(record, 0.0)
    truth = plain_machine(list(FOUR.values()), record)
    problem = with_noise_of(problem, truth)
    base = refine(problem, truth, columns_of(("magnetizing_inductance",), record, truth))
    line = search.Named("line_resistance", CATALOGUE["line_resistance"].forms[0])
    other = refine(problem, truth, columns_of((*FOUR, *line.numbers), record, truth))
    gain = base.chi2 - other.chi2
    assert gain / base.count > search.RULES.material_steady_sigma**2 and gain > 400.0, gain
    assert chi2_by_own_noise(problem, other.machine) > chi2_by_own_noise(problem, base.machine) + 400.0
    seeking = search.Search(problem, base, frozenset(), lambda _: None)
    assert search._refusal(seeking, base, base, other, (line,), gain) == search.OF_NOISE


def test_a_cause_that_is_there_gains_under_the_noise_of_each_machine():
    whole = started(PLATE, voltage_noise_v=1.0)
    u, v, w = whole.currents_a
    seen = diagnose([part_of(replace(whole, currents_a=(1.02 * u, v, w)), ONE_LOAD)], PLATE)
    assert [c.name for c in seen.causes] == ["sensor_gain_mismatch"]
