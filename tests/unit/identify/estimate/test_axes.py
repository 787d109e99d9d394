"""What several axes, and a repeated test weeks later, say."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from commissioner.identify.estimate.axes import AxisEstimate, Cause, Combined, Identity, combine, compare
from commissioner.motor.circuit import InverseGamma

TRUTH = np.array([3.7, 2.09, 0.021, 0.224])
RELATIVE = np.array([0.001, 0.002, 0.001, 0.002])


def axes(seed=0, orientations=(0.0, 60.0, 120.0, 0.0), gain=0.0, anisotropy=0.0, heat=0.0):
    rng = np.random.default_rng(seed)
    out = []
    for k, axis in enumerate(orientations):
        wave = math.cos(2 * math.radians(axis) - 0.7)
        factor = np.exp(np.array([1, 1, 1, 1]) * gain * wave + np.array([0, 0, 1, 1]) * anisotropy * wave)
        factor[0] *= math.exp(heat * k / (len(orientations) - 1))
        values = TRUTH * factor * np.exp(RELATIVE * rng.standard_normal(4))
        out.append(AxisEstimate(axis, InverseGamma(*values), np.diag((RELATIVE * TRUTH) ** 2)))
    return out


def named(estimates) -> set[Cause]:
    return {f.cause for f in combine(estimates).findings}


def test_the_mean_and_its_error_are_those_of_the_axes():
    result = combine(axes())
    assert np.array(result.parameters.as_tuple()) == pytest.approx(TRUTH, rel=4 * 0.002)
    assert np.sqrt(np.diag(result.covariance)) / TRUTH == pytest.approx(RELATIVE / 2, rel=0.9)


def test_equal_axes_give_no_findings():
    false = sum(bool(named(axes(seed))) for seed in range(100))
    assert false <= 5


@pytest.mark.parametrize(
    ("options", "cause"),
    [
        ({"gain": 0.01}, Cause.SENSOR_GAIN),
        ({"anisotropy": 0.02}, Cause.ANISOTROPY),
        ({"anisotropy": 0.05}, Cause.ANISOTROPY),
        ({"heat": 0.02}, Cause.HEATING),
    ],
)
def test_each_cause_is_named_and_no_other(options, cause):
    right = sum(named(axes(seed, **options)) == {cause} for seed in range(50))
    assert right >= 47


def test_sensor_gain_and_heating_together_are_both_named_with_their_size():
    result = combine(axes(3, gain=0.01, heat=0.02))
    sizes = {f.cause: f.relative_size for f in result.findings}
    assert sizes[Cause.SENSOR_GAIN] == pytest.approx(0.01, abs=0.002)
    assert sizes[Cause.HEATING] == pytest.approx(0.02, abs=0.005)


def test_too_few_orientations_are_said_to_be_too_few():
    for few in (axes()[:1], axes(orientations=(0.0, 60.0))):
        assert any("at least three: what the phases or their sensors differ by" in r for r in combine(few).remarks)
    assert any("heating" in r for r in combine(axes(orientations=(0.0, 60.0, 120.0))).remarks)


@pytest.mark.parametrize("orientations", [(0.0, 60.0, 0.0), (0.0, 90.0, 180.0, 0.0), (30.0, 30.0, 210.0)])
def test_a_pattern_over_the_axes_is_never_named_from_two_orientations(orientations):
    """Mean, cosine and sine are three unknowns: two orientations fit any size of them."""
    seen = [combine(axes(seed, orientations, gain=0.02)) for seed in range(10)]
    assert all({f.cause for f in one.findings} <= {Cause.HEATING, Cause.UNEXPLAINED} for one in seen)
    assert all(abs(f.relative_size) < 0.1 for one in seen for f in one.findings)


def later(factor, seed=1) -> Combined:
    rng = np.random.default_rng(seed)
    values = TRUTH * np.array(factor) * np.exp(0.002 * rng.standard_normal(4))
    return Combined(InverseGamma(*values), np.diag((RELATIVE * TRUTH) ** 2), (0.0,) * 4, (), ())


def test_the_same_motor_weeks_later_and_warmer_is_the_same():
    for seed in range(30):
        assert compare(later([1, 1, 1, 1]), later([1.08, 1.07, 1, 1], seed)).verdict is Identity.SAME


def test_a_changed_parameter_is_named_with_its_significance():
    result = compare(later([1, 1, 1, 1]), later([1, 1, 1, 0.93], 5))
    assert result.verdict is Identity.CHANGED
    assert result.changes[0].parameter == "magnetizing_inductance_h"
    assert result.changes[0].sigmas > 3.5
    assert re.fullmatch(r"magnetizing inductance L_M -\d\.\d % \(\d+\.\d standard errors\)", result.reason)


def test_another_motor_is_another_motor():
    assert compare(later([1, 1, 1, 1]), later([0.6, 0.7, 1.4, 1.5], 6)).verdict is Identity.OTHER
