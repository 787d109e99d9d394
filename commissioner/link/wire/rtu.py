"""Where Modbus RTU answers lie in a stream of bytes."""

from __future__ import annotations

from commissioner.registers.codec import crc16_bytes

SHORTEST_FRAME = 5
SIZE_BY_COUNT = frozenset({0x01, 0x02, 0x03, 0x04, 0x17})
SIZE_FIXED = {0x05: 8, 0x06: 8, 0x0F: 8, 0x10: 8}


def find_answers(data: bytes, device: int) -> list[bytes]:
    """The whole answers of the device, in order; noise and other devices' frames around them are passed over.

    An answer is what has the device's number, a function the service uses, the length it implies and a CRC of zero.
    """
    found: list[bytes] = []
    start = 0
    while start <= len(data) - SHORTEST_FRAME:
        frame = _frame_at(data, start, device)
        if frame:
            found.append(frame)
        start += len(frame) or 1
    return found


def _frame_at(data: bytes, start: int, device: int) -> bytes:
    if data[start] != device:
        return b""
    function = data[start + 1]
    if function & 0x80:
        size = SHORTEST_FRAME
    else:
        size = data[start + 2] + SHORTEST_FRAME if function in SIZE_BY_COUNT else SIZE_FIXED.get(function, 0)
    frame = data[start : start + size]
    return frame if size and len(frame) == size and crc16_bytes(frame) == 0 else b""
