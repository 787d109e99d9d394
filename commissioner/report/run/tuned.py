"""The sheet of a drive's own tuning: how it ended, each result over the repeats, what stands in the drive, on what it is proved."""

from __future__ import annotations

from collections.abc import Iterator

from markupsafe import Markup

from commissioner.motor.quantities import in_shown_unit
from commissioner.records import drive_words, plain_name
from commissioner.report.run.subject import Record, Subject
from commissioner.report.sheet import marks
from commissioner.report.sheet.marks import Column, Text
from commissioner.report.sheet.numbers import digits, held, signed, spelled
from commissioner.report.sheet.words import seen_and_limit, spoken

_COLUMNS = (
    Column("Result"),
    Column("Before", right=True),
    Column("Each repeat", right=True),
    Column("Median", right=True),
    Column("Spread", right=True),
    Column("Trend", right=True),
    Column("Per phase", right=True),
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
        seen, limit = seen_and_limit(error, str(error.get("unit") or ""))
        told = {"Step": error.get("step"), "Seen": seen, "Limit": limit, "Do this": error.get("remedy")}
        facts = [(name, spoken(str(text))) for name, text in told.items() if text]
        parts.append(marks.section("Why", marks.facts(facts), kind="why"))
    for objection in subject.result.get("objections") or ():
        limit = "{}, limit {}: ".format(*seen_and_limit(objection)) + objection["remedy"]
        parts.append(marks.paragraph(spoken(f"{_sentence(str(objection['what']))} {limit}")))
    parts.append(marks.section("In the drive", marks.facts(_facts(subject, tune))))
    if tune.get("rows"):
        parts.append(marks.table(_COLUMNS, [_row(row) for row in tune["rows"]]))
    return Markup("\n").join(parts)


def _facts(subject: Subject, tune: Record) -> Iterator[tuple[Text, Text]]:
    drive = subject.result.get("drive") or {}
    if drive:
        yield "Drive", drive_words(str(drive["drive_type"]), drive["serial_number"])
    yield "It holds", str(tune["in_the_drive"])
    yield "Tuned", f"{spelled(len(tune['repeats']), 'time')}, {tune['form']}"
    for remark in subject.result.get("remarks") or ():
        yield "Remark", spoken(str(remark))


def _row(row: Record) -> tuple[Text, ...]:
    field = row["field"] if row["ours"] is not None else None
    unit = str(row["unit"])
    return (
        plain_name(str(row["name"])),
        f"{_own(row['before'])} {unit}",
        f"{', '.join(map(_own, row['values']))} {unit}",
        f"{_own(row['median'])} {unit}",
        f"{digits(row['spread_percent'], 2)} %",
        f"{signed(row['trend_percent'], 2)} %",
        f"{in_shown_unit(field, row['ours'])} ({row['conversion']})" if field else str(row["conversion"]),
        in_shown_unit(field, row["plate_low"], row["plate_high"]) if field else "not judged",
    )


def _own(value: float) -> str:
    """As the drive counts it: what is whole stays whole."""
    return held(value) if value == round(value) else digits(value, 5)


def _sentence(text: str) -> str:
    return f"{marks.capitalised(text)}."
