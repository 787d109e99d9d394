"""Shaft speed and load periods from the currents alone.

A load that turns modulates the current: in the supply's frame it is a comb of line pairs at +-h f. The spectrum is
whitened by its own local floor; the shaft comb is looked for in the slip range that the operating point allows, other
combs anywhere. A refined comb is judged by the power it captures, and by whether it follows the mains or the clock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import median_filter

from commissioner.monitor.signals.supply import Vector
from commissioner.monitor.signals.tracking import PhaseDrift
from commissioner.records import Signal

SIGNIFICANT = 18.0
"""Whitened pair power (mean 1 on noise): P = (1 + 2q) e^{-2q} = 9e-15 for one cell, below 1e-9 over a whole spectrum."""
VISIBLE = 9.0
"""Enough where the frequency is already known to a cell: P = 3e-7."""
SHAFT_SIGNIFICANT = 12.0
"""In the few dozen cells of the slip range that the operating point allows: below 1e-7 in all of them."""
CAP = 40.0
"""One line cannot outvote the operating point by more than this."""
LOBE_CELLS = 4 / 3
"""From a line's top to the foot of its main lobe, in cells of 1.5 over the length (Hann's window: two over the length)."""
DYNAMIC_RANGE = 1e-5
"""Below 100 dB no sensor is linear, so without noise the floor is not zero."""
MOST_TURNS = 6
"""A load that repeats after at most so many shaft turns is one comb with the shaft."""
OUT_OF_COMB, NEIGHBOURS = 4.0, np.array([-3, -2, -1, 1, 2, 3])
"""Power of the shaft's line against those of a slower load's comb beside it, if it is no line of that comb: one of rectangular pulses is
at most twice the strongest of three on either side, since max |cos(m pi duty)| >= 1 / sqrt 2 over m = 1, 2, 3 for every duty."""
LOWEST_LOAD_HZ = 0.8
HIGHEST_LOAD_HZ = 220.0
MOST_LOADS = 3


@dataclass(frozen=True)
class PairSpectrum:
    """Whitened power of the line pairs +-f, `(m,)`, on the grid `frequency_hz`; `cell_hz` is the resolution."""

    frequency_hz: Signal
    power: Signal
    floor_a2: Signal
    upper: Vector
    lower: Vector
    cell_hz: float

    def at(self, frequency_hz: NDArray[np.float64] | float, cells: float = 0.6) -> Signal:
        """The largest whitened power within `cells` resolution cells of each frequency; 0 outside the spectrum."""
        step = self.frequency_hz[1]
        reach = max(1, round(cells * self.cell_hz / step))
        place = np.round(np.atleast_1d(frequency_hz) / step).astype(np.int64)
        offsets = np.arange(-reach, reach + 1)
        index = np.clip(place[:, None] + offsets, 0, self.power.size - 1)
        best = self.power[index].max(axis=1)
        return np.where((place >= 0) & (place < self.power.size), best, 0.0)


@dataclass(frozen=True)
class Periodicity:
    """A comb that was found (or given): frequency over the segment, its standard error, and what speaks for it. `is_told_from_mains`: whether one of
    its lines lies a period of the segment's length or more from every harmonic of the mains."""

    name: str
    frequency_hz: float
    frequency_std_hz: float
    follows: str
    evidence: float
    harmonics_seen: tuple[int, ...]
    drift: PhaseDrift | None = None
    is_told_from_mains: bool = True


def pair_spectrum(vector: Vector, sample_period_s: float, highest_hz: float, full_scale_a: float = 0.0) -> PairSpectrum:
    """Hann-windowed, four times zero-padded spectrum of the pairs, over a running median as floor (at least
    `DYNAMIC_RANGE` of `full_scale_a`).
    """
    count = vector.size
    window = np.hanning(count + 2)[1:-1]
    padded = fft.next_fast_len(4 * count)
    spectrum = fft.fft((vector - np.average(vector, weights=window)) * window, padded) / np.sum(window)
    step = 1 / (padded * sample_period_s)
    points = min(int(highest_hz / step), padded // 2 - 1)
    upper = spectrum[: points + 1]
    lower = np.conj(spectrum[-np.arange(points + 1)])
    raw = np.abs(upper) ** 2 + np.abs(lower) ** 2
    cell = 1.5 / (count * sample_period_s)
    floor = np.maximum(_floor(raw, cell / step), (DYNAMIC_RANGE * full_scale_a) ** 2)
    return PairSpectrum(np.arange(points + 1) * step, raw / floor, floor, upper, lower, cell)


def _floor(raw: Signal, points_per_cell: float) -> Signal:
    """Running median over about 20 cells (1.19 = mean over median of a two-pair power), thinned for speed."""
    thin = max(1, int(points_per_cell))
    width = max(5, int(20 * points_per_cell / thin)) | 1
    coarse = raw[::thin]
    smooth = 1.19 * median_filter(coarse, size=width, mode="nearest")
    return np.asarray(np.interp(np.arange(raw.size), np.arange(coarse.size) * thin, smooth) + 1e-300)


def find_peaks_above(
    spectrum: PairSpectrum, threshold: float, low_hz: float, high_hz: float
) -> list[tuple[float, float]]:
    """(frequency, whitened power) of local peaks, strongest first, at least 1.5 cells apart."""
    inside = (spectrum.frequency_hz >= low_hz) & (spectrum.frequency_hz <= high_hz) & (spectrum.power > threshold)
    found: list[tuple[float, float]] = []
    for k in np.flatnonzero(inside)[np.argsort(-spectrum.power[inside])]:
        f = float(spectrum.frequency_hz[k])
        if all(abs(f - other) > 1.5 * spectrum.cell_hz for other, _ in found):
            found.append((f, float(spectrum.power[k])))
        if len(found) >= 60:
            break
    return found


def slip_of(shaft_hz: float, supply_hz: float, pole_pairs: int) -> float:
    """1 - p n / f."""
    return 1 - shaft_hz * pole_pairs / supply_hz


@dataclass(frozen=True)
class ShaftSearch:
    """Where the shaft line can be: pole pairs, supply frequency, and the slip that the operating point suggests."""

    pole_pairs: int
    supply_hz: float
    slip: float
    slip_std: float

    @property
    def synchronous_hz(self) -> float:
        return self.supply_hz / self.pole_pairs

    def log_prior(self, frequency_hz: float) -> float:
        """Gaussian in slip, cut at synchronous speed."""
        slip = slip_of(frequency_hz, self.supply_hz, self.pole_pairs)
        return -0.5 * ((slip - self.slip) / self.slip_std) ** 2


def strongest_in_range(spectrum: PairSpectrum, search: ShaftSearch) -> float:
    """The largest whitened power where the shaft's first line may be."""
    low, high = range_hz(search)
    inside = (spectrum.frequency_hz >= low) & (spectrum.frequency_hz <= high)
    return float(spectrum.power[inside].max(initial=0.0))


def range_hz(search: ShaftSearch) -> tuple[float, float]:
    """Where the shaft's first line may be: below synchronous speed, of a machine that generates above it."""
    reach = 4.0 * search.slip_std
    least, most = (0.0, 0.5) if search.slip >= 0.0 else (-0.5, 0.0)
    low = search.synchronous_hz * (1 - min(search.slip + reach, most))
    return low, search.synchronous_hz * (1 - max(search.slip - reach, least))


def search_harmonics(band_hz: float, search: ShaftSearch) -> int:
    """How many lines of the shaft's comb are looked at: those within the band, two to eight."""
    return max(2, min(8, int(band_hz * 0.9 / search.synchronous_hz)))


def shaft_candidates(
    spectrum: PairSpectrum, search: ShaftSearch, harmonics: int
) -> list[tuple[float, float, tuple[int, ...]]]:
    """(frequency, score, harmonics seen) of combs in the slip range, best first.

    Score: capped whitened power over the lines seen, minus the operating point's misfit; a comb without its first or
    second line pays, since every shaft has some imbalance.
    """
    low, high = range_hz(search)
    step = spectrum.frequency_hz[1]
    grid = np.arange(low, high + step, 0.5 * step / min(harmonics, 4))
    if grid.size == 0:
        return []
    orders = np.arange(1, harmonics + 1)
    values = np.array([_line_at(spectrum, grid * h) for h in orders])
    weight = np.where(orders <= 2, 1.0, 0.7)[:, None]
    gain = np.where(values > VISIBLE, np.minimum(values, CAP) - 0.5 * VISIBLE, 0.0) * weight
    prior = np.array([search.log_prior(f) for f in grid])
    score = gain.sum(axis=0) + 2 * prior + 1e-3 * np.log1p(values).sum(axis=0)
    best: list[tuple[float, float, tuple[int, ...]]] = []
    for k in np.argsort(-score):
        f = float(grid[k])
        if all(abs(f - other) > 0.7 * spectrum.cell_hz for other, _, _ in best):
            seen = tuple(int(h) for h in orders[values[:, k] > VISIBLE])
            best.append((f, float(score[k]), seen))
        if len(best) >= 5:
            break
    return best


def stands_out(spectrum: PairSpectrum, frequency_hz: float) -> bool:
    """False where a slower load's comb has lines of like size beside this one: its harmonics fall into every slip range."""
    slower = find_peaks_above(
        spectrum, SIGNIFICANT, 2.0 * spectrum.cell_hz, frequency_hz / MOST_TURNS - spectrum.cell_hz
    )
    if not slower:
        return True
    own = float(spectrum.at(frequency_hz, 0.3)[0])
    beside = float(spectrum.at(frequency_hz + slower[0][0] * NEIGHBOURS).max())
    return own > VISIBLE and (beside < VISIBLE or own > OUT_OF_COMB * beside)


def top_of_line(spectrum: PairSpectrum, frequency_hz: float, orders: tuple[int, ...]) -> float:
    """The frequency of most power within the lines' own width: the capped score is flat over strong ones, and the operating
    point alone would choose a place on their skirt."""
    reach, step = LOBE_CELLS * spectrum.cell_hz / min(orders), spectrum.frequency_hz[1] / max(orders)
    grid = frequency_hz + np.arange(-reach, reach + step, step)
    return float(grid[np.argmax(sum(_line_at(spectrum, grid * h) for h in orders))])


def _line_at(spectrum: PairSpectrum, frequency_hz: Signal) -> Signal:
    place = np.clip(np.round(frequency_hz / spectrum.frequency_hz[1]).astype(np.int64), 0, spectrum.power.size - 1)
    return np.asarray(spectrum.power[place])


def lowest_fundamental(
    spectrum: PairSpectrum, line_hz: float, known_hz: list[float], supply_hz: float
) -> tuple[float, tuple[int, ...]]:
    """The fundamental whose harmonic `line_hz` is: line_hz / m with the largest gain of lines for its price.

    Each further line below threshold costs; lines of a comb already known, and products of such a comb with `line_hz`,
    do not count.
    """
    best, best_gain = line_hz, -np.inf
    best_seen: tuple[int, ...] = (1,)
    for m in range(1, 7):
        fundamental = line_hz / m
        if fundamental < LOWEST_LOAD_HZ:
            break
        orders = np.arange(1, max(4 * m, 8) + 1)
        orders = orders[orders * fundamental <= spectrum.frequency_hz[-1]]
        values = spectrum.at(orders * fundamental, 0.4)
        foreign = np.zeros(orders.size, dtype=np.bool_)
        for known in known_hz:
            foreign |= beside_multiple(orders * fundamental, known, 1) < 1.5 * spectrum.cell_hz
        seen = (values > VISIBLE) & ~foreign
        for k in np.flatnonzero(seen & (orders % m != 0)):
            seen[k] = not is_product(orders[k] * fundamental, [*known_hz, line_hz], supply_hz, spectrum.cell_hz)
        gain = np.sum(np.where(seen, np.minimum(values, CAP), 0.0)) - 6.0 * m
        if gain > best_gain + 1e-9:
            best, best_gain, best_seen = fundamental, gain, tuple(int(h) for h in orders[seen])
    return best, best_seen


def beside_multiple(frequency_hz: NDArray[np.float64] | float, of_hz: float, first: int = 0) -> Signal:
    """How far from the nearest multiple of `of_hz`, from the `first` one on."""
    return np.abs(frequency_hz - of_hz * np.maximum(np.round(np.asarray(frequency_hz) / of_hz), first))


NEAR_MAINS_HZ, NEAR_MAINS_CELLS = 0.7, 6.0
"""Mains harmonics wander in size and phase: their skirts are not loads, nor are the lobes that the window gives them."""
NEAR_COMB_HZ = 0.3
"""Nor are the skirts of a comb whose load varies."""


def on_mains_skirt(frequency_hz: float, mains_hz: float, cell_hz: float) -> bool:
    """Beside a multiple of `mains_hz`, whose line is far stronger than any load's."""
    return bool(beside_multiple(frequency_hz, mains_hz) < max(NEAR_MAINS_HZ, NEAR_MAINS_CELLS * cell_hz))


def is_mains_side_band(spectrum: PairSpectrum, frequency_hz: float, mains_hz: float, below_hz: float) -> bool:
    """As far from a multiple of `mains_hz` as a stronger line below `below_hz` is from zero: that load swings the mains' line as well."""
    beside = float(beside_multiple(frequency_hz, mains_hz))
    own, load = (float(spectrum.at(f, LOBE_CELLS)[0]) for f in (frequency_hz, beside))
    return beside < below_hz and load > max(own, SIGNIFICANT)


def is_product(frequency_hz: float, combs_hz: list[float], supply_hz: float, tolerance_hz: float) -> bool:
    """True where the line is a sum or difference of known combs and even mains harmonics: mixing, not a load."""
    if frequency_hz > 0.5 * supply_hz and on_mains_skirt(frequency_hz, supply_hz, tolerance_hz):
        return True
    if any(beside_multiple(frequency_hz, f, 1) < max(NEAR_COMB_HZ, 4 * tolerance_hz) for f in combs_hz):
        return True
    multiples = [np.arange(-12, 13) * f if k == 0 else np.arange(-6, 7) * f for k, f in enumerate(combs_hz)]
    mains = np.array([-2.0, -1.0, 0.0, 1.0, 2.0, 6.0, -6.0]) * supply_hz
    sums = mains
    for group in multiples:
        sums = (sums[:, None] + group[None, :]).ravel()
    return bool(np.any(np.abs(sums - frequency_hz) < tolerance_hz))
