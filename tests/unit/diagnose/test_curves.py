"""Splines on twice the knots, and lines seen once a stronger cause is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from commissioner.diagnose.channels import with_clearer_lines
from commissioner.diagnose.model import even_vectors, odd_vectors, with_halved_intervals
from tests.unit.diagnose.conftest import WHITE


def curve_of(vectors, weights, at):
    coefficients = weights @ vectors
    intervals = coefficients.size - 3
    return BSpline(np.arange(-3, intervals + 4) / intervals, coefficients, 3)(at)


@pytest.mark.parametrize(("make", "intervals"), [(even_vectors, 10), (even_vectors, 12), (odd_vectors, 16)])
def test_a_curve_is_the_same_on_twice_the_knots(make, intervals):
    coarse, fine = make(intervals), make(2 * intervals)
    weights = np.random.default_rng(intervals).random(coarse.shape[0])
    halved = with_halved_intervals(coarse, weights, fine)
    at = np.linspace(0.0, 1.0, 401)
    assert np.abs(curve_of(fine, halved, at) - curve_of(coarse, weights, at)).max() < 1e-12
    assert halved.min() > -1e-12, "a curve that never falls has no negative rise on the finer knots"


def with_ripple(setting, frequency_hz):
    """The recorded currents as a link with that ripple makes them, but for what passes through the rotor's time constant."""
    segments = []
    for segment in setting.record.segments:
        turn = np.cos(2.0 * np.pi * frequency_hz * segment.time_s)
        segments.append((segment, 0.01 * segment.voltage_axis_v * turn / (2.0 * np.pi * frequency_hz * 0.021)))
    return segments


@pytest.mark.parametrize(("hertz", "line"), [(300.4, "ripple_300"), (99.7, "ripple_100"), (359.0, "ripple_360")])
def test_a_ripple_is_seen_at_its_frequency(nominal, setting, hertz, line):
    random = np.random.default_rng(2)
    directions = [np.cos(np.deg2rad(s.axis_deg - np.array([0.0, 120.0, 240.0]))) for s in setting.record.segments]
    segments = tuple(
        replace(s, currents_a=s.currents_a + np.outer(d, more) + 0.01 * random.normal(size=s.currents_a.shape))
        for (s, more), d in zip(with_ripple(setting, hertz), directions, strict=True)
    )
    record = replace(setting.record, segments=segments)
    seen, lines = with_clearer_lines(record, nominal, setting.layout, WHITE, setting.lines_hz, ())
    assert line in lines and lines[line] == pytest.approx(hertz, abs=0.15)
    assert f"{line}_cos" in seen.channel_names and len(seen.channel_names) == seen.channels[0].shape[1]
    again, same = with_clearer_lines(seen, nominal, setting.layout, WHITE, lines, ())
    assert same == lines and again is seen
