"""Model-free split of a multisine response into excited, odd, even, other and drifting power.

R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., ch. 4. With few tones the odd and
even lines are the sums of three (odd) and two (even) excited frequencies; what moves between repeats is drifting.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.intake.audit import excited_lines
from commissioner.diagnose.intake.noise import repeats
from commissioner.diagnose.intake.record import Record, Segment

MOST_TONES = 12


@dataclass(frozen=True)
class Split:
    """Power by line class in dB relative to the excited lines, mean over segments; a class that cannot be formed is not there."""

    level_db: Mapping[str, float]
    tones_hz: tuple[float, ...]


def split_lines(record: Record) -> Split:
    """Levels of the axis current's line classes over the second half of every segment."""
    tones = excited_lines(record)
    if not 1 <= len(tones) <= MOST_TONES:
        return Split({}, tuple(tones))
    collected: dict[str, list[float]] = {"excited": [], "odd": [], "even": [], "cross_axis": []}
    for segment in record.segments:
        for name, value in _segment_levels(segment, tones, record.facts.sample_period_s).items():
            collected[name].append(value)
    power = {name: float(np.mean(values)) for name, values in collected.items() if values}
    power["drifting"] = _drifting(record)
    reference = max(power.get("excited", 0.0), 1e-300)
    return Split({n: float(10.0 * np.log10(p / reference)) for n, p in power.items() if p > 0.0}, tuple(tones))


def _segment_levels(segment: Segment, tones: list[float], period: float) -> dict[str, float]:
    n = segment.count // 2
    angle = np.deg2rad(segment.axis_deg)
    currents = np.where(segment.is_good, segment.currents_a, 0.0)
    alpha = currents[0]
    beta = (currents[0] + 2.0 * currents[1]) / np.sqrt(3.0)
    along = (alpha * np.cos(angle) + beta * np.sin(angle))[-n:]
    across = (beta * np.cos(angle) - alpha * np.sin(angle))[-n:]
    window = np.blackman(n)
    spectrum = np.abs(np.fft.rfft((along - along.mean()) * window)) ** 2
    cross = np.abs(np.fft.rfft((across - across.mean()) * window)) ** 2
    bins = class_bins(tones, n, period)
    return {k: _mean(spectrum, bins[k]) for k in ("excited", "odd", "even")} | {
        "cross_axis": _mean(cross, bins["excited"])
    }


def class_bins(tones: Sequence[float], samples: int, period_s: float) -> dict[str, NDArray[np.int64]]:
    """Bins of a spectrum of so many samples by class: `excited`, and for few tones `odd` and `even` distortion."""
    width = 1.0 / (samples * period_s)
    frequencies = {"excited": list(tones)}
    if len(tones) <= MOST_TONES:
        frequencies["odd"] = [f for f in _sums(tones, 3) if _is_free(f, tones, width)]
        frequencies["even"] = [f for f in _sums(tones, 2) if _is_free(f, tones, width)]
    out = {}
    for name, listed in frequencies.items():
        index = np.unique(np.round(np.array(listed) / width).astype(np.int64))
        out[name] = index[(index > 0) & (index <= samples // 2)]
    return out


def _sums(tones: Sequence[float], order: int) -> list[float]:
    out = {0.0}
    for _ in range(order):
        out = {round(abs(a + s * f), 6) for a in out for f in tones for s in (-1.0, 1.0)}
    return sorted(out)


def _is_free(f: float, tones: Sequence[float], width: float) -> bool:
    return f > 4.0 * width and all(abs(f - t) > 4.0 * width for t in tones)


def _mean(spectrum: NDArray[np.float64], bins: NDArray[np.int64]) -> float:
    return float(np.mean(spectrum[bins])) if bins.size else 0.0


def _drifting(record: Record) -> float:
    pairs = repeats(record)
    if not pairs:
        return 0.0
    a, b = pairs[0]
    first, second = record.segments[a], record.segments[b]
    n = min(first.count, second.count)
    difference = first.axis_current_a[:n] - second.axis_current_a[:n]
    return float(np.mean(np.abs(np.fft.rfft(difference * np.blackman(n))) ** 2))
