"""Page 2: limits kept, measured against simulated, values while measuring, tests against each other, the inverter's loss and
the iron. Each limit is drawn; black is the result, blue what was measured, pale a 95 % interval, hatched what was not tested."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from markupsafe import Markup

from commissioner.procedure.verdict import evidence_of
from commissioner.records import Signal
from commissioner.report.run.quantities import FOUR, Quantity
from commissioner.report.run.subject import Record, Session, Subject, Test
from commissioner.report.sheet import marks
from commissioner.report.sheet.drawing import Panel, envelope, padded
from commissioner.report.sheet.numbers import digits, half_width, spelled, with_interval

WINDOW_S = 0.03
"""Of the envelope that stands for a line of many samples."""
STRETCH_S = 0.25
"""Of the samples shown one by one."""
ABOVE_AND_BELOW = "current along the axis in A (above), stator flux in Wb (below), over energised time"
MOST_TESTS = 8
"""With panels of their own; more would leave the page."""


def evidence(subject: Subject) -> Markup:
    """The second page: of a run that ended before its tests were fitted what was applied; empty where nothing was."""
    if not subject.tests:
        return Markup("<h2>The evidence</h2>\n") + _up_to_the_end(subject) if subject.samples else Markup("")
    parts = [
        Markup("<h2>The evidence</h2>"),
        _limits_kept(subject),
        against_simulation(subject),
        _while_measuring(subject),
        beside(subject),
    ]
    return Markup("\n").join(parts)


def _limits_kept(subject: Subject) -> Markup:
    peak, undrawn = subject.peak_flux_wb, len(subject.tests) - MOST_TESTS
    acted = "took the amplitude back" if subject.guard.get("acted") else "had no cause to act"
    caption = (
        "Each test: direct currents, tones, small tones on a direct current (test 1 looks first). Filled: smallest to largest of "
        f"each {1e3 * WINDOW_S:.0f} ms. Flux is that of the fitted model. "
        + (f"The guard, which judges while measuring, saw {digits(peak, 3)} Wb at most and {acted}." if peak else "")
        + (f" {undrawn} more tests are not drawn." if undrawn > 0 else "")
    )
    drawn = over_time(subject, subject.trip_current_a, subject.guard.get("limit_wb"))
    return marks.figure("Limits kept", drawn, caption, aside=ABOVE_AND_BELOW)


def _up_to_the_end(subject: Subject) -> Markup:
    """What the motor got, and what the guard judged, where no model was fitted to it."""
    trip, limit, peak = subject.trip_current_a, subject.guard.get("limit_wb"), subject.peak_flux_wb
    time, current = subject.applied_a
    panels = [("Current along the axis, A", _against(time, current, trip, "A", "Current along the axis"))]
    caption = f"All energised time in a row; filled: smallest to largest of each {1e3 * WINDOW_S:.0f} ms."
    tones_s, flux_share = subject.guarded
    if limit and tones_s.size:
        label = "Stator flux by the guard"
        panels.append((f"{label}, Wb", _against(tones_s, limit * flux_share, limit, "Wb", label)))
        caption += " Flux is the largest that the guard took for possible at each estimate under tones" + (
            f"; between them it saw {digits(peak, 3)} Wb at most." if peak else "."
        )
    return marks.figure("Up to the end of the run", marks.multiples(panels, 2), caption)


def _against(time: Signal, value: Signal, limit: float | None, unit: str, label: str) -> Markup:
    """One quantity up to its last value, and its limit."""
    low, high = min(0.0, float(np.min(value))), max(float(np.max(value)), limit or 0.0)
    panel = Panel(331, 142, (0.0, float(time[-1])), (1.18 * (-high if low < 0.0 else 0.0), 1.18 * high), label, left=30)
    panel.grid(5).axis("s", 4)
    if low < 0.0:
        panel.band(*envelope(time, value, WINDOW_S), kind="env")
    else:
        panel.line(time, value)
    for level in [limit, -limit][: 2 if low < 0.0 else 1] if limit else ():
        panel.level(level)
    if limit:
        panel.named(float(time[-1]), 1.05 * limit, f"limit {digits(limit, 3)} {unit}", "l", "end")
    return panel.drawn()


def beside(subject: Subject) -> Markup:
    """The three small figures that stand beside each other."""
    return Markup('<div class="p3">{}{}{}</div>').format(tests_apart(subject), leg_loss(subject), iron(subject))


def over_time(subject: Subject, trip: float | None = None, flux_limit: float | None = None) -> Markup:
    """Currents above fluxes, a column each test, with their limits where there are any."""
    tests = subject.tests[:MOST_TESTS]
    currents = _panels_over_time(
        tests, "current_a", trip, f"limit {digits(trip, 3)} A" if trip else "", "Current along the axis"
    )
    fluxes = _panels_over_time(
        tests, "stator_flux_wb", flux_limit, f"limit {digits(flux_limit, 3)} Wb" if flux_limit else "", "Stator flux"
    )
    titles = [f"Test {test.number}, axis {test.axis_deg:g}°" for test in tests]
    return marks.multiples(zip(titles, currents, strict=True), 4) + marks.multiples((("", f) for f in fluxes), 4)


def _panels_over_time(tests: Sequence[Test], what: str, limit: float | None, named: str, label: str) -> list[Markup]:
    """One panel a test, all with one scale, the limit named in the first."""
    series = [test.joined(what) for test in tests]
    largest = max((float(np.max(np.abs(value))) for _, value in series if value.size), default=1.0)
    top = 1.18 * max(largest, limit or 0.0)
    longest = max((float(time[-1]) for time, _ in series if time.size), default=1.0)
    drawn = []
    for test, (time, value) in zip(tests, series, strict=True):
        panel = (
            Panel(160, 86, (0.0, longest), (-top, top), f"{label} in test {test.number}", left=22).grid(5).axis("s", 3)
        )
        panel.band(*envelope(time, value, WINDOW_S), kind="env")
        if limit:
            panel.level(limit).level(-limit)
            if test.number == 1:
                panel.named(longest, limit + 0.05 * top, named, "l", "end")
        drawn.append(panel.drawn())
    return drawn


def against_simulation(subject: Subject) -> Markup:
    """A stretch of the last test, measured on simulated, and what each test's residual is over time."""
    test = subject.tests[-1]
    fitted = [s for s in test.sessions if s.residual_a is not None]
    if not fitted:
        return Markup("")
    session = max(fitted, key=lambda s: s.time_s.size)
    noise_a = neighbours_noise_a(subject)
    left = Markup("<div><h4>{}</h4>{}{}</div>").format(
        "Current, A; below it the residual, mA", *_stretch(session, noise_a)
    )
    right = Markup("<div><h4>{}</h4>{}</div>").format(
        "Residual in each tenth of a second, mA rms", _residual_course(subject, noise_a)
    )
    caption = (
        "Dots: measured; pale line: simulated with the result. Pale band: 95 % of what differs between neighbouring samples only, "
        f"{digits(1e3 * noise_a, 2)} mA rms, which no model of the motor explains. What the model misses would stand above it."
    )
    return marks.figure(
        "Measured against simulated", Markup('<div class="p2">{}{}</div>').format(left, right), caption,
        aside=f"axis {test.axis_deg:g}°, test {test.number}",
    )  # fmt: skip


def neighbours_noise_a(subject: Subject) -> float:
    """rms of what is independent from sample to sample: half the mean square of residuals' differences (von Neumann 1941,
    doi:10.1214/aoms/1177731677)."""
    residuals = [
        s.residual_a
        for test in subject.tests
        for s in test.sessions
        if s.residual_a is not None and s.residual_a.size > 1
    ]
    squares = sum(float(np.sum(np.square(np.diff(r)))) for r in residuals)
    return math.sqrt(0.5 * squares / max(1, sum(r.size - 1 for r in residuals)))


def _stretch(session: Session, noise_a: float) -> tuple[Markup, Markup]:
    """A quarter of a second in the middle: measured on simulated, and what is left."""
    assert session.residual_a is not None
    period_s = float(session.time_s[1] - session.time_s[0]) if session.time_s.size > 1 else 1.0
    count = max(2, min(session.time_s.size, int(STRETCH_S / period_s)))
    start = (session.time_s.size - count) // 3
    part = slice(start, start + count)
    time, current, residual = session.time_s[part], session.current_a[part], session.residual_a[part]
    span = (float(time[0]), float(time[-1]))
    thin = max(1, count // 600)
    above = Panel(
        331, 88, span, padded(current), "Measured current as dots on the simulated line", left=30, bottom=4
    ).grid(3)
    above.line(time[::thin], (current - residual)[::thin], "sim")
    every = max(1, count // 100)
    above.dots(time[::every], current[::every])
    reach = 1.15e3 * max(float(np.max(np.abs(residual))), 2.0 * noise_a)
    below = Panel(331, 54, span, (-reach, reach), "Residual of the same stretch in milliamperes", left=30)
    band = half_width(noise_a, 1e3)
    below.band(span, (-band, -band), (band, band)).grid(3).line(time, 1e3 * residual, "tr thin").axis("s", 3)
    return above.drawn(), below.drawn()


def _residual_course(subject: Subject, noise_a: float) -> Markup:
    courses = [_tenths(*test.joined("residual_a")) for test in subject.tests]
    longest = max((float(t[-1]) for t, _ in courses if t.size), default=1.0)
    highest = max((float(np.max(v)) for _, v in courses if v.size), default=noise_a)
    top = 1.35e3 * max(highest, noise_a)
    panel = (
        Panel(331, 142, (0.0, longest), (0.0, top), "rms of the residual in each tenth of a second")
        .grid(4)
        .axis("s", 4)
    )
    for number, (time, value) in enumerate(courses):
        panel.line(time, 1e3 * value, "tr thin old" if number == 0 and len(courses) > 1 else "tr thin")
    panel.level(1e3 * noise_a, "res")
    panel.text(
        325, panel.at_y(1e3 * noise_a) - 5, f"from sample to sample {digits(1e3 * noise_a, 2)} mA", "k halo", "end"
    )
    panel.text(
        325,
        panel.at_y(0.12 * top),
        "what the model leaves over, each test" + (" (dashed: test 1)" if len(courses) > 1 else ""),
        "t halo",
        "end",
    )
    return panel.drawn()


def _tenths(time: Signal, value: Signal) -> tuple[Signal, Signal]:
    """(middle, rms) of each tenth of a second."""
    if not time.size:
        return time, value
    bins = np.floor(time / 0.1).astype(int)
    starts = np.flatnonzero(np.r_[True, np.diff(bins) > 0])
    counts = np.diff(np.r_[starts, time.size])
    rms = np.sqrt(np.add.reduceat(np.square(value), starts) / counts)
    whole = counts > 0.5 * np.median(counts)
    return (0.1 * (bins[starts] + 0.5))[whole], rms[whole]


def _while_measuring(subject: Subject) -> Markup:
    tests = subject.estimates
    if not tests or not subject.parameters:
        return Markup("")
    panels = [
        (Markup("{}, {}").format(quantity.symbol, quantity.unit), _convergence(subject, tests, index, quantity))
        for index, quantity in enumerate(FOUR)
    ]
    flux = digits(subject.result["holds_for_stator_flux_wb"], 3)
    caption = Markup(
        "While measuring, the iron is taken as straight and the flux is whatever was reached so far. The result is fitted to all "
        "samples together with the bent iron and stands at {} Wb: that is why {} may end elsewhere. Pale: 95 % interval of the last test."
    ).format(flux, marks.L_M)
    return marks.figure(
        "Values while measuring",
        marks.multiples(panels, 4),
        caption,
        aside=f"{spelled(len(tests), 'test')}; black: the result",
    )


def _convergence(subject: Subject, tests: Sequence[Sequence[Record]], index: int, quantity: Quantity) -> Markup:
    result = quantity.factor * subject.parameters[quantity.field]["value"]
    courses = [
        (
            np.array([row["time_s"] for row in test]),
            quantity.factor * np.array([row["parameters"][index] for row in test], dtype=float),
        )
        for test in tests
    ]
    late = [value[time > 0.3 * time[-1]] for time, value in courses]
    low, high = padded([*np.concatenate(late), result], 0.5)
    panel = Panel(
        160, 104, (0.0, max(float(t[-1]) for t, _ in courses)), (low, high), f"{quantity.words} converging", left=32
    )
    panel.grid(4).axis("s", 3)
    time, value = courses[-1]
    half = half_width(1.0, quantity.factor) * np.array([row["std"][index] or np.nan for row in tests[-1]], dtype=float)
    panel.band(time, value - half, value + half)
    for number, (time, value) in enumerate(courses):
        inside = np.where((value > low) & (value < high), value, np.nan)
        panel.line(time, inside, "tr thin old" if number == 0 and len(courses) > 1 else "tr thin")
    panel.level(result, "res")
    at = panel.at_y(result)
    panel.text(155, at + 11 if at < 70 else at - 5, f"result {digits(result, 5)}", "k halo", "end")
    return panel.drawn()


def tests_apart(subject: Subject) -> Markup:
    """Each test's values against the combined ones, with their intervals."""
    found = subject.findings.identification
    if found is None or not subject.parameters:
        return Markup("")
    axes = evidence_of(found).at_one_flux
    shares, bands = _shares(subject, axes)
    reach = 1.1 * max([*(abs(s) + h for row in shares for s, h in row), *bands, 1e-3])
    panel = Panel(
        217, 138, (0.0, 4.0), (-reach, reach), "Each test against the combined value, in per cent", left=32, bottom=22
    )
    panel.grid(5, lambda v: f"{v:+.2g}".replace("-", "−") if v else "0")
    for column, (quantity, row, band) in enumerate(zip(FOUR, shares, bands, strict=True)):
        edge = (column + 0.06, column + 0.94)
        panel.band(edge, (-band, -band), (band, band)).line(edge, (0.0, 0.0), "res")
        for number, (share, half) in enumerate(row):
            place = column + (number + 1.0) / (len(row) + 1.0)
            panel.line((place, place), (share - half, share + half)).point(place, share, "bar1", 2.3)
        letter, index = quantity.symbol.striptags()[0], quantity.symbol.striptags()[1:]
        panel.parts.append(
            Markup(
                '<text class="k" x="{}" y="134" text-anchor="middle">{}<tspan dy="2" font-size="7">{}</tspan></text>'
            ).format(f"{panel.at_x(column + 0.5):.1f}", letter, index)
        )
    limit = (subject.plan.get("acceptance") or {}).get("axis_spread_percent")
    caption = (
        f"Each test at {digits(subject.result['holds_for_stator_flux_wb'], 3)} Wb with its interval against the combined value (band)."
        + (f" Allowed: {limit:g} % apart." if limit else "")
    )
    return marks.figure("Tests side by side, %", panel.drawn(), caption)


def _shares(
    subject: Subject, axes: Sequence[tuple[float, object]]
) -> tuple[list[list[tuple[float, float]]], list[float]]:
    """Per quantity: each test's difference and interval in per cent of the combined value, and that one's own interval."""
    shares: list[list[tuple[float, float]]] = []
    bands = []
    for quantity in FOUR:
        total = subject.parameters[quantity.field]
        scale = 100.0 / abs(total["value"])
        rows: Iterator[tuple[float, float]] = (
            (scale * (values[quantity.field].value - total["value"]), half_width(values[quantity.field].std, scale))  # type: ignore[index]
            for _, values in axes
        )
        shares.append(list(rows))
        bands.append(half_width(total["std"], scale))
    return shares, bands


def leg_loss(subject: Subject) -> Markup:
    """The voltage that one leg of the inverter loses over its current."""
    inverter = subject.result.get("inverter") or {}
    current, voltage, loss = inverter.get("leg_current_a"), inverter.get("leg_voltage_v"), inverter.get("leg_error_v")
    if not (current and voltage):
        return marks.figure("Inverter’s voltage loss", Markup(""), "None was identified.")
    top = max(*voltage, loss["value"] if loss else 0.0)
    reach = min(float(max(current)), 0.5 * (subject.peak_current_a or float(max(current))))
    kept = [(a, v) for a, v in zip(current, voltage, strict=True) if a < reach]
    current, voltage = (
        [*(a for a, _ in kept), reach],
        [*(v for _, v in kept), float(np.interp(reach, current, voltage))],
    )
    panel = Panel(
        217, 138, (0.0, reach), (0.0, 1.15 * top), "Voltage lost in one inverter leg over its current", left=24
    )
    panel.grid(4).axis("A", 3).line(current, voltage)
    caption = (
        "Dead time and device drop, identified with the motor and taken off. Drawn up to half of the largest current."
    )
    if loss:
        panel.level(loss["value"], "res")
        shown = with_interval(loss["value"], half_width(loss["std"]))
        panel.text(211, panel.at_y(loss["value"]) - 4, f"{shown} V, large currents", "k halo", "end")
    panel.text(211, panel.at_y(0.72 * top), "lost in one leg, V", "t halo", "end")
    if (knee := inverter.get("knee_a")) and knee < reach:
        panel.point(knee, float(np.interp(knee, current, voltage)), "open")
        panel.named(
            knee + 0.03 * reach, float(np.interp(knee, current, voltage)) - 0.06 * top, f"knee {digits(knee, 2)} A"
        )
    return marks.figure("Inverter’s voltage loss", panel.drawn(), caption)


def iron(subject: Subject) -> Markup:
    """The magnetizing inductance over flux."""
    curve = subject.result.get("magnetizing_curve") or ()
    if not curve:
        return marks.figure("Magnetizing inductance", Markup(""), "Taken as straight: the samples do not bend it.")
    flux = np.array([point["stator_flux_wb"] for point in curve])
    value = 1e3 * np.array([point["magnetizing_inductance_h"]["value"] for point in curve])
    half = half_width(1.0, 1e3) * np.array([point["magnetizing_inductance_h"]["std"] or 0.0 for point in curve])
    held = subject.result["holds_for_stator_flux_wb"]
    at = 1e3 * subject.parameters["magnetizing_inductance_h"]["value"]
    rated, limit = subject.result["rated_flux_wb"]["stator_peak"], subject.guard.get("limit_wb")
    span = (0.0, 1.04 * max(float(flux[-1]), rated, limit or 0.0))
    panel = Panel(
        217,
        138,
        span,
        padded([*(value - half), *(value + half), at], 0.2),
        "Magnetizing inductance over stator flux",
        left=28,
    )
    panel.area((float(flux[-1]), span[1])).grid(4).axis("Wb", 4).band(flux, value - half, value + half).line(
        flux, value
    )
    if limit:
        panel.upright(limit).text(panel.at_x(limit) - 3, 60, f"limit {digits(limit, 3)}", "l halo", turn=True)
    panel.upright(rated, "ax").text(panel.at_x(rated) - 3, 60, f"rated {digits(rated, 3)}", "halo", turn=True)
    panel.point(held, at, radius=3.2)
    panel.text(
        panel.at_x(held) - 6, panel.at_y(at) + 12, f"{digits(at, 4)} mH at {digits(held, 3)} Wb", "k halo", "end"
    )
    return marks.figure(
        "Magnetizing inductance, mH",
        panel.drawn(),
        "Over stator flux, with its interval. Dot: the result. Hatched: no test went there.",
    )
