"""What is closed on a page until somebody opens it, and open on paper."""

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
