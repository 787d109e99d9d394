"""Noise that is larger at low frequencies, of sensors and of what drifts: how much of it a fit leaves unexplained, and what it costs
its estimates.

The fit's own sandwich takes stretches of a quarter of a second, too short to show it; and at the lowest tones the fit takes a part
of it away, so that its level comes from between them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from commissioner.identify.batch.model import Matrix
from commissioner.identify.batch.problem import Problem, beginnings
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
PLATEAUS_HZ = (0.0, 0.5, 1.5, 5.0, 15.0)
"""Below which a noise that falls with the square of frequency (a first-order lag of a white one; 0: a random walk) rises no more."""


@dataclass(frozen=True)
class Shape:
    """1 / f, or 1 / (f^2 + plateau^2) where there is a `plateau_hz`."""

    plateau_hz: float | None

    def __call__(self, frequency_hz: Signal) -> Signal:
        if self.plateau_hz is None:
            return 1.0 / frequency_hz
        return 1.0 / (np.square(frequency_hz) + self.plateau_hz**2)


SHAPES = (Shape(None), *map(Shape, PLATEAUS_HZ))


@dataclass(frozen=True)
class SlowNoise:
    """Periodogram |R(f)|^2 / n = `white` + sum of `slow` times shapes, in A^2: of `SHAPES` the mean, by how well each describes it."""

    white: float
    slow: tuple[float, ...]

    def above_white(self, frequency_hz: Signal) -> Signal:
        """In A^2 at these frequencies."""
        return np.asarray(sum(size * shape(frequency_hz) for size, shape in zip(self.slow, SHAPES, strict=True)))


def widened(fit: BatchFit, segments: Sequence[Segment]) -> BatchFit:
    """The fit with what such a noise adds to its covariance (sandwich with the noise's spectrum; E. J. Hannan, Journal of Applied
    Probability 8, 1971, 767); itself where there is none."""
    noise = slow_noise(fit.residuals, fit.sample_period_s)
    if noise is None:
        return fit
    problem = Problem(beginnings(segments, fit.model), fit.sample_period_s, fit.model, is_coarse=True)
    problem.expect_leg(fit.theta)
    information, sensitivities = problem.sensitivities(fit.theta, fit.own)
    scores = np.zeros_like(information)
    for columns, rows in sensitivities:
        scores[np.ix_(columns, columns)] += _shaped(rows, fit.sample_period_s, noise)
    shared = np.flatnonzero(fit.model.free_shared)
    free = np.flatnonzero(problem.free)
    scale = np.sqrt(np.maximum(np.diag(information)[free], 1e-300))
    normal, scattered = (each[np.ix_(free, free)] / np.outer(scale, scale) for each in (information, scores))
    inverse = np.linalg.pinv(normal, rcond=1e-14)
    kept = sum(len(rows) for _, rows in sensitivities) / sum(x.current_a.size for x in segments)
    by_spectrum = kept * inverse @ (noise.white * normal + scattered) @ inverse / np.outer(scale, scale)
    by_spectrum = by_spectrum[: shared.size, : shared.size]
    more = np.sqrt(np.maximum(np.diag(fit.covariance)[shared] / np.maximum(np.diag(by_spectrum), 1e-300), 1.0))
    covariance = np.zeros_like(fit.covariance)
    covariance[np.ix_(shared, shared)] = by_spectrum * np.outer(more, more)
    return replace(fit, covariance=covariance)


def slow_noise(residuals: Sequence[Signal], period_s: float) -> SlowNoise | None:
    """What describes the medians of bands; None where no slow noise is beyond doubt."""
    frequency, power = (np.concatenate(each) for each in zip(*(_bands(r, period_s) for r in residuals), strict=True))
    if len(power) < FEWEST_BANDS or not np.all(power > 0.0):
        return None
    levels, misfits = map(np.array, zip(*(_fitted(shape(frequency), power) for shape in SHAPES), strict=True))
    if not np.isfinite(misfits).any():
        return None
    share = np.exp(-0.5 * (misfits - misfits.min()))
    share /= share.sum()
    return SlowNoise(float(share @ levels[:, 0]), tuple(share * levels[:, 1]))


def _fitted(shape: Matrix, power: Matrix) -> tuple[Signal, float]:
    """((white, slow), chi-square) by weighted least squares over (bands, BAND) ordinates' medians; infinite where the slow one is not
    beyond doubt. Relative variance of a median of K exponential ordinates: 1 / (K ln^2 2)."""
    rows = np.column_stack([np.ones(len(power)), np.median(shape, axis=1)])
    ordinates = BAND * math.log(2.0) ** 2
    level = np.array([np.median(power) / math.log(2.0), 0.0])
    ratio = np.ones(len(power))
    for _ in range(PASSES):
        ratio = np.median(power / (level[0] + level[1] * shape), axis=1) / math.log(2.0)
        weighted = rows / (rows @ level)[:, None]
        level = np.linalg.solve(weighted.T @ weighted, weighted.T @ ratio)
        level = np.array([max(level[0], 1e-3 * float(np.median(power))), max(level[1], 0.0)])
    of_white = level[0] * math.sqrt(np.linalg.inv(rows.T @ rows)[1, 1] / ordinates)
    is_beyond_doubt = level[1] > CERTAIN * of_white
    return level, 2.0 * ordinates * float(np.sum(ratio - 1.0 - np.log(ratio))) if is_beyond_doubt else math.inf


def _bands(residual: Signal, period_s: float) -> tuple[Signal, Signal]:
    """(bands, BAND) frequencies and periodogram ordinates from the first one on, and below `SLOW_HZ`."""
    size = residual.size
    count = min(int(SLOW_HZ * size * period_s), size // 2 - 1) // BAND if size else 0
    frequency = np.arange(1, count * BAND + 1) / (max(size, 1) * period_s)
    power = np.square(np.abs(np.fft.rfft(residual)[1 : count * BAND + 1])) / max(size, 1) if count else frequency
    return frequency.reshape(count, BAND), power.reshape(count, BAND)


def _shaped(signals: Matrix, period_s: float, noise: SlowNoise) -> Matrix:
    """Sum over frequencies of X X^H / n times the noise above white, X the (n, p) signals' spectrum: (p, p), without what has no frequency."""
    size = len(signals)
    spectrum = np.fft.rfft(signals, axis=0)[1:]
    both_sides = np.full(len(spectrum), 2.0)
    both_sides[(size - 1) // 2 :] = 1.0  # half the sampling frequency stands once
    weight = both_sides / size * noise.above_white(np.arange(1, len(spectrum) + 1) / (size * period_s))
    return np.real((spectrum.conj().T * weight) @ spectrum)
