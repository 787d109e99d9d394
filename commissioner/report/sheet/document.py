"""Sheets put together: one HTML text that prints on A4 or Letter with the run and the number on every page."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from markupsafe import Markup

from commissioner.report.sheet.drawing import HATCH

_LATIN = "U+0000-00FF, U+0131, U+0152-0153, U+02BB-02BC, U+02C6, U+02DA, U+02DC, U+2000-206F, U+20AC, U+2122, U+2191, U+2193, U+2212, U+2215"
_RANGES = {"latin": _LATIN, "greek": "U+0370-03FF"}


@dataclass(frozen=True)
class Page:
    """A sheet that begins on a page of its own; below the one before where both flow. `anchor` names it for links, `title` in their line."""

    anchor: str
    title: str
    body: Markup
    flows: bool = False


@dataclass(frozen=True)
class Margins:
    """What stands on every printed page."""

    subject: str
    middle: str
    run: str
    below_left: str
    below_right: str


def document(title: str, margins: Margins, pages: Sequence[Page]) -> str:
    """The whole text. Nothing is loaded from elsewhere; fonts lie inside."""
    links = Markup("").join(
        Markup('<a href="#{}">{}</a>').format(page.anchor, page.title) for page in pages if len(pages) > 1
    )
    kick = Markup('<p class="kick"><span>{}</span><span class="sim">{}</span><span>{}</span></p>').format(
        margins.subject, margins.middle, margins.run
    )
    sheets = Markup("").join(
        Markup('<section class="pg{}" id="{}">{}{}</section>').format(
            " flows" if page.flows else "", page.anchor, kick, page.body
        )
        for page in pages
    )
    return str(
        Markup(
            '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1"><title>{}</title>'
            '<style>{}</style></head>\n<body>{}<nav class="bar" aria-label="Parts of the report"><b>{}</b>{}</nav>'
            "<main>{}</main></body></html>\n"
        ).format(title, Markup(_style(margins)), HATCH, title, links, sheets)
    )


def _style(margins: Margins) -> str:
    boxes = {
        "top-left": _quoted(_cut(margins.subject, 54)), "top-center": _quoted(_cut(margins.middle, 28)),
        "top-right": f'{_quoted(" · ".join(filter(None, (_cut(margins.run, 36), "page "))))} counter(page) " of " counter(pages)',
        "bottom-left": _quoted(margins.below_left), "bottom-right": _quoted(margins.below_right),
    }  # fmt: skip
    texts = " ".join(f"@{name} {{ content: {text} }}" for name, text in boxes.items())
    return f"{_fonts()}\n{_sheet()}\n@page {{ {texts} }}\n"


def _cut(text: str, longest: int) -> str:
    """What fits beside its neighbours in the one line of a margin; the page itself has the whole."""
    return text if len(text) <= longest else f"{text[: longest - 1].rstrip()}…"


def _quoted(text: str) -> str:
    """A CSS string that can end neither itself nor the style element."""
    kept = "".join(c if c.isprintable() and c not in '"\\<>{}&' else f"\\{ord(c):x} " for c in text)
    return f'"{kept}"'


@cache
def _sheet() -> str:
    return (files(__package__) / "sheet.css").read_text("utf-8")


@cache
def _fonts() -> str:
    """IBM Plex Sans in static cuts (OFL, licence beside them): Chromium prints a variable font as outlines."""
    faces = []
    for script, letters in _RANGES.items():
        for weight in (400, 500, 600):
            raw = (files(__package__) / "fonts" / f"ibm-plex-sans-{script}-{weight}-normal.woff2").read_bytes()
            data = base64.b64encode(raw).decode("ascii")
            faces.append(
                f"@font-face {{ font-family: Plex; src: url(data:font/woff2;base64,{data}) format('woff2'); "
                f"font-weight: {weight}; font-display: swap; unicode-range: {letters}; }}"
            )
    return "\n".join(faces)
