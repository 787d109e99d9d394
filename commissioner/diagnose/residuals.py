"""The error of both models over everything it may depend on, binned for reading, and its spectrum by line class."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.model import Layout, Model
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.plant import Prediction, predict
from commissioner.diagnose.record import Record, Segment

Array = NDArray[np.float64]
BINS = 40


@dataclass(frozen=True)
class Curve:
    """Mean error (A) of both models in bins of one quantity, with the standard error of a bin's mean."""

    label: str
    at: Array
    before_a: Array
    after_a: Array
    spread_a: Array


@dataclass(frozen=True)
class Residuals:
    """What the figures of the report show. `spectrum`: frequency, before, after (A rms per line) of the longest segment."""

    curves: tuple[Curve, ...]
    by_axis_deg: Array
    by_axis_before_a: Array
    by_axis_after_a: Array
    time_s: Array
    time_before_a: Array
    time_after_a: Array
    spectrum_hz: Array
    spectrum_before_a: Array
    spectrum_after_a: Array
    spectrum_noise_a: float


def residuals(record: Record, layout: Layout, nominal: Model, extended: Model, noise: Noise) -> Residuals:
    """Binned errors of phase u ... w together, along the excited axis where an axis is meant."""
    parts: dict[str, list[Array]] = {k: [] for k in (*LABELS, "before", "after", "before_along", "after_along")}
    axes: dict[float, list[tuple[float, float, int]]] = {}
    blocks: list[tuple[float, float, float]] = []
    for k, segment in enumerate(record.segments):
        one, two = predict(nominal, record, k, layout), predict(extended, record, k, layout)
        good = segment.is_good
        before, after = segment.currents_a - one.currents_a, segment.currents_a - two.currents_a
        _collect(parts, segment, before, after, two)
        sums = (float((before[:, good] ** 2).sum()), float((after[:, good] ** 2).sum()), int(good.sum()) * before.shape[0])
        axes.setdefault(segment.axis_deg, []).append(sums)
        blocks.extend(_blocks(segment.time_s[good], before[:, good], after[:, good]))
    longest = max(range(len(record.segments)), key=lambda k: record.segments[k].count)
    frequency, spectra = _spectra(record, longest, layout, nominal, extended)
    order = sorted(axes)
    power = np.array([np.sum(axes[a], axis=0) for a in order])
    table = np.array(blocks)
    return Residuals(
        tuple(_curve(label, np.concatenate(parts[key]), parts) for key, label in LABELS.items()),
        np.array(order), np.sqrt(power[:, 0] / power[:, 2]), np.sqrt(power[:, 1] / power[:, 2]),
        table[:, 0], table[:, 1], table[:, 2], frequency, spectra[0], spectra[1],
        float(noise.floor_a * np.sqrt(2.0 / record.segments[longest].count)),
    )


LABELS: Mapping[str, str] = {
    "current": "phase current / A", "voltage": "axis voltage / V", "flux": "iron flux / Wb", "slope": "di/dt / (A/s)",
}


def _collect(parts: dict[str, list[Array]], segment: Segment, before: Array, after: Array, prediction: Prediction) -> None:
    """Phase by phase against the phase's own current and slope; along the axis against its voltage and the flux."""
    good, count = segment.is_good, before.shape[0]
    slope = np.gradient(prediction.currents_a, float(np.median(np.diff(segment.time_s))), axis=1)
    parts["flux"].append(np.hypot(*prediction.iron_flux_wb)[good])
    parts["voltage"].append(segment.voltage_axis_v[good])
    for name, error in (("before", before), ("after", after)):
        along = replace(segment, currents_a=error).axis_current_a
        parts[f"{name}_along"].append(along[good])
        parts[name].append(error[:, good].ravel())
    parts["current"].append(prediction.currents_a[:, good].ravel())
    parts["slope"].append(slope[:count, good].ravel())


def _curve(label: str, x: Array, parts: Mapping[str, list[Array]]) -> Curve:
    """Equal-count bins. Against flux (never negative) the size of the error is shown."""
    which_error = "_along" if label in (LABELS["voltage"], LABELS["flux"]) else ""
    before, after = (np.concatenate(parts[f"{name}{which_error}"]) for name in ("before", "after"))
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
    which = np.clip(np.digitize(x, edges) - 1, 0, edges.shape[0] - 2)
    count = np.maximum(np.bincount(which, minlength=edges.shape[0] - 1), 1)

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(which, values, minlength=edges.shape[0] - 1) / count)

    if "flux" in label:
        return Curve(label, mean(x), np.sqrt(mean(before**2)), np.sqrt(mean(after**2)), np.zeros(count.shape[0]))
    return Curve(label, mean(x), mean(before), mean(after), np.sqrt(mean(after**2) / count))


def _blocks(time: Array, before: Array, after: Array) -> list[tuple[float, float, float]]:
    edges = np.linspace(0, time.shape[0], 9).astype(int)
    return [
        (float(time[a:b].mean()), float(np.sqrt(np.mean(before[:, a:b] ** 2))), float(np.sqrt(np.mean(after[:, a:b] ** 2))))
        for a, b in itertools.pairwise(edges) if b > a
    ]


def _spectra(record: Record, k: int, layout: Layout, nominal: Model, extended: Model) -> tuple[Array, list[Array]]:
    segment = record.segments[k]
    n = segment.count
    window = np.hanning(n)
    out = []
    for model in (nominal, extended):
        left = np.where(segment.is_good, segment.currents_a - predict(model, record, k, layout).currents_a, 0.0)
        power = np.mean(np.abs(np.fft.rfft(left * window, axis=1)) ** 2, axis=0)
        out.append(np.sqrt(2.0 * power / (n * float(window @ window))))
    return np.fft.rfftfreq(n, record.facts.sample_period_s), out
