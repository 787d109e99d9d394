"""What is left of the error after the fit, judged against the measured noise: in all, line by line, around the tones, and
by the current, its slope and the time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainccinv

from commissioner.diagnose.fit.normal_equations import whiten
from commissioner.diagnose.intake.bursts import bursts_sigma
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import Record, each_segment
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.plant.prediction import predict
from commissioner.diagnose.rules import RULES

Array = NDArray[np.float64]
TONE_BINS, BESIDE_BINS = 3, 25
"""A tone is read with so many bins on each side; what the noise is there, from the bins beyond, up to so many."""
ONCE_IN = 1e-9
"""Chance with which noise alone may exceed the limit of one tone, or of all states together."""
STATE_EDGES = (1e-3, 0.01, 0.05, 0.2, 0.5, 0.8, 0.95, 0.99, 0.999)
"""Quantiles between which a phase current, and its slope, count as one state: a limit is met in the last thousandth."""
PARTS = 4
"""Parts of a segment over which time is a state."""
FEWEST = 10
"""Samples of a state whose mean is judged."""
PART_OF_MATERIAL = 0.1
"""Of what a material error has, so much must show in the means over states: they hold a part of it."""


@dataclass(frozen=True)
class LackOfFit:
    """Structured error after the fit, in units of the noise rms; 0 where the noise explains everything."""

    sigma: float
    from_tones_sigma: float
    from_states_sigma: float
    from_bursts_sigma: float = 0.0
    from_ruled_out_sigma: float = 0.0
    """What a cause would take that was ruled out."""

    def with_ruled_out(self, sigma: float) -> LackOfFit:
        """With what a cause that was ruled out would take, in units of the noise rms."""
        return replace(self, from_ruled_out_sigma=sigma, sigma=max(self.sigma, sigma))


def lack_of_fit(
    model: Model, record: Record, layout: Layout, noise: Noise, numbers: int, tones_hz: Sequence[float] = ()
) -> LackOfFit:
    """Five measures, the largest counts: total power above the noise (beyond three standard errors of the noise
    estimate), power in single frequencies that noise would not show once in a thousand recordings, power around
    each excited tone, all segments and phases together, where what a model misses piles up first, and power that goes with the
    state: a law that is met in a few instants only, like a slew limit, shows in no line; and moments in which much more is left
    than in most.
    """
    power, count, line_power = 0.0, 0, 0.0
    around: list[list[_Around]] = [[] for _ in tones_hz]
    predicted = each_segment(lambda k: predict(model, record, k, layout).currents_a, record)
    residuals = [s.currents_a - expected for s, expected in zip(record.segments, predicted, strict=True)]
    whitened: list[Array] = []
    for segment, residual in zip(record.segments, residuals, strict=True):
        white = whiten(residual, segment.is_good, noise, record.facts.sample_period_s)
        power += float(white @ white)
        count += segment.good_count * record.facts.phases
        period = record.facts.sample_period_s
        n = segment.count
        transform = np.fft.rfft(np.where(segment.is_good, residual, 0.0), axis=1) / noise.weights(n, period)
        spectrum = np.abs(transform[:, 1:]) ** 2 / n
        # the whitened residual in its place in time
        whitened.append(np.fft.irfft(transform, n, axis=1))
        limit = np.log(spectrum.size * len(record.segments)) + 7.0
        high = spectrum > limit
        line_power += 2.0 * float((spectrum[high] - 1.0).sum())
        for rows, one in zip(around, _around_tones(spectrum, n * period, tones_hz), strict=True):
            rows.append(one)
    excess = power / max(count - numbers, 1) - 1.0
    uncertainty_here = 3.0 * float(np.hypot(noise.uncertainty, np.sqrt(2.0 / count)))
    by_power = float(np.sqrt(excess)) if excess > uncertainty_here else 0.0
    at_tones = 2.0 * sum(_excess(rows, noise.uncertainty) for rows in around)
    # the lines that coarse steps make are counted with the noise already
    by_lines, by_tones, by_states = (
        float(np.sqrt(max(power / count - noise.rounding_share, 0.0)))
        for power in (line_power, at_tones, _by_state(record, predicted, whitened, noise))
    )
    by_bursts = bursts_sigma(residuals, record, noise, has_causes=any(t.effect for t in model.terms))
    largest = max(by_power, by_lines, by_tones, by_states, by_bursts)
    return LackOfFit(largest, by_tones, by_states, by_bursts)


def _by_state(record: Record, predicted: Sequence[Array], whitened: Sequence[Array], noise: Noise) -> float:
    """Power of the `whitened` residual's means over states of a phase, beyond chance and material (else 0): over its current,
    over its slope, over both, or over time, whichever shows most.
    """
    bins = len(STATE_EDGES) + 1
    means = [_Means() for _ in range(4)]
    material = 0.0
    for phase in range(record.facts.phases):
        current = [expected[phase] for expected in predicted]
        slope = [np.gradient(one) for one in current]
        edges = [np.quantile(np.concatenate(some), STATE_EDGES) for some in (current, slope)]
        total, samples = np.zeros((bins, bins)), np.zeros((bins, bins))
        for segment, white, i, d in zip(record.segments, (w[phase] for w in whitened), current, slope, strict=True):
            good = segment.is_good
            at = (np.searchsorted(edges[0], i[good]), np.searchsorted(edges[1], d[good]))
            np.add.at(total, at, white[good])
            np.add.at(samples, at, 1.0)
            parts = zip(np.array_split(np.where(good, white, 0.0), PARTS), np.array_split(good, PARTS), strict=True)
            means[3].add(*(np.array(one) for one in zip(*((w.sum(), g.sum()) for w, g in parts), strict=True)))
            material += float(np.sum(i**2)) * (RULES.material_share / noise.sigma_a[phase]) ** 2
        for over, one in zip(((1,), (0,), ()), means, strict=False):
            one.add(total.sum(axis=over), samples.sum(axis=over))
    seen = [m.excess for m in means if m.is_beyond_chance and m.excess > PART_OF_MATERIAL * material]
    return max(seen, default=0.0)


@dataclass
class _Means:
    """Power of means over states in units of the noise's, one for every state that has samples enough."""

    power: float = 0.0
    states: int = 0

    def add(self, sums: Array, samples: Array) -> None:
        kept = samples >= FEWEST
        self.power += float((sums[kept] ** 2 / samples[kept]).sum())
        self.states += int(kept.sum())

    @property
    def excess(self) -> float:
        return self.power - self.states

    @property
    def is_beyond_chance(self) -> bool:
        return self.power > 2.0 * float(gammainccinv(0.5 * max(self.states, 1), ONCE_IN))


@dataclass(frozen=True)
class _Around:
    """Power in `bins` bins around a tone in units of the noise's, and the mean of `beside` bins next to them."""

    power: float
    bins: int
    beside_power: float
    beside: int


def _around_tones(spectrum: Array, seconds: float, tones_hz: Sequence[float]) -> list[_Around]:
    """`spectrum` (phases, k) of the bins 1, 2, ... in units of the noise's."""
    bins = np.arange(1, spectrum.shape[1] + 1)
    far = np.array([np.abs(bins - round(f * seconds)) for f in tones_hz]).reshape(len(tones_hz), bins.size)
    is_tone = far <= TONE_BINS
    beside = (far <= BESIDE_BINS) & ~is_tone.any(axis=0)
    return [
        _Around(float(spectrum[:, at].sum()), spectrum[:, at].size, float(spectrum[:, by].sum()), spectrum[:, by].size)
        for at, by in zip(is_tone, beside, strict=True)
    ]


def _excess(rows: Sequence[_Around], uncertainty: float) -> float:
    """Power around one tone beyond the noise, measured or beside the tone, if chance does not make it (else 0)."""
    power, bins = sum(r.power for r in rows), sum(r.bins for r in rows)
    beside = sum(r.beside for r in rows)
    if not bins:
        return 0.0
    level = max(sum(r.beside_power for r in rows) / beside, 1.0) if beside else 1.0
    uncertainty_here = uncertainty + (1.0 / np.sqrt(beside) if beside else 0.0)
    limit = level * (float(gammainccinv(bins, ONCE_IN)) + 3.0 * uncertainty_here * bins)
    return power - level * bins if power > limit else 0.0
