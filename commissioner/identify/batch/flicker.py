"""Sensor noise that rises towards low frequencies as 1/f: how much of it a fit leaves unexplained, and what it costs its estimates.

The fit's own sandwich takes stretches of a quarter of a second, too short to show it; and at the lowest tones the fit takes a part
of it away, so that its level comes from between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from commissioner.identify.batch.model import Matrix
from commissioner.identify.batch.problem import Problem
from commissioner.identify.batch.segments import BatchFit, Segment
from commissioner.records import Signal

BAND = 24
"""Periodogram ordinates of which a median is taken: tones and their combinations are the fewer of them, and do not move it."""
FEWEST_BANDS = 4
SLOW_HZ = 45.0
"""Only below: here the lowest tones are, which the slow noise costs most; mains and what a filter does stand above."""
CERTAIN = 7.0
"""Standard errors that a white noise would give it: it reaches as many in two of a thousand recordings of four seconds."""
PASSES = 8


def widened(fit: BatchFit, segments: Sequence[Segment]) -> BatchFit:
    """The fit with what such a noise adds to its covariance (sandwich with the noise's spectrum; E. J. Hannan, Journal of Applied
    Probability 8, 1971, 767); itself where there is none."""
    white, slow = noise_spectrum(fit.residuals, fit.sample_period_s)
    if slow == 0.0:
        return fit
    problem = Problem(segments, fit.sample_period_s, fit.model)
    problem.expect_leg(fit.theta)
    information, sensitivities = problem.sensitivities(fit.theta, fit.own)
    scores = np.zeros_like(information)
    for columns, rows in sensitivities:
        scores[np.ix_(columns, columns)] += _over_frequency(rows, fit.sample_period_s)
    shared = np.flatnonzero(fit.model.free_shared)
    free = np.flatnonzero(problem.free)
    scale = np.sqrt(np.maximum(np.diag(information)[free], 1e-300))
    normal, scattered = (each[np.ix_(free, free)] / np.outer(scale, scale) for each in (information, scores))
    inverse = np.linalg.pinv(normal, rcond=1e-14)
    kept = sum(len(rows) for _, rows in sensitivities) / sum(x.current_a.size for x in segments)
    by_spectrum = kept * inverse @ (white * normal + slow * scattered) @ inverse / np.outer(scale, scale)
    by_spectrum = by_spectrum[: shared.size, : shared.size]
    more = np.sqrt(np.maximum(np.diag(fit.covariance)[shared] / np.diag(by_spectrum), 1.0))
    covariance = np.zeros_like(fit.covariance)
    covariance[np.ix_(shared, shared)] = by_spectrum * np.outer(more, more)
    return replace(fit, covariance=covariance)


def noise_spectrum(residuals: Sequence[Signal], period_s: float) -> tuple[float, float]:
    """a in A^2 and c in A^2 Hz of the periodogram |R(f)|^2 / n = a + c / f; c is 0.0 where it is not beyond doubt.

    Weighted least squares over medians of bands (relative variance of a median of K exponential ordinates: 1 / (K ln^2 2)).
    """
    frequency, power = (np.concatenate(each) for each in zip(*(_bands(r, period_s) for r in residuals), strict=True))
    if len(power) < FEWEST_BANDS or not np.all(power > 0.0):
        return 0.0, 0.0
    middle = 1.0 / np.mean(1.0 / frequency, axis=1)
    rows = np.column_stack([np.ones(middle.size), 1.0 / middle])
    level = np.array([np.median(power) / math.log(2.0), 0.0])
    for _ in range(PASSES):
        expected = rows @ level
        ratio = np.median(power / (level[0] + level[1] / frequency), axis=1) / math.log(2.0)
        weighted = rows / expected[:, None]
        information = weighted.T @ weighted
        level = np.linalg.solve(information, weighted.T @ ratio)
        level = np.array([max(level[0], 1e-3 * float(np.median(power))), max(level[1], 0.0)])
    of_white = math.sqrt(np.linalg.inv(rows.T @ rows)[1, 1] / BAND) * level[0] / math.log(2.0)
    return float(level[0]), float(level[1]) if level[1] > CERTAIN * of_white else 0.0


def _bands(residual: Signal, period_s: float) -> tuple[Signal, Signal]:
    """(bands, BAND) frequencies and periodogram ordinates from the first one on, and below `SLOW_HZ`."""
    size = residual.size
    count = min(int(SLOW_HZ * size * period_s), size // 2 - 1) // BAND if size else 0
    frequency = np.arange(1, count * BAND + 1) / (max(size, 1) * period_s)
    power = np.square(np.abs(np.fft.rfft(residual)[1 : count * BAND + 1])) / max(size, 1) if count else frequency
    return frequency.reshape(count, BAND), power.reshape(count, BAND)


def _over_frequency(signals: Matrix, period_s: float) -> Matrix:
    """Sum over frequencies of X X^H / f, X the (n, p) signals' spectrum: (p, p), without what has no frequency."""
    size = len(signals)
    spectrum = np.fft.rfft(signals, axis=0)[1:]
    both_sides = np.full(len(spectrum), 2.0)
    both_sides[(size - 1) // 2 :] = 1.0  # half the sampling frequency stands once
    weight = both_sides * period_s / np.arange(1, len(spectrum) + 1)
    return np.real((spectrum.conj().T * weight) @ spectrum)
