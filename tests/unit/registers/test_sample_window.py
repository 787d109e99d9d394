"""The sample window: every reply is samples in SI units or a named refusal; gaps are counted, never filled."""

import struct

import numpy as np
import pytest

from commissioner.errors import UsageError
from commissioner.registers.profile import WindowLayout
from commissioner.registers.window import (
    Refusal,
    StreamCursor,
    StreamFormat,
    Window,
    WindowRefusal,
    channel_mask,
    decode_window,
    encode_request,
)
from tests.support.scripted_port import crc16

HEADER = tuple(
    (name, kind)
    for name, _, kind in (
        entry.partition(":")
        for entry in (
            "session_id:u16",
            "first_index:u32",
            "count:u16",
            "channel_mask:u16",
            "flags:u16",
            "dc_link_raw:i16",
            "crc16:u16",
        )
    )
)
FLAGS = {"running": 1, "clipped": 2, "overrun": 4, "voltage_clamped": 8, "ended": 16}
LAYOUT = WindowLayout(256, HEADER, 117, FLAGS)


def stream(mask=0b0111, session=7):
    return StreamFormat(LAYOUT, session, 60.0, mask, 2e-4, 0.5, 0.25, 0.1)


def reply(rows, *, session=7, first=0, mask=0b0111, flags=1, link=5600, count=None):
    """Words of a window as the map describes them, packed here by hand."""
    header = struct.pack(">HIHHHh", session, first, len(rows) if count is None else count, mask, flags, link)
    data = b"".join(struct.pack(f">{len(row)}h", *row) for row in rows)
    whole = header + struct.pack(">H", crc16(header + data)) + data.ljust(234, b"\0")
    return list(struct.unpack(">125H", whole))


ROWS = [(10, -4, 2), (20, -8, 4), (30, -12, 6)]


def test_a_window_becomes_samples_in_si_units():
    window = decode_window(reply(ROWS, first=5), StreamCursor(stream(), 5))
    assert isinstance(window, Window)
    block = window.block
    np.testing.assert_array_equal(block.voltage_axis_v, [5.0, 10.0, 15.0])
    np.testing.assert_array_equal(block.current_u_a, [-1.0, -2.0, -3.0])
    np.testing.assert_array_equal(block.current_v_a, [0.5, 1.0, 1.5])
    assert block.current_w_a is None
    assert (block.session, block.first_index, block.sample_period_s, block.axis_deg) == (7, 5, 2e-4, 60.0)
    assert block.dc_link_v == pytest.approx(560.0)
    assert block.voltage_axis_v.dtype == np.float64
    assert window.cursor.next_index == 8


def test_a_fourth_channel_is_the_third_phase():
    window = decode_window(reply([(2, 4, 8, 12)], mask=0b1111), StreamCursor(stream(0b1111)))
    np.testing.assert_array_equal(window.block.current_w_a, [3.0])


def test_a_full_window_holds_39_samples_of_three_channels_and_29_of_four():
    assert (stream().samples_per_window, stream(0b1111).samples_per_window) == (39, 29)
    rows = [(k, -k, 2 * k) for k in range(39)]
    assert decode_window(reply(rows), StreamCursor(stream())).block.count == 39


def test_no_new_sample_is_no_block_and_no_progress():
    window = decode_window(reply([], first=9), StreamCursor(stream(), 9, lost=3))
    assert window.block is None
    assert (window.cursor.next_index, window.cursor.lost) == (9, 3)


def test_a_gap_is_counted_once_and_marked_on_the_block_after_it():
    cursor = StreamCursor(stream(), 10)
    after = decode_window(reply(ROWS, first=25, flags=5), cursor)
    assert after.is_overrun
    assert after.block.lost_before == 15
    following = decode_window(reply(ROWS, first=28), after.cursor)
    assert following.block.lost_before == 0
    assert following.cursor.lost == 15


def test_asking_again_for_the_same_index_gives_the_same_samples():
    cursor = StreamCursor(stream(), 5)
    words = reply(ROWS, first=5)
    first, second = decode_window(words, cursor), decode_window(words, cursor)
    np.testing.assert_array_equal(first.block.current_u_a, second.block.current_u_a)
    assert first.cursor == second.cursor


@pytest.mark.parametrize(
    ("flag", "claim"),
    [(1, "is_running"), (2, "is_clipped"), (4, "is_overrun"), (8, "is_voltage_clamped"), (16, "has_ended")],
)
def test_each_flag_is_one_claim(flag, claim):
    window = decode_window(reply(ROWS, flags=flag), StreamCursor(stream()))
    claims = ("is_running", "is_clipped", "is_overrun", "is_voltage_clamped", "has_ended")
    assert [name for name in claims if getattr(window, name)] == [claim]
    assert window.block.clipped == (claim == "is_clipped")


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (reply(ROWS)[:-1], Refusal.LENGTH),
        ([*reply(ROWS), 0], Refusal.LENGTH),
        ([], Refusal.LENGTH),
        (reply(ROWS, session=6), Refusal.SESSION),
        (reply(ROWS, mask=0b1011), Refusal.CHANNELS),
        (reply(ROWS, first=4), Refusal.INDEX),
        (reply(ROWS, count=40), Refusal.COUNT),
    ],
)
def test_a_reply_that_is_not_ours_is_refused_by_name(words, reason):
    refusal = decode_window(words, StreamCursor(stream(), 5))
    assert isinstance(refusal, WindowRefusal)
    assert refusal.reason is reason
    assert refusal.seen != refusal.expected


@pytest.mark.parametrize("word", [0, 1, 2, 4, 5, 6, 8, 12, 16])
@pytest.mark.parametrize("bit", [0, 7, 15])
def test_one_wrong_bit_anywhere_is_seen(word, bit):
    words = reply(ROWS)
    words[word] ^= 1 << bit
    assert isinstance(decode_window(words, StreamCursor(stream())), WindowRefusal)


def test_the_request_carries_heartbeat_and_start_index():
    assert encode_request(0x1234, 0x00056789) == (0x1234, 0x0005, 0x6789)
    assert encode_request(0x10001, 3) == (1, 0, 3)


def test_channels_become_the_mask_of_the_map():
    assert channel_mask(["current_v_a", "voltage_axis_v", "current_u_a"]) == 0b0111
    assert channel_mask(["voltage_axis_v", "current_u_a", "current_v_a", "current_w_a"]) == 0b1111


@pytest.mark.parametrize("channels", [[], ["current_u_a", "current_v_a"], ["voltage_axis_v", "current_u_a", "speed"]])
def test_channels_that_carry_no_answer_are_refused(channels):
    with pytest.raises(UsageError):
        channel_mask(channels)
