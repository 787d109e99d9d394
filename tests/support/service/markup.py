"""Pages as a browser takes them."""

from __future__ import annotations

import re


def without_layout(page: str) -> str:
    """Without the line breaks and indents that only its template has."""
    laid_out = r"[ \n]*\n[ \n]*|[ ]{2,}"
    return re.sub(laid_out, " ", re.sub(rf"(?<=>)(?:{laid_out})|(?:{laid_out})(?=<)", "", page))
