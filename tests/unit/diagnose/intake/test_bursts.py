"""Errors that come and go are told from noise of every kind, and moments without samples count for nothing."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from commissioner.diagnose.intake.bursts import BLOCK, LEVEL, bursts_sigma
from commissioner.diagnose.intake.noise import Noise

SIGMA = 0.01


STEP = 4.0 * SIGMA


def noise_of(step_a=0.0):
    given = Noise(np.full(3, SIGMA), np.array([1.0, 1000.0]), np.ones((3, 2)), "repeated segments", True, 0.0, True)
    return given.with_converter_step(np.full(3, step_a)) if step_a else given


@pytest.fixture(scope="module")
def record(setting):
    return setting.record


def residuals(record, kind, seed=1):
    random = np.random.default_rng(seed)
    out = []
    for segment in record.segments:
        white = random.standard_normal((3, segment.count))
        if kind == "red":
            white = lfilter([np.sqrt(1.0 - 0.9**2)], [1.0, -0.9], white)
        elif kind == "wandering":
            white = white + 0.02 * np.cumsum(random.standard_normal((3, segment.count)), axis=1)
        elif kind == "heavy tails":
            white = random.standard_t(3.0, (3, segment.count)) / np.sqrt(3.0)
        elif kind == "rounded":
            moving = 30.0 * np.sin(0.003 * np.arange(segment.count)) * (segment.time_s - segment.time_s[0] > 0.4) + 2.0
            white = np.round((moving + white) / 4.0) * 4.0 - moving
        out.append(SIGMA * white)
    return out


@pytest.mark.parametrize("kind", ["white", "red", "wandering", "heavy tails", "rounded"])
def test_noise_of_any_kind_has_no_bursts(record, kind):
    noise = noise_of(STEP if kind == "rounded" else 0.0)
    assert all(bursts_sigma(residuals(record, kind, seed), record, noise) == 0.0 for seed in range(10))


@pytest.mark.parametrize("kind", ["white", "red", "heavy tails"])
def test_moments_with_three_times_the_noise_are_seen(record, kind):
    """A link that dips for 20 ms twice a segment: to the spectrum of two equal tests that is noise."""
    rows = residuals(record, kind)
    for row in rows:
        for start in (10, 25):
            row[:, start * BLOCK : (start + 2) * BLOCK] *= 12.0 if kind == "red" else 4.0
    assert bursts_sigma(rows, record, noise_of()) > 0.3


@pytest.mark.parametrize("kind", ["white", "red"])
def test_an_offset_of_two_values_jumps(record, kind):
    """For some levels each, 0.7 of the noise off their mean: to the spectrum of two equal tests that is slow noise."""
    size = 2.0 if kind == "red" else 0.7
    rows = residuals(record, kind)
    for row in rows:
        row[1] += size * SIGMA * np.where(np.arange(row.shape[1]) // LEVEL % 10 < 5, 1.0, -1.0)
    assert bursts_sigma(rows, record, noise_of()) == pytest.approx(size / np.sqrt(3.0), rel=0.2)
    assert bursts_sigma(rows, record, noise_of(), has_causes=True) == 0.0


def test_spikes_and_masked_samples_are_no_moments(record):
    rows = residuals(record, "white")
    rows[0][:, ::97] += 1.0
    masked = replace(
        record, segments=tuple(replace(s, is_good=np.arange(s.count) >= 10 * BLOCK) for s in record.segments)
    )
    for row in rows:
        row[:, : 10 * BLOCK] *= 10.0
    assert bursts_sigma(rows, masked, noise_of()) == 0.0
    assert bursts_sigma(rows, record, noise_of()) > 1.0
