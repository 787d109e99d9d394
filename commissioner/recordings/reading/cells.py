"""Cells of text as numbers: decimal points and commas, thousands, times of day, what instruments print where there is none."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from commissioner.errors import DataRefused
from commissioner.recordings.units import DAY_S
from commissioner.records import Signal

NOTHING = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "-", "--", "---", "inf", "-inf", "+inf", "infinity", "-infinity", "∞", "-∞",
     "ol", "-ol", "over", "under", "overflow", "overload", "#nv", "#n/a", "1.#inf", "-1.#inf", "1.#qnan", "********", "nv"}
)  # fmt: skip
"""What stands in a cell that holds no number, in lower case."""
NUMBER = re.compile(
    r"[+-]?(?:\d+[.,]?\d*|[.,]\d+|\d{1,3}(?:,\d{2,3})*,\d{3}(?:\.\d*)?|\d{1,3}(?:\.\d{3})+(?:,\d*)?)(?:[eEdD][+-]?\d+)?"
)
GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?: \d{3})+(?:[.,]\d*)?(?:[eEdD][+-]?\d+)?")
"""A number with spaces between its thousands, as in France."""
BETWEEN_THOUSANDS = re.compile(r"(?<=\d)['\u2019\u00a0\u2009\u202f](?=\d{3}(?!\d))")
"""An apostrophe, as in Switzerland, or a space that breaks no line."""
CLOCK = re.compile(
    r"(?:(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ]+|(\d{1,2})[-/.](\d{1,2})[-/.](\d{2,4})[T ]+)?"
    r"(?:(\d{1,2}):(?=\d{2}:)|(?=\d{1,2}:\d{2}[.,]\d))(\d{1,2}):(\d{2})([.,:]\d+)?(?: ?([AP])\.?M\.?)?(?:Z|[+-]\d{2}:?\d{2})?",
    re.IGNORECASE,
)
"""A time of day, with a date before it or without; minutes and seconds where a fraction says that they are (`59:59.98`)."""


NO_READING = 9.9e37
"""What instruments print for infinity; 9.91E37 for no number (SCPI-1999, volume 1, 7.2.1.4 and 7.2.1.5)."""
LOOKED_AT, LEAST_GROUPED = 1024, 8
"""Cells of a column, and how many of them must look like thousands to be asked for: of shortest decimals one in ten has fewer digits."""


@dataclass(frozen=True)
class Marks:
    """How a file writes numbers: its decimal mark, and what stands between thousands ('' where nothing does)."""

    decimal: str = "."
    thousands: str = ""

    @property
    def other(self) -> str:
        """The mark that is not the decimal one."""
        return "." if self.decimal == "," else ","


def plain(text: str) -> str:
    """The text with a hyphen for the minus sign, and without what can only stand between thousands: both can be read in one way only."""
    text = text.replace("\u2212", "-")
    return text if text.isascii() and "'" not in text else BETWEEN_THOUSANDS.sub("", text)


def ungrouped(cell: str) -> str:
    """A number without the spaces between its thousands; any other cell as it is."""
    return cell.replace(" ", "") if GROUPED.fullmatch(cell) else cell


def is_numeric(cell: str) -> bool:
    """A number in any notation, a time of day, or what stands for none."""
    bare = cell.strip().strip('"').strip()
    return bare.lower() in NOTHING or NUMBER.fullmatch(bare) is not None or CLOCK.fullmatch(bare) is not None


def is_number(cell: str) -> bool:
    bare = cell.strip().strip('"').strip()
    return NUMBER.fullmatch(bare) is not None or CLOCK.fullmatch(bare) is not None


def marks_of(cells: list[str], separator: str, source: str) -> Marks:
    """The decimal mark of a file, from cells of its first rows. DataRefused where a factor of 1000 would be guessed."""
    bare = [c.strip().strip('"').strip() for c in cells]
    bare = [c for c in bare if NUMBER.fullmatch(c)]
    with_comma, with_point = [c for c in bare if "," in c], [c for c in bare if "." in c]
    both = [c for c in with_comma if "." in c]
    if both:
        comma_last = sum(c.rindex(",") > c.rindex(".") for c in both)
        if 0 < comma_last < len(both):
            raise _ambiguous(both[0], source)
        return Marks(",", ".") if comma_last else Marks(".", ",")
    if not with_comma:
        return Marks()
    if any(c.count(",") > 1 for c in with_comma):
        return Marks(".", ",")
    if all(_is_grouped(c, ",") for c in with_comma) and (separator != ";" or with_point):
        raise _ambiguous(with_comma[0], source)
    if with_point and all(_is_grouped(c, ".") for c in with_point) and any(_is_grouped(c, ".") for c in with_point):
        raise _ambiguous(with_point[0], source)
    return Marks(",", "")


def _is_grouped(cell: str, mark: str) -> bool:
    """Three digits after the mark and one to three before it that do not begin with a zero."""
    whole, _, rest = cell.lstrip("+-").partition(mark)
    return len(rest) == 3 and rest.isdigit() and 1 <= len(whole) <= 3 and not whole.startswith("0")


def _ambiguous(cell: str, source: str) -> DataRefused:
    return DataRefused(
        f"{source}: {cell} may be thousands or a number with decimals", step="read numbers", value=cell,
        limit="one decimal mark, and no marks between thousands", remedy="export again without marks between thousands",
    )  # fmt: skip


def to_numbers(column: pa.ChunkedArray, marks: Marks, source: str) -> tuple[Signal, list[str]]:
    """The column as float64, not a number where a cell holds none; and the cells that are neither number nor nothing.
    DataRefused: a number that is one thing by the file's marks and another by its looks."""
    text = pc.utf8_trim_whitespace(column.cast(pa.string()).combine_chunks())
    if isinstance(text, pa.ChunkedArray):
        text = text.combine_chunks()
    marks = _of_column(text, marks)
    _require_decimals(text, marks, source)
    is_grouped = _has(text, re.escape(marks.other))
    if not is_grouped or (marks.thousands and not _has(text, _not_between_thousands(marks.thousands))):
        bare = pc.replace_substring(text, marks.other, "") if is_grouped else text
        bare = pc.replace_substring(bare, ",", ".") if marks.decimal == "," else bare
        try:
            return _cast(pc.if_else(pc.equal(bare, ""), pa.scalar(None, pa.string()), bare)), []
        except pa.ArrowInvalid:
            pass
    return _one_by_one(text, marks, source)


def _of_column(text: pa.Array, marks: Marks) -> Marks:
    """The marks of a column that has the other one for its decimals throughout (a time with points beside values with commas)."""
    is_other = not _has(text, re.escape(marks.decimal)) and _has(text, _of_decimals(marks.other))
    return Marks(marks.other) if is_other else marks


def _require_decimals(text: pa.Array, marks: Marks, source: str) -> None:
    """DataRefused: every mark for decimals stands before three digits, and whole numbers below a thousand have none: thousands, as
    in `954`, `1.012`. Decimals would be written `954.000`, or now and then with fewer digits."""
    cells = pc.drop_null(text.slice(0, LOOKED_AT))
    mark = re.escape(marks.decimal)
    if marks.thousands or _has(cells, rf"[{mark}](?:\d{{0,2}}(?:\D|$)|\d{{4}})|^[+-]?0*[{mark}]|[eEdD:/]"):
        return
    grouped = [cell for cell in cells.to_pylist() if _is_grouped(cell, marks.decimal)]
    if len(grouped) >= LEAST_GROUPED and _has(cells, r"^[+-]?[1-9]\d{0,2}$") and not _has(cells, r"^[+-]?\d{4,}$"):
        raise _ambiguous(grouped[0], source)


def _has(text: pa.Array, pattern: str) -> bool:
    return bool(pc.any(pc.match_substring_regex(text, pattern)).as_py())


def _of_decimals(mark: str) -> str:
    """A number with one such mark, which does not stand before three digits as between thousands."""
    return rf"^[+-]?(?:0\d*[{mark}]\d*|\d{{4,}}[{mark}]\d*|[{mark}]\d+|\d+[{mark}](?:\d{{0,2}}|\d{{4,}}))(?:[eEdD][+-]?\d+)?$"


def _not_between_thousands(mark: str) -> str:
    return rf"[{mark}](?:\d{{0,2}}(?:\D|$)|\d{{4}})|^[+-]?0*[{mark}]|\d{{4}}[{mark}]"


def _cast(text: pa.Array) -> Signal:
    values = pc.cast(text, pa.float64()).to_numpy(zero_copy_only=False)
    return np.where(np.abs(values) < NO_READING, values, np.nan)


def _one_by_one(text: pa.Array, marks: Marks, source: str) -> tuple[Signal, list[str]]:
    values, wrong = np.full(len(text), np.nan), []
    cells = [ungrouped((whole or "").strip().strip('"').strip()) for whole in text.to_pylist()]
    clocks = [CLOCK.fullmatch(cell) for cell in cells]
    is_month_first = _is_month_first([clock for clock in clocks if clock])
    for k, (cell, clock) in enumerate(zip(cells, clocks, strict=True)):
        if cell.lower() in NOTHING:
            continue
        try:
            values[k] = clock_seconds(clock, is_month_first) if clock else _number(cell, marks, source)
        except ValueError:
            wrong.append(cell)
    values[~(np.abs(values) < NO_READING)] = np.nan
    return values, wrong


def _number(cell: str, marks: Marks, source: str) -> float:
    """The number in a cell; ValueError where it is none, DataRefused where its marks leave open which."""
    if not NUMBER.fullmatch(cell):
        raise ValueError(cell)
    if marks.other in cell:
        is_open = marks.decimal not in cell and not marks.thousands
        is_misfit = re.search(_not_between_thousands(marks.other), cell.partition(marks.decimal)[0])
        if (is_open or is_misfit) and cell.count(marks.other) == 1:
            raise _ambiguous(cell, source)
        if is_misfit:
            raise ValueError(cell)
    return float(cell.replace(marks.other, "").replace(marks.decimal, ".").lower().replace("d", "e"))


def _is_month_first(found: Sequence[re.Match[str]]) -> bool:
    """Of dates whose year comes last: whether the month does first in all of a column. By a number above twelve or AM and PM; else by
    what lets the recording pass midnight in a day (`02/03`, `02/04`) and not in a month."""
    dates = {
        (int(one[4]), int(one[5]), int(one[6]) % 100 + 2000): bool(one[11])
        for one in found
        if one[6] and int(one[4]) and int(one[5])
    }
    if any(first > 12 or second > 12 for first, second, _ in dates):
        return not any(first > 12 for first, _, _ in dates)
    if any(dates.values()):
        return True
    spans = [
        np.ptp(
            [_days(year, *((first, second) if is_month else (second, first))) for first, second, year in dates] or [0.0]
        )
        for is_month in (False, True)
    ]
    return bool(spans[1] < spans[0])


def _days(year: int, month: int, day: int) -> float:
    """Since 1970. ValueError: there is no such day."""
    return float((np.datetime64(f"{year:04d}-{month:02d}-{day:02d}") - np.datetime64("1970-01-01")).astype(int))


def clock_seconds(found: re.Match[str], is_month_first: bool) -> float:
    """Seconds of a time of day, since 1970 where a date stands before it."""
    year, month, day, first, second, year2, hours, minutes, seconds, fraction, half = found.groups()
    days = 0.0
    if year:
        days = _days(int(year), int(month), int(day))
    elif year2:
        of_month = (int(first), int(second)) if is_month_first else (int(second), int(first))
        days = _days(int(year2) % 100 + 2000, *(of_month if of_month[0] <= 12 else of_month[::-1]))
    part = float("0." + fraction[1:]) if fraction else 0.0
    return DAY_S * days + 3600.0 * _hour(hours, half) + 60.0 * int(minutes) + int(seconds) + part


def _hour(hours: str | None, half: str | None) -> int:
    """Of the day; 12 AM is midnight, 12 PM noon; none where only minutes and seconds are written."""
    return int(hours or 0) % 12 + 12 * (half.upper() == "P") if half else int(hours or 0)
