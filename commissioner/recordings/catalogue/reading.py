"""A manufacturer's sheet from a file: a value a line (`name: value unit`, `name;value;unit`), or one row below its names.

Recognised by its names; a table with a time, or with the columns of a test sheet, or with rows of numbers, is none.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence, Set
from dataclasses import dataclass, replace
from pathlib import Path

from commissioner.errors import DataRefused
from commissioner.identify.catalogue.sheet import ABSOLUTE, KEYS, Sheet, Value
from commissioner.motor.nameplate import connection_of
from commissioner.recordings.catalogue import names
from commissioner.recordings.catalogue.cells import (
    MEASURES,
    UNITS,
    inertia_of_flywheel,
    refused,
    split_unit,
    unit_key,
    value_of,
)
from commissioner.recordings.formats import workbook
from commissioner.recordings.formats.foreign_csv import read_text
from commissioner.recordings.names import meaning_of
from commissioner.recordings.reading.cells import is_number
from commissioner.recordings.reading.layout import split
from commissioner.recordings.sheet_names import is_sheet
from commissioner.recordings.sheets.listed import Listed, listed
from commissioner.recordings.sheets.upright import upright
from commissioner.recordings.units import read_unit

ENDINGS = (".csv", ".txt", ".tsv", *workbook.ENDINGS)
LARGEST_BYTES, MOST_LINES, FEWEST = 100_000, 200, 3
"""Of a sheet; and how many values that it knows make one."""
TELLING = (
    ("efficiency",),
    ("starting_",),
    ("breakdown_",),
    ("rated_slip", "rated_speed"),
    ("power_factor",),
    ("rated_power",),
)
"""Two of them at least are on a sheet of a manufacturer."""
PAIR = re.compile(
    r"^\s*(\d+(?:[.,]\d+)?)(?:\s*[A-Za-zΔ△]+)*\s*/\s*(\d+(?:[.,]\d+)?)[\s;]*([A-Za-z]{0,3}?)\s*(?:[DYΔ△](?:\s*/\s*[DYΔ△])?)?\s*$"
)
"""`230/400 V`, `400/690 V D/Y`, `400 V D / 690 V Y`."""
_SAID_BESIDE = re.compile(r"\s*\([^()]*=[^()]*\)$")
"""Another value behind a unit: `(GD² = 0.176)`."""
_DECIMAL = re.compile(r"(?<![\d.,])(?:0([.,])\d+|\d+([.,])(?!\d{3}(?!\d))\d+)(?![.,]?\d)")
"""A number whose mark can only be a decimal one."""
_SHARE = r"\d+(?:[.,]\d+)?"
AT_LOADS = re.compile(rf"^\s*({_SHARE}(?:\s*%?(?:\s*[;/|–-]\s*|\s+){_SHARE}){{1,4}})\s*(%?)[\s;]*$")
"""Values at several loads in one cell."""
FALLING = ("", "_75", "_50")
"""Loads of three values whose order nobody says, as most sheets have them."""

_AT = re.compile(r"[\[(,]?\s*(?:\b(?:at|bei|à|a)\s|@)?\s*([-+]?\d+(?:[.,]\d+)?)\s*°\s*([CF])\s*[\])]?", re.IGNORECASE)
"""The temperature of a winding's resistance, in its name or behind its value."""


@dataclass(frozen=True)
class Entry:
    """`key` of `names.key_of`; the name and the cell as printed, and a unit that stood apart."""

    key: str
    name: str
    printed: str
    unit: str = ""


def sheet_of(files: Sequence[Path], said: object) -> Sheet | None:
    """The sheet where the one file is one and no channels are mapped."""
    return sheet_in(files[0]) if len(files) == 1 and said is None else None


def sheet_in(path: Path) -> Sheet | None:
    """The sheet in a file, None where the file is none. DataRefused: it holds several motors, a value twice, or an impossible one."""
    if path.suffix.lower() not in ENDINGS or not path.is_file() or not 0 < path.stat().st_size <= LARGEST_BYTES:
        return None
    text, _ = read_text(path)
    lines = [line.strip().lstrip("\ufeff") for line in text.replace("\r", "\n").split("\n") if line.strip()]
    if len(lines) > MOST_LINES or _is_table_of_samples(lines):
        return None
    if upright(text) is not None and not _is_of_a_type([cell for line in lines for cell in _cells(line)[:2]]):
        return None
    entries = _columned(lines, str(path)) or list(_table(lines, str(path)) or _lines(lines))
    return _sheet(entries, str(path)) if _are_enough({e.key for e in entries}) else None


def _are_enough(keys: Set[str]) -> bool:
    return len(keys) >= FEWEST and sum(any(key.startswith(of) for key in keys) for of in TELLING) > 1


def _keys(cells: Sequence[str]) -> set[str]:
    return {key for cell in cells if (key := names.key_of(cell)) is not None}


def _cells(line: str) -> list[str]:
    """Of a line: between semicolons or tabs, else commas."""
    separator = next((s for s in (";", "\t") if s in line), ",")
    return [cell.strip('" ') for cell in split(line.lstrip("# "), separator)]


def _is_table_of_samples(lines: Sequence[str]) -> bool:
    rows = [_cells(line) for line in lines]
    numbers = [row for row in rows if len(row) >= 3 and sum(map(is_number, row)) >= 3]
    alike = len({len(row) for row in numbers}) == 1
    if len(numbers) > 2 and alike and not any(sum(names.key_of(c) is not None for c in row) >= FEWEST for row in rows):
        return True
    return any(
        (is_sheet(row) and not _is_of_a_type(row))
        or (len(row) > 2 and not any(map(is_number, row)) and any(meaning_of(c) == "time_s" for c in row))
        for row in rows
    )


def _is_of_a_type(cells: Sequence[str]) -> bool:
    """Whether names tell what no test sheet does: two of how the motor starts, breaks down, and uses its power."""
    return len({key for key in _keys(cells) if key.startswith(("starting_", "breakdown_", "efficiency"))}) > 1


def _columned(lines: Sequence[str], source: str) -> list[Entry]:
    """The values of a list with columns for them; nothing of another form, or of one with fewer values than make a sheet."""
    found: list[Entry] = []
    for one in listed(lines, _is_unit):
        unit = "" if _WITHOUT.fullmatch(one.unit) else one.unit.strip("[]()")
        if not one.values:
            found += _lines(one.names)
        elif (key := _key_in(one.names, unit)) is not None:
            found += _in_columns(key, one, unit, source)
    return found if _are_enough({entry.key for entry in found}) else []


def _key_in(called: Sequence[str], unit: str) -> str | None:
    """The key that the words mean; where they mean none, that of a symbol which is more than a letter and has this unit (`Weight;m` is no
    torque, `Losses;P` no output)."""
    words, *symbols = sorted(called, key=len, reverse=True)
    if (key := names.key_of(words)) is not None or not symbols:
        return key
    meant = next((key for name in symbols if len(name) > 1 and (key := names.key_of(name))), None)
    return (
        meant if meant and (meant not in KEYS or unit_key(unit) in MEASURES.get(KEYS[meant][1], set()) | {""}) else None
    )


def _in_columns(key: str, one: Listed, unit: str, source: str) -> list[Entry]:
    """The values of one quantity: one, or one for each load that stands above them. DataRefused: several motors."""
    name = " ".join(one.names)
    filled = [value for value in one.values if value]
    loads = [names.load_of(above) for above in one.above]
    if len(set(filled)) > 1 and None in loads:
        raise refused(
            f"{len(filled)} values of {name} stand beside each other", ", ".join(filled)[:80],
            "one value of one motor at one frequency, or loads above the columns (100 %, 75 %, 50 %)", source,
        )  # fmt: skip
    at = (
        {load or "": value for load, value in zip(loads, one.values, strict=False)}
        if len(filled) > 1
        else {"": filled[0]}
    )
    at_loads = at if key in ("efficiency", "power_factor") else {"": at.get("", "")}
    return [Entry(key + load, name, value, unit) for load, value in at_loads.items() if value]


def _is_unit(text: str) -> bool:
    return unit_key(text) in UNITS or read_unit(text) is not None or _WITHOUT.fullmatch(text) is not None


def _table(lines: Sequence[str], source: str) -> list[Entry]:
    """Names in one line, units below or not, values in one line; nothing of a file of another form."""
    head = next((k for k, line in enumerate(lines) if _are_enough(_keys(_cells(line)))), None)
    if head is None:
        return []
    above = list(_lines(lines[:head]))
    titles, rows = _cells(lines[head]), [_cells(line) for line in lines[head + 1 :]]
    units = rows.pop(0) if rows and not any(map(is_number, rows[0])) else [""] * len(titles)
    if len(rows) != 1:
        raise refused(f"{len(rows)} rows of values stand below the names", len(rows), "one motor, one row", source)
    if len(rows[0]) != len(titles):
        raise refused(
            f"the row holds {len(rows[0])} cells and {len(titles)} names stand above (decimal commas between commas?)", lines[-1][:100],
            "as many cells as names", source,
        )  # fmt: skip
    units += [""] * (len(titles) - len(units))
    found = [
        Entry(key, t, c, u)
        for t, c, u in zip(titles, rows[0], units, strict=False)
        if c and (key := names.key_of(t)) is not None
    ]
    return above + found


_WITHOUT = re.compile(r"[-–—/.]|1|pu|p\.u\.|none|n/a", re.IGNORECASE)
"""What a column of units holds for a value without one."""
_LINE = (
    re.compile(r"^([^;\t]+?)\s*[;\t]\s*(.+)$"),
    re.compile(r"^([^;\t]+?)\s*[:=]\s*(?=[-+~≈]?\s*[.,]?\d)(?!\d[/\d]*[;\t:=])(.+)$"),
    re.compile(r"^([^:=]+?)\s*[:=]\s*(.+)$"),
    re.compile(r"^([^,]+?)\s*,\s*(.+)$"),
)


def _lines(lines: Sequence[str]) -> Iterator[Entry]:
    for line in lines:
        for pattern in _LINE:
            found = pattern.match(line.lstrip("# "))
            if found is not None and (key := names.key_of(found[1].strip('" '))) is not None:
                yield Entry(key, found[1].strip('" '), found[2].strip('" '))
                break


def _sheet(entries: Sequence[Entry], source: str) -> Sheet:
    words = {e.key: e.printed.strip() for e in entries if e.key in ("connection", "design_class")}
    connection = str(connection_of(words.get("connection", "")))
    sheet = Sheet(
        {}, connection if connection in ("star", "delta") else "", words.get("design_class", "").upper()[-1:], source
    )
    unsaid: list[str] = []
    entries, read = _without_thousands(entries)
    for entry in entries:
        if entry.key in words:
            continue
        for key, value in _read(entry, sheet, unsaid, read):
            sheet = _with(sheet, key, value, entry.name)
    remarks = tuple(f"{name}: not said between which terminals it was measured, not used" for name in unsaid)
    remarks += tuple(read)
    return replace(_with_unit_of_power(sheet, entries), remarks=(*sheet.remarks, *remarks))


def _without_thousands(entries: Sequence[Entry]) -> tuple[list[Entry], list[str]]:
    """(the entries without marks between thousands, remarks): a mark before three digits is none for decimals where all others that can
    only be one are the other mark (`1,435 rpm` beside `4.8 A`)."""
    marks = {found[1] or found[2] for entry in entries for found in _DECIMAL.finditer(entry.printed)}
    if len(marks) != 1:
        return list(entries), []
    (mark,) = marks
    grouped = re.compile(rf"(?<![\d.,])([1-9]\d{{0,2}}){re.escape('.' if mark == ',' else ',')}(?=\d{{3}}(?![\d.,]))")
    out = [replace(entry, printed=grouped.sub(r"\1", entry.printed)) for entry in entries]
    pairs = [(old, new) for old, new in zip(entries, out, strict=True) if old != new]
    return out, [
        f"{old.name} {old.printed}: taken as {new.printed}, for decimals stand behind `{mark}`" for old, new in pairs
    ]


def _with(sheet: Sheet, key: str, value: Value, name: str) -> Sheet:
    before = sheet.values.get(key)
    if before is not None and abs(before.value - value.value) > max(
        1e-9 * value.value, before.half_step + value.half_step if key == "inertia_kg_m2" else 0.0
    ):
        raise refused(
            f"{KEYS[key][0]} is said twice ({name}): two motors, or 50 and 60 Hz, on one sheet?", f"{before.printed} and {value.printed}",
            "one value of one motor at one frequency", sheet.source,
        )  # fmt: skip
    return replace(sheet, values={**sheet.values, key: value})


def values_of(entry: Entry, sheet: Sheet) -> list[tuple[str, Value]]:
    """The values of one entry that stands alone, with their keys; of two connections' that of the sheet's."""
    return list(_read(entry, sheet, [], []))


def _read(entry: Entry, sheet: Sheet, unsaid: list[str], remarks: list[str]) -> Iterator[tuple[str, Value]]:
    """The values of one entry, with their keys."""
    if entry.key == "winding_resistance" and (at := _AT.search(f"{entry.name} {entry.printed}")) is not None:
        yield "winding_temperature_c", value_of("winding_temperature_c", at[1], f"°{at[2]}", entry.name, sheet.source)
        entry = replace(entry, name=_AT.sub("", entry.name), printed=_AT.sub("", entry.printed))
    if entry.key in ("efficiency", "power_factor") and (at_loads := _at_loads(entry, sheet.source, remarks)):
        yield from at_loads
        return
    printed = _of_connection(entry, sheet) if (PAIR.match(entry.printed)) else entry.printed
    found = split_unit(printed)
    if found is None:
        return
    number, unit = found
    unit = _SAID_BESIDE.sub("", unit.partition(";")[0]).strip() or entry.unit or names.unit_of(entry.name)
    key = _whole_key(entry, unit, unsaid)
    if key == "flywheel_effect":
        inertia, remark = inertia_of_flywheel(number, unit, entry.name, sheet.source)
        remarks.append(remark)
        yield "inertia_kg_m2", inertia
    elif key == "poles":
        yield "pole_pairs", Value(value_of("pole_pairs", number, "", entry.name, sheet.source).value / 2.0, 0.0, number)
    elif key:
        yield key, value_of(key, number, "" if _says_it_again(key, unit) else unit, entry.name, sheet.source)


def _at_loads(entry: Entry, source: str, remarks: list[str]) -> list[tuple[str, Value]]:
    """The values of several loads in one cell; nothing where it holds one. Of three whose order is not said the power factor tells it:
    it rises with the load. DataRefused: as many values as loads are not there."""
    found, loads = AT_LOADS.match(entry.printed), names.loads_in(entry.name)
    numbers = re.findall(_SHARE, found[1]) if found else []
    if found is None or (not loads and len(numbers) != len(FALLING)):
        if loads and split_unit(entry.printed):
            raise refused(
                f"{entry.name} names {len(loads)} loads",
                entry.printed,
                f"{len(loads)} values, as 0.81/0.75/0.63",
                source,
            )
        return []
    if loads and len(loads) != len(numbers):
        raise refused(f"{entry.name} names {len(loads)} loads", entry.printed, f"{len(loads)} values", source)
    if not loads:
        shares = [float(number.replace(",", ".")) for number in numbers]
        is_rising = entry.key == "power_factor" and shares == sorted(shares)
        loads = FALLING[::-1] if is_rising else FALLING
        remarks.append(
            f"{entry.name} {entry.printed}: taken as of {'50, 75 and 100' if is_rising else '100, 75 and 50'} % load"
        )
    if None in loads:
        remarks.append(f"{entry.name} {entry.printed}: values of other loads than 100, 75 and 50 % are not used")
    unit = found[2] or names.unit_of(entry.name)
    pairs = [(entry.key + ending, number) for ending, number in zip(loads, numbers, strict=True) if ending is not None]
    return [(key, value_of(key, number, unit, entry.name, source)) for key, number in pairs]


def _says_it_again(key: str, unit: str) -> bool:
    """`7,4 x I_N`, `2,3 M_N`: what a ratio is of."""
    return key.endswith("_ratio") and re.fullmatch(r"[x×*·]?\s*[imtc]_?[nr]?|-?fach", unit.lower().strip()) is not None


def _whole_key(entry: Entry, unit: str, unsaid: list[str]) -> str:
    """The key with ratio or unit, with terminals or phase; nothing where that is not said."""
    if entry.key in ABSOLUTE:
        ending = "_a" if ABSOLUTE[entry.key] == "rated_current_a" else "_nm"
        is_absolute = unit_key(unit) in MEASURES["A"] | MEASURES["N m"] and not names.is_ratio(entry.name)
        return entry.key + (ending if is_absolute else "_ratio")
    if entry.key == "winding_resistance":
        between = names.is_between_terminals(entry.name)
        if between is None:
            unsaid.append(entry.name)
            return ""
        return "winding_resistance_uv_ohm" if between else "winding_resistance_phase_ohm"
    return entry.key


def _of_connection(entry: Entry, sheet: Sheet) -> str:
    """Of `230/400 V` or `8,7/5,0 A` the value of the connection that is said. DataRefused: none is, or it is no such pair."""
    found = PAIR.match(entry.printed)
    assert found is not None
    pair = sorted((found[1], found[2]), key=lambda t: float(t.replace(",", ".")))
    if entry.key not in ("rated_voltage_v", "rated_current_a"):
        raise refused(
            f"{entry.name} holds two values", entry.printed, "one value of one motor at one frequency", sheet.source
        )
    if not sheet.connection:
        raise DataRefused(
            f"{sheet.source}: {entry.name} holds the values of two connections and the sheet does not say which is meant", step="read the sheet",
            value=entry.printed, limit="connection: star or connection: delta", remedy="add a line `connection: star` or `connection: delta`",
        )  # fmt: skip
    is_high = (sheet.connection == "star") == (entry.key == "rated_voltage_v")
    return f"{pair[1] if is_high else pair[0]} {found[3]}"


def _with_unit_of_power(sheet: Sheet, entries: Sequence[Entry]) -> Sheet:
    """A power without any unit is in kW where volts and amperes say so."""
    named = next((e for e in entries if e.key == "rated_power_w"), None)
    power, voltage, current = (sheet.get(k) for k in ("rated_power_w", "rated_voltage_v", "rated_current_a"))
    if named is None or power is None or voltage is None or current is None:
        return sheet
    is_said = names.unit_of(named.name) or named.unit or (split_unit(named.printed) or ("", ""))[1]
    if is_said or power > 0.05 * math.sqrt(3.0) * voltage * current:
        return sheet
    said = f"the rated power has no unit: {power:g} was taken as kW, by volts and amperes"
    return replace(sheet.with_value("rated_power_w", 1e3 * power), remarks=(*sheet.remarks, said))
