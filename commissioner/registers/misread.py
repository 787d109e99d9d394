"""Does a number that cannot be right become right when its register is read another way? What to try in the drive file then.

Drive files written by hand mistake three things: the order of words and bytes, the address by one, the scale by a power of ten.
Each of these makes of a right value a certain wrong one.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator

POWERS = (1, -1, 2, -2, 3, -3)
"""Of ten, the likelier first."""
_ORDERS = {
    (2, 3, 0, 1): "its two words are exchanged: try the other link.word_order",
    (1, 0, 3, 2): "its bytes are exchanged within each word, which no drive file can undo: see the gateway's or the drive's setting",
    (3, 2, 1, 0): "its four bytes stand in reverse: try the other link.word_order, and see the gateway's or the drive's setting",
}  # fmt: skip
"""Of the four bytes as they were read: what would put them right."""


def misread_word(seen: object, wanted: object) -> str:
    """What to try where a whole number of 32 bits is not what it must be; empty where no way of reading explains it."""
    if not (
        isinstance(seen, int) and isinstance(wanted, int) and min(seen, wanted) >= 0 and max(seen, wanted) < 1 << 32
    ):
        return ""
    of_words = {_in_order(seen, order): way for order, way in _ORDERS.items()}
    if wanted in of_words:
        return of_words[wanted]
    if wanted >> 16 == seen & 0xFFFF:
        return "its first word stands one register later: try addresses larger by 1 (link.address_base)"
    if wanted & 0xFFFF == seen >> 16:
        return "its second word stands here: try addresses smaller by 1 (link.address_base)"
    return ""


def _in_order(word: int, order: tuple[int, ...]) -> int:
    octets = word.to_bytes(4, "big")
    return int.from_bytes(bytes(octets[k] for k in order), "big")


def misread(key: str, value: float, low: float, high: float, unit: str = "") -> str:
    """What to try in the drive file's item `key`, of which a value within `low` ... `high` is expected; empty where it is one, and where nothing makes it
    one."""
    for right, how in _ways(float(value)) if not low <= value <= high else ():
        if low <= right <= high:
            shown = f"{right:.4g} {unit}".rstrip()
            return f"or see items.{key} in the drive file, which would be {shown} {how}"
    return ""


def _ways(value: float) -> Iterator[tuple[float, str]]:
    for power in POWERS:
        factor = 10.0**power
        yield value * factor, f"with {factor:g} times its scale"
    yield _exchanged(value), "with its two words exchanged (link.word_order)"
    if 0.0 < value < 1 << 32 and value.is_integer():
        yield float(struct.unpack(">f", struct.pack(">I", int(value)))[0]), 'as type = "f32"'


def _exchanged(value: float) -> float:
    """A float of two registers with its words in the other order; NaN where it is none of 32 bits."""
    try:
        high, low = struct.unpack(">2H", struct.pack(">f", value))
    except OverflowError:
        return math.nan
    return float(struct.unpack(">f", struct.pack(">2H", low, high))[0])
