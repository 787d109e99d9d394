"""Round trips, and random bytes: typed answers only."""

import math
import struct

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from commissioner.errors import CommissionerError, UsageError
from commissioner.link.wire.rtu import find_answers
from commissioner.link.wire.url import parse_url
from commissioner.registers.codec import crc16_bytes, decode_item, encode_item
from commissioner.registers.profile import WORDS_PER_ELEMENT, Item, WindowLayout, plan_spans
from commissioner.registers.status import DriveState, decode_state
from commissioner.registers.window import (
    CHANNEL_BITS,
    NEEDED_BITS,
    StreamCursor,
    StreamFormat,
    Window,
    WindowRefusal,
    decode_window,
)
from tests.support.scripted_port import crc16

HEADER = (
    ("session_id", "u16"),
    ("first_index", "u32"),
    ("count", "u16"),
    ("channel_mask", "u16"),
    ("flags", "u16"),
    ("dc_link_raw", "i16"),
    ("crc16", "u16"),
)
LAYOUT = WindowLayout(
    256, HEADER, 117, {n: 1 << k for k, n in enumerate(("running", "clipped", "overrun", "voltage_clamped", "ended"))}
)
WORD = st.integers(0, 0xFFFF)
KINDS = st.sampled_from(["u16", "i16", "u32", "i32", "f32"])
ORDERS = st.sampled_from(["big", "little"])
MASKS = st.sampled_from([NEEDED_BITS, NEEDED_BITS | CHANNEL_BITS["current_w_a"]])


@st.composite
def items(draw):
    kind = draw(KINDS)
    length = draw(st.integers(1, 6))
    return Item("x", 0, kind, length, draw(st.sampled_from([1.0, 0.1, 1e-3, 1e-9, 50.0])), word_order=draw(ORDERS))


@given(item=items(), data=st.data())
def test_any_words_survive_decoding_and_encoding(item, data):
    words = tuple(data.draw(st.lists(WORD, min_size=item.words, max_size=item.words)))
    value = decode_item(item, words)
    elements = value if isinstance(value, tuple) else (value,)
    if all(math.isfinite(element) for element in elements):
        again = decode_item(item, encode_item(item, value))
        np.testing.assert_array_equal(again, value)
        if item.type != "f32":
            assert encode_item(item, value) == words


@given(item=items(), value=st.one_of(st.floats(), st.integers(), st.text(), st.none(), st.tuples(st.floats())))
def test_any_value_is_encoded_or_refused_by_name(item, value):
    try:
        words = encode_item(item, value)
    except UsageError as error:
        assert error.limit
    else:
        assert len(words) == item.words
        assert all(0 <= word <= 0xFFFF for word in words)


@given(item=items(), words=st.lists(WORD, max_size=16))
def test_any_number_of_words_is_decoded_or_refused_by_name(item, words):
    try:
        decode_item(item, words)
    except CommissionerError:
        assert len(words) != item.words


@given(value=st.floats(allow_nan=False, allow_infinity=False, width=32), scale=st.sampled_from([1.0, 1e-3, 1e3]))
def test_a_value_read_from_the_drive_goes_back_to_the_same_words(value, scale):
    """Restoring a snapshot is exact: float32 -> scaled float64 -> float32."""
    item = Item("x", 0, "f32", scale=scale)
    words = struct.unpack(">2H", struct.pack(">f", value))
    assert decode_item(item, encode_item(item, decode_item(item, words))) == decode_item(item, words)
    if value != 0.0:
        assert encode_item(item, decode_item(item, words)) == words


@given(st.binary(max_size=64))
def test_the_crc_is_the_specifications_and_closes_every_frame(data):
    crc = crc16_bytes(data)
    assert crc == crc16(data)
    assert crc16_bytes(data + crc.to_bytes(2, "little")) == 0


def cursor(mask=NEEDED_BITS, session=7, index=0):
    return StreamCursor(StreamFormat(LAYOUT, session, 0.0, mask, 1e-4, 0.02, 0.001, 0.05), index)


@given(st.lists(WORD, min_size=0, max_size=130))
def test_random_words_are_never_samples(words):
    assert isinstance(decode_window(words, cursor()), WindowRefusal)


@given(
    mask=MASKS,
    index=st.integers(0, 2**31),
    gap=st.integers(0, 5000),
    count=st.integers(0, 29),
    flags=st.integers(0, 31),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_window_gives_back_the_samples_that_went_in(mask, index, gap, count, flags, seed):
    rows = np.random.default_rng(seed).integers(-32768, 32768, (count, mask.bit_count()))
    header = struct.pack(">HIHHHh", 7, index + gap, count, mask, flags, -5)
    data = rows.astype(">i2").tobytes()
    whole = header + struct.pack(">H", crc16(header + data)) + data.ljust(234, b"\xa5")
    window = decode_window(struct.unpack(">125H", whole), cursor(mask, index=index))
    assert isinstance(window, Window)
    if count == 0:
        assert window.block is None and window.cursor.next_index == index
        return
    block = window.block
    np.testing.assert_array_equal(np.round(block.voltage_axis_v / 0.02), rows[:, 0])
    np.testing.assert_array_equal(np.round(block.current_v_a / 0.001), rows[:, 2])
    assert block.lost_before == gap == window.cursor.lost
    assert window.cursor.next_index == index + gap + count
    assert (window.is_running, window.has_ended) == (bool(flags & 1), bool(flags & 16))


@given(chunks=st.lists(st.tuples(st.integers(0, 50), st.integers(1, 39)), max_size=30))
def test_however_a_stream_is_cut_the_counts_add_up(chunks):
    """Samples received plus samples lost is where the reader stands."""
    place, received, position = cursor(), 0, 0
    for gap, count in chunks:
        header = struct.pack(">HIHHHh", 7, position + gap, count, NEEDED_BITS, 1, 0)
        data = bytes(6 * count)
        whole = header + struct.pack(">H", crc16(header + data)) + data.ljust(234, b"\0")
        window = decode_window(struct.unpack(">125H", whole), place)
        place, received, position = window.cursor, received + window.block.count, position + gap + count
    assert place.next_index == position
    assert received + place.lost == position


@given(st.lists(st.tuples(st.integers(0, 500), KINDS, st.integers(1, 4)), max_size=40), st.integers(8, 125))
def test_spans_cover_every_register_of_the_items_once_and_no_other(places, room):
    items, taken = [], set()
    for k, (address, kind, length) in enumerate(places):
        item = Item(f"i{k}", address, kind, length)
        if item.words <= room and not taken & set(range(item.address, item.end)):
            items.append(item)
            taken |= set(range(item.address, item.end))
    spans = plan_spans(items, room)
    covered = [register for span in spans for register in range(span.address, span.address + span.count)]
    assert sorted(covered) == sorted(taken)
    assert all(span.count <= room for span in spans)


@given(st.integers(0, 0xFFFF))
def test_every_status_word_has_a_state(word):
    assert decode_state("cia402", word, {}) in DriveState


@given(st.text(max_size=60))
def test_any_text_is_an_address_or_a_usage_error(text):
    try:
        parse_url(text)
    except UsageError as error:
        assert error.remedy


@given(scheme=st.sampled_from(["tcp", "tls", "rtu"]), rest=st.text(alphabet="/:?&=[]@#%.-ab01١", max_size=30))
def test_texts_that_look_like_addresses_are_addresses_or_usage_errors(scheme, rest):
    try:
        parse_url(f"{scheme}://{rest}")
    except UsageError as error:
        assert error.remedy


@given(before=st.binary(max_size=12), after=st.binary(max_size=12), words=st.lists(WORD, min_size=1, max_size=20))
def test_an_rtu_answer_is_found_among_any_noise(before, after, words):
    body = bytes([9, 3, 2 * len(words)]) + struct.pack(f">{len(words)}H", *words)
    frame = body + crc16(body).to_bytes(2, "little")
    assert frame in find_answers(before + frame + after, 9)
    assert find_answers(before + frame + frame + after, 9).count(frame) == 2
    assert frame not in find_answers(before + frame + after, 8)


@given(st.binary(max_size=300), st.integers(1, 247))
def test_random_bytes_hold_answers_or_none_and_never_fail(data, device):
    for answer in find_answers(data, device):
        assert answer in data
        assert crc16(answer[:-2]) == int.from_bytes(answer[-2:], "little")


def test_word_sizes_are_those_of_the_map():
    assert dict(WORDS_PER_ELEMENT) == {"u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2, "ascii": 1}
