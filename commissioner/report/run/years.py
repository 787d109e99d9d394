"""The motor over the years: what its earlier runs found beside this one, at one flux and one temperature."""

from __future__ import annotations

from markupsafe import Markup

from commissioner.history.motor import Trend, Trends
from commissioner.report.run.quantities import BY_FIELD, Quantity
from commissioner.report.sheet import marks
from commissioner.report.sheet.drawing import Panel, padded
from commissioner.report.sheet.marks import Column
from commissioner.report.sheet.numbers import digits, half_width, with_interval
from commissioner.report.sheet.words import spoken

_SCALES = ((365.25 * 86400.0, "a"), (86400.0, "d"), (3600.0, "h"), (60.0, "min"))
"""Seconds of a unit and its sign: the first of which a motor's history takes more than two."""
_COLUMNS = (
    Column("Parameter"), Column("This run", right=True), Column("Since it last changed", right=True), Column("Change a year", right=True),
)  # fmt: skip


def years_sheet(years: Trends | None) -> Markup:
    """Empty where there is no history to show."""
    if years is None:
        return Markup("")
    panels = [(Markup("{}, {}").format(q.symbol, q.unit), _panel(trend, q)) for trend, q in _shown(years)]
    where = [
        f"a stator flux of {digits(years.common.stator_flux_wb, 3)} Wb" if years.common.stator_flux_wb else "",
        f"{digits(years.common.temperature_degc, 3)} °C" if years.common.temperature_degc is not None else "",
    ]
    at = " and ".join(filter(None, where))
    runs = len(years.trends[0].points)
    caption = f"{runs} runs of this motor{f', at {at}' if at else ''}, each with its interval; the newest is this run. Line: the level."
    return Markup("\n").join(
        [
            marks.figure("The motor over the years", marks.multiples(panels, 2), caption),
            marks.table(_COLUMNS, [_row(trend, q) for trend, q in _shown(years)]),
            *(
                marks.paragraph(spoken(f"{marks.capitalised(said)}."))
                for said in (*years.sentences, *years.common.sentences)
            ),
        ]
    )


def _shown(years: Trends) -> list[tuple[Trend, Quantity]]:
    return [(trend, BY_FIELD[trend.name]) for trend in years.trends]


def _row(trend: Trend, quantity: Quantity) -> tuple[Markup | str, ...]:
    newest, factor, unit = trend.points[-1], quantity.factor, quantity.unit
    slope = "too few runs, or too short a time" if trend.slope_per_year is None or trend.slope_std is None else (
        f"{with_interval(100 * trend.slope_per_year, half_width(trend.slope_std, 100))} %"
    )  # fmt: skip
    return (
        Markup("{} {}").format(quantity.symbol, quantity.words),
        f"{with_interval(factor * newest.value, half_width(factor * newest.std))} {unit}",
        f"{with_interval(factor * trend.level, half_width(factor * trend.level_std))} {unit}",
        slope,
    )


def _panel(trend: Trend, quantity: Quantity) -> Markup:
    first, last = trend.points[0].time_s, trend.points[-1].time_s
    scale, sign = next((s for s in _SCALES if last - first > 2.0 * s[0]), _SCALES[-1])
    rows = [
        ((p.time_s - last) / scale, quantity.factor * p.value, half_width(quantity.factor * p.std))
        for p in trend.points
    ]
    level, half = quantity.factor * trend.level, half_width(quantity.factor * trend.level_std)
    reach = padded([v + s * h for _, v, h in rows for s in (-1.0, 1.0)], 0.12)
    span = padded([x for x, _, _ in rows], 0.04)
    words = f"{quantity.words} over {len(rows)} runs, in {quantity.unit}"
    panel = Panel(325, 112, span, reach, words, left=36).grid(4).axis(sign, 5)
    begin = next(
        (x for (x, _, _), p in zip(rows, trend.points, strict=True) if trend.steps and p.run == trend.steps[-1].run),
        span[0],
    )
    panel.band((begin, span[1]), (level - half,) * 2, (level + half,) * 2).line((begin, span[1]), (level, level), "res")
    for x, value, half in rows:
        panel.line((x, x), (value - half, value + half)).point(x, value)
    if trend.is_alarm:
        panel.point(rows[-1][0], rows[-1][1], "bar1", 4.0)
    return panel.drawn()
