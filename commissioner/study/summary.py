"""What a study's rows say together: outcomes, errors against the truth, flux; as numbers and as a sheet with pictures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from commissioner.motor.circuit import PARAMETERS
from commissioner.report.run.quantities import BY_FIELD
from commissioner.report.sheet import marks
from commissioner.report.sheet.document import Margins, Page, document
from commissioner.report.sheet.drawing import Panel
from commissioner.report.sheet.numbers import digits

Row = Mapping[str, Any]
QUANTILES = (0.5, 0.95, 1.0)
MOST_REASONS = 20


@dataclass(frozen=True)
class Errors:
    """Of one parameter over the accepted cases: quantiles of the absolute relative error; share of truths inside the stated
    95 % interval."""

    field: str
    count: int
    quantiles: tuple[float, ...]
    coverage: float


@dataclass(frozen=True)
class Summary:
    """`reasons`: how often each reason ended a case that was not accepted."""

    cases: int
    outcomes: Mapping[str, int]
    reasons: Mapping[str, int]
    errors: tuple[Errors, ...]
    worst_flux_fraction: float | None
    cpu_s: float


def summarise(rows: Sequence[Row]) -> Summary:
    """Over all rows; parameters over those that were commissioned."""
    outcomes = Counter(str(row["outcome"]) for row in rows)
    reasons = Counter(f"{row['outcome']}: {row.get('reason', '')}" for row in rows if row["outcome"] != "commissioned")
    accepted = [row for row in rows if row["outcome"] == "commissioned"]
    flux = [row["peak_flux_fraction"] for row in rows if row.get("peak_flux_fraction") is not None]
    found = (_errors(name, accepted) for name in PARAMETERS)
    return Summary(
        len(rows), dict(outcomes.most_common()), dict(reasons.most_common(MOST_REASONS)), tuple(e for e in found if e is not None),
        max(flux, default=None), math.fsum(row.get("cpu_s") or 0.0 for row in rows),
    )  # fmt: skip


def _errors(name: str, rows: Iterable[Row]) -> Errors | None:
    known = [row for row in rows if row.get(f"{name}_true") and row.get(f"{name}_value") is not None]
    if not known:
        return None
    off = np.array([row[f"{name}_value"] - row[f"{name}_true"] for row in known])
    true, std = (np.array([row[f"{name}_{what}"] for row in known], dtype=float) for what in ("true", "std"))
    relative = np.abs(off) / true
    inside = np.abs(off) <= 1.96 * std
    return Errors(name, len(known), tuple(float(np.quantile(relative, q)) for q in QUANTILES), float(np.mean(inside)))


def page(rows: Sequence[Row], title: str) -> str:
    """One sheet: what ended how, how far off, and each case's error over the motor's size where it is known."""
    seen = summarise(rows)
    body = [
        Markup("<h1>{}</h1>").format(title),
        marks.strip(
            [
                (outcome, str(number), f"{100 * number / seen.cases:.1f} %")
                for outcome, number in list(seen.outcomes.items())[:4]
            ]
            + [("Worst true flux", _share(seen.worst_flux_fraction), "of the guard’s limit")]
        ),
    ]
    if seen.errors:
        columns = (
            marks.Column("Parameter"), *(marks.Column(f"{100 * q:.0f} % of cases within" if q < 1 else "worst", right=True) for q in QUANTILES),
            marks.Column("truth inside the 95 % interval", right=True), marks.Column("cases", right=True),
        )  # fmt: skip
        body.append(marks.table(columns, (_error_row(error) for error in seen.errors)))
        body.append(
            marks.figure(
                "Error of each accepted case, %",
                marks.multiples(_scatter(rows), 4),
                "In the order of cases; zero is the truth.",
            )
        )
    if seen.reasons:
        reasons = [(reason, str(number)) for reason, number in seen.reasons.items()]
        body.append(marks.table((marks.Column("Not accepted because"), marks.Column("Cases", right=True)), reasons))
    margins = Margins("Study", "", title, "", f"{seen.cases} cases, {seen.cpu_s:.0f} CPU-s")
    return document(title, margins, [Page("study", "Study", Markup("\n").join(body))])


def _share(value: float | None) -> str:
    return "not known" if value is None else digits(value, 3)


def _error_row(error: Errors) -> tuple[marks.Text, ...]:
    quantity = BY_FIELD[error.field]
    shown = (f"{digits(100 * value, 2)} %" for value in error.quantiles)
    name = Markup("{} {}").format(quantity.symbol, quantity.words)
    return name, *shown, f"{100 * error.coverage:.1f} %", str(error.count)


def _scatter(rows: Sequence[Row]) -> Iterable[tuple[marks.Text, Markup]]:
    for name in PARAMETERS:
        points = [
            (row["case"], 100.0 * (row[f"{name}_value"] / row[f"{name}_true"] - 1.0))
            for row in rows
            if row["outcome"] == "commissioned" and row.get(f"{name}_true")
        ]
        if not points:
            continue
        reach = 1.1 * max(abs(error) for _, error in points) or 1.0
        panel = Panel(
            160,
            104,
            (0.0, max(1.0, float(max(case for case, _ in points)))),
            (-reach, reach),
            f"errors of {name}",
            left=30,
        )
        panel.grid(4).axis("", 3).level(0.0, "res").dots([case for case, _ in points], [error for _, error in points])
        yield Markup("{}, %").format(BY_FIELD[name].symbol), panel.drawn()
