"""Measurement noise, from data that hold no model: repeats, zero voltage, the sum of three currents, quiet frequencies.

Spectrum: medians of the periodogram in bins of constant ratio (a median ignores the few lines a distortion leaves),
so white, 1/f^g and autoregressive noise need no choice of order. Whitening weights the Fourier transform of residual
and sensitivities alike (P. Whittle, 1953).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize
from scipy.special import erfc, gammainccinv

from commissioner.diagnose.intake.record import Record, Segment

Array = NDArray[np.float64]
BINS_PER_DECADE = 10
SHORTEST_RECORD = 400
RISING_LIKELIHOOD = 8.0
"""Log-likelihood a 1/f^g part must gain over white to be believed (two numbers; p about 3e-4: cheap to believe)."""
SLOW_BINS = 6.0
"""Below so many bins of the shortest noise record the window smears the spectrum; the power law takes over."""
SLOW_MARGIN = 1.6
"""Power margin on the extrapolated part: one recording shows few periods of the slowest noise."""
RESOLVED = 3e-5
"""Share of the current's peak below which nothing counts: 15 bits. No drive's converter resolves more, nor does a law's form, where a
simulation adds no noise.
"""
NOTHING_MORE = 1e-6
"""Of the variance."""
MAINS_HZ, LOBE_BINS, AROUND_BINS = (50.0, 60.0), 5, 16
"""Mains lines, and bins next to one: those that its skirts fill, and those that tell what is noise there."""
STANDS_OUT, ONCE_IN = 1.5, 1e-6
"""A line is none of the noise where its bins hold so many times what chance makes of them once in so many recordings."""
FOLLOWS = 25.0
"""Variance ratio (F) from which the sum of the currents follows the currents: five standard deviations of each number."""
SPIKE, RARE = 12.0, 1e-3
"""Of the median deviation, and of the samples: fewer than these beyond that are spikes, not noise."""
WHITE_WITHIN = 0.12
"""A spectrum flat within this fraction everywhere is taken as white (whitening then costs nothing)."""


@dataclass(frozen=True)
class Noise:
    """`sigma_a` (phases,) rms of one sample; `density` (phases, b) relative to white at `frequency_hz` (b,).

    `uncertainty` is the relative standard error of the variance; `is_known` False where it had to be taken from quiet
    frequencies of the same record, which counts broadband structure as noise.
    """

    sigma_a: Array
    frequency_hz: Array
    density: Array
    source: str
    is_known: bool
    uncertainty: float
    is_white: bool
    by_source: dict[str, list[float]] = field(default_factory=dict)
    rounding_share: float = 0.0
    """Part of the variance that coarse converter steps make, which repeat with the signal: lines, not noise."""
    step_a: float = 0.0
    """Largest step of the converters."""

    @property
    def floor_a(self) -> float:
        """Root mean square over the phases, of coloured noise at its white end."""
        return float(np.sqrt(np.mean(self.sigma_a**2)))

    def rms_a(self, samples: int, period_s: float) -> float:
        """Root mean square over the phases and so many samples in a row, slow noise included."""
        power = self.weights(samples, period_s) ** 2
        both_sides = np.full(power.shape[1], 2.0)
        both_sides[0] = 1.0
        if samples % 2 == 0:
            both_sides[-1] = 1.0
        return float(np.sqrt(np.mean(power @ both_sides) / samples))

    def with_converter_step(self, step_a: Array, resting: float = 0.0) -> Noise:
        """What coarse steps hide from the noise's measurement is added: the rounding error of a signal that moves is step^2/12
        in all, of which repeats of one test show only what differs between them, and a current that rests shows less, or, at
        the edge of a step (as zero is to a converter that cuts off), up to step^2/4: of the `resting` share of all samples it
        was seen.
        """
        stepped = replace(self, step_a=float(np.max(step_a)))
        if self.source not in ("repeated segments", "repeated periods", "zero voltage"):
            return stepped
        seen = _rounded_at_rest if self.source == "zero voltage" else _rounded_twice
        variance, repeating = self.sigma_a**2, np.zeros_like(self.sigma_a)
        for k, step in enumerate(step_a):
            if 0.0 < self.sigma_a[k] < step:
                ratio = _solved(seen, float(variance[k]) / step**2)
                variance[k] = max(variance[k], step**2 * (ratio**2 + 1.0 / 12.0))
                repeating[k] = step**2 * _repeating(ratio)
                if "zero voltage" in self.by_source:
                    # no more than rounding makes there: what decays at zero voltage is no noise
                    at_rest = min(self.by_source["zero voltage"][k] ** 2, step**2 * (ratio**2 + 0.25))
                    variance[k] += resting * max(at_rest - variance[k], 0.0)
        hidden = float(np.sum(variance) / np.sum(self.sigma_a**2)) - 1.0
        if hidden < NOTHING_MORE:
            return stepped
        uncertainty = max(self.uncertainty, min(hidden, 0.1))
        share = float(np.sum(repeating) / np.sum(variance))
        return replace(stepped, sigma_a=np.sqrt(variance), uncertainty=uncertainty, rounding_share=share)

    def weights(self, samples: int, period_s: float) -> Array:
        """(phases, samples//2 + 1): what a Fourier coefficient is divided by, white level included."""
        frequency = np.fft.rfftfreq(samples, period_s)
        log_f = np.log(np.maximum(frequency, frequency[1] if samples > 2 else 1.0))
        shape = np.stack([np.exp(np.interp(log_f, np.log(self.frequency_hz), np.log(row))) for row in self.density])
        weights: Array = self.sigma_a[:, None] * np.sqrt(shape)
        return weights


def _repeating(ratio: float) -> float:
    """Mean square, in steps, of the rounding error that repeats with the signal; `ratio`: noise rms over the step (B. Widrow,
    I. Kollar, Quantization Noise, 2008, ch. 4: a sawtooth of the signal, smoothed by the noise).
    """
    k = np.arange(1.0, 40.0)
    return float(np.sum(np.exp(-((2.0 * np.pi * k * ratio) ** 2)) / (2.0 * np.pi**2 * k**2)))


def _solved(seen: Callable[[float], float], variance: float) -> float:
    """The ratio of noise to step at which so much variance, in steps and below 1, is `seen`."""
    least, most = 1e-3, 1.5
    return float(brentq(lambda x: seen(x) - variance, least, most)) if seen(least) < variance else least


def _rounded_twice(ratio: float) -> float:
    """Variance, in steps, that differs between two roundings of one moving signal with fresh noise."""
    return ratio**2 + 1.0 / 12.0 - _repeating(ratio)


def _rounded_at_rest(ratio: float) -> float:
    """Variance, in steps, of rounded noise about the middle of a step."""
    k = np.arange(1.0, 12.0)
    return float(np.sum((2.0 * k - 1.0) * erfc((k - 0.5) / (np.sqrt(2.0) * ratio))))


def repeats(record: Record) -> list[tuple[int, int]]:
    """Pairs of segments with the same axis and the same command, sample by sample (common length)."""
    pairs = []
    for a in range(len(record.segments)):
        for b in range(a + 1, len(record.segments)):
            if _is_same_test(record.segments[a], record.segments[b]):
                pairs.append((a, b))
                break
    return pairs


def _is_same_test(a: Segment, b: Segment) -> bool:
    n = min(a.count, b.count)
    if n < SHORTEST_RECORD or a.file != b.file or a.axis_deg != b.axis_deg:
        return False
    scale = float(np.std(a.voltage_axis_v[:n]))
    difference = a.voltage_axis_v[:n] - b.voltage_axis_v[:n]
    return scale > 0 and float(np.abs(difference).max()) < 1e-3 * scale


def command_period(segment: Segment) -> int | None:
    """Samples after which the command repeats exactly (at least two periods in the segment), or None."""
    v = segment.voltage_axis_v
    n = v.shape[0]
    scale = float(np.std(v))
    if scale == 0 or n < 2 * SHORTEST_RECORD:
        return None
    tail = v[n // 4 :]
    m = tail.shape[0]
    spectrum = np.fft.rfft(tail - tail.mean(), 2 * m)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[:m] / np.arange(m, 0, -1)
    peaks = np.flatnonzero(correlation[: m // 2] > 0.999 * correlation[0])
    for lag in peaks[peaks > 8]:
        if float(np.abs(tail[lag:] - tail[:-lag]).max()) < 1e-3 * scale:
            return int(lag)
    return None


def measure_noise(record: Record) -> Noise:
    """The best available measurement, with every other one listed in `by_source`."""
    found = {
        "repeated segments": _from_repeated_segments(record),
        "repeated periods": _from_repeated_periods(record),
        "zero voltage": _from_zero_voltage(record),
        "sum of the three currents": _from_zero_sequence(record),
    }
    listed = {name: _rms(values) for name, values in found.items() if values}
    for name, values in found.items():
        if values and sum(v.shape[1] for v in values) >= SHORTEST_RECORD:
            return _noise(values, record, name, True, listed)
    return _noise(_quiet(record), record, "quiet frequencies", False, listed)


def _rms(values: Sequence[Array]) -> list[float]:
    stacked = np.concatenate([v - v.mean(axis=1, keepdims=True) for v in values], axis=1)
    return [float(x) for x in stacked.std(axis=1)]


def _from_repeated_segments(record: Record) -> list[Array]:
    out = []
    for a, b in repeats(record):
        first, second = record.segments[a], record.segments[b]
        n = min(first.count, second.count)
        good = first.is_good[:n] & second.is_good[:n]
        if good.mean() > 0.9:
            difference = (first.currents_a[:, :n] - second.currents_a[:, :n]) / np.sqrt(2.0)
            out.append(np.where(good, difference, 0.0) / np.sqrt(good.mean()))
    return out


def _from_repeated_periods(record: Record) -> list[Array]:
    out: list[Array] = []
    for segment in record.segments:
        lag = command_period(segment)
        if lag is None or segment.count < 3 * lag:
            continue
        settled = segment.currents_a[:, lag:]
        n = 2 * lag * ((settled.shape[1]) // (2 * lag))
        blocks = settled[:, :n].reshape(settled.shape[0], -1, 2, lag)
        difference = (blocks[:, :, 0] - blocks[:, :, 1]) / np.sqrt(2.0)
        if lag >= 100 and difference.size:
            out.extend(np.ascontiguousarray(difference[:, k]) for k in range(difference.shape[1]))
    return out


def _from_zero_voltage(record: Record) -> list[Array]:
    """Stretches with zero command: at the start of a segment that starts at rest, or after the current has decayed."""
    out = []
    for segment in record.segments:
        edges = np.flatnonzero(np.diff(np.r_[0, (segment.voltage_axis_v == 0).astype(int), 0]))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            begin = start if start == 0 and segment.starts_at_rest else start + (stop - start) * 3 // 4
            if stop - begin >= SHORTEST_RECORD:
                piece = segment.currents_a[:, begin:stop]
                ramp = np.linspace(-1, 1, piece.shape[1])
                slope = (piece @ ramp) / (ramp @ ramp)
                out.append(piece - piece.mean(axis=1, keepdims=True) - slope[:, None] * ramp)
    return out


def resting_share(record: Record) -> float:
    """Share of all samples in stretches of zero voltage."""
    resting: int = sum(piece.shape[1] for piece in _from_zero_voltage(record))
    return resting / sum(s.count for s in record.segments)


def _from_zero_sequence(record: Record) -> list[Array]:
    """Sum of three independent sensors / sqrt(3): motor currents cancel, but for unlike gains. Not when the third was computed."""
    if record.facts.phases < 3:
        return []
    sums = _without_unlike_gains(record, [s.currents_a.sum(axis=0) for s in record.segments])
    scale = record.facts.current_peak_a
    if max(float(np.std(x)) for x in sums) < 1e-6 * scale:
        return []
    return [np.repeat(x[None, :] / np.sqrt(3.0), 3, axis=0) for x in sums]


def _without_unlike_gains(record: Record, sums: list[Array]) -> list[Array]:
    """The sums without what of them follows the current vector and its rate of change: sensors of unlike gain and lag leave that.

    The vector's own noise is orthogonal to that of the sum, of which two numbers of a gain and two of a lag take nothing.
    """
    design, target = [], []
    for segment, total in zip(record.segments, sums, strict=True):
        u, v, w = segment.currents_a
        vector = np.stack([2.0 * u - v - w, v - w])
        shapes = np.concatenate([vector, np.gradient(vector, axis=1)])
        design.append(_centred(shapes, segment.is_good).T)
        target.append(_centred(total[None, :], segment.is_good)[0])
    rows, wanted = np.concatenate(design), np.concatenate(target)
    solved, *_ = np.linalg.lstsq(rows, wanted, rcond=None)
    left = wanted - rows @ solved
    gained = float(wanted @ wanted - left @ left)
    if gained < FOLLOWS * rows.shape[1] * float(left @ left) / max(wanted.size - rows.shape[1], 1):
        return sums
    return [total - shapes @ solved for total, shapes in zip(sums, design, strict=True)]


def _centred(values: Array, is_good: NDArray[np.bool_]) -> Array:
    """Rows less their mean over the good samples, zero at the others."""
    mean = values @ is_good / max(int(is_good.sum()), 1)
    return np.where(is_good, values - mean[:, None], 0.0)


def _quiet(record: Record) -> list[Array]:
    """The currents themselves; only the quiet quantile of their spectrum is used."""
    return [s.currents_a for s in record.segments]


def _window(n: int) -> Array:
    t = 2.0 * np.pi * np.arange(n) / n
    return np.asarray(0.35875 - 0.48829 * np.cos(t) + 0.14128 * np.cos(2 * t) - 0.01168 * np.cos(3 * t))


def _noise(
    values: Sequence[Array], record: Record, source: str, is_known: bool, listed: dict[str, list[float]]
) -> Noise:
    period = record.facts.sample_period_s
    quantile = 0.5 if is_known else 0.15
    correction = -np.log(1.0 - quantile)
    frequency, power, phase_count = [], [], values[0].shape[0]
    spectra = []
    for piece in values:
        n = piece.shape[1]
        window = _window(n)
        centred = piece - piece.mean(axis=1, keepdims=True)
        if is_known:
            centred = _without_spikes(centred)
        spectrum = np.abs(np.fft.rfft(centred * window, axis=1)) ** 2 / float(window @ window)
        spectra.append((np.asarray(np.fft.rfftfreq(n, period)[2:], dtype=np.float64), spectrum[:, 2:]))
    hum = [hz for hz in MAINS_HZ if _stands_out(spectra, hz)]
    for here, spectrum in spectra:
        kept = (
            ~np.any([np.abs(here - hz) < LOBE_BINS * here[0] / 2.0 for hz in hum], axis=0)
            if hum
            else np.ones(here.size, dtype=bool)
        )
        frequency.append(here[kept])
        power.append(spectrum[:, kept])
    f, p = np.concatenate(frequency), np.concatenate(power, axis=1)
    top = 0.5 / period
    least = (RESOLVED * record.facts.current_peak_a) ** 2
    edges = np.geomspace(max(float(f.min()), 1e-3), top * 1.0001, _bin_count(float(f.min()), top))
    which = np.digitize(f, edges)
    centres, density = [], []
    for k in range(1, edges.shape[0]):
        inside = which == k
        if inside.sum() >= 12:
            centres.append(float(np.sqrt(edges[k - 1] * edges[k])))
            density.append(np.maximum(np.quantile(p[:, inside], quantile, axis=1) / correction, least))
    level = np.array(density).T
    white = np.array([_level(p[c], quantile) if p[c].max() > least else 0.0 for c in range(phase_count)])
    if white.max() < least:
        flat = np.ones((phase_count, 2))
        return Noise(
            np.full(phase_count, np.sqrt(least)), np.array([1.0, top]), flat, source, is_known, 0.0, True, listed
        )
    white = np.maximum(white, least)
    relative = level / white[:, None]
    at = np.array(centres)
    low_f, low_level, is_rising = _power_law(f, p / white[:, None])
    first = max(SLOW_BINS / min(v.shape[1] for v in values) / period, 1e-3)
    keep = at > first
    at, relative = at[keep], relative[:, keep]
    per_bin = np.array([(which == k).sum() for k in range(1, edges.shape[0])])
    per_bin = per_bin[per_bin >= 12][keep]
    spread = 2.2 * 3.0 / np.sqrt(per_bin / 2.0)
    is_white = not is_rising and bool(np.all(np.abs(np.log(relative)).max(axis=0) < np.maximum(WHITE_WITHIN, spread)))
    if is_white:
        relative = np.ones_like(relative)
    elif is_rising:
        model = np.interp(np.log(at), np.log(low_f), low_level)
        ratio = np.exp(np.mean(np.log(relative / model), axis=0))
        follows = bool(np.all(np.abs(np.log(ratio)) < np.maximum(WHITE_WITHIN, spread)))
        ratio = np.ones_like(ratio) if follows else ratio
        slow = low_f < first
        low = low_level[slow] * ratio[0] * SLOW_MARGIN
        relative = np.tile(np.concatenate([low, model * ratio]), (phase_count, 1))
        at = np.concatenate([low_f[slow], at])
    else:
        relative = np.tile(np.exp(np.mean(np.log(relative), axis=0)), (phase_count, 1))
    total = f.shape[0]
    return Noise(
        np.sqrt(white),
        at,
        relative,
        source,
        is_known,
        float(1.5 * np.sqrt(1.0 / max(total, 1))),
        is_white,
        listed,
    )


def _stands_out(spectra: Sequence[tuple[Array, Array]], hz: float) -> bool:
    """Whether mains hum stands above what is around it in these spectra, (b,) Hz and (phases, b): in a stretch of a third of a second its
    skirts are the whole neighbourhood, and what is hum would be noise.
    """
    power, bins = 0.0, 0
    for frequency, spectrum in spectra:
        apart = np.abs(frequency - hz) / (frequency[0] / 2.0)
        around = spectrum[:, (apart >= LOBE_BINS) & (apart < AROUND_BINS)]
        if around.shape[1] < LOBE_BINS or hz > frequency[-1]:
            continue
        level = np.median(around, axis=1) / np.log(2.0)
        if level.min() > 0.0:
            power += float((spectrum[:, int(np.argmin(apart))] / level).sum())
            bins += spectrum.shape[0]
    return bins > 0 and power > STANDS_OUT * float(gammainccinv(bins, ONCE_IN))


def _without_spikes(values: Array) -> Array:
    """Rare values that no noise has, zero in place of them: ten of 75 000 samples had made the noise ten times too large."""
    spread = 1.4826 * np.median(np.abs(values), axis=1, keepdims=True)
    is_spike = np.abs(values) > SPIKE * spread
    rare = (is_spike.mean(axis=1, keepdims=True) < RARE) & (spread > 0.0)
    return np.where(is_spike & rare, 0.0, values)


def _power_law(frequency: Array, power: Array) -> tuple[Array, Array, bool]:
    """1 + (f_c / f)^g by Whittle's likelihood over the slow half of the spectrum, and whether it beats white there.

    Lines of a distortion are kept from pulling it by capping each power at six times the model.
    """
    top = float(frequency.max())
    inside = frequency < 0.1 * top
    f, p = frequency[inside], np.mean(power[:, inside], axis=0)
    weight = power.shape[0]

    def cost(x: Array) -> float:
        level = 1.0 + np.exp(np.clip(x[1] * (x[0] - np.log(f)), -60.0, 60.0))
        return float(weight * np.sum(np.log(level) + np.minimum(p / level, 6.0)))

    white = float(weight * np.sum(np.minimum(p, 6.0)))
    starts = [(np.log(fc), g) for fc in (0.3, 3.0, 30.0) for g in (0.7, 1.2)]
    best = min((minimize(cost, s, method="Nelder-Mead", options={"maxiter": 200}) for s in starts), key=lambda r: r.fun)
    grid = np.geomspace(1e-3, top, 80)
    slope = float(np.clip(best.x[1], 0.0, 2.0))
    level = 1.0 + np.exp(np.clip(slope * (best.x[0] - np.log(grid)), -60.0, 60.0))
    return grid, level, bool(white - best.fun > RISING_LIKELIHOOD and slope > 0.0)


def _level(power: Array, quantile: float) -> float:
    """Mean of exponentially distributed powers, by quantile, then refined by the mean below five times that."""
    rough = float(np.quantile(power, quantile)) / -float(np.log(1.0 - quantile))
    below = power[power < 5.0 * rough]
    expected = float((1.0 - np.exp(-5.0) * 6.0) / (1.0 - np.exp(-5.0)))
    return float(below.mean()) / expected if quantile == 0.5 else rough


def _bin_count(low: float, high: float) -> int:
    return max(4, int(BINS_PER_DECADE * np.log10(high / max(low, 1e-3))) + 1)
