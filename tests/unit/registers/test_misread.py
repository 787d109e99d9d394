"""Registers read in a wrong order, at a wrong address or with a wrong scale: what to try is said."""

import struct

import pytest

from commissioner.registers.misread import misread, misread_word

MAGIC = 0x434D5352


@pytest.mark.parametrize(("code", "way"), [("<HH", "two words"), (">HH", None)], ids=["words exchanged", "as it is"])
def test_words_in_the_other_order_are_told(code, way):
    words = struct.unpack(">HH", struct.pack(">I", MAGIC))
    seen = struct.unpack(">I", struct.pack(">HH", *(words[::-1] if way else words)))[0]
    assert ("two words" in misread_word(seen, MAGIC)) is bool(way)


@pytest.mark.parametrize(
    ("seen", "said"),
    [
        (0x4D435253, "bytes are exchanged within each word"),
        (0x52534D43, "four bytes stand in reverse"),
        (0x0001434D, "addresses larger by 1"),
        (0x53520001, "addresses smaller by 1"),
        (0x12345678, ""),
        (None, ""),
        ("text", ""),
    ],
)
def test_bytes_and_addresses_are_told(seen, said):
    assert said in misread_word(seen, MAGIC)
    assert bool(misread_word(seen, MAGIC)) is bool(said)


@pytest.mark.parametrize(("value", "factor"), [(54.0, "10"), (5400.0, "0.1"), (0.54, "1000")])
def test_a_scale_wrong_by_a_power_of_ten_is_told_with_the_item(value, factor):
    said = misread("dc_link_v", value, 480.0, 640.0, "V")
    assert said == f"or see items.dc_link_v in the drive file, which would be 540 V with {factor} times its scale"


def test_a_float_with_exchanged_words_is_told():
    high, low = struct.unpack(">HH", struct.pack(">f", 541.25))
    seen = struct.unpack(">f", struct.pack(">HH", low, high))[0]
    assert "which would be 541.2 V with its two words exchanged" in misread("dc_link_v", seen, 480.0, 640.0, "V")


def test_a_float_that_was_read_as_a_whole_number_is_told():
    seen = float(struct.unpack(">I", struct.pack(">f", 541.25))[0])
    assert misread("dc_link_v", seen, 480.0, 640.0, "V").endswith('541.2 V as type = "f32"')


@pytest.mark.parametrize("value", [541, 300, 300.0, 0.0, float("nan"), float("inf"), 1e300])
def test_a_value_that_no_misreading_explains_gets_no_guess(value):
    assert misread("dc_link_v", value, 480.0, 640.0, "V") == ""
