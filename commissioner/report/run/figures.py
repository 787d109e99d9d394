"""The figures of a run's report. Each takes plain series and returns a matplotlib figure in the house style."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from commissioner.procedure.verdict import Values
from commissioner.records import Signal
from commissioner.report.page import BLUE, GREEN, INK, MUTED, ORANGE, PLOT_STYLE, PURPLE, RED

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXIS_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED, INK)
PANELS = (
    ("stator_resistance_ohm", "R_s / Ω", 1.0),
    ("rotor_resistance_ohm", "R_R / Ω", 1.0),
    ("leakage_inductance_h", "L_σ / mH", 1e3),
    ("magnetizing_inductance_h", "L_M / mH", 1e3),
)
MAX_POINTS = 4000


def convergence(tests: Sequence[Sequence[Mapping[str, Any]]]) -> Figure:
    """The four estimates with two standard errors over motor time, one colour per test."""
    figure, panels = _panels(2, 2, 5.2)
    for index, (panel, (_, label, factor)) in enumerate(zip(panels.flat, PANELS, strict=True)):
        for number, test in enumerate(tests):
            time = np.array([row["time_s"] for row in test])
            value = factor * np.array([row["parameters"][index] for row in test], dtype=float)
            spread = 2 * factor * np.array([row["std"][index] or np.nan for row in test], dtype=float)
            colour = AXIS_COLOURS[number % len(AXIS_COLOURS)]
            panel.plot(time, value, color=colour, label=test[0]["label"])
            panel.fill_between(time, value - spread, value + spread, color=colour, alpha=0.15, linewidth=0)
        panel.set_ylabel(label)
        _settle(panel, tests, index, factor)
    for panel in panels[-1]:
        panel.set_xlabel("time under test / s")
    panels.flat[0].legend(ncols=2)
    return figure


def _settle(panel: Any, tests: Sequence[Sequence[Mapping[str, Any]]], index: int, factor: float) -> None:
    """Scale to the second half of the long tests: start-up and first look may leave the panel."""
    longest = max(test[-1]["time_s"] for test in tests)
    late = [
        factor * row["parameters"][index]
        for test in tests
        if test[-1]["time_s"] > 0.5 * longest
        for row in test
        if row["time_s"] > 0.5 * test[-1]["time_s"]
    ]
    low, high = min(late), max(late)
    margin = max(3.0 * (high - low), 0.03 * abs(high))
    panel.set_ylim(low - margin, high + margin)


def magnetizing_curve(curve: Sequence[Mapping[str, Any]], holds_for_wb: float, rated_wb: float) -> Figure:
    """L_M over the stator flux that was visited, with its 95 % interval; nothing beyond."""
    figure, panels = _panels(1, 1, 2.6)
    panel = panels.flat[0]
    flux = np.array([row["stator_flux_wb"] for row in curve])
    value = 1e3 * np.array([row["magnetizing_inductance_h"]["value"] for row in curve])
    spread = 1.96e3 * np.array([row["magnetizing_inductance_h"]["std"] or np.nan for row in curve])
    panel.plot(flux, value, color=BLUE, label="identified")
    panel.fill_between(flux, value - spread, value + spread, color=BLUE, alpha=0.15, linewidth=0)
    panel.axvline(holds_for_wb, color=GREEN, label="the result holds here")
    panel.axvline(rated_wb, color=RED, linestyle="--", label="rated")
    panel.set_xlabel("peak stator flux / Wb")
    panel.set_ylabel("L_M / mH")
    panel.legend(ncols=3)
    return figure


def fluxes(tests: Sequence[Sequence[Mapping[str, Any]]], limit_wb: float) -> Figure:
    """Both flux estimates of every test against the limit, one after the other on the time axis."""
    figure, panels = _panels(1, 1, 2.7)
    panel = panels.flat[0]
    start = 0.0
    for number, test in enumerate(test for test in tests if test):
        time = start + np.array([row["time_s"] for row in test])
        first = number == 0
        panel.plot(time, [row["observer_flux_wb"] for row in test], color=BLUE, label="observer" if first else None)
        panel.plot(
            time,
            [row["model_free_flux_wb"] for row in test],
            color=ORANGE,
            label="model-free" if first else None,
            linewidth=0.9,
        )
        panel.axvline(start, color=MUTED, linewidth=0.5)
        start = float(time[-1])
    panel.axhline(limit_wb, color=RED, linestyle="--", label="limit")
    panel.set_ylim(0, 1.3 * limit_wb)
    panel.set_xlabel("time under test / s, tests one after the other")
    panel.set_ylabel("stator flux / Wb")
    panel.legend(ncols=3, loc="upper right")
    return figure


def currents(time_s: Signal, current_a: Signal, residual_a: Signal, title: str) -> Figure:
    """The measured axis current and what the model leaves of it."""
    figure, panels = _panels(2, 1, 3.8, sharex=True)
    keep = slice(None, None, max(1, time_s.size // MAX_POINTS))
    panels.flat[0].plot(time_s[keep], current_a[keep], color=BLUE, linewidth=0.6)
    panels.flat[0].set_ylabel("axis current / A")
    panels.flat[0].set_title(title)
    panels.flat[1].plot(time_s[keep], 1e3 * residual_a[keep], color=ORANGE, linewidth=0.5)
    panels.flat[1].set_ylabel("residual / mA")
    panels.flat[1].set_xlabel("time / s")
    return figure


def axes_side_by_side(axes: Sequence[tuple[float, Values]], combined: Mapping[str, Any]) -> Figure:
    """Each orientation's estimate with its 95 % interval beside the combined value, all at one flux."""
    figure, panels = _panels(1, 4, 2.6)
    for panel, (name, label, factor) in zip(panels.flat, PANELS, strict=True):
        for position, (_, values) in enumerate(axes):
            quantity = values[name]
            panel.errorbar(
                position,
                factor * quantity.value,
                yerr=1.96 * factor * (quantity.std or 0.0),
                fmt="o",
                color=BLUE,
                capsize=3,
                markersize=4,
            )
        total = combined[name]
        low, high = (factor * (total["value"] + sign * 1.96 * (total["std"] or 0.0)) for sign in (-1, 1))
        panel.axhspan(low, high, color=GREEN, alpha=0.18, linewidth=0)
        panel.axhline(factor * total["value"], color=GREEN)
        panel.set_title(label)
        panel.set_xticks(range(len(axes)), [f"{axis_deg:g}°" for axis_deg, _ in axes])
        panel.set_xlim(-0.6, len(axes) - 0.4)
    return figure


def _panels(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    import matplotlib as mpl
    from matplotlib.figure import Figure as NewFigure

    with mpl.rc_context(PLOT_STYLE):
        figure = NewFigure(figsize=(9.2, height))
        panels = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, panels
