"""What each window of levels is called: off, residual, standstill, start, ramp, voltage dip, load step, steady, coast-down."""

from __future__ import annotations

import numpy as np

from commissioner.monitor.intake.states.windows import HOPS, Levels
from commissioner.motor.nameplate import Nameplate
from commissioner.records import Signal

RESIDUAL_VOLTAGE = 0.03
"""Of the rated voltage, from which on a motor without current still has flux: it coasts."""
FAST_CHANGE = 0.12
"""Of the supply frequency, within half a second, that makes a ramp."""
STEP = 0.15
"""Of the current's level, between two sides that are each constant within `STEADIER` of it: a slow swing's are no better than 0.3."""
STEADIER = 0.25
SETTLED = 0.08
"""Of the level that follows, within which a start's current has come down."""
START_CURRENT = 2.0
"""Of the rated current, from which on a motor starts: the level of a start stays for seconds where the inertia is large, and is none that
follows it."""
STANDING = 0.02
"""Of the rated frequency: a slower vector is direct current."""
LEAST_STEADY_S, STEP_SIDE_S = 0.4, 1.0
"""What is steady, and how far to each side of a step the level is looked at."""
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
    for k in range(len(names)):
        a, b = max(k - half, 0), min(k + half, len(names) - 1)
        if idle[a : b + 1].any():
            continue
        change = abs(levels.frequency_hz[b] - levels.frequency_hz[a]) / max(levels.frequency_hz[a : b + 1].max(), 1e-9)
        if change > FAST_CHANGE * (b - a) / (2 * half) or levels.sense[a] != levels.sense[b]:
            names[k] = "ramp"
    # what lies between off and a ramp, shorter than a ramp is seen over, belongs to it
    ramps = [k for k, n in enumerate(names) if n == "ramp"]
    if ramps and (k := ramps[0]) <= 2 * half + int(np.argmin(idle)):
        for j in range(int(np.argmin(idle)), k):
            names[j] = "ramp"


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
    settled = 0
    was_off = begin > 0 and names[begin - 1] in ("off", "residual", "coast-down")
    is_first = begin == 0 and float(current[:HOPS].max()) > START_CURRENT * rated_a
    if was_off or is_first:
        peak = int(np.argmax(current))
        above = np.flatnonzero(current > (1.0 + STEP) * later)
        if current[peak] > START_CURRENT * rated_a or (
            above.size and above[0] <= 2 * HOPS and current[peak] > 1.5 * later
        ):
            settled = _first_still(current, peak, START_CURRENT * rated_a)
        else:
            settled = HOPS
        for k in range(begin, min(begin + settled, end)):
            names[k] = "start"
    elif begin > 0 and names[begin - 1] == "voltage dip":
        settled = _first_still(current, 0, np.inf)
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


def _first_still(current: Signal, peak: int, below: float) -> int:
    """From where behind the peak the level is lower than `below` and stays within a few per cent of what follows."""
    for k in range(peak, current.size - HOPS):
        ahead = current[k : k + 3 * HOPS]
        if np.ptp(ahead) < SETTLED * np.median(ahead) < SETTLED * below:
            return k
    return current.size


def _name_steps(levels: Levels, begin: int, end: int, names: list[str]) -> None:
    """The clearest step of the level first, then those before and behind it."""
    at = _clearest_step(
        levels.current_a[begin:end], round(LEAST_STEADY_S / levels.hop_s), round(STEP_SIDE_S / levels.hop_s)
    )
    if at is None:
        return
    edges = begin + at - HOPS // 2, begin + at + HOPS // 2
    names[edges[0] : edges[1]] = ["load step"] * (edges[1] - edges[0])
    _name_steps(levels, begin, edges[0], names)
    _name_steps(levels, edges[1], end, names)


def _clearest_step(current: Signal, least: int, side: int) -> int | None:
    """Where the level before and the level behind differ most, against how much each varies; None where nowhere enough. Windows that
    reach over the step are left out of both."""
    best, found = STEADIER, None
    for k in range(least, current.size - least):
        before, behind = (
            current[max(k - HOPS // 2 - side, 0) : k - HOPS // 2],
            current[k + HOPS // 2 : k + HOPS // 2 + side],
        )
        apart = abs(float(np.median(behind) - np.median(before)))
        rest = float(np.std(before) + np.std(behind))
        if apart > STEP * float(np.median(current)) and rest < best * apart:
            best, found = rest / apart, k
    return found
