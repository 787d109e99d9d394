"""The figures of a diagnosis: error over what it may depend on, its spectrum, its tie to the command, causes that look alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.verdict.collinearity import Alike
from commissioner.diagnose.verdict.residuals import Correlation, Residuals, Spectrum
from commissioner.motor.circuit import QUANTILE
from commissioner.report.page import BLUE, INK, MUTED, ORANGE, PLOT_STYLE, plain_decades, told_apart
from commissioner.report.sheet.words import cause_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE, AFTER = "simulation as it was", "with the named causes"
TOTAL_WIDTH = 9.4
BAND, NOISE_BAND = 2.58, QUANTILE
"""99 % and 95 % of a normal variable."""
VISIBLE = 0.02
"""Thinnest band that shows, as a share of a panel's height."""
CLASS_WORDS = {
    "excited": "the test's\nown",
    "odd": "odd\ndistortion",
    "even": "even\ndistortion",
    "other": "all others",
}
Array = NDArray[np.float64]
Wanted = ParamSpec("Wanted")


def _styled(draw: Callable[Wanted, Figure]) -> Callable[Wanted, Figure]:
    """Draws in the house style without changing matplotlib's settings for others."""

    @wraps(draw)
    def drawn(*args: Wanted.args, **keys: Wanted.kwargs) -> Figure:
        import matplotlib as mpl

        with mpl.rc_context(PLOT_STYLE):
            return draw(*args, **keys)

    return drawn


@_styled
def over_quantities(seen: Residuals, has_causes: bool) -> Figure:
    """Four panels: error against current, voltage, flux and slope."""
    figure = _figure(5.6)
    for axes, curve in zip(figure.subplots(2, 2).flat, seen.curves, strict=True):
        _pair(axes, curve.at, curve.before_a * 1e3, curve.after_a * 1e3, has_causes)
        if curve.spread_a.any():
            band = NOISE_BAND * curve.spread_a * 1e3
            axes.fill_between(curve.at, -band, band, color=MUTED, alpha=0.35, linewidth=0)
            axes.axhline(0.0, color=MUTED, linewidth=0.8)
        else:
            axes.set_ylim(0, None)
        axes.set_xlabel(curve.label)
        axes.set_ylabel("size of the error / mA rms" if "flux" in curve.label else "mean error / mA")
    _legend_above(figure, figure.axes[0])
    return figure


def shade_is_visible(seen: Residuals, has_causes: bool) -> bool:
    """Whether a panel's noise band is thick enough to be seen beside the curves."""
    for curve in seen.curves:
        drawn = np.concatenate([curve.before_a, curve.after_a if has_causes else curve.before_a, [0.0]])
        if 2 * NOISE_BAND * float(curve.spread_a.max()) > VISIBLE * float(np.ptp(drawn)):
            return True
    return False


@_styled
def over_time_and_axis(seen: Residuals, has_causes: bool, noise_a: float | None) -> Figure:
    """Two panels: error rms over the recording's time, and for each axis; the noise where it is known."""
    figure = _figure(2.9)
    left, right = figure.subplots(1, 2, width_ratios=(2, 1), sharey=True)
    _pair(left, seen.time_s, seen.time_before_a * 1e3, seen.time_after_a * 1e3, has_causes, is_dotted=True)
    left.set(xlabel="time / s", ylabel="size of the error / mA rms")
    if noise_a is not None:
        left.axhline(noise_a * 1e3, color=MUTED, linestyle="--", label="noise")
        right.axhline(noise_a * 1e3, color=MUTED, linestyle="--")
    at = np.arange(seen.by_axis_deg.shape[0])
    width = 0.4 if has_causes else 0.6
    right.bar(at - (0.2 if has_causes else 0.0), seen.by_axis_before_a * 1e3, width, color=ORANGE)
    if has_causes:
        right.bar(at + 0.2, seen.by_axis_after_a * 1e3, width, color=BLUE)
    right.set_xticks(at, [f"{a:.0f}°" for a in seen.by_axis_deg])
    right.set_xlim(-0.8, at.size - 0.2)
    right.set(xlabel="axis")
    left.set_ylim(0, 1.05 * 1e3 * float(max(seen.time_before_a.max(), seen.time_after_a.max(), noise_a or 0.0)))
    _legend_above(figure, left)
    return figure


@_styled
def spectrum(seen: Spectrum, tones_hz: Sequence[float], has_causes: bool) -> Figure:
    """Lines of the error with the excited frequencies marked and the noise; beside it the classes of frequency."""
    figure = _figure(3.3)
    axes, bars = figure.subplots(1, 2, width_ratios=(2.2, 1))
    axes.loglog(seen.frequency_hz[:-1], seen.before_a[:-1] * 1e3, color=ORANGE, linewidth=0.7, label=BEFORE)
    if has_causes:
        axes.loglog(seen.frequency_hz[:-1], seen.after_a[:-1] * 1e3, color=BLUE, linewidth=0.7, label=AFTER)
    axes.loglog(seen.frequency_hz, seen.noise_a * 1e3, color=INK, linestyle="--", linewidth=1.0, label="noise")
    for tone in tones_hz:
        axes.axvline(tone, color=MUTED, linewidth=0.5, alpha=0.5, zorder=0)
    top = 1e3 * float(max(seen.before_a.max(), seen.noise_a.max()))
    axes.set_ylim(0.1e3 * float(seen.noise_a.min()), 2.0 * top)
    axes.set(xlabel="frequency / Hz (thin upright lines: the test's own)", ylabel="error at each frequency / mA rms")
    axes.xaxis.set_major_formatter("{x:g}")
    plain_decades(axes.yaxis)
    _legend_above(figure, axes)
    names = [k for k in CLASS_WORDS if k in seen.by_class]
    at = np.arange(len(names))
    shift = 0.2 if has_causes else 0.0
    before, after = ([seen.by_class[n][k] for n in names] for k in (0, 1))
    bars.bar(at - shift, before, 0.4, color=ORANGE)
    if has_causes:
        bars.bar(at + shift, after, 0.4, color=BLUE)
    bars.axhline(1.0, color=INK, linestyle="--", linewidth=1.0)
    bars.set_yscale("log")
    bars.set_ylim(0.3, 3.0 * max(*before, *after, 1.0))
    plain_decades(bars.yaxis)
    bars.set_xticks(at, [CLASS_WORDS[n] for n in names], fontsize=7.5)
    bars.set_xlim(-0.7, at.size - 0.3)
    bars.set(ylabel="error, times the noise")
    return figure


@_styled
def correlation(seen: Correlation, has_causes: bool) -> Figure:
    """Error against the command a while earlier, with the band that noise alone stays in."""
    figure = _figure(2.7)
    axes = figure.subplots()
    axes.axhspan(-BAND, BAND, color=MUTED, alpha=0.25, linewidth=0, label="noise alone stays here 99 % of the time")
    _pair(axes, seen.lag_s * 1e3, seen.before, seen.after, has_causes)
    largest = float(np.abs(np.concatenate([seen.before, seen.after])).max())
    if largest > 10.0 * BAND:
        powers = 10.0 ** np.arange(1, 1 + int(np.log10(2.0 * largest)))
        axes.set_yscale("symlog", linthresh=BAND)
        axes.set_yticks([*-powers[::-1], 0.0, *powers])
        axes.minorticks_off()
        axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylim(-max(2.0 * largest, 2.0 * BAND), max(2.0 * largest, 2.0 * BAND))
    axes.set(
        xlabel="how long the current's error comes after the voltage / ms",
        ylabel="tie to the voltage,\ntimes the noise",
    )
    _legend_above(figure, axes)
    return figure


@_styled
def look_alikes(seen: Alike, named: Sequence[str]) -> Figure:
    """Heat map, row: the cause at work, column: the cause it may be taken for. Found causes are bold."""
    count = len(seen.names)
    figure = _figure(min(1.9 + 0.27 * count, 6.0), width=min(3.4 + 0.38 * count, TOTAL_WIDTH))
    axes = figure.subplots()
    axes.imshow(seen.share, cmap="Blues", vmin=0.0, vmax=1.15, aspect="auto")
    words = [cause_name(n) for n in seen.names]
    axes.set_xticks(range(count), words, rotation=40, ha="right", rotation_mode="anchor")
    axes.set_yticks(range(count), words)
    for label, name in zip([*axes.get_xticklabels(), *axes.get_yticklabels()], seen.names * 2, strict=True):
        label.set(color=INK, fontsize=8.0, fontweight="bold" if name in named else "normal")
    for row, column in np.argwhere(seen.share >= 0.1):
        share = float(seen.share[row, column])
        text = "" if row == column else f"{100.0 * share:.0f}"
        axes.text(column, row, text, ha="center", va="center", fontsize=7.0, color="white" if share > 0.6 else INK)
    axes.grid(False)
    axes.set(xlabel="could be taken for ... (%)", ylabel="cause at work")
    return figure


@_styled
def over_points(points: Sequence[Mapping[str, float]], is_locked: bool, has_causes: bool) -> Figure:
    """Error of the predicted current and power at every test point, over current (locked rotor) or flux (no load), and
    over frequency where the test has several. Rings: the point was left out of the fit; dots: it was in it."""
    frequency, volts, amps = (
        np.array([p[k] for p in points]) for k in ("frequency_hz", "voltage_line_v", "current_line_a")
    )
    across = (
        [(amps, "line current / A rms")]
        if is_locked
        else [(np.sqrt(2.0 / 3.0) * volts / (2.0 * np.pi * frequency), "stator flux / Wb peak")]
    )
    if np.unique(frequency).size > 1:
        across.append((frequency, "frequency / Hz"))
    figure = _figure(4.6)
    panels = figure.subplots(2, len(across), sharex="col", sharey="row", squeeze=False)
    for row, what in zip(panels, ("current", "power"), strict=True):
        for axes, (x, label) in zip(row, across, strict=True):
            for when, color in (("before", ORANGE), ("after", BLUE))[: 2 if has_causes else 1]:
                out, inside = (
                    100.0 * np.array([p[f"{what}_error_{when}_{how}"] for p in points])
                    for how in ("left_out", "fitted")
                )
                axes.plot(
                    x, inside, ".", color=color, markersize=4, label=f"{BEFORE if when == 'before' else AFTER}, fitted"
                )
                axes.plot(
                    x, out, "o", color=color, fillstyle="none", markersize=6, label="the same point left out of the fit"
                )
            axes.axhline(0.0, color=MUTED, linewidth=0.8)
            axes.set_xlabel(label if what == "power" else "")
        row[0].set_ylabel(f"error of the {what} / %")
    _legend_above(figure, panels[0, 0], columns=2)
    return figure


def _legend_above(figure: Figure, axes: Axes, columns: int = 4) -> None:
    """The legend outside the panels, where no curve runs."""
    figure.legend(*axes.get_legend_handles_labels(), ncols=columns, loc="outside upper center")


def _pair(axes: Axes, x: Array, before: Array, after: Array, has_causes: bool, *, is_dotted: bool = False) -> None:
    """The error before and, where causes were named, after: lines, or crosses and dots."""
    axes.plot(x, before, **(_dots(ORANGE, "x") if is_dotted else told_apart(ORANGE)), label=BEFORE)
    if has_causes:
        axes.plot(x, after, **(_dots(BLUE, ".") if is_dotted else told_apart(BLUE)), label=AFTER)


def _dots(color: str, marker: str) -> dict[str, Any]:
    return {"color": color, "linestyle": "", "marker": marker, "markersize": 4.0}


def _figure(height: float, width: float = TOTAL_WIDTH) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height))
