"""What a winding and a cage that warm share: the course of heat, its size, and how it is written for the simulator."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Entry
from commissioner.diagnose.causes.regressors import CAGE_HEAT, HEAT_LEAKS_S
from commissioner.diagnose.causes.setting import Array, Numbers, Setting, Sizes, nearest_course
from commissioner.diagnose.plant.model import Model

ADIABATIC_S = 1e6
"""Time constant of heat that does not leak away."""
FASTEST_RISE = 20.0
"""Relative rise of a resistance (1/min at rated current) that no winding and no cage exceeds."""
LEAKING = ("settling", *(end for end in HEAT_LEAKS_S if end))
"""What names of courses end in that bend."""
SHORTEST_LEAK_S, MOST_LEAKS, LEAKS_TRIED, HEAT_POINTS = 3.0, 300.0, 12, 100
"""Where the one leak is looked for that does what several do together (and how often the recording may last as long as its time
constant), in how many steps, and on how many points of each segment."""


def warming(setting: Setting, values: Mapping[str, float]) -> tuple[float, float]:
    """Rise at first (1/min at rated current) and leak (1/s) of the one course of heat that comes nearest to the sum of these but
    for a constant, which is part of the resistance: several leaks in place of one between them begin more steeply than it does.
    """
    at_work = {symbol: value for symbol, value in values.items() if value}
    if not any(symbol.endswith(LEAKING) for symbol in at_work):
        return float(sum(at_work.values())), 0.0
    times, course = _on_points(setting, at_work)
    _, dose = _on_points(setting, {CAGE_HEAT[0] if _is_of_the_cage(next(iter(at_work))) else "mean": 1.0})

    def leaking(leak: float) -> Array:
        """Dose that leaks away: each step of the dose decays from its middle on."""
        fades = np.exp(leak * (times - times[0]))
        steps = np.diff(dose, prepend=0.0) * np.exp(-0.5 * leak * np.diff(times, prepend=times[0]))
        return np.asarray(np.cumsum(fades * steps) / fades)

    fastest = min(1.0 / SHORTEST_LEAK_S, MOST_LEAKS / float(times[-1] - times[0]))
    return nearest_course(course, leaking, np.r_[0.0, np.geomspace(1e-2, 1.0, LEAKS_TRIED) * fastest])


def _on_points(setting: Setting, values: Mapping[str, float]) -> tuple[Array, Array]:
    """Times (s) on some points of every segment of the first file, and there the sum of courses of heat, of windings their mean."""
    record = setting.record
    times, sums = [], []
    for segment, channels in zip(record.segments, record.channels, strict=True):
        if segment.file == record.segments[0].file:
            at = np.linspace(0, segment.count - 1, HEAT_POINTS).astype(int)
            times.append(segment.time_s[at])
            sums.append(
                sum(value * channels[at][:, _columns(setting, symbol)].mean(axis=1) for symbol, value in values.items())
            )
    return np.concatenate(times), np.concatenate(sums)


def _columns(setting: Setting, symbol: str) -> list[int]:
    """Channels of a course of heat, by its name."""
    names = [symbol] if _is_of_the_cage(symbol) else [f"heat_{symbol}_{p}" for p in "uvw"]
    return [setting.record.channel(n) for n in names]


def _is_of_the_cage(symbol: str) -> bool:
    return symbol.startswith(CAGE_HEAT[0])


class Warming(Cause):
    """A resistance that rises with the heat in it."""

    family = "drifting"
    sign = 1

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        return {"rise_per_minute_at_rated_current": (warming(setting, values)[0], "1/min")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """All of the heat with the one leak that bends its course as they do together."""
        rise, leak = warming(setting, values)
        return {"size": rise, "time_constant_s": 1.0 / max(leak, 1.0 / ADIABATIC_S)}
