"""A noise that rises as 1/f costs an estimate more than a white one of the same power, and the stated errors say so."""

import numpy as np
import pytest

from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.flicker import noise_spectrum, widened
from commissioner.identify.batch.problem import MOST_KEPT
from commissioner.identify.batch.segments import Segment
from commissioner.motor.circuit import InverseGamma
from tests.support.standstill import linear_response, multitone

PERIOD_S = 5e-4
TRUTH = (3.7, 2.09, 0.021, 0.224)
TONES = [(6.0, 0.25, 0.0), (5.0, 1.3, 1.0), (10.0, 16.4, 2.0), (14.0, 112.1, 3.0)]
NOISE_A, CORNER_HZ = 0.02, 30.0


def noise(seed, size, corner_hz):
    """White noise and one of density NOISE_A^2 corner_hz / f."""
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft(rng.standard_normal(size))
    frequency = np.fft.rfftfreq(size, PERIOD_S)
    spectrum[1:] *= np.sqrt(corner_hz / frequency[1:])
    spectrum[0] = 0.0
    return NOISE_A * (rng.standard_normal(size) + np.fft.irfft(spectrum, size))


def test_the_density_is_found_and_a_white_noise_has_none():
    assert [noise_spectrum([noise(k, 10_000, 0.0)], PERIOD_S)[1] for k in range(40)] == [0.0] * 40
    found = [noise_spectrum([noise(k, 10_000, CORNER_HZ)], PERIOD_S)[1] for k in range(40)]
    assert np.mean(found) == pytest.approx(NOISE_A**2 * CORNER_HZ, rel=0.1)
    assert min(found) > 0.0


def test_two_short_stretches_are_judged_together_and_a_moment_or_silence_says_nothing():
    assert noise_spectrum([noise(1, 5_000, CORNER_HZ), noise(2, 5_000, CORNER_HZ)], PERIOD_S)[1] > 0.0
    assert noise_spectrum([noise(1, 100, CORNER_HZ), noise(2, 1, CORNER_HZ)], PERIOD_S)[1] == 0.0
    assert noise_spectrum([noise(1, 10_000, CORNER_HZ), np.zeros(10_000)], PERIOD_S) == (0.0, 0.0)


@pytest.mark.parametrize("kept", [MOST_KEPT, 80_000], ids=["whole", "too long to keep"])
@pytest.mark.parametrize("corner_hz", [0.0, CORNER_HZ])
def test_errors_are_as_large_as_stated(monkeypatch, corner_hz, kept):
    """Root mean square of 40 draws' errors over the stated ones; without the noise's spectrum 2.3 for R_s, 1.9 for R_R, 1.8 for L_M."""
    monkeypatch.setattr("commissioner.identify.batch.problem.MOST_KEPT", kept)
    voltage = multitone(TONES, 5.3, PERIOD_S)
    current = linear_response(TRUTH, voltage, PERIOD_S)[0]
    errors = []
    for seed in range(40):
        parts = [Segment(voltage, current + noise(seed, current.size, corner_hz), 0.0, False)]
        machine, covariance = widened(fit_segments(parts, PERIOD_S, InverseGamma(*TRUTH)), parts).inverse_gamma_at(0.0)
        errors.append((np.array(machine.as_tuple()) - TRUTH) / np.sqrt(np.diag(covariance)))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert np.all((rms > 0.7) & (rms < 1.35)), rms
