"""The sample window: what to ask, and what an answer is worth. Gaps are counted and marked, never filled.

The check sum runs over the header without itself and the samples the header counts, not over the unused registers.

Asking again for the same index gives the same samples, so a repeated question is harmless and a late answer to an
older one shows by its session or index.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import UsageError
from commissioner.records import SampleBlock
from commissioner.registers.codec import Words, crc16_bytes
from commissioner.registers.profile import WindowLayout

VOLTAGE_BIT, CURRENT_U_BIT, CURRENT_V_BIT, CURRENT_W_BIT = 1, 2, 4, 8
CHANNEL_BITS = {
    "voltage_axis_v": VOLTAGE_BIT,
    "current_u_a": CURRENT_U_BIT,
    "current_v_a": CURRENT_V_BIT,
    "current_w_a": CURRENT_W_BIT,
}
NEEDED_BITS = VOLTAGE_BIT | CURRENT_U_BIT | CURRENT_V_BIT
"""A sample block without the voltage or with fewer than two currents carries no answer."""


class Refusal(Enum):
    """Why a window reply is not used. The value is the sentence shown to the user."""

    LENGTH = "the window reply does not have the window's length"
    CHECK_SUM = "the window's check sum does not fit its content"
    SESSION = "the window belongs to another session"
    INDEX = "the window starts before the sample asked for: an answer to an older question"
    CHANNELS = "the window carries other channels than were set"
    COUNT = "the window claims more samples than it can hold"


@dataclass(frozen=True)
class WindowRefusal:
    """A reply that must not be used, with what was seen and what would have been right."""

    reason: Refusal
    seen: object
    expected: object


@dataclass(frozen=True)
class StreamFormat:
    """What one enable fixed: session, axis, channels, period and scales (unit per count)."""

    layout: WindowLayout
    session: int
    axis_deg: float
    channel_mask: int
    sample_period_s: float
    voltage_scale_v: float
    current_scale_a: float
    dc_link_scale_v: float
    averaged: int = 1

    @property
    def channels(self) -> int:
        return self.channel_mask.bit_count()

    @cached_property
    def bits(self) -> tuple[int, ...]:
        """Of the channels, in the window's order."""
        return tuple(bit for bit in CHANNEL_BITS.values() if self.channel_mask & bit)

    @cached_property
    def scales(self) -> NDArray[np.float64]:
        """(channels, 1): unit per count."""
        return np.array([[self.voltage_scale_v if b == VOLTAGE_BIT else self.current_scale_a] for b in self.bits])

    @property
    def samples_per_window(self) -> int:
        """The most samples one fetch can bring."""
        return self.layout.data_registers // self.channels

    def registers_for(self, samples: int) -> int:
        """Of a window that brings no more than these."""
        return self.layout.header_words + self.channels * min(max(samples, 1), self.samples_per_window)


@dataclass(frozen=True)
class StreamCursor:
    """Where the reader is: the next sample wanted and how many were lost up to here."""

    stream: StreamFormat
    next_index: int = 0
    lost: int = 0


@dataclass(frozen=True)
class Window:
    """A usable reply. `block` is None where no new sample was ready; `cursor` is where to go on."""

    block: SampleBlock | None
    cursor: StreamCursor
    is_running: bool
    is_clipped: bool
    is_overrun: bool
    is_voltage_clamped: bool
    has_ended: bool


def channel_mask(channels: Sequence[str]) -> int:
    """The mask for the named channels. Raises UsageError where a name is unknown or the set carries no answer."""
    unknown = [name for name in channels if name not in CHANNEL_BITS]
    mask = sum({CHANNEL_BITS[name] for name in channels if name in CHANNEL_BITS})
    if unknown or mask & NEEDED_BITS != NEEDED_BITS:
        raise UsageError(
            "these channels cannot be streamed",
            step="choose channels",
            value=", ".join(channels),
            limit="voltage_axis_v, current_u_a, current_v_a and optionally current_w_a",
            remedy="name the axis voltage and at least currents u and v",
        )
    return mask


def encode_request(heartbeat: int, next_index: int) -> Words:
    """heartbeat:u16, window_index:u32: the write half of a fetch."""
    return (heartbeat & 0xFFFF, next_index >> 16 & 0xFFFF, next_index & 0xFFFF)


def decode_window(words: Sequence[int], cursor: StreamCursor, asked: int | None = None) -> Window | WindowRefusal:
    """The reply as samples in SI units, or why it must not be used. Never raises for any words. `asked`: registers asked for,
    where not the whole window: over a slow link a shorter answer is here sooner."""
    layout = cursor.stream.layout
    wanted = layout.words if asked is None else asked
    if len(words) != wanted:
        return WindowRefusal(Refusal.LENGTH, f"{len(words)} registers", f"{wanted} registers")
    packed = struct.pack(f">{len(words)}H", *words)
    header = dict(zip(layout.header_names, layout.header_form.unpack_from(packed), strict=True))
    refusal = _examine(packed, header, cursor)
    return refusal or _accept(packed, header, cursor)


def _examine(packed: bytes, header: dict[str, int], cursor: StreamCursor) -> WindowRefusal | None:
    stream = cursor.stream
    used = header["count"] * header["channel_mask"].bit_count()
    most = len(packed) // 2 - stream.layout.header_words
    if used > most:
        return WindowRefusal(Refusal.COUNT, f"{used} data registers", f"at most {most}")
    start = 2 * stream.layout.header_words
    check_sum = crc16_bytes(packed[: start - 2] + packed[start : start + 2 * used])
    if header["crc16"] != check_sum:
        return WindowRefusal(Refusal.CHECK_SUM, f"0x{header['crc16']:04X}", f"0x{check_sum:04X}")
    if header["session_id"] != stream.session:
        return WindowRefusal(Refusal.SESSION, header["session_id"], stream.session)
    if header["channel_mask"] != stream.channel_mask:
        return WindowRefusal(Refusal.CHANNELS, header["channel_mask"], stream.channel_mask)
    if header["count"] and header["first_index"] < cursor.next_index:
        return WindowRefusal(Refusal.INDEX, header["first_index"], f"{cursor.next_index} or later")
    return None


def _accept(packed: bytes, header: dict[str, int], cursor: StreamCursor) -> Window:
    flags = cursor.stream.layout.flags
    count, first = header["count"], header["first_index"]
    lost = first - cursor.next_index if count else 0
    claims = {name: bool(header["flags"] & mask) for name, mask in flags.items()}
    return Window(
        block=_block(packed, header, cursor.stream, lost, claims["clipped"]) if count else None,
        cursor=StreamCursor(cursor.stream, first + count, cursor.lost + lost) if count else cursor,
        is_running=claims["running"],
        is_clipped=claims["clipped"],
        is_overrun=claims["overrun"],
        is_voltage_clamped=claims["voltage_clamped"],
        has_ended=claims["ended"],
    )


def _block(packed: bytes, header: dict[str, int], stream: StreamFormat, lost: int, is_clipped: bool) -> SampleBlock:
    shape = (header["count"], stream.channels)
    data = np.ndarray(shape, ">i2", packed, 2 * stream.layout.header_words)
    scaled = np.multiply(data.T, stream.scales, order="C")
    columns: dict[int, NDArray[np.float64]] = dict(zip(stream.bits, scaled, strict=True))
    return SampleBlock(
        session=stream.session,
        first_index=header["first_index"],
        sample_period_s=stream.sample_period_s,
        axis_deg=stream.axis_deg,
        voltage_axis_v=columns[VOLTAGE_BIT],
        current_u_a=columns[CURRENT_U_BIT],
        current_v_a=columns[CURRENT_V_BIT],
        current_w_a=columns.get(CURRENT_W_BIT),
        dc_link_v=header["dc_link_raw"] * stream.dc_link_scale_v,
        lost_before=lost,
        clipped=is_clipped,
        averaged=stream.averaged,
        unit_v=stream.voltage_scale_v,
        unit_a=stream.current_scale_a,
    )
