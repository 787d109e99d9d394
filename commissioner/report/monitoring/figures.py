"""Figures of a monitored recording, in the house style."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from commissioner.monitor.chain import Observation
from commissioner.monitor.periods.periods import SIGNIFICANT, VISIBLE
from commissioner.monitor.trend.indicators import Indicator, Pulses
from commissioner.monitor.trend.trend import History, Verdict
from commissioner.motor.circuit import QUANTILE
from commissioner.records import RPM, Signal, in_words
from commissioner.report.page import BLUE, GREEN, INK, MUTED, ORANGE, PURPLE, RED, RULE, figure_of, told_apart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = (BLUE, ORANGE, GREEN, PURPLE, RED, INK)
MOST_POINTS, MOST_LINES = 1500, 2500
MOST_NAMED = 12


def _panels(rows: int, columns: int, height: float, **options: Any) -> tuple[Figure, Any]:
    figure, drawn = figure_of(rows, columns, height, **options)
    for panel in drawn.flat:
        panel.grid(True, color=RULE, linewidth=0.6)
    return figure, drawn


def _thin(*signals: Signal) -> tuple[Signal, ...]:
    step = max(1, signals[0].size // MOST_POINTS)
    return tuple(signal[::step] for signal in signals)


def over_angle(seen: Observation) -> Figure:
    """Speed above, torques below, over shaft angle in turns."""
    period = seen.period
    figure, panels = _panels(2, 1, 5.4, sharex=True)
    turns = period.shaft_angle_rad / (2 * np.pi)
    x, y, s = _thin(turns, period.speed_rad_per_s * RPM, period.speed_std * RPM)
    speed, torque = panels[:, 0]
    speed.plot(x, y, color=BLUE)
    speed.fill_between(x, y - QUANTILE * s, y + QUANTILE * s, color=BLUE, alpha=0.2, linewidth=0)
    speed.set_ylabel("speed / (1/min)")
    for name, value, std, colour in (
        ("electromagnetic", period.torque_nm, period.torque_std, ORANGE),
        ("load", period.load_torque_nm, period.load_torque_std, GREEN),
    ):
        if value is not None and std is not None:
            x, y, s = _thin(turns, value, std)
            torque.plot(x, y, **told_apart(colour), label=name)
            torque.fill_between(x, y - QUANTILE * s, y + QUANTILE * s, color=colour, alpha=0.2, linewidth=0)
    torque.set_ylabel("torque / N m")
    torque.set_xlabel("shaft turns from the first sample of the period")
    torque.legend(frameon=False)
    return figure


def polar(seen: Observation) -> Figure:
    """Load (or electromagnetic) torque and speed deviation around the shaft."""
    period = seen.period
    figure, panels = _panels(1, 2, 4.2, subplot_kw={"projection": "polar"})
    torque, std = period.load_torque_nm, period.load_torque_std
    if torque is None or std is None:
        torque, std = period.torque_nm, period.torque_std
    label = "electromagnetic torque / N m" if period.load_torque_nm is None else "load torque / N m"
    for panel, value, spread, title, colour in (
        (panels[0, 0], torque, std, label, GREEN),
        (panels[0, 1], period.speed_rad_per_s * RPM, period.speed_std * RPM, "speed / (1/min)", BLUE),
    ):
        angle, radius, s = _thin(period.shaft_angle_rad, value, spread)
        if len(seen.combs) == 1:  # one period closes on itself
            turn = 2 * np.pi * round(seen.segment_speed_rad_per_s / (2 * np.pi * seen.combs[0].frequency_hz))
            angle, radius, s = np.append(angle, turn + angle[0]), np.append(radius, radius[0]), np.append(s, s[0])
        panel.plot(angle, radius, color=colour)
        panel.fill_between(angle, radius - QUANTILE * s, radius + QUANTILE * s, color=colour, alpha=0.2, linewidth=0)
        if radius.min() < 0 < radius.max():
            panel.plot(np.linspace(0, 2 * np.pi, 200), np.zeros(200), color=MUTED, linewidth=0.8, linestyle="--")
        margin = 0.6 * float(np.ptp(radius)) or 1.0
        panel.set_rlim(float(radius.min()) - margin, float(radius.max()) + 0.1 * margin)
        panel.set_title(title, fontsize=10)
        panel.tick_params(labelsize=7)
    return figure


def resimulation(seen: Observation) -> Figure:
    """i_d and i_q measured and simulated over a little more than one period."""
    proof = seen.proof
    figure, panels = _panels(1, 2, 3.2)
    length = min(
        proof.time_s.size, int(1.2 / seen.load_periods[0].frequency_hz / max(seen.audited.sample_period_s, 1e-9))
    )
    time = (proof.time_s[:length] - proof.time_s[0]) * 1e3
    for panel, part, name in ((panels[0, 0], np.real, "i_d / A"), (panels[0, 1], np.imag, "i_q / A")):
        x, measured, simulated = _thin(time, part(proof.measured_a[:length]), part(proof.simulated_a[:length]))
        panel.plot(x, measured, color=MUTED, linewidth=2.2, label="measured")
        panel.plot(x, simulated, color=BLUE, linewidth=0.9, label="simulated")
        panel.set_ylabel(name)
        panel.set_xlabel("time / ms")
        panel.margins(y=0.22)
    panels[0, 0].legend(frameon=False, ncols=2, loc="upper left")
    return figure


def spectrum(seen: Observation) -> Figure:
    """Height of the side bands over the floor, with the combs' lines marked; below, what is left."""
    found = seen.found
    figure, panels = _panels(2, 1, 5.2, sharex=True, sharey=True)
    for panel, one in ((panels[0, 0], found.spectrum), (panels[1, 0], found.left_over)):
        x, y = _envelope(one.frequency_hz, 10 * np.log10(np.maximum(one.power, 1e-2)))
        panel.plot(x, y, color=INK, linewidth=0.7)
        panel.axhline(
            10 * np.log10(SIGNIFICANT), color=MUTED, linewidth=0.8, linestyle="--", label="a line counts from here"
        )
        panel.set_ylabel("height over floor / dB")
    top = panels[0, 0]
    for k, load in enumerate(seen.load_periods):
        colour = COLOURS[(k + 1) % len(COLOURS)]
        named = f"{load.name}: {load.frequency_hz:.2f} Hz and multiples"
        for h in range(1, MOST_NAMED + 1):
            height = float(found.spectrum.at(h * load.frequency_hz, 0.4)[0])
            if h == 1 or height > VISIBLE:
                top.axvline(
                    h * load.frequency_hz,
                    **told_apart(colour),
                    alpha=0.45,
                    linewidth=1.0,
                    label=named if h == 1 else None,
                )
                top.annotate(
                    f"{h}×",
                    (h * load.frequency_hz, 10 * np.log10(max(height, 1.0))),
                    (3, 2),
                    textcoords="offset points",
                    fontsize=8,
                    color=colour,
                )
    slip_line = 2 * abs(seen.slip) * seen.search.supply_hz
    top.axvline(
        slip_line,
        color=RED,
        alpha=0.5,
        linewidth=1.0,
        linestyle=":",
        label="2 s f (rotor, or a load that swings there)",
    )
    top.margins(y=0.3)
    top.set_ylim(bottom=-8)
    top.legend(frameon=False, ncols=2, loc="upper right", fontsize=8)
    panels[1, 0].set_xlabel("distance from the supply frequency / Hz")
    panels[0, 0].set_xlim(0, min(12.5 * seen.segment_speed_rad_per_s / (2 * np.pi), found.spectrum.frequency_hz[-1]))
    return figure


def _envelope(x: Signal, y: Signal) -> tuple[Signal, Signal]:
    """The largest of each group of points, so that narrow lines survive."""
    step = max(1, x.size // MOST_LINES)
    count = x.size // step
    return x[: count * step : step], y[: count * step].reshape(count, step).max(axis=1)


def superimposed(pulses: Pulses) -> Figure:
    """Each pulse of the turn on the same axis."""
    figure, panels = _panels(1, 1, 3.4)
    panel = panels[0, 0]
    for k, curve in enumerate(pulses.curves):
        panel.plot(
            np.linspace(0, 1, curve.size), curve, **told_apart(COLOURS[k % len(COLOURS)]), label=f"pulse {k + 1}"
        )
    panel.set_xlabel(f"part of the pulse (1/{pulses.per_turn} turn)")
    panel.set_ylabel("torque / height of the mean pulse")
    panel.legend(frameon=False)
    return figure


def trend(history: History, indicators: Sequence[Indicator], verdict: Verdict | None = None) -> Figure:
    """Each indicator over the recordings: healthy ones first, then those judged, with the range in which none alarms."""
    limits = {} if verdict is None else {w.name: w for w in verdict.watched}
    names = [indicator.name for indicator in indicators]
    figure, panels = _panels((len(names) + 1) // 2, 2, 1.9 * ((len(names) + 1) // 2))
    for panel, name in zip(panels.flat, names, strict=False):
        count = 0
        for entries, colour, label, marker in (
            (history.healthy, GREEN, "healthy", "o"),
            (history.judged, ORANGE, "judged", "D"),
        ):
            values = [entry.indicators[name] for entry in entries if name in entry.indicators]
            x = np.arange(count, count + len(values))
            count += len(values)
            if values:
                panel.errorbar(
                    x,
                    [v for v, _ in values],
                    yerr=[QUANTILE * s for _, s in values],
                    fmt=marker,
                    markersize=3,
                    color=colour,
                    label=label,
                )
        if name in limits:
            watched = limits[name]
            reach = watched.threshold * watched.healthy_std
            panel.axhspan(
                watched.healthy_mean - reach, watched.healthy_mean + reach, color=GREEN, alpha=0.12, linewidth=0
            )
        panel.set_title(" / ".join(filter(None, in_words(name))), fontsize=8, loc="left")
        panel.tick_params(labelsize=7)
        panel.set_xlabel("recording", fontsize=7)
    for panel in panels.flat[len(names) :]:
        panel.set_visible(False)
    panels.flat[0].legend(frameon=False, fontsize=7)
    return figure
