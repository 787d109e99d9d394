"""What each window of levels is called: off, residual, standstill, start, ramp, voltage dip, voltage step, load step, steady, coast-down."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter

from commissioner.monitor.intake.states.windows import HOPS, Levels
from commissioner.monitor.signals.supply import Vector
from commissioner.motor.nameplate import Nameplate
from commissioner.records import Signal

RESIDUAL_VOLTAGE = 0.03
"""Of the rated voltage, from which on a motor without current still has flux: it coasts."""
FAST_CHANGE, SLOW_CHANGE = 0.12, 0.02
"""Of the supply frequency, within half a second, that makes a ramp; within a second where the voltages carry it: they do not swing with
the load."""
STEP = 0.08
"""Of the current's level, between two sides that are each constant within `STEADIER` of it: a slow swing's are no better than 0.3."""
STEADIER = 0.25
"""Less where the change takes as long as the sides are looked at: the crests of a swing are level too."""
SETTLED = 0.08
"""Of the level that follows, within which a start's current has come down."""
START_CURRENT = 2.0
"""Of the rated current, from which on a motor starts: the level of a start stays for seconds where the inertia is large, and is none that
follows it."""
STANDING = 0.02
"""Of the rated frequency: a slower vector is direct current."""
LEAST_STEADY_S, STEP_SIDES_S = 0.4, (1.0, 0.6)
"""What is steady, and how far to each side of a step the level is looked at."""
FLAT = 0.02
"""Of the step: sides that vary less are as level as any, and the shorter change is taken."""
CHANGES_S = (0.0, 0.25, 0.5, 1.0, 2.0, 3.0, 4.0)
"""How long a load may take from one level to the next."""
DIP, LONGEST_DIP_S, SAME_FREQUENCY = 0.12, 1.0, 0.02
"""A voltage that is lower by this share than that of a second before and after, at the same frequency."""
OFF_CURRENT = 0.05
"""Of the rated current: an energised motor idles on 0.12 at least."""


def named(levels: Levels, plate: Nameplate) -> list[str]:
    current, count = levels.current_a, levels.time_s.size
    idle = current < OFF_CURRENT * plate.rated_current_a
    names = ["steady"] * count
    if idle.all():
        is_off = np.all(levels.voltage_v <= RESIDUAL_VOLTAGE * plate.rated_voltage_v / np.sqrt(3.0))
        return ["off"] * count if is_off else names
    has_run = False
    for k in range(count):
        if idle[k]:
            has_voltage = levels.voltage_v[k] > RESIDUAL_VOLTAGE * plate.rated_voltage_v / np.sqrt(3.0)
            names[k] = "coast-down" if has_run else ("residual" if has_voltage else "off")
        else:
            has_run = True
    standing = ~idle & (levels.frequency_hz < STANDING * plate.rated_frequency_hz)
    for k in np.flatnonzero(standing).tolist():
        names[k] = "standstill"
    if standing.all():
        return names
    _name_ramps(levels, idle | standing, names)
    _name_dips(levels, names)
    for begin, end in _runs([n != "steady" for n in names]):
        _name_within(levels, begin, end, names, plate.rated_current_a)
    return names


def _name_ramps(levels: Levels, idle: np.ndarray, names: list[str]) -> None:
    half = max(round(0.25 / levels.hop_s), 1)
    hertz, last = levels.frequency_hz, len(names) - 1
    before, behind = (np.clip(np.arange(last + 1) + k, 0, last) for k in (-half, half))
    share = FAST_CHANGE * (behind - before) / (2 * half)
    is_ramp = _moved(hertz, before, behind, share) | (levels.sense[before] != levels.sense[behind])
    # a window over the switching off has the coasting machine's frequency in it, and current yet
    is_near_idle = maximum_filter1d(idle, 2 * (half + HOPS) + 1, mode="nearest")
    is_ramp &= ~is_near_idle
    if levels.vector_a is not None:
        is_ramp |= _slow_ramps(levels, maximum_filter1d(is_near_idle, 2 * half + 1, mode="nearest"), half)
    for k in np.flatnonzero(is_ramp).tolist():
        names[k] = "ramp"
    # what lies between off and a ramp, shorter than a ramp is seen over, belongs to it
    ramps = [k for k, n in enumerate(names) if n == "ramp"]
    if ramps and (k := ramps[0]) <= 2 * half + int(np.argmin(idle)):
        for j in range(int(np.argmin(idle)), k):
            names[j] = "ramp"


def _moved(hertz: Signal, before: np.ndarray, behind: np.ndarray, share: Signal | float) -> np.ndarray:
    return np.asarray(np.abs(hertz[behind] - hertz[before]) > share * np.maximum(hertz[before], hertz[behind]))


def _slow_ramps(levels: Levels, is_near_idle: np.ndarray, half: int) -> np.ndarray:
    """Where the frequency of half a second before and of half a second behind both move, the same way."""
    hertz, at = median_filter(levels.frequency_hz, half, mode="nearest"), np.arange(levels.frequency_hz.size)
    before, behind = np.maximum(at - 2 * half, 0), np.minimum(at + 2 * half, at.size - 1)
    is_one_way = (hertz[at] - hertz[before]) * (hertz[behind] - hertz[at]) >= 0.0
    both = [
        _moved(hertz, a, b, 0.5 * SLOW_CHANGE * (b - a) / (2 * half)) | (a == b)
        for a, b in ((before, at), (at, behind))
    ]
    return np.asarray(both[0] & both[1] & is_one_way & ~is_near_idle)


def _name_dips(levels: Levels, names: list[str]) -> None:
    around = max(round(LONGEST_DIP_S / levels.hop_s), 1)
    steady = np.array([name == "steady" for name in names])
    is_low = np.zeros(steady.size, dtype=bool)
    for k in np.flatnonzero(steady).tolist():
        near = slice(max(k - around, 0), k + around + 1)
        volts, hertz = (float(np.median(x[near][steady[near]])) for x in (levels.voltage_v, levels.frequency_hz))
        is_lower = levels.voltage_v[k] < (1.0 - DIP) * volts
        is_low[k] = is_lower and abs(levels.frequency_hz[k] - hertz) < SAME_FREQUENCY * hertz
    for begin, end in _runs((~is_low).tolist()):
        if begin > 0 and end < len(names) and names[begin - 1] == names[end] == "steady":
            names[begin:end] = ["voltage dip"] * (end - begin)


def _runs(cut: list[bool]) -> list[tuple[int, int]]:
    """(begin, end) of the stretches that are not cut."""
    edges = np.flatnonzero(np.diff(np.r_[1, np.array(cut, dtype=int), 1]))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _name_within(levels: Levels, begin: int, end: int, names: list[str], rated_a: float) -> None:
    """The start at the head of an energised stretch, and steps of the level inside it."""
    current = levels.current_a[begin:end]
    later = float(np.median(current[current.size // 2 :]))
    settled, again = 0, round(LEAST_STEADY_S / levels.hop_s)
    was_off = begin > 0 and names[begin - 1] in ("off", "residual", "coast-down")
    is_first = begin == 0 and float(current[:HOPS].max()) > START_CURRENT * rated_a
    if was_off or is_first:
        peak = int(np.argmax(current))
        above = np.flatnonzero(current > (1.0 + STEP) * later)
        if current[peak] > START_CURRENT * rated_a or (
            above.size and above[0] <= 2 * HOPS and current[peak] > 1.5 * later
        ):
            settled = _first_still(current, peak, START_CURRENT * rated_a, again)
        else:
            settled = HOPS
        for k in range(begin, min(begin + settled, end)):
            names[k] = "start"
    elif begin > 0 and names[begin - 1] == "voltage dip":
        settled = _first_still(current, 0, np.inf, again)
        names[begin : begin + settled] = ["voltage dip"] * settled
    if end < len(names):
        # windows that reach over the switch-off: half of them lie before it
        for k in range(max(end - HOPS // 2, begin + settled), end):
            names[k] = names[end]
        end = max(end - HOPS, begin + settled)
    if begin > 0:
        for k in range(begin, min(begin + HOPS // 2, end)):
            names[k] = names[begin - 1]
    _name_steps(levels, begin + settled, end, names)


def _first_still(current: Signal, peak: int, below: float, again: int) -> int:
    """From where behind the peak the level is lower than `below` and stays within a few per cent of what follows; where it swings, and
    so does not for twice `again` windows, from where it is no higher than it comes `again` windows later or more."""
    still = current.size
    for k in range(peak, current.size - HOPS):
        ahead = current[k : k + 3 * HOPS]
        if np.ptp(ahead) < SETTLED * np.median(ahead) < SETTLED * below:
            still = k
            break
    highest_from = np.maximum.accumulate(current[::-1])[::-1]
    back = peak + np.flatnonzero(current[peak:-again] <= np.minimum(highest_from[peak + again :], below))
    return int(back[0]) if back.size and still - back[0] > 2 * again else still


def _name_steps(levels: Levels, begin: int, end: int, names: list[str]) -> None:
    """The clearest step of the level first, then those before and behind it."""
    found = _clearest_step(levels.load_a[begin:end], levels.hop_s)
    if found is None:
        return
    at, gap = found
    edges = begin + at - gap, begin + at + gap
    volts = [float(np.median(levels.voltage_v[max(a, begin) : min(b, end)])) for a, b in _beside(edges, levels.hop_s)]
    name = "voltage step" if abs(volts[1] - volts[0]) > DIP * max(volts) else "load step"
    names[edges[0] : edges[1]] = [name] * (edges[1] - edges[0])
    _name_steps(levels, begin, edges[0], names)
    _name_steps(levels, edges[1], end, names)


def _beside(edges: tuple[int, int], hop_s: float) -> tuple[tuple[int, int], tuple[int, int]]:
    side = round(LEAST_STEADY_S / hop_s)
    return (edges[0] - side, edges[0]), (edges[1], edges[1] + side)


def _clearest_step(level: Signal | Vector, hop_s: float) -> tuple[int, int] | None:
    """(where, half the change's length): where the level before and the level behind differ most, against how much each varies; None
    where nowhere enough. What lies in the change is left out of both, and each is looked at for as long as the change takes, at least half
    as long at the ends."""
    best, found = 1.0, None
    least, shortest = round(LEAST_STEADY_S / hop_s), HOPS // 2
    sums, squares = (np.concatenate([[0.0], np.cumsum(x)]) for x in (level, np.abs(level) ** 2))
    size = float(np.median(np.abs(level))) if level.size else 0.0

    def mean_and_variance(a: np.ndarray, b: np.ndarray) -> tuple[Vector, Signal]:
        mean = (sums[b] - sums[a]) / (b - a)
        return mean, np.asarray(np.maximum((squares[b] - squares[a]) / (b - a) - np.abs(mean) ** 2, 0.0))

    for gap_s in CHANGES_S:
        gap = max(round(0.5 * gap_s / hop_s), shortest)
        for side in {max(round(s / hop_s), 2 * gap) for s in STEP_SIDES_S}:
            near = max(min(side, least - shortest), gap)
            k = np.arange(gap + near, level.size - gap - near + 1)
            if k.size == 0:
                continue
            before, varies = mean_and_variance(np.maximum(k - gap - side, 0), k - gap)
            behind, varies_too = mean_and_variance(k + gap, np.minimum(k + gap + side, level.size))
            apart, rest = np.abs(behind - before), np.sqrt(varies) + np.sqrt(varies_too)
            allowed = STEADIER * (side / (side + 2 * gap)) ** 2 * apart
            share = np.where(apart > STEP * size, np.maximum(rest, FLAT * apart) / np.maximum(allowed, 1e-12), np.inf)
            j = int(np.argmin(share))
            if share[j] < best:
                best, found = float(share[j]), (int(k[j]), gap)
    return found
