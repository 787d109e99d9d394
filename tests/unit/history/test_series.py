"""A trend names what has changed, and what has not at most as often as it says."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.history.motor import Measured, motor_trends
from commissioner.history.series import judge
from commissioner.identify.estimate.axes import Combined, Identity
from commissioner.identify.estimate.common_ground import Result
from commissioner.motor.circuit import PARAMETERS, InverseGamma
from commissioner.operations.history.compare import beside

STATED = 0.03
"""A rate that 2 000 series can measure; trends promise 0.001 by the same formulas."""


def rate(points, scatter, cases=2000):
    chance = np.random.default_rng(points)
    wrong = 0
    for _ in range(cases):
        claimed = np.exp(chance.normal(0.0, 0.3, points))
        seen = judge(
            np.sort(chance.uniform(0, 5, points)),
            scatter * claimed * chance.standard_normal(points),
            claimed,
            false_alarm=STATED,
        )
        wrong += bool(seen.steps or (seen.slope and seen.slope.is_significant) or (seen.alarm and seen.alarm.is_raised))
    return wrong / cases


@pytest.mark.parametrize(("points", "scatter"), [(3, 1.0), (6, 1.0), (20, 1.0), (6, 1.5), (20, 1.5)])
def test_nothing_is_named_more_often_by_chance_than_stated(points, scatter):
    """Where points scatter more than they claim, at most twice as often."""
    measured, stated = rate(points, scatter), STATED if scatter == 1.0 else 2 * STATED
    assert measured <= stated + 3.0 * np.sqrt(stated * (1 - stated) / 2000), measured


def series(level, noise=1.0, seed=3):
    chance = np.random.default_rng(seed)
    level = np.asarray(level, dtype=float)
    return judge(
        np.arange(level.size, dtype=float),
        level + noise * chance.standard_normal(level.size),
        np.full(level.size, noise),
        tests=4,
    )


def test_a_step_is_found_at_its_place_with_its_size():
    seen = series([0.0] * 6 + [12.0] * 6)
    (step,) = seen.steps
    assert step.at == 6
    assert abs(step.change - 12.0) < 4 * step.std
    assert step.std == pytest.approx(np.sqrt(2 / 6) * seen.widening, rel=1e-6)
    assert abs(seen.level - 12.0) < 2.0


def test_two_steps_are_found_and_the_level_is_that_of_now():
    seen = series([0.0] * 6 + [15.0] * 5 + [3.0] * 6)
    assert [step.at for step in seen.steps] == [6, 11]
    assert abs(seen.level - 3.0) < 2.0


@pytest.mark.parametrize(("points", "over_all"), [(6, 20.0), (12, 12.0), (12, 24.0), (24, 8.0), (24, 80.0)])
def test_a_drift_is_a_slope_with_its_size_and_no_steps(points, over_all):
    """A winding that ages evenly has no day on which it began: at most one of 20 is told as steps."""
    seen = [series(np.linspace(0.0, over_all, points), seed=seed) for seed in range(20)]
    drifting = [one.slope for one in seen if not one.steps and one.slope is not None and one.slope.is_significant]
    assert len(drifting) >= 19
    assert all(abs(slope.value - over_all / (points - 1)) < 4 * slope.std for slope in drifting)


def test_a_drift_within_less_than_the_least_span_stays_steps():
    time, value = np.arange(12.0), 4.0 * np.arange(12.0)
    seen = judge(time, value, np.ones(12), least_span=20.0)
    assert seen.slope is None and seen.steps


@pytest.mark.parametrize("at", [2, 4, 8, 12, 16])
def test_a_step_stays_a_step_where_a_line_might_pass_for_it(at):
    seen = [series(np.where(np.arange(18) < at, 0.0, 9.0), seed=seed) for seed in range(20)]
    assert sum([step.at for step in one.steps] == [at] for one in seen) >= 19


def test_a_slow_drift_is_told_within_its_error():
    slopes = [series(0.4 * np.arange(12.0), seed=seed).slope for seed in range(40)]
    error = [(slope.value - 0.4) / slope.std for slope in slopes if slope is not None]
    assert np.std(error) < 1.3
    assert abs(np.mean(error)) < 0.6


def test_a_newest_value_that_is_off_is_an_alarm():
    assert series([0.0] * 8 + [14.0]).alarm.is_raised
    assert not series([0.0] * 9).alarm.is_raised


def test_points_that_scatter_more_than_they_claim_widen_every_interval():
    chance = np.random.default_rng(5)
    values = 3.0 * chance.standard_normal(30)
    assert judge(np.arange(30.0), values, np.ones(30)).widening == pytest.approx(3.0, rel=0.35)


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_points_have_a_level_and_no_verdict(count):
    seen = judge(np.arange(float(count)), np.ones(count), np.ones(count))
    assert seen.level == 1.0 and seen.alarm is None and seen.slope is None and not seen.steps


def test_runs_within_minutes_have_no_drift_a_year_and_an_unaccepted_one_is_said():
    """Four runs of an hour told `-19000 +- 80000 % a year`; a rejected one stood among them as any other."""
    result = Result("first", combined_of(), 0.7, (), 24.0)
    runs = [Measured(f"r{k}", 60.0 * k, replace(result, name=f"r{k}")) for k in range(4)]
    runs.append(Measured("bad", 300.0, replace(result, name="bad", ended="rejected")))
    found = motor_trends(runs)
    assert all(trend.slope_per_year is None for trend in found.trends)
    assert "bad was rejected: its values are measured, not accepted" in found.common.sentences
    later = [replace(one, time_s=one.time_s * 1e6) for one in runs]
    assert all(trend.slope_per_year is not None for trend in motor_trends(later).trends)


def test_a_sentence_has_the_interval_that_every_page_has():
    """Half of it, one standard error, stood on the report's page beside intervals of 95 %."""
    result = Result("r", combined_of(), 0.7, (), 24.0)
    moved = replace(result.combined, parameters=InverseGamma(4.44, 2.2, 0.0215, 0.31))
    runs = [Measured(f"r{k}", 1e7 * k, result if k < 6 else replace(result, combined=moved)) for k in range(12)]
    trend = motor_trends(runs).trends[0]
    (step,) = trend.steps
    said = next(text for text in motor_trends(runs).sentences if "has moved" in text)
    assert f"± {196.0 * step.relative_std:.2f} %" in said  # two digits, and as many of the change


def combined_of():
    values = np.array([3.7, 2.2, 0.0215, 0.31])
    return Combined(InverseGamma(*values), np.diag((0.001 * values) ** 2), (0.0,) * 4, (), ())


def scaled(degc, factors):
    """A result that claims 0.2 %."""
    values = np.array([3.7, 2.2, 0.0215, 0.31]) * factors
    combined = replace(combined_of(), parameters=InverseGamma(*values), covariance=np.diag((0.002 * values) ** 2))
    return Result("r", combined, 0.7, (), degc)


@pytest.mark.parametrize(("degc", "share"), [((20.0, 20.0), 0.0), ((None, 20.0), 0.5), ((None, None), 1.0)])
def test_a_difference_is_as_sure_between_two_runs_as_between_two_points_of_a_trend(degc, share):
    """Repeatability is each run's: a difference has it twice. 25 K of unknown temperature are a difference's: each run has half the
    variance. By hand from the table of repeatability, claimed errors of 0.2 %."""
    pair = [scaled(known, [1.05, 1.05, 1.05, 1.05] if k else [1.0] * 4) for k, known in enumerate(degc)]
    repeat, heat = np.array([0.004, 0.006, 0.006, 0.008]), 0.0039 * 25.0 * np.array([1.0, np.sqrt(1.09), 0.0, 0.0])
    std = np.sqrt(2 * 0.002**2 + 2 * repeat**2 + share * heat**2)
    sigmas = {change.parameter: change.sigmas for change in beside(*pair).comparison.changes}
    assert [sigmas[name] for name in PARAMETERS] == pytest.approx(np.log(1.05) / std)
    points = [
        trend.points for trend in motor_trends([Measured(str(k), 86400.0 * k, r) for k, r in enumerate(pair)]).trends
    ]
    assert [np.hypot(*(point.std / point.value for point in two)) for two in points] == pytest.approx(std)


def test_a_change_just_beyond_the_limit_has_its_causes():
    """3.55 standard errors in one of four: their common chance, 0.013, is no reason to be silent."""
    limit = np.hypot(0.006, 0.002) * np.sqrt(2.0)
    done = beside(scaled(20.0, [1.0] * 4), scaled(20.0, [1.0, 1.0, float(np.exp(3.55 * limit)), 1.0]))
    assert done.comparison.verdict is Identity.CHANGED
    assert done.explained_by[0].cause == "leakage"


def test_an_explanations_error_is_relative_as_its_size_is():
    """A tripled R_s by a cable is three times as uncertain, relative to what it was, as an R_s that has not moved."""
    done = beside(scaled(20.0, [1.0] * 4), scaled(20.0, [3.0, 1.0, 1.0, 1.0]))
    (cable,) = [one for one in done.explained_by if one.cause == "cable"]
    assert cable.size == pytest.approx(2.0)
    assert cable.std == pytest.approx(3.0 * np.sqrt(2.0) * np.hypot(0.004, 0.002))
