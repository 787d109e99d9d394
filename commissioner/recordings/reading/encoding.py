"""Bytes to text: marks, UTF-8, UTF-16 without a mark, and of code pages the one in which most of the words are known."""

from __future__ import annotations

from commissioner.recordings.reading.preface import INTERVAL, RATE
from commissioner.recordings.units import WHOLE
from commissioner.recordings.words import TRANSLATED

SAMPLE = 1 << 16
CODE_PAGES = {"cp1252": "Windows-1252", "gb18030": "GBK", "cp932": "Shift-JIS", "cp1251": "Windows-1251", "cp1250": "Windows-1250",
              "cp1254": "Windows-1254", "big5": "Big5", "cp949": "Korean (cp949)", "cp1253": "Windows-1253"}  # fmt: skip
"""With what they are called. Of those that know as many letters the first: most of the West is the same in three of them."""
WORDS = frozenset(word for word in (*TRANSLATED, *INTERVAL, *RATE, *WHOLE) if not word.isascii() and len(word) > 1)
"""Those that code pages write differently; a single letter is one of some word in each."""


def decode(data: bytes) -> tuple[str, str]:
    """(text, the encoding's name). Latin-1 takes any byte, so this never fails; names then decide what is understood."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data[: len(data) // 2 * 2].decode("utf-16", errors="replace"), "UTF-16"
    head = data[:SAMPLE]
    for order, at in (("utf-16-le", 1), ("utf-16-be", 0)):
        half = head[at::2]
        if len(half) > 8 and half.count(0) > 0.7 * len(half):
            return data[: len(data) // 2 * 2].decode(order, errors="replace"), order.upper()
    try:
        return data.decode("utf-8-sig"), "UTF-8"
    except UnicodeDecodeError:
        return _of_code_page(data)


def _of_code_page(data: bytes) -> tuple[str, str]:
    for page in sorted(CODE_PAGES, key=lambda page: -_known_letters(data[:SAMPLE], page)):
        try:
            return data.decode(page), CODE_PAGES[page]
        except UnicodeDecodeError:
            pass
    return data.decode("latin-1"), "Latin-1"


def _known_letters(head: bytes, page: str) -> int:
    """How many letters of known words the bytes hold in this code page."""
    text = head.decode(page, errors="replace").lower()
    return sum(len(word) * text.count(word) for word in WORDS)
