"""Windows of a running recording: where they begin, what they are, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from commissioner.errors import DataRefused
from commissioner.estimation.record import STATES, between, noise_of, prepare
from tests.running_effects.cases import Case, taken


@pytest.fixture(scope="module")
def start():
    recording, plate, _ = taken(Case(5000, "null").scenario(), 5000)
    return recording, plate


def test_a_window_begins_one_sample_after_closing_at_rest(start):
    recording, plate = start
    (window,) = prepare([recording], plate).windows
    skipped = recording.time_s.size - window.count
    volts = np.abs(np.array(recording.voltages_v))
    assert volts[:, : skipped - 2].max() < 0.05 * plate.rated_voltage_v
    assert volts[:, skipped].max() > 0.05 * plate.rated_voltage_v
    assert window.is_from_rest
    assert {STATES[k] for k in np.unique(window.state)} == {"start", "steady", "transient"}


def test_noise_is_measured_beside_harmonics():
    t = np.arange(10_000) * 2e-4
    rng = np.random.default_rng(1)
    x = (
        10.0 * np.sin(314 * t)
        + 0.3 * np.sin(5 * 314 * t)
        + 0.2 * np.sin(7 * 314 * t)
        + 0.02 * rng.standard_normal(t.size)
    )
    assert noise_of(x) == pytest.approx(0.02, rel=0.05)


def test_between_samples_a_harmonic_is_met():
    t = np.arange(400) * 2e-4
    fine = 0.5e-4 * 2 * np.arange(2 * t.size - 1)
    assert np.abs(between(np.sin(314 * t))[3:-3] - np.sin(314 * fine)[3:-3]).max() < 2e-6


def test_phases_that_turn_against_each_other_are_refused(start):
    recording, plate = start
    u, v, w = recording.currents_a
    with pytest.raises(DataRefused, match="turn against each other"):
        prepare([replace(recording, currents_a=(u, w, v))], plate)


def test_both_turning_backwards_is_said_and_used(start):
    recording, plate = start
    (a, b, c), (u, v, w) = recording.currents_a, recording.voltages_v
    record = prepare([replace(recording, currents_a=(a, c, b), voltages_v=(u, w, v))], plate)
    assert any("turns backwards" in r for r in record.remarks)
    straight = prepare([recording], plate).windows[0]
    assert np.allclose(record.windows[0].current, straight.current)


def test_pulses_and_slow_sampling_are_refused(start):
    recording, plate = start
    rng = np.random.default_rng(2)
    noisy = tuple(v + 200.0 * rng.choice([-1.0, 1.0], v.size) for v in recording.voltages_v)
    with pytest.raises(DataRefused, match="pulses"):
        prepare([replace(recording, voltages_v=noisy)], plate)
    with pytest.raises(DataRefused, match="too few"):
        prepare([replace(recording, sample_period_s=1e-3)], plate)


def test_a_lost_third_current_or_line_voltages_change_nothing(start):
    recording, plate = start
    u, v, w = recording.voltages_v
    record = prepare([recording], plate)
    lines = prepare([replace(recording, voltages_v=(u - v, v - w, w - u), voltages_are_line_to_line=True)], plate)
    assert np.allclose(lines.windows[0].voltage, record.windows[0].voltage, atol=1e-6 * plate.rated_voltage_v)
    two = prepare([replace(recording, currents_a=(*recording.currents_a[:2], np.full(u.size, np.nan)))], plate)
    assert not two.has_zero
    assert np.abs(two.windows[0].current[:, 2]).max() < 1e-12
