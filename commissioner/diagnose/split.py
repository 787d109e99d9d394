"""Model-free split of a multisine response into excited, odd, even, other and drifting power.

R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd ed., ch. 4. With few tones the odd and
even lines are the sums of three (odd) and two (even) excited frequencies; what moves between repeats is drifting.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from commissioner.diagnose.audit import excited_lines
from commissioner.diagnose.noise import repeats
from commissioner.diagnose.record import Record, Segment

MOST_TONES = 12


@dataclass(frozen=True)
class Split:
    """Power by line class in dB relative to the excited lines, mean over segments; NaN where it cannot be formed."""

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
    return Split(
        {n: float(10.0 * np.log10(max(p, 1e-300) / reference)) for n, p in power.items()}, tuple(tones)
    )


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
    width = 1.0 / (n * period)
    excited = _at(spectrum, tones, width)
    odd = _at(spectrum, [f for f in _sums(tones, 3) if _is_free(f, tones, width)], width)
    even = _at(spectrum, [f for f in _sums(tones, 2) if _is_free(f, tones, width)], width)
    cross = np.abs(np.fft.rfft((across - across.mean()) * window)) ** 2
    return {"excited": excited, "odd": odd, "even": even, "cross_axis": _at(cross, tones, width)}


def _sums(tones: list[float], order: int) -> list[float]:
    out = {0.0}
    for _ in range(order):
        out = {round(abs(a + s * f), 6) for a in out for f in tones for s in (-1.0, 1.0)}
    return sorted(out)


def _is_free(f: float, tones: list[float], width: float) -> bool:
    return f > 4.0 * width and all(abs(f - t) > 4.0 * width for t in tones)


def _at(spectrum: np.ndarray, frequencies: list[float], width: float) -> float:
    index = np.unique(np.round(np.array(frequencies) / width).astype(int))
    index = index[(index > 0) & (index < spectrum.shape[0])]
    return float(np.mean(spectrum[index])) if index.size else 0.0


def _drifting(record: Record) -> float:
    pairs = repeats(record)
    if not pairs:
        return 0.0
    a, b = pairs[0]
    first, second = record.segments[a], record.segments[b]
    n = min(first.count, second.count)
    difference = first.axis_current_a[:n] - second.axis_current_a[:n]
    return float(np.mean(np.abs(np.fft.rfft(difference * np.blackman(n))) ** 2))
