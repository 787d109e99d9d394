"""Figures of a running diagnosis: measured and simulated over each other, the residual's band by time and by frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from commissioner.estimation.fit import residuals, simulate
from commissioner.estimation.record import STATES
from commissioner.report.page import BLUE, GREEN, MUTED, ORANGE, RED, figure_of, legend_above
from commissioner.running.search import Found

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN_S = 0.16
BAND_S = 0.02


def over_each_other(found: Found) -> Figure:
    """Phase u: the first periods and the last ones, measured, plain simulation, extended one; below, what each leaves."""
    figure, drawn = figure_of(2, 2, 5.2)
    window = found.problem.record.windows[0]
    plain, extended = (simulate(found.problem, m)[0][0][:, 0] for m in (found.nominal.machine, found.fit.machine))
    count = round(SHOWN_S / found.problem.period)
    for column, part in enumerate((slice(0, count), slice(window.count - count // 2, window.count))):
        t = window.time_s[part]
        top, below = drawn[0, column], drawn[1, column]
        top.plot(t, window.current[part, 0], color=MUTED, linewidth=2.2, label="measured")
        top.plot(t, plain[part], color=ORANGE, linewidth=0.9, linestyle="--", label="plain simulation")
        top.plot(t, extended[part], color=BLUE, linewidth=0.9, label="with the named causes")
        top.set_title("first periods" if column == 0 else "last periods, held out", loc="left")
        below.plot(t, window.current[part, 0] - plain[part], color=ORANGE, linewidth=0.9)
        below.plot(t, window.current[part, 0] - extended[part], color=BLUE, linewidth=0.9)
        below.set_xlabel("time / s")
    drawn[0, 0].set_ylabel("current alpha / A")
    drawn[1, 0].set_ylabel("measured - simulated / A")
    legend_above(drawn[0, 0])
    return figure


def over_time(found: Found) -> Figure:
    """Residual over noise in blocks of 20 ms, before and after; states shaded, the held-out part marked."""
    figure, drawn = figure_of(1, 1, 3.0)
    panel = drawn[0, 0]
    window, until = found.problem.record.windows[0], found.problem.until[0]
    block = max(round(BAND_S / found.problem.period), 4)
    for machine, colour, label in (
        (found.nominal.machine, ORANGE, "plain simulation"),
        (found.fit.machine, BLUE, "with the named causes"),
    ):
        square = np.mean(residuals(found.problem, machine)[0] ** 2, axis=1)
        usable = square[: square.size // block * block].reshape(-1, block).mean(axis=1)
        panel.step(
            window.time_s[: usable.size * block : block], np.sqrt(usable), where="post", color=colour, label=label
        )
    shades = {"start": RED, "transient": GREEN}
    for name, colour in shades.items():
        chosen = (window.state == STATES.index(name)).astype(int)
        edges = np.flatnonzero(np.diff(chosen, prepend=0, append=0))
        for k, (a, b) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
            panel.axvspan(
                window.time_s[a], window.time_s[min(b, window.count - 1)], color=colour, alpha=0.08, linewidth=0,
                label=f"{name if name == 'start' else 'load step or ramp'}" if k == 0 else None,
            )  # fmt: skip
    panel.axhline(1.0, color=MUTED, linewidth=0.8, linestyle="--")
    if until < window.count:
        panel.axvline(window.time_s[until], color=MUTED, linewidth=1.0, linestyle=":", label="held out from here")
    panel.set_yscale("log")
    panel.set_ylabel("residual / noise")
    panel.set_xlabel("time / s")
    legend_above(panel)
    return figure


def over_frequency(found: Found) -> Figure:
    """Spectrum of the whitened residual vector, negative sequence left, before and after."""
    figure, drawn = figure_of(1, 1, 3.0)
    panel = drawn[0, 0]
    for machine, colour, label in (
        (found.nominal.machine, ORANGE, "plain simulation"),
        (found.fit.machine, BLUE, "with the named causes"),
    ):
        rest = residuals(found.problem, machine)[0]
        vector = (rest[:, 0] + 1j * rest[:, 1]) * np.hanning(rest.shape[0])
        power = np.abs(np.fft.fftshift(np.fft.fft(vector))) ** 2 / np.sum(np.hanning(rest.shape[0]) ** 2) / 2.0
        hz = np.fft.fftshift(np.fft.fftfreq(vector.size, found.problem.period))
        inside = np.abs(hz) < 400.0
        panel.plot(hz[inside], 10 * np.log10(np.maximum(power[inside], 1e-2)), color=colour, linewidth=0.7, label=label)
    panel.axhline(0.0, color=MUTED, linewidth=0.8, linestyle="--")
    panel.set_xlabel("frequency / Hz, negative: turns against the field")
    panel.set_ylabel("residual over noise / dB")
    legend_above(panel)
    return figure
