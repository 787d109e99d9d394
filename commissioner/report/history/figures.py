"""A panel a parameter: each point with its 95 % interval, the levels between steps, the newest marked where it is an alarm."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from commissioner.history.motor import Trend, Trends
from commissioner.motor.circuit import QUANTILE
from commissioner.motor.quantities import quantity_of
from commissioner.records import in_words
from commissioner.report.page import BLUE, INK, MUTED, ORANGE, PLOT_STYLE, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def over_years(title: str, found: Trends) -> Figure:
    """The trends in panels of two columns."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(PLOT_STYLE):
        rows = (len(found.trends) + 1) // 2
        figure = Figure(figsize=(9.2, 0.6 + 2.5 * rows))
        panels = np.atleast_1d(figure.subplots(rows, min(2, len(found.trends)), sharex=True, squeeze=False).flat)
        for panel, trend in zip(panels, found.trends, strict=False):
            _panel(panel, trend)
        for panel in panels[len(found.trends) :]:
            panel.set_visible(False)
        where = [f"{found.common.stator_flux_wb:.3g} Wb" if found.common.stator_flux_wb is not None else ""]
        where.append(f"{found.common.temperature_degc:.3g} °C" if found.common.temperature_degc is not None else "")
        at = " and ".join(filter(None, where))
        figure.suptitle(
            f"{title}{f', at {at}' if at else ''}: 95 % intervals", x=0.01, ha="left", fontsize=10, fontweight="bold"
        )
    return figure


def _panel(panel: Any, trend: Trend) -> None:
    quantity = quantity_of(trend.name)
    factor = 1.0 if quantity is None else quantity.factor
    name, unit = (in_words(trend.name)[0], trend.unit) if quantity is None else (quantity.symbol, quantity.unit)
    label = f"{name} / {unit}" if unit else name
    has_dates = bool(trend.points) and min(point.time_s for point in trend.points) > 1e6
    time = np.array([point.time_s for point in trend.points])
    shown: Any = (time * 1e6).astype("datetime64[us]") if has_dates else time
    value = factor * np.array([point.value for point in trend.points])
    error = QUANTILE * factor * np.array([point.std for point in trend.points])
    edges = [
        0,
        *(k for k, point in enumerate(trend.points) if any(step.run == point.run for step in trend.steps)),
        value.size,
    ]
    for begin, end in itertools.pairwise(edges):
        weight = 1.0 / np.maximum(error[begin:end], 1e-30) ** 2
        level = float(np.sum(weight * value[begin:end]) / np.sum(weight))
        panel.hlines(level, shown[begin], shown[end - 1], color=MUTED, linewidth=1.0)
        if begin:
            panel.axvline(shown[begin], color=ORANGE, linewidth=1.0, linestyle="--")
    panel.errorbar(shown, value, yerr=error, fmt="o", color=BLUE, markersize=4, capsize=2, linewidth=1.0)
    if trend.is_alarm:
        panel.plot(shown[-1:], value[-1:], "o", color=RED, markersize=9, fillstyle="none", markeredgewidth=2)
    panel.set_ylabel(label, color=INK)
    panel.set_xlabel("" if has_dates else "recording")
    panel.tick_params(axis="x", labelrotation=30 if has_dates else 0)
