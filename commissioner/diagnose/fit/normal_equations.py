"""A model on a record: trajectories, whitened residuals and normal equations, gathered segment by segment.

Only chi2, Gram matrices and, until they are asked for, the trajectories leave a segment: sensitivities never do, and
leave-one-segment-out estimates are a subtraction.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft

from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record, each_segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Layout, Model, Term
from commissioner.diagnose.plant.prediction import Path, predict, trajectory

Array = NDArray[np.float64]
Directions = tuple[Array, Array, NDArray[np.bool_]]
AT_ONCE = 48
"""Numbers of the machine whose sensitivities at every sample are held at once where they are averaged."""
HELD_SAMPLES = 400_000
"""Of a record whose trajectories are held: a quarter of a gigabyte at the most."""


@dataclass(frozen=True)
class Normal:
    """Whitened normal equations per segment: `gram` (s, P, P), `slope` (s, P), `chi2` (s,), `count` (s,) samples."""

    gram: Array
    slope: Array
    chi2: Array
    count: Array

    @property
    def total_gram(self) -> Array:
        total: Array = self.gram.sum(axis=0)
        return total

    @property
    def total_slope(self) -> Array:
        total: Array = self.slope.sum(axis=0)
        return total

    @property
    def total_chi2(self) -> float:
        return float(self.chi2.sum())

    @property
    def unexplained(self) -> float:
        """Chi2 above what the noise makes, which is 1 for every sample."""
        return self.total_chi2 - float(self.count.sum())


def whiten(signal: Array, is_good: NDArray[np.bool_], noise: Noise, period_s: float) -> Array:
    """`(..., phases, n)` residual or sensitivities -> `(..., m)` with unit noise variance; masked samples drop out."""
    if noise.is_white:
        scaled = signal / noise.sigma_a[:, None]
        if not is_good.all():
            scaled = scaled[..., is_good]
        return np.ascontiguousarray(scaled.reshape(*signal.shape[:-2], -1))
    # zeros to a length of small factors: a prime one takes five times as long
    n = next_fast_len(signal.shape[-1], real=True)
    weights = noise.weights(n, period_s)
    masked = np.where(is_good, signal, 0.0) if not is_good.all() else signal
    spectrum = rfft(masked, n, axis=-1)
    scale = np.full(weights.shape[1], np.sqrt(2.0 / n))
    scale[0] = np.sqrt(1.0 / n)
    if n % 2 == 0:
        scale[-1] = np.sqrt(1.0 / n)
    spectrum *= scale / weights
    # real and imaginary parts side by side
    return np.asarray(spectrum.view(np.float64).reshape(*signal.shape[:-2], -1))


class NormalEquations:
    """A model on a record: its chi2 from the trajectories alone, and the derivatives for the four and `wanted` once they are asked for.

    The trajectories of a long record are not held between the two: there derivatives come with the chi2.
    """

    def __init__(self, model: Model, record: Record, layout: Layout, wanted: Sequence[Term], noise: Noise) -> None:
        self._model, self._record, self._layout, self._wanted, self._noise = model, record, layout, wanted, noise
        self._size = 4 + len(wanted)
        self._paths: list[Path] = []
        self._prior = layout.penalty(wanted)
        known = {(t.effect, t.symbol): x for t, x in zip(model.terms, model.theta[4:], strict=True)}
        self._theta = np.array([0.0] * 4 + [known.get((t.effect, t.symbol), 0.0) for t in wanted])

    @cached_property
    def chi2(self) -> float:
        if self._wanted and self._record.samples > HELD_SAMPLES:
            return self._normal.total_chi2
        paths, chi2 = zip(*each_segment(self._chi2_of, self._record), strict=True)
        self._paths = list(paths) if self._wanted else []
        return float(sum(chi2)) + float(self._theta @ self._prior @ self._theta)

    @cached_property
    def _normal(self) -> Normal:
        return self._gathered(1)

    def _here(self, k: int) -> list[int]:
        return [c for c, term in enumerate(self._wanted) if term.segment in (-1, self._record.segments[k].uid)]

    def _chi2_of(self, k: int) -> tuple[Path, float]:
        here = [self._wanted[c] for c in self._here(k)]
        # a trial step may be far too long, and the setting of the caller's thread does not hold in another
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            path = trajectory(self._model, self._record, k, self._layout, here)
            segment = self._record.segments[k]
            left = segment.currents_a - predict(self._model, self._record, k, self._layout, path=path).currents_a
            white = whiten(left, segment.is_good, self._noise, self._record.facts.sample_period_s)
            return path, float(white @ white)

    def normal(self, block: int = 1) -> Normal:
        """Gram matrix and slope of the whitened residual, one block per segment.

        `block` > 1 averages so many neighbouring samples first (white noise only): a screening needs no more bandwidth
        than the excitation has.
        """
        return self._normal if block == 1 else self._gathered(block)

    def _gathered(self, block: int) -> Normal:
        def of_segment(k: int) -> tuple[Array, Array, float, int]:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                here, segment = self._here(k), self._record.segments[k]
                is_averaged = block > 1 and self._noise.is_white
                directions, left, good = self._averaged(k, here, block) if is_averaged else self._directions(k, here)
                product = self._product(directions, left, good)
            rows = np.array([0, 1, 2, 3, *(4 + c for c in here)])
            gram, slope = np.zeros((self._size, self._size)), np.zeros(self._size)
            gram[np.ix_(rows, rows)] = product[:-1, :-1]
            slope[rows] = product[:-1, -1]
            return gram, slope, float(product[-1, -1]), segment.good_count * self._record.facts.phases

        grams, slopes, chi2, counts = (
            list(column) for column in zip(*each_segment(of_segment, self._record), strict=True)
        )
        if self._prior.any():
            grams.append(self._prior)
            slopes.append(-self._prior @ self._theta)
            chi2.append(float(self._theta @ self._prior @ self._theta))
            counts.append(0)
        return Normal(np.array(grams), np.array(slopes), np.array(chi2), np.array(counts))

    def _directions(self, k: int, here: Sequence[int]) -> Directions:
        """Sensitivities for the four and the numbers `here`, the residual, and which samples of it are good."""
        segment, path = self._record.segments[k], self._paths[k] if self._paths else None
        seen = predict(self._model, self._record, k, self._layout, [self._wanted[c] for c in here], path)
        return seen.jacobian, segment.currents_a - seen.currents_a, segment.is_good

    def _averaged(self, k: int, here: Sequence[int], block: int) -> Directions:
        """`_directions` with `block` neighbours averaged, some numbers at a time: all of a screening at every sample would be half a
        gigabyte a segment.
        """
        segment = self._record.segments[k]
        wanted = [self._wanted[c] for c in here]
        path = self._paths[k] if self._paths else trajectory(self._model, self._record, k, self._layout, wanted)
        # what a sensor does goes first, with the four: a number of its own may change what they are seen through
        inside = [c for c, t in enumerate(wanted) if t.kind < kinds.FIRST_OF_SENSING]
        outside = [c for c, t in enumerate(wanted) if t.kind >= kinds.FIRST_OF_SENSING]
        turns = [outside, *(inside[first : first + AT_ONCE] for first in range(0, len(inside), AT_ONCE))]
        phases = self._record.facts.phases
        directions = np.zeros((phases, 4 + len(wanted), segment.count // block)).swapaxes(0, 1)
        left = np.zeros((phases, 0))
        for turn in turns:
            seen = predict(self._model, self._record, k, self._layout, [wanted[c] for c in turn], path)
            rows = [4 + c for c in turn]
            if turn is outside:
                left = segment.currents_a - seen.currents_a
                directions[:4] = _averaged(seen.jacobian[:4], block)
            directions[rows] = _averaged(seen.jacobian[4:], block)
        return directions, _averaged(left, block), _whole(segment.is_good, block)

    def _product(self, jacobian: Array, residual: Array, good: NDArray[np.bool_]) -> Array:
        """Whitened Gram matrix of all directions and, last, the residual: of white noise phase by phase, never copied whole."""
        noise, size = self._noise, jacobian.shape[0] + 1
        total = np.zeros((size, size))
        if noise.is_white:
            for phase, sigma_a in enumerate(noise.sigma_a):
                directions, left = jacobian[:, phase], residual[phase]
                if not good.all():
                    directions, left = directions[:, good], left[good]
                _add_products(directions, left, float(sigma_a) ** -2.0, total)
        else:
            period = self._record.facts.sample_period_s
            directions, left = (whiten(x, good, noise, period) for x in (jacobian, residual[None]))
            _add_products(directions, left[0], 1.0, total)
        return total


def _add_products(directions: Array, residual: Array, weight: float, total: Array) -> None:
    total[:-1, :-1] += weight * (directions @ directions.T)
    total[:-1, -1] += weight * (directions @ residual)
    total[-1, -1] += weight * float(residual @ residual)


def _averaged(signal: Array, block: int) -> Array:
    """Sums of `block` neighbours over sqrt(block): the noise variance stays one sample's."""
    blocks = signal.shape[-1] // block
    summed: Array = signal[..., : blocks * block].reshape(*signal.shape[:-1], blocks, block) @ np.full(
        block, 1.0 / np.sqrt(block)
    )
    return summed


def _whole(good: NDArray[np.bool_], block: int) -> NDArray[np.bool_]:
    """Blocks whose every sample is good."""
    whole: NDArray[np.bool_] = np.asarray(good[: good.size // block * block].reshape(-1, block).all(axis=1))
    return whole
