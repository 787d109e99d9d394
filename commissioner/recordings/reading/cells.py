"""Cells of text as numbers: decimal points and commas, thousands, times of day, what instruments print where there is none."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from commissioner.errors import DataRefused
from commissioner.records import Signal

NOTHING = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "-", "--", "---", "inf", "-inf", "+inf", "infinity", "-infinity", "∞", "-∞",
     "ol", "-ol", "over", "under", "overflow", "overload", "#nv", "#n/a", "1.#inf", "-1.#inf", "1.#qnan", "********", "nv"}
)  # fmt: skip
"""What stands in a cell that holds no number, in lower case."""
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)*|[.,]\d+)(?:[eEdD][+-]?\d+)?")
APOSTROPHE = re.compile(r"(?<=\d)['\u2019](?=\d{3}(?!\d))")
"""Between thousands, as in Switzerland."""
CLOCK = re.compile(
    r"(?:(\d{4})[-/.](\d{1,2})[-/.](\d{1,2})[T ]+|(\d{1,2})[-/.](\d{1,2})[-/.](\d{2,4})[T ]+)?(\d{1,2}):(\d{2}):(\d{2})([.,:]\d+)?(?:Z|[+-]\d{2}:?\d{2})?"
)


@dataclass(frozen=True)
class Marks:
    """How a file writes numbers: its decimal mark, and what stands between thousands ('' where nothing does)."""

    decimal: str = "."
    thousands: str = ""


def plain(text: str) -> str:
    """The text with a hyphen for the minus sign, and without apostrophes between thousands: both can be read in one way only."""
    text = text.replace("\u2212", "-")
    return APOSTROPHE.sub("", text) if "'" in text or "\u2019" in text else text


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
    if all(_is_grouped(c, ",") for c in with_comma) and separator != ";":
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
        f"{source}: {cell} may be thousands or a number with three decimals", step="read numbers", value=cell,
        limit="one decimal mark, and no marks between thousands", remedy="export again without marks between thousands",
    )  # fmt: skip


def to_numbers(column: pa.ChunkedArray, marks: Marks) -> tuple[Signal, int]:
    """The column as float64, not a number where a cell holds none; and how many cells are neither number nor nothing."""
    text = pc.utf8_trim_whitespace(column.cast(pa.string()).combine_chunks())
    if isinstance(text, pa.ChunkedArray):
        text = text.combine_chunks()
    if marks.thousands:
        text = pc.replace_substring(text, marks.thousands, "")
    if marks.decimal == ",":
        text = pc.replace_substring(text, ",", ".")
    try:
        return _cast(pc.if_else(pc.equal(text, ""), pa.scalar(None, pa.string()), text)), 0
    except pa.ArrowInvalid:
        return _one_by_one(text)


def _cast(text: pa.Array) -> Signal:
    values = pc.cast(text, pa.float64()).to_numpy(zero_copy_only=False)
    return np.where(np.isfinite(values), values, np.nan)


def _one_by_one(text: pa.Array) -> tuple[Signal, int]:
    values, wrong = np.full(len(text), np.nan), 0
    for k, cell in enumerate(text.to_pylist()):
        bare = (cell or "").strip().strip('"').lower()
        if bare in NOTHING:
            continue
        clock = CLOCK.fullmatch(bare.upper())
        try:
            values[k] = clock_seconds(clock) if clock else float(bare.replace("d", "e"))
        except ValueError:
            wrong += 1
    values[~np.isfinite(values)] = np.nan
    return values, wrong


def clock_seconds(found: re.Match[str]) -> float:
    """Seconds of a time of day, since 1970 where a date stands before it (day before month where the year comes last)."""
    year, month, day, day2, month2, year2, hours, minutes, seconds, fraction = found.groups()
    days = 0.0
    if year or year2:
        date = (int(year), int(month), int(day)) if year else (int(year2) % 100 + 2000, int(month2), int(day2))
        if date[1] > 12:
            date = (date[0], date[2], date[1])
        days = float(
            (np.datetime64(f"{date[0]:04d}-{date[1]:02d}-{date[2]:02d}") - np.datetime64("1970-01-01")).astype(int)
        )
    part = float("0." + fraction[1:]) if fraction else 0.0
    return 86400.0 * days + 3600.0 * int(hours) + 60.0 * int(minutes) + int(seconds) + part
