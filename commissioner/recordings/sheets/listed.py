"""Lists whose quantities have their name, symbol, unit and value in columns of their own: `Parameter;Symbol;Unit;Value`, in any order,
with these words above or without, between semicolons, tabs, bars, commas or wide spaces."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from commissioner.recordings.reading.cells import is_number
from commissioner.recordings.reading.layout import split
from commissioner.recordings.words import folded

NAME, SYMBOL, UNIT, VALUE, ASIDE = "name", "symbol", "unit", "value", "aside"
QUANTITIES = "parameter quantity name item variable measurand grosse messgrosse kenngrosse grandeur magnitud grandezza grandeza parametr wielkosc"
UNITS = "unit units einheit einheiten unite unites unidad unidades unita unidade jednostka birim"
VALUES = "value values reading wert werte messwert valeur valeurs valor valores valore valori wartosc wartosci deger degerler"
"""What a column of each is called in a list as in a long table, without accents."""
HEADS = {
    NAME: f"{QUANTITIES} parameters description designation characteristic property data kennwert bezeichnung benennung merkmal angabe "
    "eigenschaft parametre caracteristique parametro concepto caracteristica descripcion descrizione caratteristica",
    SYMBOL: "symbol sym formelzeichen zeichen kurzzeichen formelz symbole simbolo sigla abbreviation",
    UNIT: f"{UNITS} einh uom dimension",
    VALUE: f"{VALUES} nennwert measured betrag nominal rated result ergebnis",
    ASIDE: "pos no nr n id row zeile remark remarks note notes comment bemerkung bemerkungen tolerance toleranz source quelle standard norm",
}  # fmt: skip
"""What the columns are called, without accents."""
_ROLE = {word: role for role, words in HEADS.items() for word in words.split()}
MARKS = (";", "\t", "|", ",", "  ")
DRAWN = ("|", "  ", ":", "=")
"""Between columns, and nowhere else in a list: two columns are one."""
FEWEST, MOSTLY, UNITS_PART = 3, 0.6, 0.75
"""Rows that make a list; the parts of a column's cells that begin with a number where it holds values, and that are known units where it
holds units: pages name some that no quantity here has (kg, dB(A))."""
_BEGINS = re.compile(r"\s*(?:ca\.?|~|≈)?\s*[-+]?[.,]?\d")
_RULE = re.compile(r"[\s|:+=_-]+")
"""A line drawn under a head."""


@dataclass(frozen=True)
class Listed:
    """A quantity, or a title without values: its names in the order of their columns; `unit` as printed; `values` of every column of values (empty
    where this one has none), and what stands above these (`100 %`, `Motor A`)."""

    names: tuple[str, ...]
    unit: str
    values: tuple[str, ...]
    above: tuple[str, ...] = ()


def listed(lines: Sequence[str], is_unit: Callable[[str], bool], marks: Sequence[str] = MARKS) -> tuple[Listed, ...]:
    """The quantities, rows of one cell (titles) among them without values; nothing where the lines are no list of such columns."""
    return next((found for mark in marks if (found := _between(lines, mark, is_unit))), ())


def _between(lines: Sequence[str], mark: str, is_unit: Callable[[str], bool]) -> tuple[Listed, ...]:
    rows = [_cells(line, mark) for line in lines if not line.startswith("#") and not _RULE.fullmatch(line)]
    head = next((k for k, row in enumerate(rows) if _is_head(row)), None)
    below = rows if head is None else rows[head + 1 :]
    width = len(rows[head]) if head is not None else _usual_width(below)
    if width < (2 if mark in DRAWN else 3) or sum(len(row) > 1 for row in below) < FEWEST:
        return ()
    below = [_fitted(row, width) for row in below]
    said = [""] * width if head is None else rows[head]
    roles = _roles(below, said, is_unit)
    if VALUE not in roles or not {NAME, SYMBOL} & set(roles):
        return ()
    found = tuple(_listed(row, roles, said) for row in below if any(row))
    return () if any(is_number(one.names[0]) for one in found) else found


def _cells(line: str, mark: str) -> list[str]:
    if mark == "  ":
        return [cell.strip() for cell in re.split(r" {2,}|\t", line.strip())]
    if mark in (":", "="):
        return [cell.strip() for cell in line.split(mark, 1)]
    if mark == "|":
        return [cell.strip() for cell in line.strip().strip("|").split("|")]
    return [cell.strip('" ') for cell in split(line, mark)]


def _word(cell: str) -> str:
    return re.sub(r"[^a-z]", "", folded(cell).lower())


def _is_head(row: Sequence[str]) -> bool:
    """Whether the cells are words for columns: that of a name or a symbol, and of a value or a unit; none of them twice."""
    roles = [_ROLE.get(_word(cell), "") for cell in row]
    several = [role for role, count in Counter(roles).items() if role not in ("", ASIDE) and count > 1]
    return bool({VALUE, UNIT} & set(roles)) and bool({NAME, SYMBOL} & set(roles)) and not several


def _usual_width(rows: Iterable[Sequence[str]]) -> int:
    widths = Counter(len(row) for row in rows if len(row) > 1)
    return widths.most_common(1)[0][0] if widths else 0


def _fitted(row: Sequence[str], width: int) -> list[str]:
    """As many cells as there are columns; a number that its own decimal comma cut is whole again."""
    row = list(row)
    while len(row) > width and not row[-1]:
        row.pop()
    if len(row) == width + 1:
        cut = [k for k in range(width) if row[k].isdigit() and row[k + 1].isdigit()]
        if len(cut) == 1:
            row[cut[0] : cut[0] + 2] = [f"{row[cut[0]]},{row[cut[0] + 1]}"]
    return [*row[:width], *[""] * (width - len(row))]


def _roles(rows: Sequence[Sequence[str]], head: Sequence[str], is_unit: Callable[[str], bool]) -> list[str]:
    """The roles by the words above the columns, else by what stands in them."""
    whole = [row for row in rows if any(map(_BEGINS.match, row[1:])) or sum(map(bool, row)) > 2]
    columns = [[row[k] for row in whole if row[k]] for k in range(len(head))]
    said = [_ROLE.get(_word(cell), "") for cell in head]
    is_titled = any(said)
    roles = [role or _told(cells, k, is_unit) for k, (role, cells) in enumerate(zip(said, columns, strict=True))]
    if is_titled and UNIT in said:
        roles = [ASIDE if not s and role == UNIT else role for s, role in zip(said, roles, strict=True)]
    if VALUE in said:
        roles = [ASIDE if not s and role == VALUE else role for s, role in zip(said, roles, strict=True)]
    last = min((k for k, role in enumerate(roles) if role == VALUE), default=0)
    is_open = NAME not in said
    return [
        role or (NAME if k < last and (is_open or not said[k]) and not is_titled else ASIDE)
        for k, role in enumerate(roles)
    ]


def _told(cells: Sequence[str], place: int, is_unit: Callable[[str], bool]) -> str:
    """The role of a column by its cells; nothing where they are words."""
    if not cells:
        return ASIDE
    if place and len(cells) >= FEWEST - 1 and sum(map(is_unit, cells)) > UNITS_PART * len(cells):
        return UNIT
    if place and sum(bool(_BEGINS.match(cell)) for cell in cells) > MOSTLY * len(cells):
        return VALUE
    return ASIDE if all(cell.rstrip(".").isdigit() for cell in cells) else ""


def _listed(row: Sequence[str], roles: Sequence[str], head: Sequence[str]) -> Listed:
    """A row's quantity; of one that is too short for its columns (`Schaltung;Dreieck`) the last cell is the value."""

    def of(wanted: str) -> tuple[str, ...]:
        return tuple(cell for cell, role in zip(row, roles, strict=True) if role == wanted and cell)

    filled = [cell for cell in row if cell]
    if len(filled) == 2 and not of(VALUE):
        return Listed((filled[0],), "", (filled[1],))
    values = [(cell, above) for cell, role, above in zip(row, roles, head, strict=True) if role == VALUE]
    return Listed(
        (*of(NAME), *of(SYMBOL)) or tuple(filled[:1]), next(iter(of(UNIT)), ""),
        tuple(cell for cell, _ in values) if of(VALUE) else (), tuple(above for _, above in values),
    )  # fmt: skip
