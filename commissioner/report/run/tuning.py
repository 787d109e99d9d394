"""The page of a drive's own tuning: each result over the repeats, in our own terms where the drive file says how."""

from __future__ import annotations

from collections.abc import Iterator

from markupsafe import Markup

from commissioner.report.run.subject import Record, Subject
from commissioner.report.sheet import marks
from commissioner.report.sheet.marks import Column, Text
from commissioner.report.sheet.numbers import digits, held, signed

_COLUMNS = (
    Column("Result, the drive’s unit"), Column("Before", right=True), Column("Repeats", right=True), Column("Median", right=True),
    Column("Spread", right=True), Column("Trend", right=True), Column("Per phase, SI", right=True), Column("The plate allows", right=True),
)  # fmt: skip


def tuning(subject: Subject) -> Markup:
    """Empty where the drive did not tune itself."""
    tune = subject.result.get("tune")
    if not tune or not tune.get("rows"):
        return Markup("")
    parts = [
        Markup("<h2>The drive’s own tuning</h2>"),
        marks.table(_COLUMNS, _rows(tune["rows"])),
        marks.paragraph(
            "Spread: largest minus smallest, of the median. Trend: from the first to the last repeat; repeats heat the winding. "
            f"In the drive: {tune['in_the_drive']}.", kind="small",
        ),
    ]  # fmt: skip
    return Markup("\n").join(parts)


def _rows(rows: list[Record]) -> Iterator[tuple[Text, ...]]:
    for row in rows:
        ours = "–" if row["ours"] is None else f"{digits(row['ours'], 5)} ({row['conversion']})"
        box = "–" if row["plate_low"] is None else f"{digits(row['plate_low'], 3)} … {digits(row['plate_high'], 3)}"
        yield (
            f"{row['name']}, {row['unit']}", held(row["before"]), Markup("<br>").join(held(value) for value in row["values"]),
            Markup("<b>{}</b>").format(held(row["median"])), f"{digits(row['spread_percent'], 2)} %", f"{signed(row['trend_percent'], 2)} %",
            ours, box,
        )  # fmt: skip
