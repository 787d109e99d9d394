"""The figures of a diagnosis: error over what it may depend on, over time and axis, and its spectrum."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from commissioner.diagnose.residuals import Residuals
from commissioner.report.page import BLUE, MUTED, ORANGE, PLOT_STYLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEFORE, AFTER = "simulation as it was", "with the named causes"


def over_quantities(seen: Residuals) -> Figure:
    """Four panels: error against current, voltage, flux and slope."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(PLOT_STYLE):
        figure = Figure(figsize=(9.4, 5.6))
        for axes, curve in zip(figure.subplots(2, 2).flat, seen.curves, strict=True):
            axes.plot(curve.at, curve.before_a * 1e3, color=ORANGE, label=BEFORE)
            axes.plot(curve.at, curve.after_a * 1e3, color=BLUE, label=AFTER)
            if curve.spread_a.any():
                low, high = (curve.after_a - 2 * curve.spread_a) * 1e3, (curve.after_a + 2 * curve.spread_a) * 1e3
                axes.fill_between(curve.at, low, high, color=BLUE, alpha=0.15, linewidth=0)
            axes.set_xlabel(curve.label)
            axes.set_ylabel("error rms / mA" if "flux" in curve.label else "mean error / mA")
        figure.axes[0].legend()
    return figure


def over_time_and_axis(seen: Residuals) -> Figure:
    """Two panels: error rms over the recording's time, and for each axis."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(PLOT_STYLE):
        figure = Figure(figsize=(9.4, 3.0))
        left, right = figure.subplots(1, 2, width_ratios=(2, 1))
        left.plot(seen.time_s, seen.time_before_a * 1e3, ".", color=ORANGE, label=BEFORE)
        left.plot(seen.time_s, seen.time_after_a * 1e3, ".", color=BLUE, label=AFTER)
        left.set(xlabel="time / s", ylabel="error rms / mA", ylim=(0, None))
        left.legend()
        at = np.arange(seen.by_axis_deg.shape[0])
        right.bar(at - 0.2, seen.by_axis_before_a * 1e3, 0.4, color=ORANGE)
        right.bar(at + 0.2, seen.by_axis_after_a * 1e3, 0.4, color=BLUE)
        right.set_xticks(at, [f"{a:.0f}°" for a in seen.by_axis_deg])
        right.set(xlabel="axis", ylabel="error rms / mA")
    return figure


def spectrum(seen: Residuals, tones_hz: tuple[float, ...]) -> Figure:
    """Lines of the error before and after, with the excited frequencies marked and the noise level."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(PLOT_STYLE):
        figure = Figure(figsize=(9.4, 3.2))
        axes = figure.subplots()
        shown = seen.spectrum_hz > 0
        axes.loglog(seen.spectrum_hz[shown], seen.spectrum_before_a[shown] * 1e3, color=ORANGE, linewidth=0.6, label=BEFORE)
        axes.loglog(seen.spectrum_hz[shown], seen.spectrum_after_a[shown] * 1e3, color=BLUE, linewidth=0.6, label=AFTER)
        axes.axhline(seen.spectrum_noise_a * 1e3, color=MUTED, linestyle="--", label="noise")
        for tone in tones_hz:
            axes.axvline(tone, color=MUTED, linewidth=0.5, alpha=0.5)
        axes.set(xlabel="frequency / Hz (thin lines: excited)", ylabel="line of the error / mA rms")
        axes.legend(loc="upper right")
    return figure
