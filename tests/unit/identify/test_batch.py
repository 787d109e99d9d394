"""Joint least squares: nuisance values, delay, inverter, iron, honest errors."""

from __future__ import annotations

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.identify.batch.extensions import select_model
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.foresight import Foresight
from commissioner.identify.batch.model import DELAY, IRON, OWN, SHARED, SPLIT, ModelChoice, start_theta
from commissioner.identify.batch.output_error import WIDTH
from commissioner.identify.batch.problem import Problem
from commissioner.identify.batch.segments import Segment
from commissioner.identify.batch.whiteness import whiteness
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.staircase import knee_shape
from commissioner.motor.circuit import Gamma, InverseGamma
from commissioner.motor.space_vector import phase_cosines
from tests.support.exact.cramer_rao import cramer_rao
from tests.support.standstill import linear_response, multitone, saturating_block

PERIOD_S = 2e-4
TRUTH = (3.7, 2.09, 0.021, 0.224)
TONES = [(14.0, 0.7, 0.0), (4.0, 2.3, 1.0), (12.0, 19.8, 2.0), (9.0, 60.1, 3.0)]
START = InverseGamma(5.0, 1.5, 0.03, 0.3)


def relative(fit, truth=TRUTH, flux_wb=0.0):
    return np.array(fit.inverse_gamma_at(flux_wb)[0].as_tuple()) / np.array(truth) - 1.0


def test_noise_free_segments_give_the_truth():
    voltage = multitone(TONES, 4.0, PERIOD_S)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0]
    fit = fit_segments([Segment(voltage, current, 0.0, True)], PERIOD_S, START)
    assert fit.has_converged
    assert np.max(np.abs(relative(fit))) < 1e-9


def test_segments_share_the_machine_and_keep_their_own_offset_and_state():
    voltage = multitone(TONES, 6.0, PERIOD_S)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0]
    cut = 11111
    parts = [
        Segment(voltage[:cut], current[:cut] + 0.1, 0.0, True),
        Segment(voltage[cut:], current[cut:] - 0.2, 60.0, False),
    ]
    fit = fit_segments(parts, PERIOD_S, START)
    assert np.max(np.abs(relative(fit))) < 1e-8
    assert fit.offsets_a == pytest.approx((0.1, -0.2), abs=1e-9)


def test_a_fit_goes_on_where_an_earlier_one_ended():
    voltage = multitone(TONES, 6.0, PERIOD_S)
    noise = 0.01 * np.random.default_rng(3).standard_normal(voltage.size)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0] + noise
    parts = [Segment(voltage[1500:], current[1500:] + 0.1, 0.0, False)]
    first = fit_segments(parts, PERIOD_S, START)
    again = fit_segments(parts, PERIOD_S, START, theta_start=first.theta, own_start=first.own, max_iterations=1)
    assert again.sum_of_squares == pytest.approx(first.sum_of_squares, rel=1e-9)
    assert np.any(np.abs(first.own[0, 1:]) > 1e-3)


def test_a_start_whose_machine_runs_away_is_refused():
    """Iron that gives back more current the more flux it holds."""
    voltage = multitone(TONES, 2.0, PERIOD_S)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0]
    model = ModelChoice(extra_powers=4, flux_scale_wb=0.1)
    theta = start_theta(START, model)
    theta[SHARED : SHARED + 4] = -50.0
    with pytest.raises(DataRefused, match="cannot be simulated from this start"):
        fit_segments([Segment(voltage, current, 0.0, True)], PERIOD_S, START, model, theta)


def test_masked_samples_do_not_count():
    voltage = multitone(TONES, 4.0, PERIOD_S)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0]
    weight = np.ones_like(current)
    weight[5000:5100] = 0.0
    current[5000:5100] = 99.0
    fit = fit_segments([Segment(voltage, current, 0.0, True, weight=weight)], PERIOD_S, START)
    assert np.max(np.abs(relative(fit))) < 1e-9


def test_a_fractional_delay_is_a_fifth_parameter():
    voltage = multitone(TONES, 6.0, PERIOD_S)
    late = np.concatenate([np.zeros(7), np.repeat(voltage, 10)[:-7]])  # 140 us
    current = linear_response(TRUTH, late, PERIOD_S / 10)[0][::10].copy()
    fit = fit_segments([Segment(voltage, current, 0.0, True)], PERIOD_S, START, ModelChoice(with_delay=True))
    assert fit.delay.value == pytest.approx(140e-6, abs=1e-6)
    assert np.max(np.abs(relative(fit))) < 5e-4


@pytest.mark.parametrize(
    "model",
    [ModelChoice(4, 1.0, LegLaw(1.5), True, True), ModelChoice(4, 1.0, with_split=True), ModelChoice()],
    ids=["all", "iron between the leakages", "linear"],
)
def test_sensitivities_are_the_derivatives_of_the_simulation(model):
    """Information and score against finite differences of the sum of squares, saturation, knee and delay included."""
    voltage = multitone([(20.0, 0.7, 0.0), (12.0, 19.8, 2.0), (9.0, 60.1, 3.0)], 1.0, PERIOD_S)
    rng = np.random.default_rng(3)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0] + 0.3 * rng.standard_normal(voltage.size)
    weight = np.ones_like(current)
    weight[700:800] = 0.0
    problem = Problem([Segment(voltage, current, 30.0, False, weight=weight)], PERIOD_S, model)
    theta = start_theta(START, model, knee_shape(2.0, 0.3, 2.0))
    theta[DELAY], theta[SPLIT] = 8e-5 * model.with_delay, 0.4 * model.with_split
    theta[SHARED : SHARED + model.extra_powers] = (0.1, 0.4, 0.2, 0.1)[: model.extra_powers]
    own = np.array([[0.05, 0.1, 0.08]])
    at = problem.evaluate(theta, own)
    full = np.concatenate([theta, own[0]])
    for j in np.flatnonzero(problem.free):
        step = 1e-6 * max(abs(full[j]), 1e-3) if j != DELAY else 1e-10
        pair = []
        for sign in (1, -1):
            moved = full.copy()
            moved[j] += sign * step
            pair.append(problem.evaluate(moved[: theta.size], moved[theta.size :][None, :]).squares)
        numeric = -(pair[0] - pair[1]) / (4 * step)
        assert at.score[j] == pytest.approx(numeric, rel=2e-3, abs=1e-4 * np.sqrt(at.information[j, j] * at.squares)), j


def test_the_linear_machine_is_the_general_one_without_extensions():
    voltage = multitone([(20.0, 0.7, 0.0), (9.0, 60.1, 3.0)], 1.0, PERIOD_S)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0]
    problem = Problem([Segment(voltage, current, 30.0, False)], PERIOD_S, ModelChoice())
    theta, own = start_theta(START, problem.model), np.array([[0.05, 0.1, 0.08]])
    modal = problem.evaluate(theta, own)
    theta[DELAY] = 1e-300  # a delay of nothing takes the general way
    general = problem.evaluate(theta, own)
    free = np.ix_(problem.free, problem.free)
    assert modal.squares == pytest.approx(general.squares, rel=1e-10)
    assert modal.residuals[0] == pytest.approx(general.residuals[0], abs=1e-10)
    assert modal.flux[0] == pytest.approx(general.flux[0], abs=1e-10)
    assert modal.information[free] == pytest.approx(general.information[free], rel=1e-7)
    assert modal.score[problem.free] == pytest.approx(general.score[problem.free], rel=1e-7)


def test_the_compiled_pass_has_room_for_the_largest_model():
    assert ModelChoice(max(IRON), leg=LegLaw(1.0)).size + OWN <= WIDTH


def behind_legs():
    """Segments and the peak flux. Legs lose 5 V x tanh(i / 0.15 A), L_s = 0.34 / (1 + (0.84 psi)^7): published 2.2 kW machine."""
    stairs = np.concatenate([np.full(3000, v) for v in (8.0, 10.0, 13.0, 16.0, -8.0, -10.0, -13.0, -16.0)])
    tones = multitone([(20.0, 0.7, 0.0), (5.0, 2.3, 1.0), (14.0, 19.8, 2.0), (9.0, 60.1, 3.0)], 6.0, PERIOD_S)
    rng = np.random.default_rng(4)
    segments, peak = [], 0.0
    for u in (stairs, tones):
        current, flux = np.empty_like(u), np.empty_like(u)
        machine = np.array([3.7, 2.5, 0.023, 0.34, 0.84, 7.0])
        saturating_block(u, PERIOD_S, np.zeros(2), machine, 5.0, 0.15, np.array(phase_cosines(0.0)), current, flux)
        segments.append(Segment(u, current + 0.02 * rng.standard_normal(u.size), 0.0, True))
        peak = max(peak, float(np.max(np.abs(flux))))
    return segments, peak


def test_inverter_and_iron_are_told_from_the_machine():
    segments, peak = behind_legs()
    model = ModelChoice(4, 0.9, LegLaw(3.0), with_delay=False)
    start = start_theta(START, model, knee_shape(4.0, 0.1, 2.0))
    fit = fit_segments(segments, PERIOD_S, START, model, start)
    assert fit.peak_flux_wb == pytest.approx(peak, rel=2e-3)
    inductance = 0.34 / (1 + (0.84 * 0.8) ** 7)
    truth = Gamma(3.7, 2.5, 0.023, inductance).as_inverse_gamma().as_tuple()
    found, covariance = fit.inverse_gamma_at(0.8)
    limits = np.array([0.005, 0.02, 0.01, 0.02])
    assert np.all(np.abs(np.array(found.as_tuple()) / truth - 1) < limits)
    assert np.all(np.abs(np.array(found.as_tuple()) - truth) < 4.5 * np.sqrt(np.diag(covariance)))
    leg = fit.inverter()
    assert leg is not None
    assert leg.leg_voltage_v(np.array([0.3, 1.5])) == pytest.approx(5.0 * np.tanh([2.0, 10.0]), abs=0.15)
    flux, l_m, std = fit.magnetizing_curve()
    assert flux[-1] <= fit.peak_flux_wb * 1.0001
    secant = 0.34 / (1 + (0.84 * flux) ** 7)
    assert np.all(np.abs(l_m - secant**2 / (secant + 0.023)) < 5 * std + 0.002)


def test_the_information_bound_is_the_scatter_of_the_fit():
    voltage = multitone(TONES, 2.0, PERIOD_S)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0]
    bound = np.sqrt(np.diag(cramer_rao(InverseGamma(*TRUTH), voltage, PERIOD_S, 0.1)))
    found = []
    for seed in range(40):
        measured = current + 0.1 * np.random.default_rng(seed).standard_normal(current.size)
        fit = fit_segments([Segment(voltage, measured, 0.0, True)], PERIOD_S, InverseGamma(*TRUTH))
        found.append(fit.inverse_gamma_at(0.0)[0].as_tuple())
    ratio = np.std(found, axis=0) / bound
    assert np.all(np.abs(ratio - 1.0) < 4 / np.sqrt(2 * 40)), ratio


def test_white_noise_is_white_and_a_missing_cause_is_not():
    rng = np.random.default_rng(8)
    statistics = [whiteness([rng.standard_normal(20000)]).statistic for _ in range(200)]
    assert np.mean(np.array(statistics) > 20.1) <= 0.04
    assert np.mean(statistics) == pytest.approx(8.0, abs=4 * 4 / np.sqrt(200))
    wave = 0.5 * np.sin(np.arange(20000) / 40)
    assert not whiteness([rng.standard_normal(20000) + wave]).is_white


def two_late_segments():
    """Two stretches with an offset each, the current 60 us late and noisy."""
    voltage = multitone(TONES, 6.0, PERIOD_S)
    late = np.concatenate([np.zeros(3), np.repeat(voltage, 10)[:-3]])
    current = linear_response(TRUTH, late, PERIOD_S / 10)[0][::10].copy()
    current = current + 0.02 * np.random.default_rng(5).standard_normal(current.size)
    return [
        Segment(voltage[:15000], current[:15000] + 0.05, 0.0, False),
        Segment(voltage[15000:], current[15000:] - 0.05, 0.0, False),
    ]


@pytest.mark.parametrize(
    ("have", "other"),
    [
        (ModelChoice(with_delay=False, with_drift=True), ModelChoice(with_delay=True, with_drift=True)),
        (ModelChoice(with_delay=True, with_drift=False), ModelChoice(with_delay=True, with_drift=True)),
        (ModelChoice(with_delay=True, with_drift=True), ModelChoice(with_delay=False, with_drift=True)),
        (ModelChoice(with_delay=True, with_drift=True), ModelChoice(with_delay=True, with_drift=False)),
        (ModelChoice(with_delay=True), ModelChoice(extra_powers=1, with_delay=True)),
    ],
    ids=["delay", "drift", "no delay", "no drift", "iron"],
)
def test_what_another_model_will_come_to_is_foreseen_from_one_evaluation(have, other):
    """Its gain or loss in the criterion, beside what fitting it gives; thousands for the delay, none for the iron."""
    parts = two_late_segments()
    fit = fit_segments(parts, PERIOD_S, START, have)
    everything = ModelChoice(extra_powers=other.extra_powers, with_delay=True, with_drift=True)
    theta = np.append(fit.theta, np.zeros(everything.size - fit.theta.size))
    seen = Foresight.at(Problem(parts, PERIOD_S, everything), theta, fit.own)
    assert seen.criterion(have) == pytest.approx(fit.criterion(), abs=0.1)
    gained = fit_segments(parts, PERIOD_S, START, other).criterion() - fit.criterion()
    assert seen.criterion(other) - seen.criterion(have) == pytest.approx(gained, rel=0.15, abs=0.5)


def test_the_model_that_made_the_samples_is_chosen():
    chosen = select_model(two_late_segments(), PERIOD_S, [START, InverseGamma(*TRUTH)], None).model
    assert (chosen.with_delay, chosen.with_drift, chosen.extra_powers, chosen.leg) == (True, True, 0, None)
