"""Small marks on a page: what is closed until somebody opens it, commands, and numbers behind a word."""

from __future__ import annotations

from collections.abc import Sequence

from markupsafe import Markup

from commissioner.report.page import Picture


def folded(summary: str, parts: Sequence[str | Picture]) -> Picture:
    """Paragraphs and pictures under one line that opens them; text is escaped."""
    inside = Markup("").join(
        Markup("<figure>{}<figcaption>{}</figcaption></figure>").format(Markup(part.markup), part.caption)
        if isinstance(part, Picture)
        else Markup("<p>{}</p>").format(part)
        for part in parts
    )
    return Picture(str(Markup("<details><summary>{}</summary>{}</details>").format(summary, inside)), "")


def hinted(text: str, hint: str) -> Markup:
    """A cell whose number shows when the pointer rests on it."""
    return Markup('<span title="{}">{}</span>').format(hint, text)
