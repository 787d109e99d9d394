"""Workbooks of spreadsheets (.xlsx, .xlsm, .xlsb, .xls, .ods): the one sheet that holds a table, as the text a CSV export of it would be.

Read by calamine (MIT), for it knows all three formats; formulas give the values that were stored with them.
"""

from __future__ import annotations

import datetime as dt
import re
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.errors import DataRefused
from commissioner.recordings.bounds import too_large, unpacked_limit
from commissioner.recordings.sheets.united import is_quantity

if TYPE_CHECKING:
    from python_calamine import CalamineWorkbook

ENDINGS = frozenset({".xlsx", ".xlsm", ".xlsb", ".xls", ".ods"})
LEAST_ROWS, LEAST_NUMBERS = 2, 2
"""Rows of so many numbers make a sheet a table; a page of remarks has fewer."""
_CHUNK = 1 << 20
MOST_BYTES = 64 * 1024**2
"""Unpacked: 1.3 million cells, each of which becomes an object."""
_UNSTORED = re.compile(
    rb'<c\b(?![^>]*\bt="str")[^>]*>\s*<f\b[^>]*(?:/>|>[^<]*</f>)\s*(?:<v\s*/>|<v>\s*</v>)?\s*</c>'
    rb"|<table:table-cell\b(?=[^>]*\btable:formula=)(?![^>]*\boffice:value-type=)[^>]*>"
)
"""A formula without the value that it gave, as programs write it that do not calculate (XLSX, ODS)."""
_ROW = re.compile(rb"<(?:row|table:table-row)\b[^>]*>.*?</(?:row|table:table-row)>", re.DOTALL)
_STORED = re.compile(
    rb'<c\b(?![^>]*\bt="(?:s|str|inlineStr|b|e)")[^>]*>(?:\s*<f\b[^>]*(?:/>|>[^<]*</f>))?\s*<v>[^<]'
    rb'|<table:table-cell\b[^>]*\boffice:value-type="(?:float|percentage|currency|date|time)"'
)
"""A cell with a number (XLSX, ODS)."""
Cells = Sequence[Sequence[Any]]


def text_of(path: Path) -> str:
    """The table's cells between tabs. DataRefused: damaged, locked by a password, too large, formulas without values, or tables on
    several sheets."""
    if path.suffix.lower() != ".xls":
        _require_bounded(path)
    sheets = _sheets(path)
    tables = {name: cells for name, cells in sheets.items() if _is_table(cells)}
    if len(tables) > 1:
        raise _refused(
            path,
            "holds tables on several sheets",
            ", ".join(tables)[:120],
            "one table",
            "save the one that is meant as CSV, or alone",
        )
    chosen = max((tables or sheets).values(), key=lambda cells: sum(map(len, cells)), default=())
    return "\n".join("\t".join(map(_shown, row)) for row in chosen) + "\n"


def _sheets(path: Path) -> dict[str, Cells]:
    from python_calamine import CalamineError, PasswordError

    try:
        with _opened(path) as book:
            return {name: book.get_sheet_by_name(name).to_python() for name in book.sheet_names}
    except PasswordError as error:
        raise _refused(
            path, "is locked by a password", str(error), "an open file", "save it without a password"
        ) from error
    except (CalamineError, OSError, ValueError) as error:
        raise _unreadable(path, error) from error


def _opened(path: Path) -> CalamineWorkbook:
    """ValueError where the reader gives up at its own assertion, which is no Exception."""
    from python_calamine import CalamineWorkbook

    try:
        return CalamineWorkbook.from_path(path)
    except BaseException as panic:
        if type(panic).__name__ == "PanicException":
            raise ValueError(str(panic)) from None
        raise


def _require_bounded(path: Path) -> None:
    """Unpacks to count: what a workbook says of its own size proves nothing, and a wrong size fails its check sum here.
    DataRefused also where a formula has no value."""
    limit, size = min(MOST_BYTES, unpacked_limit(path)), 0
    unstored, sampled, holds_numbers = 0, 0, False
    try:
        with zipfile.ZipFile(path) as packed:
            for member in packed.infolist():
                pieces = []
                with packed.open(member) as file:
                    while piece := file.read(_CHUNK):
                        size += len(piece)
                        if size > limit:
                            raise too_large(path, f"> {limit}", limit)
                        pieces.append(piece)
                if member.filename.endswith(".xml"):
                    found = _unstored(b"".join(pieces))
                    unstored, sampled = unstored + found[0], sampled + found[1]
                    holds_numbers |= found[2]
    except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, NotImplementedError) as error:
        raise _unreadable(path, error) from error
    if sampled or (unstored and not holds_numbers):
        raise _refused(
            path, "holds formulas whose values were not stored", f"{unstored} cells, {sampled} of them in the table", "a value in each cell",
            "open it in a spreadsheet program and save it there, which calculates it, or save it as CSV",
        )  # fmt: skip


def _unstored(member: bytes) -> tuple[int, int, bool]:
    """(formulas without a value, how many of them a table needs, whether any page holds rows of numbers). A row that holds no number is a summary where it stands below the
    numbers, or above them and not next to them, where the names do; without it the rest is whole. A page without numbers is a table of
    formulas where several rows hold several of them."""
    count, needed, holds_numbers = 0, 0, False
    for page in member.split(b"<table:table "):
        rows = [(len(_UNSTORED.findall(row)), _STORED.search(row) is not None) for row in _ROW.findall(page)]
        lost = [one[0] for one in rows]
        numbers = [k for k, (_, holds_number) in enumerate(rows) if holds_number]
        count += sum(lost)
        holds_numbers |= len(numbers) >= LEAST_ROWS
        if len(numbers) >= LEAST_ROWS:
            needed += sum(lost[max(numbers[0] - 1, 0) : numbers[-1] + 1])
        elif sum(one >= LEAST_NUMBERS for one in lost) >= LEAST_ROWS:
            needed += sum(lost)
    return count, needed, holds_numbers


def _is_table(cells: Cells) -> bool:
    numbers = (sum(map(_is_number, row)) for row in cells)
    return sum(count >= LEAST_NUMBERS for count in numbers) >= LEAST_ROWS


def _is_number(cell: object) -> bool:
    """A number, or a text that is one, with its unit or without."""
    return is_quantity(cell) if isinstance(cell, str) else isinstance(cell, int | float) and not isinstance(cell, bool)


def _shown(cell: object) -> str:
    """As a spreadsheet shows it: 15 digits at most, and no more than were written, for these tell how well a value is known."""
    if isinstance(cell, bool | str):
        return " ".join(str(cell).split())
    if isinstance(cell, dt.datetime | dt.date | dt.time):
        return cell.isoformat()
    if isinstance(cell, dt.timedelta):
        return f"{cell.total_seconds():.15g}"
    return f"{cell:.15g}" if isinstance(cell, int | float) else ""


def _unreadable(path: Path, error: Exception) -> DataRefused:
    return _refused(
        path, "is no workbook that can be read", str(error)[:120], "a whole file", "save it again, or as CSV"
    )


def _refused(path: Path, what: str, value: str, limit: str, remedy: str) -> DataRefused:
    return DataRefused(
        f"{path}: Excel or OpenDocument: {what}", step="read recording", value=value, limit=limit, remedy=remedy
    )
