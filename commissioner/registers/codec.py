"""Registers <-> values: every type, word order and scale; check sums."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from fastcrc import crc16

from commissioner.errors import ReplyMismatch, UsageError
from commissioner.registers.profile import Item, Span

Value = float | int | str | tuple[float, ...]
Words = tuple[int, ...]

_RANGE = {"u16": (0, 0xFFFF), "i16": (-0x8000, 0x7FFF), "u32": (0, 0xFFFFFFFF), "i32": (-0x80000000, 0x7FFFFFFF)}
_FORMAT = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "f32": ">f"}
F32_MAX = 3.4028234663852886e38


def decode_item(item: Item, words: Sequence[int]) -> Value:
    """The item's value in its unit: int for unscaled integers, float otherwise, str for ascii, a tuple for arrays.

    Raises ReplyMismatch where the number of words is not the item's.
    """
    if len(words) != item.words:
        raise ReplyMismatch(
            f"{item.name} came with {len(words)} registers",
            step=f"decode {item.name}",
            value=len(words),
            limit=f"{item.words} registers",
            remedy="check that the drive file fits the drive's firmware",
        )
    if item.type == "ascii":
        return struct.pack(f">{len(words)}H", *words).decode("ascii", "replace").rstrip("\x00 ")
    size = item.words // item.length
    elements = [_decode_element(item, words[k : k + size]) for k in range(0, item.words, size)]
    return elements[0] if item.length == 1 else tuple(float(e) for e in elements)


def encode_item(item: Item, value: Value) -> Words:
    """The words that stand for `value`. Raises UsageError where the item cannot hold it."""
    if item.type == "ascii":
        return _encode_ascii(item, value)
    elements = (value,) if item.length == 1 else value
    if isinstance(elements, str) or not isinstance(elements, tuple) or len(elements) > item.length:
        raise _unfit(item, value, f"at most {item.length} numbers")
    padded = (*elements, *([0.0] * (item.length - len(elements))))
    return tuple(word for element in padded for word in _encode_element(item, element))


def held_words(item: Item, value: Value) -> Words:
    """The words by which the drive held `value`, which was read from it: what the file allows of new values, and that a float is no
    number, does not matter to what is compared or given back. UsageError where no words of the item can be read as it."""
    if isinstance(value, float) and item.type == "f32" and not math.isfinite(value):
        words = struct.unpack(">2H", struct.pack(">f", value))
        return words if item.word_order == "big" else words[::-1]
    return encode_item(replace(item, minimum=None, maximum=None), value)


def decode_span(span: Span, words: Sequence[int]) -> dict[str, Value]:
    """Every item of the span by name."""
    return {
        item.name: decode_item(item, words[item.address - span.address : item.end - span.address])
        for item in span.items
    }


def encode_span(span: Span, values: Mapping[str, Value], encode: Callable[[Item, Value], Words] = encode_item) -> Words:
    """The span's words, from the values of all its items."""
    return tuple(word for item in span.items for word in encode(item, values[item.name]))


def crc16_modbus(words: Sequence[int]) -> int:
    """CRC-16/MODBUS over registers, each high byte first."""
    return crc16_bytes(struct.pack(f">{len(words)}H", *words))


def crc16_bytes(data: bytes) -> int:
    """CRC-16/MODBUS: reflected polynomial 0xA001, start 0xFFFF; 0x4B37 for b"123456789" (the catalogue's check value).

    Zero over a whole RTU frame, whose last two bytes are the sum, low byte first.
    """
    return crc16.modbus(data)


def _decode_element(item: Item, words: Sequence[int]) -> float | int:
    ordered = words if item.word_order == "big" else tuple(reversed(words))
    raw: float | int = struct.unpack(_FORMAT[item.type], struct.pack(f">{len(ordered)}H", *ordered))[0]
    return raw if item.scale == 1.0 else raw * item.scale


def _encode_element(item: Item, value: object) -> Words:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise _unfit(item, value, "a finite number")
    low, high = item.minimum, item.maximum
    if (low is not None and value < low) or (high is not None and value > high):
        raise _unfit(item, value, f"{item.bounds} {item.unit}".rstrip())
    raw = value if item.scale == 1.0 else value / item.scale
    packed = _pack_real(item, value, raw) if item.type == "f32" else _pack_whole(item, value, raw)
    words = struct.unpack(f">{len(packed) // 2}H", packed)
    return words if item.word_order == "big" else words[::-1]


def _pack_real(item: Item, value: object, raw: float) -> bytes:
    if abs(raw) > F32_MAX:
        raise _unfit(item, value, f"at most {F32_MAX:.7g} as a 32-bit float")
    return struct.pack(">f", raw)


def _pack_whole(item: Item, value: object, raw: float) -> bytes:
    low, high = _RANGE[item.type]
    whole = round(raw)
    if not low <= whole <= high:
        raise _unfit(item, value, f"{low * item.scale:g} ... {high * item.scale:g} {item.unit}".rstrip())
    return struct.pack(_FORMAT[item.type], whole)


def _encode_ascii(item: Item, value: object) -> Words:
    if not isinstance(value, str) or not value.isascii() or len(value) > 2 * item.length:
        raise _unfit(item, value, f"at most {2 * item.length} ASCII characters")
    return struct.unpack(f">{item.length}H", value.encode("ascii").ljust(2 * item.length, b"\x00"))


def _unfit(item: Item, value: object, expected: str) -> UsageError:
    return UsageError(
        f"{item.name} cannot hold {value!r}",
        step=f"encode {item.name}",
        value=repr(value),
        limit=expected,
        remedy=f"ask for a value the register at {item.address} ({item.type}) can hold",
    )
