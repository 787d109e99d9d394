"""A motor's four parameters over the years, at one flux and one temperature."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.history.series import FALSE_ALARM, LEAST, Array, Judged, judge
from commissioner.identify.estimate.axes import TEMPERATURE_K, scatter
from commissioner.identify.estimate.common_ground import CommonGround, Result, at_one_flux, at_temperature
from commissioner.motor.circuit import PARAMETERS, QUANTILE
from commissioner.motor.quantities import places, quantity_of
from commissioner.records import in_words

YEAR_S = 365.25 * 86400.0
LEAST_SPAN_S = 7 * 86400.0
"""Over less than this nothing is told for a year: of runs within minutes it would be thousands of per cent."""


@dataclass(frozen=True)
class Measured:
    """One run's result; `time_s`: of its start, since any fixed moment."""

    run: str
    time_s: float
    result: Result


@dataclass(frozen=True)
class Point:
    """`value` at the common flux and temperature; `std`: all of it, repeatability and an unknown temperature included."""

    run: str
    time_s: float
    value: float
    std: float


@dataclass(frozen=True)
class Move:
    """A step in a trend: from this `run` on, relative, at most by chance with `probability`."""

    run: str
    relative_change: float
    relative_std: float
    probability: float


@dataclass(frozen=True)
class Trend:
    """`level`: since the last step. `slope_per_year` relative, None for too few points or too short a time; `alarm_distance` of the newest point in
    standard errors against `alarm_threshold`, None for too few. `widening`: how much more the points scatter than they claim."""

    name: str
    unit: str
    points: tuple[Point, ...]
    level: float
    level_std: float
    steps: tuple[Move, ...]
    slope_per_year: float | None
    slope_std: float | None
    slope_probability: float | None
    is_sloping: bool
    alarm_distance: float | None
    alarm_threshold: float | None
    is_alarm: bool
    widening: float


@dataclass(frozen=True)
class Trends:
    """`false_alarm`: chance that anything is named though nothing has changed, all of `trends` together."""

    trends: tuple[Trend, ...]
    common: CommonGround
    false_alarm: float
    sentences: tuple[str, ...]


def motor_trends(measured: Sequence[Measured], *, false_alarm: float = FALSE_ALARM) -> Trends:
    """At least one result, in order of time. L_M at the lowest flux of all; resistances at the first known winding temperature, those
    of runs that know none with that as noise (`scatter`)."""
    results, flux_wb, said = at_one_flux([one.result for one in measured])
    degc = next((result.winding_degc for result in results if result.winding_degc is not None), None)
    of = next((result.name for result in results if result.winding_degc is not None), "")
    moved = [
        result if result.winding_degc is None or degc is None else at_temperature(result, degc, of)[0]
        for result in results
    ]
    time = np.array([one.time_s for one in measured])
    noise = np.array([scatter(result.combined, result.winding_degc is not None) for result in moved])
    trends = []
    for k, name in enumerate(PARAMETERS):
        value = np.array([result.combined.parameters.as_tuple()[k] for result in moved])
        std = noise[:, k]
        judged = _judged(time, np.log(value), std, len(PARAMETERS), false_alarm)
        trends.append(_relative(name, measured, value, std, judged))
    sentences = [*said, *_heat_sentences(results, degc)]
    return Trends(
        tuple(trends), CommonGround(flux_wb, degc, tuple(sentences)), false_alarm, _words(trends, false_alarm)
    )


def indicator_trends(
    series: Mapping[str, Sequence[tuple[str, float, float, float]]],
    units: Mapping[str, str],
    *,
    false_alarm: float = FALSE_ALARM,
) -> Trends:
    """Indicators of `monitor` by name: (source, time in s, value, noise) each, at one operating point, in order of time."""
    trends = []
    for name, rows in series.items():
        time, value, std = (np.array([row[k] for row in rows]) for k in (1, 2, 3))
        judged = _judged(time, value, np.maximum(std, 1e-12), len(series), false_alarm)
        points = tuple(Point(row[0], row[1], row[2], row[3]) for row in rows)
        scale = abs(judged.level) or 1.0
        trends.append(_trend(name, units.get(name, ""), points, (judged.level, judged.level_std), judged, scale))
    ground = CommonGround(None, None, ())
    return Trends(tuple(trends), ground, false_alarm, _words(trends, false_alarm))


def _judged(time_s: Array, value: Array, std: Array, tests: int, false_alarm: float) -> Judged:
    return judge(time_s / YEAR_S, value, std, tests=tests, false_alarm=false_alarm, least_span=LEAST_SPAN_S / YEAR_S)


def _relative(name: str, measured: Sequence[Measured], value: Array, std: Array, judged: Judged) -> Trend:
    points = tuple(
        Point(one.run, one.time_s, float(v), float(v * s)) for one, v, s in zip(measured, value, std, strict=True)
    )
    level = math.exp(judged.level)
    return _trend(
        name, "ohm" if name.endswith("_ohm") else "H", points, (level, level * judged.level_std), judged, None
    )


def _trend(
    name: str, unit: str, points: tuple[Point, ...], level: tuple[float, float], judged: Judged, scale: float | None
) -> Trend:
    """`scale`: by which what was judged is divided to be relative; None: it was the logarithm."""
    by, slope, alarm = scale or 1.0, judged.slope, judged.alarm
    steps = (
        Move(points[s.at].run, math.expm1(s.change) if scale is None else s.change / by, s.std / by, s.probability)
        for s in judged.steps
    )
    return Trend(
        name, unit, points, *level, tuple(steps),
        slope.value / by if slope else None, slope.std / by if slope else None, slope.probability if slope else None,
        bool(slope and slope.is_significant), alarm.distance if alarm else None, alarm.threshold if alarm else None,
        bool(alarm and alarm.is_raised), judged.widening,
    )  # fmt: skip


def _heat_sentences(results: Sequence[Result], degc: float | None) -> list[str]:
    unknown = sum(result.winding_degc is None for result in results)
    if degc is None:
        return [f"no winding temperature is known: resistances may differ by what {TEMPERATURE_K:g} K make"]
    said = [f"resistances are shown at {degc:.3g} °C, the rotor taken to be as warm as the winding"]
    if unknown:
        said.append(
            f"{unknown} of {len(results)} runs know no winding temperature: their resistances may differ by what {TEMPERATURE_K:g} K make"
        )
    return said


def in_percent(share: float, std: float) -> str:
    """`+8.00 ± 0.12 %`: a 95 % interval to two digits, the share as far as these."""
    half = 100 * QUANTILE * std
    last = places(half) if 0.0 < half < math.inf else 1
    return f"{round(100 * share, last):+.{max(last, 0)}f} ± {round(half, last):.{max(last, 0)}f} %"


def _words(trends: Sequence[Trend], false_alarm: float) -> tuple[str, ...]:
    said = []
    for trend in trends:
        quantity = quantity_of(trend.name)
        spoken = in_words(trend.name)[0] if quantity is None else quantity.words
        for step in trend.steps:
            said.append(
                f"{spoken} has moved by {in_percent(step.relative_change, step.relative_std)} from {step.run} on "
                f"(by chance: {step.probability:.1g})"
            )
        if trend.is_sloping and trend.slope_per_year is not None and trend.slope_std is not None:
            said.append(
                f"{spoken} drifts by {in_percent(trend.slope_per_year, trend.slope_std)} a year (by chance: "
                f"{trend.slope_probability:.1g})"
            )
        if trend.is_alarm:
            said.append(
                f"alarm: the newest {spoken} is {trend.alarm_distance:+.1f} standard errors off, beyond {trend.alarm_threshold:.1f}"
            )
    if not said and max((len(trend.points) for trend in trends), default=0) < LEAST:
        return (f"fewer than {LEAST} points: levels only, nothing can be said of a change",)
    if not said:
        said.append("nothing has changed beyond error")
    said.append(f"a motor without any change gets one of these sentences with a chance of at most {false_alarm:g}")
    return tuple(said)
