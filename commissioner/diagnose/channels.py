"""Known functions of time that effects ride on: heat doses, lagged power, ripple and mains lines, hats, phase patterns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.signal import lfilter
from scipy.special import gammainccinv

from commissioner.diagnose.audit import excited_lines
from commissioner.diagnose.model import Layout, Model
from commissioner.diagnose.noise import Noise
from commissioner.diagnose.plant import predict
from commissioner.diagnose.record import TO_PHASES, Record, Segment, each_segment

Array = NDArray[np.float64]
SAG_LAGS_S = (0.0003, 0.001, 0.003, 0.01, 0.03, 0.1)
HEAT_LEAKS_S = {"": np.inf, "_20s": 20.0, "_6s": 6.0}
"""Time constants (s) with which heat leaks away, by how the names end: in sums of these every course with one of 5 s or more is

there to 1 % of its power, from 20 s on to 0.03 %."""
STATOR_HEAT = (*(f"{kind}{leak}" for kind in ("own", "mean") for leak in HEAT_LEAKS_S), "time", "settling")
CAGE_HEAT = tuple(f"rotor_heat{kind}" for kind in (*HEAT_LEAKS_S, "_time", "_settling"))
"""Warmth that is carried over from segment to segment: of the windings by their own loss or the mean of the three, and of the cage."""
FRESH_STATOR_HEAT, FRESH_CAGE_HEAT = "fresh", "rotor_heat_fresh"
"""Of a motor that cools in the pauses, whatever the time stamps say."""
SETTLED = 4.0
"""Thermal time constants in a recording, for a temperature that settles within it."""
SPEED_KNOTS_S, MOST_SPEED_KNOTS = 0.4, 40
"""A shaft held by its load swings below about 1 Hz: cubic splines of this spacing follow it to a per cent."""
HARMONICS = {"mains": (3, 5, 7), "ripple": (2,)}
"""Mains hum comes distorted; a rectifier's ripple is no sine."""
RIPPLE_HZ = (100.0, 120.0, 300.0, 360.0)
MAINS_HZ = (50.0, 60.0)
SEARCH = 0.008
"""Relative range in which a mains-bound frequency is looked for (grid codes allow 1 %, seconds-long records see less)."""

AT_A_TONE = 4.0
"""Lines beside an excited one that count as its own."""
BY_CHANCE = 1e-6
"""Chance with which noise makes a line at one frequency that counts as seen."""
SAME_LINE = 0.02
"""Turns by which two frequencies may come apart in a segment: every segment has its own phase."""
LINES = {"ripple": "dc_link_ripple", "mains": "mains_pickup"}
"""The causes that ride on each kind of line."""


def add_channels(record: Record, model: Model, layout: Layout, noise: Noise) -> tuple[Record, dict[str, float]]:
    """The record with every known function of time, and the refined mains-bound frequencies (`ripple_300`: Hz)."""
    predictions = [predict(model, record, k, layout) for k in range(len(record.segments))]
    residuals = [s.currents_a - p.currents_a for s, p in zip(record.segments, predictions, strict=True)]
    lines = {name: frequency for name, (frequency, _) in _lines(record, residuals, model, noise).items()}
    return with_known(record, [p.rotor_current_a for p in predictions], lines), lines


def with_clearer_lines(
    record: Record, model: Model, layout: Layout, noise: Noise, lines: Mapping[str, float], kept: Sequence[str]
) -> tuple[Record, Mapping[str, float]]:
    """The record with the lines that a better model shows where they differ from `lines`: a strong cause that was not in the

    model hides them. Lines of the `kept` kinds, which the model has, stay near where they are.
    """
    # what the model has of a line is in the residual as well where the line is looked for
    bare = model
    for kind in kept:
        bare = bare.without(LINES[kind])
    residuals = each_segment(lambda k: record.segments[k].currents_a - predict(bare, record, k, layout).currents_a, record)
    readings = len(residuals)
    clear = float(gammainccinv(readings, BY_CHANCE) / gammainccinv(readings, 0.5))
    longest = max(s.count for s in record.segments) * record.facts.sample_period_s
    fresh: dict[str, float] = {}
    for (old, known), (new, (frequency, ratio)) in zip(lines.items(), _lines(record, residuals, model, noise).items(), strict=True):
        is_same = old == new and abs(frequency - known) * longest < SAME_LINE
        is_old = is_same or ratio < clear or (old != new and new.partition("_")[0] in kept)
        fresh |= {old: known} if is_old else {new: frequency}
    return (record, lines) if fresh == lines else (_with_lines(record, fresh), fresh)


def _lines(record: Record, residuals: Sequence[Array], model: Model, noise: Noise) -> dict[str, tuple[float, float]]:
    """Of ripple and mains each the frequency that stands out most, Hz, and by how much (`ripple_300`: ...)."""
    lines = {}
    for name, bases, build in (("ripple", RIPPLE_HZ, _ripple_drive), ("mains", MAINS_HZ, _mains_drive)):
        signals = build(record, residuals, model, noise)
        found = [_refine(record, signals, base) for base in bases]
        best = int(np.argmax([ratio for _, ratio in found]))
        lines[f"{name}_{bases[best]:.0f}"] = found[best]
    return lines


def with_known(record: Record, rotor_current_a: Sequence[Array], lines: Mapping[str, float]) -> Record:
    """The known functions of time in their fixed order, for given rotor currents and line frequencies."""
    record = _with(record, _phase_patterns(record))
    record = _with(record, _heat(record, rotor_current_a))
    record = _with(record, _sag(record))
    return _with_lines(_with(record, _hats(record)), lines)


def _with_lines(record: Record, lines: Mapping[str, float]) -> Record:
    """The record with these lines as its last channels, in place of those it had."""
    others = sum(name.partition("_")[0].partition("x")[0] not in HARMONICS for name in record.channel_names)
    record = replace(
        record, channel_names=record.channel_names[:others], channels=tuple(c[:, :others] for c in record.channels)
    )
    for name, frequency in lines.items():
        record = _with(record, _line(record, name, frequency))
        for order in HARMONICS[name.partition("_")[0]]:
            if order * frequency * record.facts.sample_period_s < 0.45:
                record = _with(record, _line(record, f"{name}x{order}", order * frequency))
    return record


Named = tuple[tuple[str, ...], list[Array]]


def _with(record: Record, named: Named) -> Record:
    return record.with_channels(named[0], tuple(np.ascontiguousarray(c) for c in named[1]))


def _phase_patterns(record: Record) -> Named:
    """Phase resistances of a second-harmonic tensor, constant: cos and sin of twice the phase angle."""
    double = 2.0 * np.arctan2(TO_PHASES[:, 1], TO_PHASES[:, 0])
    row = np.concatenate([np.cos(double), np.sin(double)])
    names = tuple(f"phase_{n}_{p}" for n in ("cos", "sin") for p in "uvw")
    return names, [np.tile(row, (s.count, 1)) for s in record.segments]


def _three_phases(segment: Segment) -> Array:
    currents = np.where(segment.is_good, segment.currents_a, 0.0)
    if currents.shape[0] == 3:
        return currents
    return np.vstack([currents, -currents.sum(axis=0)])


def _heat(record: Record, rotor: Sequence[Array]) -> Named:
    """Doses in minutes at rated current, carried over segments: own phase, and mean of phases, each with every leak; plain time

    and time towards a settled temperature (to the same end as the mean); own phase since the segment's start; the same of the rotor.
    """
    rates = [_heat_rates(record, s, current) for s, current in zip(record.segments, rotor, strict=True)]
    doses = [_doses(record, rates, leak) for leak in HEAT_LEAKS_S.values()]
    ends = {s.file: dose[:, -1] for s, dose in zip(record.segments, doses[0], strict=True)}
    out = []
    for segment, rate, *here in zip(record.segments, rates, *doses, strict=True):
        since = _since_start(record, segment)
        settling = np.expm1(-SETTLED * since) / np.expm1(-SETTLED)
        fresh = np.cumsum(rate, axis=1) - rate
        end = ends[segment.file]
        windings = [
            *(dose[:3] for dose in here), *(np.repeat(dose[:3].mean(axis=0)[None], 3, axis=0) for dose in here),
            *(np.repeat(end[:3].mean() * x[None], 3, axis=0) for x in (since, settling)), fresh[:3],
        ]
        cage = [*(dose[3] for dose in here), end[3] * since, end[3] * settling, fresh[3]]
        out.append(np.vstack([*windings, *cage]).T)
    names = tuple(f"heat_{kind}_{p}" for kind in (*STATOR_HEAT, FRESH_STATOR_HEAT) for p in "uvw")
    return (*names, *CAGE_HEAT, FRESH_CAGE_HEAT), out


def _heat_rates(record: Record, segment: Segment, rotor_current: Array) -> Array:
    """(4, n) minutes at rated current that each sample adds: by the loss of every phase, and of the cage."""
    power = np.vstack([_three_phases(segment) ** 2, 0.5 * (rotor_current**2).sum(axis=0)])
    return np.asarray(2.0 * power / record.facts.rated_current_peak_a**2 * record.facts.sample_period_s / 60.0)


def _doses(record: Record, rates: Sequence[Array], leak_s: float) -> list[Array]:
    """Heat at every sample from those before it: d dose/dt = rate - dose / leak, over the segments of a file and their pauses."""
    stays = float(np.exp(-record.facts.sample_period_s / leak_s))
    out: list[Array] = []
    before: Segment | None = None
    held = np.zeros(0)
    for segment, rate in zip(record.segments, rates, strict=True):
        is_first = before is None or before.file != segment.file
        pause = 0.0 if before is None else max(float(segment.time_s[0] - before.time_s[-1]), 0.0)
        held = np.zeros(rate.shape[0]) if is_first else held * np.exp(-pause / leak_s)
        dose, _ = lfilter([1.0], [1.0, -stays], rate, axis=1, zi=held[:, None])
        out.append(dose - rate)
        before, held = segment, dose[:, -1]
    return out


def _since_start(record: Record, segment: Segment) -> Array:
    """Time since the file's first sample as a share of its whole length."""
    times = [s.time_s for s in record.segments if s.file == segment.file]
    share: Array = (segment.time_s - times[0][0]) / max(float(times[-1][-1] - times[0][0]), 1e-9)
    return share


def _sag(record: Record) -> Named:
    """Minus lagged electrical power over rated power."""
    out = [-np.stack([lagged_power(record, s, lag) for lag in SAG_LAGS_S], axis=1) for s in record.segments]
    return tuple(f"sag_{lag * 1e3:g}ms" for lag in SAG_LAGS_S), out


def lagged_power(record: Record, segment: Segment, lag_s: float) -> Array:
    """Mean over each period, (n,), of the electrical power over rated power behind a lag; the command of a sample acts on the

    current until the next.
    """
    current = segment.axis_current_a
    over_the_period = 0.5 * (current + np.append(current[1:], current[-1]))
    power = 1.5 * segment.voltage_axis_v * over_the_period / record.facts.rated_power_w
    periods = record.facts.sample_period_s / lag_s
    arrives = -float(np.expm1(-periods))
    before = lfilter([0.0, arrives], [1.0, arrives - 1.0], power)
    return np.asarray(power + (before - power) * arrives / periods)


def _hats(record: Record) -> Named:
    out = []
    for segment in record.segments:
        seconds = segment.count * record.facts.sample_period_s
        intervals = int(np.clip(round(seconds / SPEED_KNOTS_S), 2, MOST_SPEED_KNOTS))
        knots = np.r_[np.zeros(3), np.linspace(0.0, 1.0, intervals + 1), np.ones(3)]
        out.append(BSpline.design_matrix(np.linspace(0.0, 1.0, segment.count), knots, 3).toarray())
    most = max(o.shape[1] for o in out)
    padded = [np.hstack([o, np.zeros((o.shape[0], most - o.shape[1]))]) for o in out]
    return tuple(f"hat_{k}" for k in range(most)), padded


def _mains_drive(record: Record, residuals: Sequence[Array], model: Model, noise: Noise) -> list[Array]:
    return [np.asarray(r) for r in residuals]


def _ripple_drive(record: Record, residuals: Sequence[Array], model: Model, noise: Noise) -> list[Array]:
    """The residual as seen by a ripple: through the conjugate admittance over the noise's power, times the command (matched

    filter: G. Turin, IRE Trans. Inf. Theory 6(3), 1960); a ripple line stands out at its frequency.
    """
    r_s, r_r, l_sigma, l_m = model.nominal
    tones = np.array(excited_lines(record))
    out = []
    for segment, residual in zip(record.segments, residuals, strict=True):
        n, period = segment.count, record.facts.sample_period_s
        angle = np.deg2rad(segment.axis_deg)
        weights = TO_PHASES[: residual.shape[0]] @ np.array([np.cos(angle), np.sin(angle)])
        along = weights @ np.where(segment.is_good, residual, 0.0)
        frequency = np.fft.rfftfreq(n, period)
        s = 2j * np.pi * frequency
        impedance = r_s + s * l_sigma + s * l_m * r_r / (r_r + s * l_m)
        matched = np.fft.rfft(along) / (np.conj(impedance) * (weights**2 @ noise.weights(n, period) ** 2))
        # an error at one tone, times another, is no ripple
        matched[(np.abs(frequency[:, None] - tones) < AT_A_TONE / (n * period)).any(axis=1)] = 0.0
        out.append((np.fft.irfft(matched, n) * segment.voltage_axis_v)[None])
    return out


def _refine(record: Record, signals: Sequence[Array], base: float) -> tuple[float, float]:
    """The frequency near `base` where the signals are strongest, and its power over the median beside the search."""
    period = record.facts.sample_period_s
    span = max(float(s.time_s[-1] - s.time_s[0]) for s in record.segments)
    grid = base * np.linspace(1 - SEARCH, 1 + SEARCH, 2 * int(8 * SEARCH * base * span) + 3)
    powers = _powers(signals, grid, period)
    # a line in a short segment is as wide as the search: what it stands out from lies beyond its skirts
    skirt = SEARCH * base + np.arange(3, 11) / span
    beside = _powers(signals, np.concatenate([base - skirt[::-1], base + skirt]), period)
    best = int(np.argmax(powers))
    at = float(grid[best])
    if 0 < best < grid.shape[0] - 1:
        left, middle, right = powers[best - 1 : best + 2]
        bend = left - 2.0 * middle + right
        at += 0.5 * float((left - right) / bend) * float(grid[1] - grid[0]) if bend < 0 else 0.0
    return at, float(powers[best] / max(float(np.median(beside)), 1e-300))


def _powers(signals: Sequence[Array], frequency: Array, period: float) -> Array:
    powers = np.zeros(frequency.shape[0])
    for signal in signals:
        window = np.hanning(signal.shape[1])
        powers += sum(np.abs(_zoom(row * window, frequency, period)) ** 2 for row in signal)
    return powers


def _zoom(signal: Array, frequency: Array, period: float) -> Array:
    """Fourier sums at a few frequencies after block averaging around the centre frequency."""
    centre = float(np.mean(frequency))
    n = signal.shape[0]
    block = max(1, int(0.02 / period))
    base = signal * np.exp(-2j * np.pi * centre * np.arange(n) * period)
    m = n // block
    slow = base[: m * block].reshape(m, block).sum(axis=1)
    at = (np.arange(m) * block + 0.5 * (block - 1)) * period
    return np.asarray(np.exp(-2j * np.pi * np.outer(frequency - centre, at)) @ slow)


def _line(record: Record, name: str, frequency: float) -> Named:
    """Cosine and sine of the time within the segment: phases need not carry over pauses."""
    out = []
    for segment in record.segments:
        angle = 2.0 * np.pi * frequency * (segment.time_s - segment.time_s[0])
        out.append(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return (f"{name}_cos", f"{name}_sin"), out
