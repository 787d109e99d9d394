"""The sheet of a drive's own tuning: how it ended, each result over the repeats, what stands in the drive, on what it is proved."""

from __future__ import annotations

from collections.abc import Iterator

from markupsafe import Markup

from commissioner.records import drive_words
from commissioner.report.run.subject import Record, Subject
from commissioner.report.sheet import marks
from commissioner.report.sheet.marks import Column, Text
from commissioner.report.sheet.numbers import digits, signed

_COLUMNS = (
    Column("Result"),
    Column("Before", right=True),
    Column("Each repeat", right=True),
    Column("Median", right=True),
    Column("Spread", right=True),
    Column("Trend", right=True),
    Column("Per phase, SI", right=True),
    Column("The plate allows", right=True),
)


def tuned_sheet(subject: Subject) -> Markup:
    """The whole page, for every way a tune can end."""
    tune, error = subject.result["tune"], subject.result.get("error") or {}
    mark = marks.GOOD if subject.is_good else marks.BAD
    parts = [
        Markup('<div class="verdict">{}<h1>{}</h1><p>{}</p></div>').format(
            mark, f"The drive's own tuning: {subject.outcome}", _sentence(str(subject.result["reason"]))
        )
    ]
    if error:
        facts = [(name, str(error[name])) for name in ("step", "value", "limit", "remedy") if error.get(name)]
        parts.append(marks.section("Why", marks.facts(facts), kind="why"))
    for objection in subject.result.get("objections") or ():
        limit = f"{objection['value']}, limit {objection['limit']}: {objection['remedy']}"
        parts.append(marks.paragraph(f"{_sentence(str(objection['what']))} {limit}"))
    parts.append(marks.section("In the drive", marks.facts(_facts(subject, tune))))
    if tune.get("rows"):
        parts.append(marks.table(_COLUMNS, [_row(row) for row in tune["rows"]]))
    return Markup("\n").join(parts)


def _facts(subject: Subject, tune: Record) -> Iterator[tuple[Text, Text]]:
    drive = subject.result.get("drive") or {}
    if drive:
        yield "Drive", drive_words(str(drive["drive_type"]), drive["serial_number"])
    yield "It holds", str(tune["in_the_drive"])
    yield "Tuned", f"{len(tune['repeats'])} times, {tune['form']}"
    for remark in subject.result.get("remarks") or ():
        yield "Remark", str(remark)


def _row(row: Record) -> tuple[Text, ...]:
    is_known = row["ours"] is not None
    return (
        str(row["name"]).replace("_", " "),
        digits(row["before"], 5),
        ", ".join(digits(value, 5) for value in row["values"]),
        f"{digits(row['median'], 5)} {row['unit']}",
        f"{digits(row['spread_percent'], 2)} %",
        f"{signed(row['trend_percent'], 2)} %",
        f"{digits(row['ours'], 5)} ({row['conversion']})" if is_known else str(row["conversion"]),
        f"{digits(row['plate_low'], 3)} ... {digits(row['plate_high'], 3)}" if is_known else "not judged",
    )


def _sentence(text: str) -> str:
    return f"{marks.capitalised(text)}."
