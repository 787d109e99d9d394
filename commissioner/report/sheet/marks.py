"""The pieces of a sheet: marks, symbols, lists and tables. All text is escaped; only `Markup` passes as it stands."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from markupsafe import Markup, escape

Text = str | Markup


def symbol(letter: str, index: str) -> Markup:
    """`R_s` as it is set."""
    return Markup('<b class="n">{}<sub>{}</sub></b>').format(letter, index)


R_S, R_R, L_SIGMA, L_M, T_R = (
    symbol("R", "s"), symbol("R", "R"), symbol("L", "σ"), symbol("L", "M"), symbol("T", "R"),
)  # fmt: skip

GOOD = Markup(
    '<svg viewBox="0 0 20 20" aria-hidden="true"><circle cx="10" cy="10" r="8.5" fill="none" stroke="currentColor" stroke-width="1.6"/>'
    '<path d="M6 10.3l2.8 2.8L14 7.3" fill="none" stroke="currentColor" stroke-width="2"/></svg>'
)
BAD = Markup(
    '<svg viewBox="0 0 20 20" aria-hidden="true"><path d="M6.3 1h7.4L19 6.3v7.4L13.7 19H6.3L1 13.7V6.3z" fill="currentColor"/>'
    '<path d="M6.5 6.5l7 7M13.5 6.5l-7 7" stroke="#fff" stroke-width="2"/></svg>'
)
WARN = Markup(
    '<svg viewBox="0 0 20 20" aria-hidden="true"><path d="M10 2L18.6 17.5H1.4z" fill="none" stroke="currentColor" stroke-width="1.6" stroke-linejoin="round"/>'
    '<path d="M10 7.5v5M10 14v1.8" stroke="currentColor" stroke-width="2"/></svg>'
)
UNDONE = Markup(
    '<svg viewBox="0 0 20 20" aria-hidden="true"><circle cx="10" cy="10" r="8.5" fill="none" stroke="currentColor" stroke-width="1.6" '
    'stroke-dasharray="3 2.4"/><path d="M6 10h8" stroke="currentColor" stroke-width="2"/></svg>'
)
BLANK = Markup('<span class="fill"></span>')
"""What nobody recorded: a line to write on."""


@dataclass(frozen=True)
class Column:
    """`right`: numbers. `name` may hold markup; `label` names the column in a card, where the head is not seen."""

    name: Text
    right: bool = False
    label: str = ""


def capitalised(text: str) -> str:
    """Begun with a capital: `DC link sag` stays, `dead time` becomes `Dead time`; a key of a file, as `limits.flux_fraction`, a file's
    name and an id stay."""
    return text if re.match(r"[^\s:]*(\w[._]\w|\d)", text) else text[:1].upper() + text[1:]


def coded(text: str) -> Markup:
    """What stands between back quotes is set as a command or a key."""
    parts = text.split("`")
    return Markup("").join(Markup("<code>{}</code>").format(p) if k % 2 else escape(p) for k, p in enumerate(parts))


def facts(rows: Iterable[tuple[Text, Text]]) -> Markup:
    """Names beside values."""
    inner = (Markup("<dt>{}</dt><dd>{}</dd>").format(name, value) for name, value in rows)
    return Markup('<dl class="kv">{}</dl>').format(Markup("").join(inner))


def strip(cells: Iterable[tuple[Text, str, str]]) -> Markup:
    """The few numbers that carry the verdict: name, value, limit."""
    inner = (Markup('<div><dt>{}</dt><dd>{}</dd><dd class="lim">{}</dd></div>').format(*cell) for cell in cells)
    return Markup('<dl class="strip">{}</dl>').format(Markup("").join(inner))


def actions(items: Iterable[Text]) -> Markup:
    """What to do, in order."""
    inner = (Markup("<li><span>{}</span></li>").format(item) for item in items)
    return Markup('<ol class="todo">{}</ol>').format(Markup("").join(inner))


def unchecked(items: Sequence[Text]) -> Markup:
    """What nobody looked at, in two columns."""
    cut = (len(items) + 1) // 2
    lists = (
        Markup('<ul class="undone">{}</ul>').format(
            Markup("").join(Markup("<li>{}<span>{}</span></li>").format(UNDONE, item) for item in half)
        )
        for half in (items[:cut], items[cut:])
        if half
    )
    return Markup('<div class="two">{}</div>').format(Markup("").join(lists))


def section(title: Text, *parts: Text, kind: str = "", level: int = 2) -> Markup:
    head = Markup("<section{}><h{}>{}</h{}>").format(_of_class(kind), level, title, level)
    return head + Markup("").join(parts) + Markup("</section>")


def side_by_side(*parts: Markup, columns: int = 2) -> Markup:
    return Markup('<div class="{}">{}</div>').format({2: "two", 3: "three"}[columns], Markup("").join(parts))


def paragraph(text: Text, kind: str = "") -> Markup:
    return Markup("<p{}>{}</p>").format(_of_class(kind), text)


def table(
    columns: Sequence[Column],
    rows: Iterable[Sequence[Text]],
    kind: str = "cards",
    tones: Sequence[str] = (),
    caption: Text = "",
) -> Markup:
    """The first cell of a row names it. `cards`: on a narrow screen each row becomes a card; `keep`: it stays a table. `tones[i]` marks
    row i."""
    head = Markup("").join(
        Markup('<th scope="col"{}>{}</th>').format(_aligned(column), column.name) for column in columns
    )
    body = Markup("").join(
        Markup("<tr{}>{}</tr>").format(
            _of_class(tone),
            Markup("").join(
                _cell(column, cell, is_first=k == 0) for k, (column, cell) in enumerate(zip(columns, row, strict=True))
            ),
        )
        for row, tone in zip_longest(rows, tones)
    )
    above = Markup("<caption>{}</caption>").format(caption) if caption else Markup("")
    return Markup('<table class="{}">{}<thead><tr>{}</tr></thead><tbody>{}</tbody></table>').format(
        kind, above, head, body
    )


def _of_class(kind: str | None) -> Markup:
    return Markup(' class="{}"').format(kind) if kind else Markup("")


def _aligned(column: Column) -> Markup:
    return _of_class("r" if column.right else None)


def _cell(column: Column, cell: Text, *, is_first: bool) -> Markup:
    if is_first:
        return Markup('<th scope="row">{}</th>').format(cell)
    name = column.label or column.name
    if isinstance(name, Markup):  # an attribute would lose the index of a symbol
        return Markup('<td{}><span class="col" aria-hidden="true">{}</span>{}</td>').format(
            _aligned(column), name, cell
        )
    label = Markup(' data-l="{}"').format(name) if name else Markup("")
    return Markup("<td{}{}>{}</td>").format(_aligned(column), label, cell)


def figure(title: Text, drawings: Text, caption: Text = "", aside: Text = "") -> Markup:
    """A drawing with its title (or none) above and what to see in it below."""
    side = Markup('<span class="small">{}</span>').format(aside) if aside else Markup("")
    below = Markup("<figcaption>{}</figcaption>").format(caption) if caption else Markup("")
    above = Markup("<header><h3>{}</h3>{}</header>").format(title, side) if title else Markup("")
    return Markup("<figure>{}{}{}</figure>").format(above, drawings, below)


def multiples(panels: Iterable[tuple[Text, Markup]], columns: int) -> Markup:
    """Panels of one size beside each other, each with a small title (or none)."""
    cells = (
        Markup("<div>{}{}</div>").format(Markup("<h4>{}</h4>").format(title) if title else "", drawn)
        for title, drawn in panels
    )
    return Markup('<div class="p{}">{}</div>').format(columns, Markup("").join(cells))


def judged(text: Text, *, is_good: bool) -> Markup:
    """A mark before a word."""
    return Markup('<span class="mark {}">{}{}</span>').format(
        "ok" if is_good else "bad", GOOD if is_good else BAD, text
    )
