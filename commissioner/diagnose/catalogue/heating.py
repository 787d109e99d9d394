"""Windings and cage that warm during the test."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.catalogue.effect import Effect, Setting, Sizes, effect, nearest_course
from commissioner.diagnose.catalogue.regressors import (
    CAGE_HEAT,
    FRESH_CAGE_HEAT,
    FRESH_STATOR_HEAT,
    HEAT_LEAKS_S,
    STATOR_HEAT,
)
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Term

Array = NDArray[np.float64]
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


def _heating_sizes(setting: Setting, values: Mapping[str, float]) -> Sizes:
    return {"rise_per_minute_at_rated_current": (warming(setting, values)[0], "1/min")}


@effect(
    "stator_heating",
    "Stator winding that warms during the test",
    sign=1,
    family="drifting",
    sizes=_heating_sizes,
    signature="skirts around the lowest tone, resistance higher in later segments, most in the phase that carried most",
    confounders=("rotor_heating", "resistance_anisotropy", "sensor_gain_mismatch"),
    source="adiabatic heating, IEC 60079-7 form; copper 0.393 %/K; d theta/dt = P/C - theta/tau",
    split_by="repeat the first segment last, axes in the order a-b-c-c-b-a",
    either=(STATOR_HEAT, (FRESH_STATOR_HEAT,)),
)
def stator_heating(setting: Setting) -> tuple[Term, ...]:
    """R_x = R_s (1 + k integral i_x^2 / I_N^2 dt): relative rise per minute at rated current, k >= 0, each phase by its

    own current or by the mean of the three, without a leak and with leaks of 20 and 6 s, in proportion to time, and settling (a
    dictionary); or anew in every segment.
    """
    kinds_of_heat = STATOR_HEAT + ((FRESH_STATOR_HEAT,) if setting.spans_segments else ())
    channels = {kind: f"heat_{kind}_u" for kind in kinds_of_heat}
    return tuple(
        Term(
            "stator_heating",
            kind,
            "1/min",
            kinds.PHASE_RESISTANCE,
            setting.record.channel(n),
            0.01,
            0.0,
            FASTEST_RISE,
            channel=n,
        )
        for kind, n in channels.items()
    )


@effect(
    "rotor_heating",
    "Rotor cage that warms during the test",
    sign=1,
    family="drifting",
    sizes=_heating_sizes,
    signature="rotor resistance higher in later segments; only AC content heats it",
    confounders=("stator_heating", "resistance_anisotropy", "sensor_gain_mismatch"),
    source="as stator heating, driven by the rotor current of the nominal model",
    split_by="a DC-bias segment between two AC segments",
    either=(CAGE_HEAT, (FRESH_CAGE_HEAT,)),
)
def rotor_heating(setting: Setting) -> tuple[Term, ...]:
    """R_R = R_R0 (1 + k integral i_R^2 / I_N^2 dt), k >= 0, relative rise per minute at rated current, with the leaks of the stator's;

    or in proportion to time, or settling; or anew in every segment.
    """
    names = CAGE_HEAT + ((FRESH_CAGE_HEAT,) if setting.spans_segments else ())
    return tuple(
        Term(
            "rotor_heating", n, "1/min", kinds.ROTOR_MOD, setting.record.channel(n), 0.01, 0.0, FASTEST_RISE, channel=n
        )
        for n in names
    )


ENTRIES: tuple[Effect, ...] = (stator_heating, rotor_heating)
