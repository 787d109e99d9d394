"""The study's page: how its cases ended, errors by parameter, size and effect, flux; with pictures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import cast

from markupsafe import Markup

from commissioner.monitor.contract import Measured
from commissioner.motor.circuit import PARAMETERS
from commissioner.records import peak
from commissioner.report.run.quantities import BY_FIELD, FOUR
from commissioner.report.sheet import marks
from commissioner.report.sheet.document import Margins, Page, document
from commissioner.report.sheet.drawing import Panel, Range, padded
from commissioner.report.sheet.numbers import digits, half_width, spelled, with_interval
from commissioner.report.sheet.words import spoken
from commissioner.study.rows import Row
from commissioner.study.summary import COMMISSIONED, QUANTILES, Errors, Group, Summary, accepted, relative_errors

_OF_RUNNING = {"mean_speed_rad_per_s": "Speed, rad/s", "mean_torque_nm": "Torque, N m"}
FEW = 200
OUTCOMES = (COMMISSIONED, "rejected", "aborted", "faulted")


def page(rows: Sequence[Row], seen: Summary, title: str) -> str:
    """One sheet of all rows and their summary; what the kind of the study does not know is left out."""
    parts = [Markup("<h1>{}</h1>").format(title), _head(seen)]
    if seen.errors:
        parts += [_by_parameter(seen), _scatter(rows)]
    if any(row.get("peak_flux_fraction") for row in rows):
        parts.append(_flux(rows))
    if any("file" in row for row in rows):
        parts.append(_by_file(rows))
    for head, sentences in (("Not accepted because", seen.reasons), ("Remarks", seen.remarks)):
        if sentences:
            counts = [(spoken(sentence), str(number)) for sentence, number in sentences.items()]
            parts.append(marks.table((marks.Column(head), marks.Column("Cases", right=True)), counts))
    if any(group.errors for group in seen.effects):
        parts.append(_by_effect(seen.effects))
    margins = Margins("Study", "", title, "", f"{spelled(seen.cases, 'case')}, {seen.cpu_s:.0f} CPU-s")
    return document(title, margins, [Page("study", "Study", Markup("\n").join(parts))])


def _head(seen: Summary) -> Markup:
    ends = [(outcome, str(n), f"{100 * n / seen.cases:.1f} %") for outcome, n in list(seen.outcomes.items())[:4]]
    worst = seen.worst_flux_fraction
    flux = [] if worst is None else [("Worst true flux", digits(worst, 3), "of the guard’s limit")]
    return marks.strip([*ends, *flux])


def _by_parameter(seen: Summary) -> Markup:
    columns = (
        marks.Column("Parameter"), marks.Column("Motors"),
        *(marks.Column(f"{100 * q:.0f} % of cases within" if q < 1 else "worst", right=True) for q in QUANTILES),
        marks.Column("truth inside the 95 % interval", right=True), marks.Column("cases", right=True),
    )  # fmt: skip
    rows = []
    for errors in seen.errors:
        rows.append(_error_row(errors, "all"))
        of_sizes = ((group.name, e) for group in seen.sizes for e in group.errors if e.field == errors.field)
        rows += [_error_row(e, name, is_first=False) for name, e in of_sizes]
    return marks.table(columns, rows)


def _error_row(errors: Errors, motors: str, *, is_first: bool = True) -> tuple[marks.Text, ...]:
    quantity = BY_FIELD[errors.field]
    name = Markup("{} {}").format(quantity.symbol, quantity.words) if is_first else quantity.symbol
    shown = (f"{digits(100 * value, 2)} %" for value in errors.quantiles)
    return name, motors, *shown, f"{100 * errors.coverage:.1f} %", str(errors.count)


def _by_file(rows: Sequence[Row]) -> Markup:
    """A row for each recording: how it ended, and what was found in it."""
    found = [(row, list(_found(row))) for row in rows]
    names = dict.fromkeys(name for _, values in found for name, _ in values)
    columns = (marks.Column("Recording"), marks.Column("Outcome"), *(marks.Column(name, right=True) for name in names))
    shown = [
        (row.get("file", "–"), row["outcome"].replace("_", " "), *(dict(values).get(name, "–") for name in names))
        for row, values in found
    ]
    return marks.table(columns, shown)


def _found(row: Row) -> Iterator[tuple[marks.Text, str]]:
    """Heads of columns and values with their intervals."""
    for quantity in FOUR:
        value, std = (row.get(f"{quantity.field}_{what}") for what in ("value", "std"))
        if isinstance(value, float) and isinstance(std, float):
            shown = with_interval(quantity.factor * value, half_width(std, quantity.factor))
            yield Markup("{}, {}").format(quantity.symbol, quantity.unit), shown
    for field, head in _OF_RUNNING.items():
        if measured := cast("Measured | None", row.get(field)):
            yield head, with_interval(measured["value"], half_width(measured["std"]))
    if "causes" in row:
        yield "Causes", row["causes"].replace("_", " ") or "–"


def _by_effect(groups: Iterable[Group]) -> Markup:
    """A row for each effect: how its cases ended, and what 95 % of the accepted are within."""
    columns = (
        marks.Column("Effect in the drive or the motor"), *(marks.Column(outcome, right=True) for outcome in OUTCOMES),
        *(marks.Column(Markup("{}, 95 % within").format(BY_FIELD[name].symbol), right=True) for name in PARAMETERS),
    )  # fmt: skip
    rows = []
    for group in groups:
        within = {errors.field: f"{digits(100 * errors.quantiles[1], 2)} %" for errors in group.errors}
        ends = (str(group.outcomes.get(outcome, 0)) for outcome in OUTCOMES)
        rows.append((group.name.replace("_", " "), *ends, *(within.get(name, "–") for name in PARAMETERS)))
    return marks.table(columns, rows)


def _scatter(rows: Sequence[Row]) -> Markup:
    return marks.figure(
        "Error of each accepted case, %",
        marks.multiples(_errors_over_cases(rows), 4),
        "In the order of cases; zero is the truth.",
    )


def _errors_over_cases(rows: Sequence[Row]) -> Iterator[tuple[marks.Text, Markup]]:
    for name in PARAMETERS:
        known = accepted(rows, name)
        if not known:
            continue
        cases = [float(row["case"]) for row in known]
        errors = 100.0 * relative_errors(known, name)
        reach = 1.1 * peak(errors) or 1.0
        panel = Panel(160, 104, _span(cases), (-reach, reach), f"errors of {name}", left=30)
        _dotted(panel.grid(4).axis("", 3).level(0.0, "res"), cases, errors)
        yield Markup("{}, %").format(BY_FIELD[name].symbol), panel.drawn()


def _span(cases: Sequence[float]) -> Range:
    return padded([0.0, max(1.0, *cases)], 0.03)


def _dotted(panel: Panel, cases: Sequence[float], values: Iterable[float]) -> None:
    """Few cases as points: a dot alone is not seen."""
    if len(cases) > FEW:
        panel.dots(cases, list(values))
        return
    for case, value in zip(cases, values, strict=True):
        panel.point(case, value, radius=1.8)


def _flux(rows: Sequence[Row]) -> Markup:
    known = [(float(row["case"]), fraction) for row in rows if (fraction := row.get("peak_flux_fraction"))]
    cases, fractions = [case for case, _ in known], [fraction for _, fraction in known]
    panel = Panel(660, 130, _span(cases), (0.0, 1.1 * max(1.0, *fractions)), "highest true flux of each case", left=30)
    _dotted(panel.grid(4).axis("", min(6, max(1, len(cases) - 1))).level(1.0), cases, fractions)
    return marks.figure(
        "Highest true flux of each case, of the guard’s limit",
        panel.drawn(),
        "By the simulator; cases that ended before much flux lie low.",
    )
