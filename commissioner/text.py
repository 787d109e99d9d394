"""Text from outside (a drive, a file, a folder's name, an argument) is data: it is shown, and steers nothing.

The one function of the boundary. Terminal, page and log add what their own markup needs (`screen.text`, the templates'
autoescape, JSON); what no medium may get is spelled out here.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from difflib import get_close_matches
from urllib.parse import SplitResult, urlsplit

LONGEST = 300
"""Characters of one text on a terminal or page; what is longer is told by its length."""
NEAR, SHORTEST_BEGINNING = 0.75, 4
"""How alike two names are of which one may be the other misspelt (difflib's ratio); characters of a name that only one begins with."""
_NEVER = frozenset({"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"})
"""Unicode categories that are spelled out: control (C0, DEL, C1), format (direction marks, zero width), surrogates, private
use, unassigned, line and paragraph separators."""


def visible(text: str) -> str:
    """All of it in one line, each character of which only shows."""
    return text if text.isprintable() and text.isascii() else "".join(map(_visible, text))


def is_sayable(text: str) -> bool:
    """False where it holds bytes of another encoding, as half a character each: no file, database or page can hold them."""
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return False
    return True


def shown(value: object, longest: int = LONGEST) -> str:
    """`str(value)` in one line of at most about `longest` characters, each of which only shows: ESC is `\\x1b`."""
    text = str(value)
    kept = visible(text[:longest])
    return kept if len(text) <= longest else f"{kept}... ({len(text)} characters)"


def in_unit(text: str, value: object, unit: str) -> str:
    """`text`, which shows `value`, with its unit where the value is a number: words have theirs inside."""
    return f"{text} {unit}" if unit and isinstance(value, int | float) and not isinstance(value, bool) else text


def counted(count: int, what: str) -> str:
    """`1 register`, `2 registers`."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`; did you mean 'danfoss_fc302'?` where a name that is not there is nearly, or begins, one that is; else nothing."""
    spelled = {one.casefold(): one for one in known}
    asked = name.casefold()
    begun = [one for one in spelled if len(asked) >= SHORTEST_BEGINNING and one.startswith(asked)]
    near = begun[:1] if len(begun) == 1 else get_close_matches(asked, spelled, n=1, cutoff=NEAR)
    return f"; did you mean {spelled[near[0]]!r}?" if near else ""


def split_address(text: str) -> SplitResult:
    """The parts of an address that somebody gave; none where it is no address, or its port none."""
    try:
        parts = urlsplit(text)
        _ = parts.port  # raises where it is no number of a port
        return parts
    except ValueError:
        return urlsplit("")


def _visible(character: str) -> str:
    if unicodedata.category(character) not in _NEVER:
        return character
    return character.encode("unicode_escape").decode("ascii")
