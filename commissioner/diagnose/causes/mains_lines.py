"""Lines bound to the mains: ripple of the link and pickup of the sensors, found in a residual and laid down as functions of time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammainccinv

from commissioner.diagnose.intake.audit import excited_lines
from commissioner.diagnose.intake.noise import Noise
from commissioner.diagnose.intake.record import TO_PHASES, Named, Record, Segment, each_segment
from commissioner.diagnose.plant.model import Layout, Model, impedance
from commissioner.diagnose.plant.prediction import predict
from commissioner.estimation.cancelling import ask_for_time

Array = NDArray[np.float64]
HARMONICS = {"mains": (3, 5, 7), "ripple": (2,)}
"""Mains hum comes distorted; a rectifier's ripple is no sine."""
RIPPLE_HZ = (100.0, 120.0, 300.0, 360.0)
MAINS_HZ = (50.0, 60.0)
SEARCH = 0.008
"""Relative range in which a mains-bound frequency is looked for (grid codes allow 1 %, seconds-long records see less)."""
MOST_PEAKS, WEIGHED_SAMPLES = 3, 16384
"""Of each mains-bound frequency, so many that stand out are weighed, on so many samples of every segment."""
AT_A_TONE = 4.0
"""Lines beside an excited one that count as its own."""
BY_CHANCE = 1e-6
"""Chance with which noise makes a line at one frequency that counts as seen."""
SURELY_A_LINE = 100.0
"""Times the power beside it that a ripple has in a recorded link."""
SAME_LINE = 0.02
"""Turns by which two frequencies may come apart in a segment: every segment has its own phase."""


def with_clearer_lines(
    record: Record, model: Model, layout: Layout, noise: Noise, lines: Mapping[str, float], kept: Mapping[str, str]
) -> tuple[Record, Mapping[str, float]]:
    """The record with the lines that a better model shows where they differ from `lines`: a strong cause that was not in the
    model hides them. Lines of the kinds that are `kept`, whose causes the model has, stay near where they are.
    """
    # what the model has of a line is in the residual as well where the line is looked for
    bare = model
    for kind in kept.values():
        bare = bare.without(kind)
    residuals = each_segment(
        lambda k: record.segments[k].currents_a - predict(bare, record, k, layout).currents_a, record
    )
    readings = len(residuals)
    clear = float(gammainccinv(readings, BY_CHANCE) / gammainccinv(readings, 0.5))
    longest = max(s.count for s in record.segments) * record.facts.sample_period_s
    fresh: dict[str, float] = {}
    for (old, known), (new, (frequency, ratio)) in zip(
        lines.items(), found_lines(record, residuals, model, noise).items(), strict=True
    ):
        is_same = old == new and abs(frequency - known) * longest < SAME_LINE
        is_old = is_same or ratio < clear or (old != new and new.partition("_")[0] in kept)
        fresh |= {old: known} if is_old else {new: frequency}
    return (record, lines) if fresh == lines else (with_lines(record, fresh), fresh)


def line_entry(kind: str, sizes: Mapping[str, float], lines_hz: Mapping[str, float]) -> dict[str, float | str]:
    """Amplitude and refined frequency of a mains-bound line, as a scenario of the simulated inverter states them."""
    name, frequency = next((k, f) for k, f in lines_hz.items() if k.startswith(kind))
    base = name.rpartition("_")[2]
    return {"size": next(v for k, v in sizes.items() if k.startswith(f"amplitude_{base}")), "frequency_hz": frequency}


def found_lines(
    record: Record, residuals: Sequence[Array], model: Model, noise: Noise
) -> dict[str, tuple[float, float]]:
    """Of ripple and mains each the frequency that explains or stands out most, Hz, and by how much it stands out (`ripple_300`: ...)."""
    tones = np.array(excited_lines(record))
    drive = _ripple_drive(record, residuals, model, noise, tones)
    driven = [(base, *peak) for base in RIPPLE_HZ for peak in _peaks(record, drive, base)]
    # what one tone's error or another side line makes of the command may stand out more, but explains less
    gains = _ripple_gains(record, residuals, model, noise, tones, [frequency for _, frequency, _ in driven])
    ripple, ripple_hz, ripple_ratio = driven[int(np.argmax(gains))]
    mains, mains_hz, mains_ratio = max(
        ((base, *_peaks(record, residuals, base)[0]) for base in MAINS_HZ), key=lambda found: found[2]
    )
    return {f"ripple_{ripple:.0f}": (ripple_hz, ripple_ratio), f"mains_{mains:.0f}": (mains_hz, mains_ratio)}


def recorded_sag(record: Record) -> list[Array]:
    """Of a recorded DC link, for every segment, what it deviates from its median without its ripple, (n,); empty where it was not
    recorded. A line that two tones make together is no ripple.
    """
    swings = [s.link_swing for s in record.segments if s.link_swing is not None]
    if len(swings) < len(record.segments):
        return []
    for base in RIPPLE_HZ:
        frequency, ratio = _peaks(record, [swing[None] for swing in swings], base)[0]
        if ratio > SURELY_A_LINE and not is_made_by_tones(record, frequency):
            swings = [_without_line(s, swing, frequency) for s, swing in zip(record.segments, swings, strict=True)]
    return swings


def is_made_by_tones(record: Record, *hertz: float) -> bool:
    """Whether two excited tones lie so far apart, or make so much together, as one of these, within two lines of the longest segment."""
    tones = np.array(excited_lines(record))
    made = np.abs(np.concatenate([(tones[:, None] - tones).ravel(), (tones[:, None] + tones).ravel()]))
    width = 2.0 / max(s.count * record.facts.sample_period_s for s in record.segments)
    return any(bool((np.abs(made - f) < width).any()) for f in hertz)


def _without_line(segment: Segment, signal: Array, frequency: float) -> Array:
    table = np.hstack([_cos_and_sin(segment, k * frequency) for k in (1.0, *HARMONICS["ripple"])])
    return np.asarray(signal - table @ np.linalg.lstsq(table, signal, rcond=None)[0])


def without_lines(record: Record) -> Record:
    others = sum(name.partition("_")[0].partition("x")[0] not in HARMONICS for name in record.channel_names)
    return replace(
        record, channel_names=record.channel_names[:others], channels=tuple(c[:, :others] for c in record.channels)
    )


def with_lines(record: Record, lines: Mapping[str, float]) -> Record:
    """The record with these lines as its last channels, in place of those it had."""
    return without_lines(record).with_channels(*courses_of(record, lines))


def courses_of(record: Record, lines: Mapping[str, float]) -> list[Named]:
    """Cosine and sine of these lines and of their harmonics below the sampling's, at every sample."""
    out = []
    for name, frequency in lines.items():
        out.append(_line(record, name, frequency))
        for order in HARMONICS[name.partition("_")[0]]:
            if order * frequency * record.facts.sample_period_s < 0.45:
                out.append(_line(record, f"{name}x{order}", order * frequency))
    return out


@dataclass(frozen=True)
class _Along:
    """A segment's residual along its axis, seen through the four-parameter machine; `power` (bins,) of its noise, `is_free` (bins,)
    of the lines beside the tones: an error at one tone, times another, is no ripple.
    """

    residual: Array
    impedance: NDArray[np.complex128]
    power: Array
    is_free: NDArray[np.bool_]

    def freed(self, signal: Array) -> Array:
        """The signal without its lines at the tones."""
        return np.asarray(np.fft.irfft(np.where(self.is_free, np.fft.rfft(signal), 0.0), signal.size))


def _along(record: Record, segment: Segment, residual: Array, model: Model, noise: Noise, tones: Array) -> _Along:
    n, period = segment.count, record.facts.sample_period_s
    angle = np.deg2rad(segment.axis_deg)
    weights = TO_PHASES[: residual.shape[0]] @ np.array([np.cos(angle), np.sin(angle)])
    weights /= weights @ weights
    frequency = np.asarray(np.fft.rfftfreq(n, period), dtype=np.float64)
    is_free = np.all(np.abs(frequency[:, None] - tones) >= AT_A_TONE / (n * period), axis=1)
    return _Along(
        weights @ np.where(segment.is_good, residual, 0.0),
        impedance(model.nominal, frequency),
        weights**2 @ noise.weights(n, period) ** 2,
        is_free,
    )


def _ripple_drive(record: Record, residuals: Sequence[Array], model: Model, noise: Noise, tones: Array) -> list[Array]:
    """The residual as seen by a ripple: through the conjugate admittance over the noise's power, times the command (matched
    filter: G. Turin, IRE Trans. Inf. Theory 6(3), 1960); a ripple line stands out at its frequency.
    """
    out = []
    for segment, residual in zip(record.segments, residuals, strict=True):
        seen = _along(record, segment, residual, model, noise, tones)
        matched = np.where(seen.is_free, np.fft.rfft(seen.residual) / (np.conj(seen.impedance) * seen.power), 0.0)
        out.append((np.fft.irfft(matched, segment.count) * segment.voltage_axis_v)[None])
    return out


def _ripple_gains(
    record: Record, residuals: Sequence[Array], model: Model, noise: Noise, tones: Array, frequencies: Sequence[float]
) -> list[float]:
    """What ripples of these frequencies (Hz) each explain of the residual beside the tones, in chi2 to first order."""

    def of_segment(k: int) -> Array:
        segment = record.segments[k].first(WEIGHED_SAMPLES)
        seen = _along(record, segment, residuals[k][:, : segment.count], model, noise, tones)
        # what a start leaves would reach far beyond the tones' own lines
        window = np.hanning(segment.count)
        left = np.fft.rfft(window * seen.freed(seen.residual)) / np.sqrt(seen.power)
        time = np.arange(segment.count) * record.facts.sample_period_s
        gains = []
        for frequency in frequencies:
            pushed = [segment.voltage_axis_v * of(2.0 * np.pi * frequency * time) for of in (np.cos, np.sin)]
            currents = [np.fft.irfft(np.fft.rfft(v) / seen.impedance, v.size) for v in pushed]
            table = np.stack([np.fft.rfft(window * seen.freed(i)) / np.sqrt(seen.power) for i in currents])
            gram, slope = (table.conj() @ table.T).real, (table.conj() @ left).real
            gains.append(2.0 / segment.count * float(slope @ np.linalg.pinv(gram, hermitian=True) @ slope))
        return np.array(gains)

    return list(np.sum(each_segment(of_segment, record), axis=0))


def _peaks(record: Record, signals: Sequence[Array], base: float) -> list[tuple[float, float]]:
    """The frequencies near `base` where the signals are strongest, the strongest first, each with its power over the median beside
    the search.
    """
    period = record.facts.sample_period_s
    span = max(float(s.time_s[-1] - s.time_s[0]) for s in record.segments)
    grid = base * np.linspace(1 - SEARCH, 1 + SEARCH, 2 * int(8 * SEARCH * base * span) + 3)
    powers = _powers(signals, grid, period)
    # a line in a short segment is as wide as the search: what it stands out from lies beyond its skirts
    skirt = SEARCH * base + np.arange(3, 11) / span
    beside = _powers(signals, np.concatenate([base - skirt[::-1], base + skirt]), period)
    around = np.pad(powers, 1, constant_values=-np.inf)
    tops = np.flatnonzero((around[1:-1] > around[:-2]) & (around[1:-1] >= around[2:]))
    out = []
    for top in [int(k) for k in sorted(tops, key=lambda k: -powers[k])[:MOST_PEAKS]] or [0]:
        at = float(grid[top])
        if 0 < top < grid.shape[0] - 1:
            left, middle, right = powers[top - 1 : top + 2]
            bend = left - 2.0 * middle + right
            at += 0.5 * float((left - right) / bend) * float(grid[1] - grid[0]) if bend < 0 else 0.0
        out.append((at, float(powers[top] / max(float(np.median(beside)), 1e-300))))
    return out


def _powers(signals: Sequence[Array], frequency: Array, period: float) -> Array:
    powers = np.zeros(frequency.shape[0])
    for signal in signals:
        ask_for_time()
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
    return (f"{name}_cos", f"{name}_sin"), [_cos_and_sin(s, frequency) for s in record.segments]


def _cos_and_sin(segment: Segment, frequency: float) -> Array:
    """(n, 2) of the time within the segment: phases need not carry over pauses."""
    angle = 2.0 * np.pi * frequency * (segment.time_s - segment.time_s[0])
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)
