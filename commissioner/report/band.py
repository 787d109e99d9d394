"""The states of a recording as a band: what the motor did, stretch by stretch, under or instead of its signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from commissioner.report.page import INK, PLOT_STYLE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = {
    "off": "#d8dde5", "residual": "#b9c2cf", "standstill": "#8fa3bf", "start": "#e69f00", "ramp": "#f0c25c",
    "voltage dip": "#9c6b30", "voltage step": "#c9a227", "load step": "#cc79a7", "steady": "#5fb59b", "coast-down": "#7aa6d8", "lost": "#d1495b",
}  # fmt: skip
LEAST_NAMED = 0.05
"""Of the width: a narrower stretch stands without its name."""


def draw(axes: Axes, stretches: Sequence[Mapping[str, Any]]) -> None:
    """One bar for each stretch on its own axes, named where there is room."""
    begin, end = stretches[0]["start_s"], stretches[-1]["end_s"]
    for s in stretches:
        width = s["end_s"] - s["start_s"]
        axes.barh(0, width, left=s["start_s"], height=1.0, color=COLOURS[s["state"]], edgecolor="white", linewidth=0.8)
        if width > LEAST_NAMED * (end - begin):
            axes.text(s["start_s"] + 0.5 * width, 0, s["state"], ha="center", va="center", fontsize=7, color=INK)
    axes.set_xlim(begin, end)
    axes.set_yticks([])
    axes.set_ylim(-0.5, 0.5)


def strip(stretches: Sequence[Mapping[str, Any]]) -> Figure:
    """The band alone, over time."""
    import matplotlib as mpl
    from matplotlib.figure import Figure as Canvas

    with mpl.rc_context(PLOT_STYLE):
        figure = Canvas(figsize=(9.2, 1.1), layout="constrained")
        axes = figure.add_subplot()
        draw(axes, stretches)
        axes.set_xlabel("time / s")
    return figure
