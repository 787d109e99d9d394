"""The page of an identification from a running motor: values, measured against simulated, and the shaft."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from commissioner.estimation.fit import problem_of, simulate
from commissioner.records import RPM
from commissioner.report.page import BLUE, MUTED, Page, Section, Table, figure_of, legend_above, picture
from commissioner.report.running.figures import SHOWN_S
from commissioner.report.running.page import NAMES
from commissioner.report.running.words import Document, number
from commissioner.report.sheet.numbers import half_width, interval
from commissioner.running.identification import Identified

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def page_of(seen: Identified, document: Document, name: str) -> Page:
    """One self-contained page."""
    rows = [_row(q.name, document["parameters"].get(q.field) or document.get(q.field), q.factor, q.unit) for q in NAMES]
    facts = [
        ("left by the model", f"{number(document['residual_over_noise'])} × noise"),
        ("peak stator flux it holds at", f"{number(document['holds_for_stator_flux_wb'])} Wb"),
        ("speed", str(document["speed"])),
        ("recorded", f"{number(document['duration_s'])} s"),
    ]
    drawn = picture(
        _drawn(seen), "Above: current of one phase, measured (grey) and simulated with the result. Middle: what is left. Below: speed.",
        raster=True,
    )  # fmt: skip
    parts = [
        Section("Parameters", Table(("", "value", "95 % interval"), [row for row in rows if row])),
        Section("Measured against simulated", drawn),
    ]
    if document["remarks"]:
        parts.append(Section("Remarks", *document["remarks"]))
    return Page(f"Identification of a running motor: {name}", document["reason"], "plain", facts, parts,
                "± holds the true value in 19 of 20 cases. SI, per phase of the star equivalent.")  # fmt: skip


def _row(label: str, measured: Any, factor: float, unit: str) -> tuple[str, str, str]:
    if measured is None:
        return label, "not in these data", ""
    value, half = interval(factor * measured["value"], half_width(measured["std"], factor))
    return label, f"{value} {unit}", f"± {half} {unit}" if half else "–"


def _drawn(seen: Identified) -> Figure:
    """The first and the last periods of the first recording; speed over all of it."""
    problem = problem_of(seen.record, 0.0)
    window, (current, shaft) = problem.record.windows[0], simulate(problem, seen.fit.machine)[0]
    count = min(round(SHOWN_S / problem.period), window.count)
    figure, drawn = figure_of(3, 2, 6.4)
    for column, part in enumerate((slice(0, count), slice(window.count - count, window.count))):
        time, measured = window.time_s[part], window.current[part, 0]
        drawn[0, column].plot(time, measured, color=MUTED, linewidth=2.2, label="measured")
        drawn[0, column].plot(time, current[part, 0], color=BLUE, linewidth=0.9, label="simulated")
        drawn[0, column].set_title("first periods" if column == 0 else "last periods", loc="left")
        drawn[1, column].plot(time, measured - current[part, 0], color=BLUE, linewidth=0.9)
        every = max(1, window.count // 2000)
        whole = slice(None, None, every) if column == 0 else part
        drawn[2, column].plot(
            window.time_s[whole],
            RPM * shaft[whole, 0] / problem.record.scales.pole_pairs,
            color=BLUE,
            linewidth=1.0,
        )
        drawn[2, column].set_xlabel("time / s")
    drawn[0, 0].set_ylabel("current alpha / A")
    drawn[1, 0].set_ylabel("measured - simulated / A")
    drawn[2, 0].set_ylabel("speed / (1/min)")
    legend_above(drawn[0, 0])
    return figure
