"""The error of both models over everything it may depend on, binned for reading; its spectrum, its tie to the command."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.line_classes import class_bins
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import TO_PHASES, Record, Segment
from commissioner.diagnose.plant.model import Layout, Model
from commissioner.diagnose.plant.prediction import Prediction, predict

Array = NDArray[np.float64]
BINS = 40
SPECTRUM_POINTS = 1500
LONGEST_LAG_S, LAGS = 0.05, 160


@dataclass(frozen=True)
class Curve:
    """Mean error (A) of both models in bins of one quantity, with the standard error of a bin's mean."""

    label: str
    at: Array
    before_a: Array
    after_a: Array
    spread_a: Array


@dataclass(frozen=True)
class Spectrum:
    """Lines of the error (A rms) of the longest segment, the largest of each of at most SPECTRUM_POINTS neighbourhoods,
    and the error by class of frequency over all segments, as a multiple of what noise alone would make there.
    """

    frequency_hz: Array
    before_a: Array
    after_a: Array
    noise_a: Array
    by_class: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Correlation:
    """Error along the axis correlated with the command `lag_s` earlier, in standard deviations of noise alone.

    L. Ljung, System Identification, 2nd ed., sec. 16.6: outside +-2.58 (99 %) the model misses something linear.
    """

    lag_s: Array
    before: Array
    after: Array


@dataclass(frozen=True)
class Residuals:
    """What the figures of the report show."""

    curves: tuple[Curve, ...]
    by_axis_deg: Array
    by_axis_before_a: Array
    by_axis_after_a: Array
    time_s: Array
    """Since the first sample."""
    time_before_a: Array
    time_after_a: Array
    spectrum: Spectrum
    correlation: Correlation


@dataclass(frozen=True)
class _Errors:
    """Errors (phases, n) of both models in one segment, and what the extended one predicts."""

    segment: Segment
    before: Array
    after: Array
    prediction: Prediction

    def along(self) -> tuple[Array, Array]:
        """Both errors projected on the excited axis, zero where samples are bad."""
        one, two = (replace(self.segment, currents_a=e).axis_current_a for e in (self.before, self.after))
        return np.where(self.segment.is_good, one, 0.0), np.where(self.segment.is_good, two, 0.0)


def residuals(
    record: Record, layout: Layout, nominal: Model, extended: Model, noise: Noise, tones_hz: Sequence[float] = ()
) -> Residuals:
    """Binned errors of phase u ... w together, along the excited axis where an axis is meant."""
    errors = []
    for k, segment in enumerate(record.segments):
        one, two = predict(nominal, record, k, layout), predict(extended, record, k, layout)
        errors.append(_Errors(segment, segment.currents_a - one.currents_a, segment.currents_a - two.currents_a, two))
    parts: dict[str, list[Array]] = {
        k: [] for k in (*LABELS, *(f"{name}{of}" for name in ("before", "after") for of in ("", "_along", "_size")))
    }
    axes: dict[float, list[tuple[float, float, int]]] = {}
    blocks: list[tuple[float, float, float]] = []
    for error in errors:
        _collect(parts, error)
        good = error.segment.is_good
        before, after = error.before[:, good], error.after[:, good]
        axes.setdefault(error.segment.axis_deg, []).append(
            (float((before**2).sum()), float((after**2).sum()), before.size)
        )
        blocks.extend(_blocks(error.segment.time_s[good] - record.segments[0].time_s[0], before, after))
    order = sorted(axes)
    power = np.array([np.sum(axes[a], axis=0) for a in order])
    table = np.array(blocks)
    period = record.facts.sample_period_s
    return Residuals(
        tuple(_curve(label, np.concatenate(parts[key]), parts) for key, label in LABELS.items()),
        np.array(order),
        np.sqrt(power[:, 0] / power[:, 2]),
        np.sqrt(power[:, 1] / power[:, 2]),
        table[:, 0],
        table[:, 1],
        table[:, 2],
        _spectrum(errors, noise, tones_hz, period),
        _correlation(errors, noise, period),
    )


LABELS: Mapping[str, str] = {
    "current": "phase current / A",
    "voltage": "axis voltage / V",
    "flux": "iron flux / Wb",
    "slope": "di/dt / (A/s)",
}


def _collect(parts: dict[str, list[Array]], error: _Errors) -> None:
    """Phase by phase against the phase's own current and slope; along the axis against its voltage; of all phases against the flux,
    for along the axis two sensors show their noise larger on some axes than on others.
    """
    segment, prediction = error.segment, error.prediction
    good, count = segment.is_good, error.before.shape[0]
    slope = np.gradient(prediction.currents_a, segment.period_s, axis=1)
    parts["flux"].append(np.hypot(*prediction.iron_flux_wb)[good])
    parts["voltage"].append(segment.voltage_axis_v[good])
    for name, value, along in zip(("before", "after"), (error.before, error.after), error.along(), strict=True):
        parts[f"{name}_along"].append(along[good])
        parts[f"{name}_size"].append(np.sqrt(np.mean(value[:, good] ** 2, axis=0)))
        parts[name].append(value[:, good].ravel())
    parts["current"].append(prediction.currents_a[:, good].ravel())
    parts["slope"].append(slope[:count, good].ravel())


def _curve(label: str, x: Array, parts: Mapping[str, list[Array]]) -> Curve:
    """Equal-count bins. Against flux (never negative) the size of the error is shown."""
    which_error = {LABELS["voltage"]: "_along", LABELS["flux"]: "_size"}.get(label, "")
    before, after = (np.concatenate(parts[f"{name}{which_error}"]) for name in ("before", "after"))
    every = max(x.size // 50_000, 1)
    edges = np.unique(np.quantile(x[::every], np.linspace(0.0, 1.0, BINS + 1)))
    if edges.size < 2:
        edges = np.array([edges[0], edges[0] + 1.0])
    which = np.clip(np.digitize(x, edges) - 1, 0, edges.shape[0] - 2)
    count = np.bincount(which, minlength=edges.shape[0] - 1)
    filled = count > 0

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(which, values, minlength=count.size)[filled] / count[filled])

    if "flux" in label:
        return Curve(label, mean(x), np.sqrt(mean(before**2)), np.sqrt(mean(after**2)), np.zeros(int(filled.sum())))
    return Curve(label, mean(x), mean(before), mean(after), np.sqrt(mean(after**2) / count[filled]))


def _blocks(time: Array, before: Array, after: Array) -> list[tuple[float, float, float]]:
    edges = np.linspace(0, time.shape[0], 9).astype(int)
    return [
        (
            float(time[a:b].mean()),
            float(np.sqrt(np.mean(before[:, a:b] ** 2))),
            float(np.sqrt(np.mean(after[:, a:b] ** 2))),
        )
        for a, b in itertools.pairwise(edges)
        if b > a
    ]


def _axis_density(segment: Segment, noise: Noise, samples: int, period_s: float) -> Array:
    """Expected power |X(f)|^2 / samples of the noise in the axis current."""
    angle = np.deg2rad(segment.axis_deg)
    weights = TO_PHASES[: segment.currents_a.shape[0]] @ np.array([np.cos(angle), np.sin(angle)])
    density: Array = (weights / float(weights @ weights)) ** 2 @ noise.weights(samples, period_s) ** 2
    return density


def _spectrum(errors: Sequence[_Errors], noise: Noise, tones_hz: Sequence[float], period_s: float) -> Spectrum:
    """Second half of every segment, where the start has decayed; Blackman window as in `split`."""
    longest = max(errors, key=lambda e: e.segment.count)
    sums: dict[str, Array] = {}
    for error in errors:
        n = error.segment.count // 2
        window = np.blackman(n)
        power = [np.abs(np.fft.rfft((e[-n:] - e[-n:].mean()) * window)) ** 2 for e in error.along()]
        expected = _axis_density(error.segment, noise, n, period_s) * float(window @ window)
        bins = class_bins(tones_hz, n, period_s)
        near = np.concatenate([np.r_[0:3], *([b + k for b in bins.values() for k in range(-3, 4)])]).astype(int)
        bins["other"] = np.setdiff1d(np.arange(expected.size), near)
        for name, at in bins.items():
            totals = np.array([float(p[at].sum()) for p in (*power, expected)])
            sums[name] = sums.get(name, np.zeros(3)) + totals
        if error is longest:
            scale = 2.0 / (n * float(window @ window))
            lines = [np.sqrt(scale * p[1:]) for p in (*power, expected)]
            frequency = np.fft.rfftfreq(n, period_s)[1:]
    by_class = {k: (float(np.sqrt(s[0] / s[2])), float(np.sqrt(s[1] / s[2]))) for k, s in sums.items() if s[2] > 0}
    edges = np.unique(np.searchsorted(frequency, np.geomspace(frequency[0], frequency[-1], SPECTRUM_POINTS)))
    before, after, quiet = (np.maximum.reduceat(line, edges) for line in lines)
    return Spectrum(np.asarray(frequency[edges], dtype=np.float64), before, after, quiet, by_class)


def _correlation(errors: Sequence[_Errors], noise: Noise, period_s: float) -> Correlation:
    """Sums over segments; noise alone, coloured or not, gives a standard normal variable at every lag."""
    step = max(round(LONGEST_LAG_S / period_s / LAGS), 1)
    lags = step * np.arange(-LAGS // 8, LAGS)
    total, variance = np.zeros((2, lags.size)), 0.0
    for error in errors:
        segment = error.segment
        n = segment.count
        size = 2 * n
        command = np.fft.rfft(segment.voltage_axis_v - segment.voltage_axis_v.mean(), size)
        for k, along in enumerate(error.along()):
            total[k] += np.fft.irfft(np.fft.rfft(along, size) * np.conj(command), size)[lags % size]
        power = np.abs(command) ** 2
        power[1:-1] *= 2.0
        variance += float(power @ _axis_density(segment, noise, size, period_s)) / size
    return Correlation(np.asarray(lags * period_s, dtype=np.float64), *(total / np.sqrt(max(variance, 1e-300))))
