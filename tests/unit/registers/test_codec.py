"""Words <-> values against hand-made words (IEEE 754, two's complement, the CRC catalogue)."""

import math

import pytest

from commissioner.errors import ReplyMismatch, UsageError
from commissioner.registers.codec import crc16_bytes, crc16_modbus, decode_item, decode_span, encode_item, held_words
from commissioner.registers.profile import Item, Span, plan_spans


def item(kind, **facts):
    return Item("x", 0, kind, **facts)


@pytest.mark.parametrize(
    ("description", "words", "value"),
    [
        (item("u16"), (0xFFFF,), 65535),
        (item("i16"), (0xFFFE,), -2),
        (item("u32"), (0x0001, 0x0002), 65538),
        (item("u32", word_order="little"), (0x0002, 0x0001), 65538),
        (item("i32"), (0xFFFF, 0xFFFF), -1),
        (item("f32"), (0x3FC0, 0x0000), 1.5),
        (item("f32", word_order="little"), (0x0000, 0xC020), -2.5),
        (item("u16", scale=0.5), (7,), 3.5),
        (item("u32", scale=1e-9), (0x0003, 0x0D40), 200_000 * 1e-9),
        (item("f32", length=2), (0x3F80, 0, 0x4000, 0), (1.0, 2.0)),
        (item("ascii", length=3), (0x4142, 0x4300, 0), "ABC"),
    ],
)
def test_words_and_values_stand_for_each_other(description, words, value):
    assert decode_item(description, words) == value
    assert encode_item(description, value) == words


def test_a_missing_sensor_reads_as_nan():
    assert math.isnan(decode_item(item("f32"), (0x7FC0, 0)))


def test_a_short_array_is_filled_with_zeros():
    assert encode_item(item("f32", length=3), (1.0,)) == (0x3F80, 0, 0, 0, 0, 0)


@pytest.mark.parametrize("words", [(), (1,), (1, 2, 3)])
def test_a_wrong_number_of_words_is_refused(words):
    with pytest.raises(ReplyMismatch, match="x came with"):
        decode_item(item("f32"), words)


@pytest.mark.parametrize(
    ("description", "value"),
    [
        (item("u16"), -1),
        (item("u16"), 65536),
        (item("i16"), 32768),
        (item("u32"), 2**32),
        (item("u16", minimum=1, maximum=100), 101),
        (item("u16", minimum=1, maximum=100), 0),
        (item("f32"), math.nan),
        (item("f32"), math.inf),
        (item("f32"), 1e39),
        (item("f32"), "1.0"),
        (item("f32"), True),
        (item("f32", length=2), (1.0, 2.0, 3.0)),
        (item("f32", length=2), 1.0),
        (item("ascii", length=1), "ABC"),
        (item("ascii", length=1), "Ä"),
        (item("ascii", length=1), 5),
    ],
)
def test_what_an_item_cannot_hold_is_refused_with_what_it_can(description, value):
    with pytest.raises(UsageError) as caught:
        encode_item(description, value)
    assert caught.value.limit


def test_crc_has_the_catalogue_check_value():
    assert crc16_bytes(b"123456789") == 0x4B37


def test_crc_of_a_specification_frame_closes_to_zero():
    """Read of 10 registers at 0 from device 1: the frame 01 03 00 00 00 0A C5 CD of the Modbus literature."""
    assert crc16_bytes(bytes.fromhex("01030000000AC5CD")) == 0


def test_registers_enter_the_crc_high_byte_first():
    assert crc16_modbus([0x0103, 0x0000, 0x000A]) == crc16_bytes(bytes.fromhex("01030000000A")) == 0xCDC5


def test_items_side_by_side_share_a_request_and_holes_are_never_touched():
    items = [Item("a", 10, "u16"), Item("c", 14, "f32"), Item("b", 11, "u32"), Item("d", 16, "u16")]
    spans = plan_spans(items, 125)
    seen = [(span.address, span.count, [item.name for item in span.items]) for span in spans]
    assert seen == [(10, 3, ["a", "b"]), (14, 3, ["c", "d"])]


def test_a_request_never_exceeds_the_drives_limit():
    items = [Item(f"i{k}", 2 * k, "f32") for k in range(20)]
    assert max(span.count for span in plan_spans(items, 16)) == 16


def test_a_span_decodes_each_item_from_its_own_words():
    span = Span(10, 3, (Item("a", 10, "u16"), Item("b", 11, "u32")))
    assert decode_span(span, (7, 1, 2)) == {"a": 7, "b": 65538}


@pytest.mark.parametrize(
    ("description", "words"),
    [
        (item("u16", minimum=1.0), (0,)),
        (item("i16", scale=0.01, maximum=5.0), (0x7FFF,)),
        (item("f32"), (0x7FC0, 0)),
        (item("f32", word_order="little"), (0, 0x7F80)),
    ],
)
def test_what_a_drive_held_is_compared_and_given_back_whatever_new_values_may_be(description, words):
    value = decode_item(description, words)
    assert held_words(description, value) == words
    with pytest.raises(UsageError):
        encode_item(description, value)
