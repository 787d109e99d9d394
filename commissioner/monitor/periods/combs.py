"""From a spectrum to combs: the shaft first, then whatever else repeats, each refined and told from mixing products."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.periods import periods
from commissioner.monitor.periods.periods import PairSpectrum, Periodicity, ShaftSearch
from commissioner.monitor.signals import tracking
from commissioner.monitor.signals.averaging import Comb, apart, free_orders
from commissioner.monitor.signals.supply import TurningFrame, Vector
from commissioner.records import Signal

SUPPLY_ORDERS = 13
MOST_ORDERS = 40
MOST_SEARCH_ORDERS = 14
"""Taken out while looking for further combs: higher ones are below the floor of any load seen so far."""
MOST_SHAFT_ORDERS = 24
USED_FOR_REFINING = 4
DRIFT_DEGREE = 4
"""A slip that wanders over the segment, as voltage and load do: phase polynomial beyond a fixed ratio to the mains (or to the
clock), only as far as its coefficients stand out. Where it does, the frequency that captures most is not the mean one."""
MOST_AGAIN, STILL = 3, 0.3
"""How often lines are told apart anew, and the share of their standard errors within which their frequencies then stay."""
EVENLY = 3.0**-0.5
"""Standard deviation over its width of what lies anywhere between two values: with the mains' line removed, what is left of a line nearer than
a period of the recording's length peaks at half a period and more from it, wherever it was. (Two-pole motors of 75 to 150 kW at a tenth of their
load, 4 and 6 s: 0.06 and 0.13 % off, stated 0.02; of four poles, whose second line is the mains', 0.012 and 0.003.)"""
OUTSIDE_SIGMA = 4.0
"""Of a line's frequency, from which it lies beyond the slip that the power allows."""


@dataclass(frozen=True)
class Found:
    """The periodicities, with the spectrum in which the shaft was looked for and the one that is left at the end."""

    shaft: Periodicity | None
    loads: tuple[Periodicity, ...]
    spectrum: PairSpectrum
    left_over: PairSpectrum
    candidates: tuple[tuple[float, float], ...]


def find(frame: TurningFrame, part: slice, search: ShaftSearch, given_hz: tuple[float, ...] = ()) -> Found:
    """Shaft and load periods of the segment. Loads at rational multiples of the shaft are the shaft's own comb."""
    residual, _ = apart(frame, part, [], SUPPLY_ORDERS)
    highest, full_scale = frame.band_hz * 0.95, float(abs(frame.current_a[part].mean()))
    spectrum = periods.pair_spectrum(residual, frame.sample_period_s, highest, full_scale)
    shaft, candidates = _find_shaft(frame, part, residual, spectrum, search)
    known = [shaft] if shaft else []
    left = spectrum
    for frequency in given_hz:
        known.append(_refined(frame, part, residual, spectrum, f"load {frequency:.4g} Hz", frequency, (1, 2, 3)))
    sure = len(known)
    for _ in range(periods.MOST_LOADS):
        left_current, own = told_apart(frame, part, known)
        left = periods.pair_spectrum(left_current, frame.sample_period_s, highest, full_scale)
        new = _next_load(frame, part, left_current, left, known, search.supply_hz, spectrum)
        if new is None:
            break
        known.append(new)
    for _ in range(MOST_AGAIN if known else 0):
        before = known
        rest, own = told_apart(frame, part, known)
        known = [_again(frame, part, rest + mine, spectrum, one) for one, mine in zip(known, own, strict=True)]
        if any(drifts := [k >= sure and _is_drift(one, frame, part) for k, one in enumerate(known)]):
            known = [one for one, drift in zip(known, drifts, strict=True) if not drift]
            continue
        if all(
            abs(n.frequency_hz - o.frequency_hz) < STILL * n.frequency_std_hz
            for n, o in zip(known, before, strict=True)
        ):
            break
    loads = tuple(known[1:] if shaft else known)
    return Found(known[0] if shaft and _is_inside(known[0], search) else None, loads, spectrum, left, candidates)


def _is_drift(load: Periodicity, frame: TurningFrame, part: slice) -> bool:
    """Whether it does not repeat within the segment: a line that led there was the skirt of what drifts."""
    return bool(load.frequency_hz * np.ptp(frame.time_s[part]) < 1.0)


def _is_inside(shaft: Periodicity, search: ShaftSearch) -> bool:
    """Within the slip's range, as far as its frequency is known. A line that was another's leaves it once that one is told apart."""
    low, high = periods.range_hz(search)
    beside = OUTSIDE_SIGMA * shaft.frequency_std_hz
    return low - beside <= shaft.frequency_hz <= high + beside


def told_apart(frame: TurningFrame, part: slice, known: list[Periodicity]) -> tuple[Vector, list[Vector]]:
    """The current's residual, and each comb's own part of it."""
    combs = [
        comb_of(frame, part, one, [c.frequency_hz for c in known[:k]], MOST_SEARCH_ORDERS)
        for k, one in enumerate(known)
    ]
    return apart(frame, part, combs, SUPPLY_ORDERS)


def _again(frame: TurningFrame, part: slice, alone: Vector, spectrum: PairSpectrum, one: Periodicity) -> Periodicity:
    """Refined once more without the others and the mains: a line of theirs some tenths of a hertz beside would turn the phase that
    is followed, as an offset does beside a two-pole motor's shaft, and took some of it while the comb was not known."""
    found = _refined(frame, part, alone, spectrum, one.name, one.frequency_hz, one.harmonics_seen)
    return found if one.name == "shaft" else replace(found, name=f"load {found.frequency_hz:.4g} Hz")


def _find_shaft(
    frame: TurningFrame, part: slice, residual: Vector, spectrum: PairSpectrum, search: ShaftSearch
) -> tuple[Periodicity | None, tuple[tuple[float, float], ...]]:
    """The best comb of the slip range whose lines do not lead out of it (half a supply period is a pulse pattern's own, too) and are
    not a slower load's."""
    candidates = periods.shaft_candidates(spectrum, search, periods.search_harmonics(frame.band_hz, search))
    table = tuple((f, score) for f, score, _ in candidates)
    for frequency, _, visible in candidates:
        seen = tuple(h for h in visible if _is_own_line(spectrum, h * frequency, 2 * search.supply_hz, frequency))
        powers = spectrum.at(np.array(seen, dtype=np.float64) * frequency, 0.3) if seen else np.array([0.0])
        if powers.max() <= periods.SHAFT_SIGNIFICANT and powers.sum() <= 2 * periods.SHAFT_SIGNIFICANT:
            break
        top = periods.top_of_line(spectrum, frequency, seen)
        shaft = _refined(frame, part, residual, spectrum, "shaft", top, seen)
        if _is_inside(shaft, search) and any(periods.stands_out(spectrum, h * shaft.frequency_hz) for h in seen):
            return shaft, table
    return None, table


def _is_own_line(spectrum: PairSpectrum, line_hz: float, mains_hz: float, shaft_hz: float) -> bool:
    """Neither another line's skirt nor what the mains and a slower load make."""
    return (
        _is_peak(spectrum, line_hz)
        and not periods.on_mains_skirt(line_hz, mains_hz, spectrum.cell_hz)
        and not periods.is_mains_side_band(spectrum, line_hz, mains_hz, shaft_hz / periods.MOST_TURNS)
    )


def _is_peak(spectrum: PairSpectrum, frequency_hz: float) -> bool:
    """False on the skirt of a stronger line within three cells: the shaft then turns outside the slip that was allowed."""
    place = np.array([frequency_hz])
    return bool(spectrum.at(place, 0.6)[0] > 0.3 * spectrum.at(place, 3.0)[0])


def _refined(
    frame: TurningFrame,
    part: slice,
    residual: Vector,
    spectrum: PairSpectrum,
    name: str,
    frequency_hz: float,
    seen: tuple[int, ...],
) -> Periodicity:
    """The frequency at which the comb captures most; a shaft follows the mains, others what captures more. Of a line that cannot be told from
    the mains' the nearer part went with those: it is left out, or, where there is no other, its frequency known to its distance."""
    time = frame.time_s[part]
    told = tuple(h for h in seen if _beside_mains(frame, part, h * frequency_hz) > 1.0 / np.ptp(time))
    strongest = _strongest(spectrum, frequency_hz, told or seen)
    tries = []
    noise = None
    for follows in ("mains",) if name == "shaft" else ("clock", "mains"):
        phase = comb_phase(frame, part, frequency_hz, follows)
        demodulated = tracking.demodulate(residual, time, phase, strongest)
        noise = demodulated.noise_variance if noise is None else noise
        demodulated = replace(demodulated, noise_variance=noise)  # the same for both, or chance in it would decide
        shift, std, power = tracking.refine(demodulated, 0.8 / np.ptp(time))
        tries.append((power, frequency_hz + shift, std, follows))
    power, frequency, std, follows = max(tries)
    phase = comb_phase(frame, part, frequency, follows)
    drift = tracking.track(tracking.demodulate(residual, time, phase, strongest), DRIFT_DEGREE)
    shift = drift.mean_rad_per_s / (2 * np.pi)
    std = float(np.hypot(std, drift.mean_error_rad_per_s / (2 * np.pi)))
    is_told = bool(told or not seen)
    if not is_told:
        std = float(
            np.hypot(std, max(_beside_mains(frame, part, h * (frequency + shift)) / h for h in strongest) * EVENLY)
        )
    return Periodicity(name, frequency + shift, std, follows, power, seen, drift.without_mean(), is_told)


def _beside_mains(frame: TurningFrame, part: slice, line_hz: float) -> float:
    """Hz from a line to the nearest harmonic of the mains; in the turning frame an offset is one."""
    return float(periods.beside_multiple(line_hz, mean_supply(frame, part) / (2 * np.pi), 1))


def _strongest(spectrum: PairSpectrum, frequency_hz: float, seen: tuple[int, ...]) -> list[int]:
    """Up to four harmonics, those with the most power times order squared (they fix the frequency best)."""
    orders = np.array(seen or (1, 2), dtype=np.float64)
    power = spectrum.at(orders * frequency_hz, 0.3)
    ranked = orders[np.argsort(-power * np.minimum(orders, 6) ** 2)]
    return [int(h) for h in ranked[:USED_FOR_REFINING]]


def comb_phase(frame: TurningFrame, part: slice, frequency_hz: float, follows: str) -> Signal:
    """Phase of the fundamental over the segment, zero at its middle: 2 pi f t for "clock"; for "mains" rho (theta_e + slip's
    wander), the wander without its mean slope, so that `frequency_hz` stays the mean frequency.
    """
    time = frame.time_s[part]
    if follows == "clock":
        return np.asarray(2 * np.pi * frequency_hz * (time - 0.5 * (time[0] + time[-1])))
    angle = frame.supply_angle_rad[part]
    ratio = 2 * np.pi * frequency_hz / mean_supply(frame, part)
    wander = frame.slip_phase_rad[part]
    turned = angle + wander - (wander[-1] - wander[0]) * (time - time[0]) / (time[-1] - time[0])
    return np.asarray(ratio * (turned - turned[turned.size // 2]))


def mean_supply(frame: TurningFrame, part: slice) -> float:
    """Supply frequency of the segment in rad/s: turns of the supply angle over its length."""
    angle, time = frame.supply_angle_rad[part], frame.time_s[part]
    return float((angle[-1] - angle[0]) / (time[-1] - time[0]))


def comb_of(
    frame: TurningFrame, part: slice, found: Periodicity, others_hz: list[float], most: int = MOST_ORDERS
) -> Comb:
    """The comb's phase and orders on the segment; orders that collide with `others_hz` or the mains are left out."""
    time = frame.time_s[part]
    limit = min(MOST_SHAFT_ORDERS if found.name == "shaft" else MOST_ORDERS, most)
    highest = min(limit, int(0.9 * frame.band_hz / found.frequency_hz))
    taken = [h * f for f in others_hz for h in range(1, int(frame.band_hz / f) + 1) if h <= limit]
    orders = free_orders(
        found.frequency_hz, highest, taken, mean_supply(frame, part) / (2 * np.pi), float(np.ptp(time))
    )
    phase = comb_phase(frame, part, found.frequency_hz, found.follows)
    if found.drift is not None:
        phase = phase + found.drift(time)
    return Comb(found.name, phase, found.frequency_hz, orders, found.follows)


def _next_load(
    frame: TurningFrame,
    part: slice,
    residual: Vector,
    left: PairSpectrum,
    known: list[Periodicity],
    supply_hz: float,
    first: PairSpectrum,
) -> Periodicity | None:
    """The strongest remaining pair that is no product of known combs, as a comb of its own."""
    strongest = max((first.power * first.floor_a2).max(), 1e-300)
    combs_hz = [c.frequency_hz for c in known]
    for frequency, power in periods.find_peaks_above(
        left, periods.SIGNIFICANT, periods.LOWEST_LOAD_HZ, periods.HIGHEST_LOAD_HZ
    ):
        k = round(frequency / left.frequency_hz[1])
        if power * left.floor_a2[k] < LEAST_SHARE * strongest or not _is_torque_like(left, k):
            continue
        if periods.is_product(frequency, combs_hz, supply_hz, left.cell_hz):
            continue
        fundamental, seen = periods.lowest_fundamental(left, frequency, combs_hz, supply_hz)
        found = _refined(frame, part, residual, left, f"load {fundamental:.4g} Hz", fundamental, seen)
        if _is_drift(found, frame, part):
            continue
        return replace(found, name=f"load {found.frequency_hz:.4g} Hz")
    return None


LEAST_SHARE = 1e-4
"""Power of a load line against the strongest line: below 1 % of its amplitude it moves no waveform."""


def _is_torque_like(spectrum: PairSpectrum, k: int) -> bool:
    """A torque makes both side bands; one alone is a slot or network line. True within a factor of 8 in amplitude."""
    upper, lower = abs(spectrum.upper[k]), abs(spectrum.lower[k])
    return bool(max(upper, lower) < 8 * min(upper, lower))
