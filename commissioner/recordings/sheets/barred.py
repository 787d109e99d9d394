"""A table drawn with bars (`| t | Ia |`, as in Markdown or a wiki, or bars alone between its columns) as one between tabs."""

from __future__ import annotations

import re

from commissioner.recordings.reading.layout import head_lines

LEAST_PART, LOOKED_AT = 0.8, 40
"""Of the lines that are no comments: so many hold the same number of bars."""
_RULE = re.compile(r"[\s|:+=-]*-[\s|:+=-]*")


def unbarred(text: str) -> str:
    """The text with tabs in place of bars, without the lines drawn under its names; any other text as it is."""
    lines = [line.text for line in head_lines(text[: 1 << 14]) if line.text.strip() and not line.text.startswith("#")]
    bars = [line.count("|") for line in lines[-LOOKED_AT:]]
    usual = max(set(bars), key=bars.count, default=0)
    if usual < 1 or bars.count(usual) < LEAST_PART * len(bars) or any("\t" in line for line in lines):
        return text
    rows = (line.strip() for line in text.splitlines())
    return "\n".join(_between_tabs(row) for row in rows if not (_RULE.fullmatch(row) and "|" in row)) + "\n"


def _between_tabs(row: str) -> str:
    if row.startswith("#") or "|" not in row:
        return row
    return "\t".join(cell.strip() for cell in row.removeprefix("|").removesuffix("|").split("|"))
