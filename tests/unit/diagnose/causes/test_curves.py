"""Splines on twice the knots and over wider ranges, and lines seen once a stronger cause is known."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.causes.mains_lines import with_clearer_lines
from commissioner.diagnose.plant.model import Model, even_vectors, odd_vectors, with_halved_intervals
from commissioner.diagnose.search.dictionaries import carried_over
from commissioner.diagnose.search.nominal import with_ranges
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


def carried(setting, name, wider, reached, seed=3):
    """A model of that cause with random numbers, and the same in dictionaries whose ranges are `wider` times as large."""
    layout, random = setting.layout, np.random.default_rng(seed)
    terms = tuple(t for t in CATALOGUE[name].terms(setting) if t.symbol != "split")
    model = Model((1.0, 1.0, 0.01, 0.2), terms, tuple(random.random(len(terms))))
    fresh = with_ranges(layout, wider * layout.iron_top_wb / 1.08, wider * layout.leak_top_wb / 1.2)
    return model, fresh, carried_over(model, layout, (reached, reached), fresh)


@pytest.mark.parametrize(("name", "vectors", "top"), [
    ("magnetizing_saturation", "iron_vectors", "iron_top_wb"), ("leakage_saturation", "leak_vectors", "leak_top_wb"),
])  # fmt: skip
@pytest.mark.parametrize("wider", [0.9, 1.0, 1.3])
def test_a_curve_carried_over_is_the_same_where_it_was_seen_and_straight_beyond(setting, name, vectors, top, wider):
    old_top = getattr(setting.layout, top)
    reached = 0.8 * old_top
    model, fresh, there = carried(setting, name, wider, reached)
    at = np.linspace(0.0, min(wider, 1.0) * old_top, 201)

    def curve(layout, one):
        return curve_of(getattr(layout, vectors), np.array(one.values), at / getattr(layout, top))

    old, new = curve(setting.layout, model), curve(fresh, there)
    seen = at <= reached
    assert np.abs(new - old)[seen].max() < 0.01 * old[seen].max()
    rise = (old[seen][-1] - old[seen][-2]) / (at[1] - at[0])
    straight = old[seen][-1] + rise * (at[~seen] - at[seen][-1])
    assert new[~seen] == pytest.approx(straight, rel=0.01), "beyond what was reached no coefficient is believed"
    assert np.abs(old[~seen] - straight).max() > 0.01 * straight.max()


def with_ripple(setting, nominal, frequency_hz):
    """What a link with that ripple adds to the currents, through the machine's impedance."""
    r_s, r_r, l_sigma, l_m = nominal.nominal
    segments = []
    for segment in setting.record.segments:
        turn = np.cos(2.0 * np.pi * frequency_hz * segment.time_s)
        s = 2j * np.pi * np.fft.rfftfreq(segment.count, segment.period_s)
        impedance = r_s + s * l_sigma + s * l_m * r_r / (r_r + s * l_m)
        segments.append(
            (segment, np.fft.irfft(np.fft.rfft(0.01 * segment.voltage_axis_v * turn) / impedance, segment.count))
        )
    return segments


@pytest.mark.parametrize(("hertz", "line"), [(300.4, "ripple_300"), (99.7, "ripple_100"), (359.0, "ripple_360")])
def test_a_ripple_is_seen_at_its_frequency(nominal, setting, hertz, line):
    random = np.random.default_rng(2)
    directions = [np.cos(np.deg2rad(s.axis_deg - np.array([0.0, 120.0, 240.0]))) for s in setting.record.segments]
    segments = tuple(
        replace(s, currents_a=s.currents_a + np.outer(d, more) + 0.01 * random.normal(size=s.currents_a.shape))
        for (s, more), d in zip(with_ripple(setting, nominal, hertz), directions, strict=True)
    )
    record = replace(setting.record, segments=segments)
    seen, lines = with_clearer_lines(record, nominal, setting.layout, WHITE, setting.lines_hz, {})
    assert line in lines and lines[line] == pytest.approx(hertz, abs=0.15)
    assert f"{line}_cos" in seen.channel_names and len(seen.channel_names) == seen.channels[0].shape[1]
    again, same = with_clearer_lines(seen, nominal, setting.layout, WHITE, lines, {})
    assert same == lines and again is seen


@pytest.mark.parametrize("intervals", [10, 20])
def test_a_foot_of_the_magnetizing_curve_is_not_cut_off_on_twice_the_knots(setting, intervals):
    """It had been, where no coefficient beyond a quarter of the flux might fall: the finer fit began 1 700 in chi2 higher."""
    coarse, fine = even_vectors(intervals), even_vectors(2 * intervals)
    lower = [
        np.array(
            [
                t.lower
                for t in CATALOGUE["magnetizing_saturation"].terms(
                    replace(setting, layout=replace(setting.layout, iron_vectors=v))
                )
            ][:-1]
        )
        for v in (coarse, fine)
    ]
    weights = (
        np.where(np.isinf(lower[0]), -1.0, 0.0)
        + np.r_[np.zeros(intervals // 2), np.ones(intervals + 1 - intervals // 2)]
    )
    assert (weights < 0.0).sum() >= 3
    halved = with_halved_intervals(coarse, weights, fine)
    assert np.all(halved > lower[1] - 1e-9)
