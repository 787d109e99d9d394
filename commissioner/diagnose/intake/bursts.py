"""Errors that come and go: moments in which much more is left than in most (a link that dips, a command that is skipped), and levels
that jump (an offset of two values). No repeat of the test shows them, and a spectrum takes them for noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record

Array = NDArray[np.float64]
BLOCK = 100
"""Samples of a moment."""
MEDIAN_OF_SQUARE = 0.4549
"""Of a normal number: a single sample that stands out makes no moment."""
RESTING = 0.05
"""Of the noise's power: a moment with less is one at which coarse steps of the converter stand still."""
APART, TIMES, LEAST_MOMENTS = 6.0, 2.0, 3
"""A moment stands out by so many of the usual scatter of moments (their logarithms), and has so many times the power of the median
one; fewer than these are chance or a start."""
LEVEL = 400
"""Samples of a level."""


def bursts_sigma(residuals: Sequence[Array], record: Record, noise: Noise, *, has_causes: bool = False) -> float:
    """Root mean square of what comes and goes, over the noise's: moments or levels, whichever is more; 0 where there is none.

    What named causes leave, like a shaft that swings faster than its knots, moves from level to level as well: there only moments count.
    """
    moments = _moments_sigma(residuals, record, noise)
    return moments if has_causes else max(moments, _jumps_sigma(residuals, record, noise))


def _jumps_sigma(residuals: Sequence[Array], record: Record, noise: Noise) -> float:
    """Root mean square of the levels, medians of neighbouring stretches, where some jump by far more than most move: an offset that has
    two values. Noise of any colour moves from stretch to stretch as a normal number does. From the first stretch of a segment,
    which holds its start, no move is counted.
    """
    every, moves = [], []
    for segment, residual in zip(record.segments, residuals, strict=True):
        count = segment.count // LEVEL
        levels = np.median(residual[:, : count * LEVEL].reshape(residual.shape[0], count, LEVEL), axis=2)
        good = np.asarray(segment.is_good[: count * LEVEL].reshape(count, LEVEL).all(axis=1))
        both = np.flatnonzero(good[1:] & good[:-1])
        every.append(levels[:, good])
        moves.append(np.diff(levels, axis=1)[:, both[both > 0]])
    levels, moved = np.hstack(every), np.abs(np.hstack(moves))
    if moved.shape[1] == 0:
        return 0.0
    # two medians of white noise differ by sqrt(pi / LEVEL) of it
    least = np.maximum(np.sqrt(np.pi / LEVEL) * noise.sigma_a, noise.step_a)
    usual = np.maximum(1.4826 * np.median(moved, axis=1), least)
    jumps = (moved > APART * usual[:, None]).sum(axis=1) >= LEAST_MOMENTS
    return float(np.sqrt(np.mean(np.where(jumps, np.mean(levels**2, axis=1) / noise.sigma_a**2, 0.0))))


def _moments_sigma(residuals: Sequence[Array], record: Record, noise: Noise) -> float:
    """Root mean square over the whole record of what the moments that stand out have above the median one, over that one's.

    `residuals` (phases, n) per segment; each moment is taken about a straight line, for noise rises towards low
    frequencies. A current that rests between two steps of the converter is half of one off, all of the time.
    """
    line = np.stack([np.ones(BLOCK), np.linspace(-1.0, 1.0, BLOCK)])
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    floor = float(np.median(noise.sigma_a**2)) + noise.step_a**2 / 4.0 / MEDIAN_OF_SQUARE
    about, above = [], []
    for segment, residual in zip(record.segments, residuals, strict=True):
        count = segment.count // BLOCK
        blocks = residual[:, : count * BLOCK].reshape(residual.shape[0], count, BLOCK)
        blocks = blocks - (blocks @ line.T) @ line
        power = np.median(blocks.transpose(1, 0, 2).reshape(count, -1) ** 2, axis=1) / MEDIAN_OF_SQUARE
        moments = np.log(
            np.maximum(power[segment.is_good[: count * BLOCK].reshape(count, BLOCK).all(axis=1)], RESTING * floor)
        )
        awake = moments[moments > np.log(RESTING * floor)]
        if awake.size:
            usual = float(np.median(awake))
            about.append(awake - usual)
            above.append(moments - max(usual, float(np.log(floor))))
    if not above:
        return 0.0
    scatter, every = 1.4826 * float(np.median(np.abs(np.concatenate(about)))), np.concatenate(above)
    high = every[every > max(APART * scatter, np.log(TIMES))]
    return float(np.sqrt(np.expm1(high).sum() / every.size)) if high.size >= LEAST_MOMENTS else 0.0
