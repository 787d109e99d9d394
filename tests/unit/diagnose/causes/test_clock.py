"""Clocks that run apart, of simulated recordings: set anew with every segment, or running on over them."""

import copy

import pytest

from commissioner.diagnose.diagnosis import diagnose
from sim.recordings import hidden
from sim.scenario import build
from tests.hidden_effects.cases import recording_of

SEED = 5


def seen_with(effects):
    """Diagnosis of one drawn machine's seven segments with just these effects."""
    document = copy.deepcopy(hidden.draw(SEED, "one", only="clock_drift", noise="white", seconds=2.0).document)
    return diagnose([recording_of(build({**document, "effects": effects}, "clock"), SEED)])


def clock(fast_ppm, runs_on):
    return {"clock_drift": {"size": fast_ppm, "runs_on": float(runs_on)}}


@pytest.mark.parametrize(("fast_ppm", "runs_on"), [(-1.0, True), (12.0, True), (-6.0, False)])
def test_a_clock_is_named_with_its_rate_whether_it_runs_on_or_restarts(fast_ppm, runs_on):
    seen = seen_with(clock(fast_ppm, runs_on))
    assert [c.name for c in seen.causes] == ["clock_drift"] and seen.verdict == "explained"
    rate, spread, _ = seen.causes[0].sizes["drift_ppm"]
    assert abs(rate + fast_ppm) < max(4.0 * spread, 0.01 * abs(fast_ppm))


def test_a_delay_is_found_beside_a_clock_that_runs_on_and_stays_one_without():
    late = {"sampling_delay": {"size": 6e-5}}
    alone, beside = (seen_with({**late, **more}) for more in ({}, clock(-1.0, True)))
    delays = {"sampling_delay", "sensor_lag"}
    assert {c.name for c in alone.causes} <= delays and len(alone.causes) == 1
    assert {c.name for c in beside.causes} - delays == {"clock_drift"} and len(beside.causes) == 2
    rates = [c.sizes["drift_ppm"][0] for c in beside.causes if c.name == "clock_drift"]
    assert rates == pytest.approx([1.0], rel=0.05)
