"""Modbus' two ways to frame a request: TCP, and RTU on a serial line or a pseudo terminal of our own."""

from __future__ import annotations

import os
import socket
import struct
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial

from sim.wire.crc import crc_bytes

Answer = Callable[[bytes], bytes | None]
"""A drive's PDU to a request's; None where it says nothing."""
SILENCE_S = 0.05
"""Of a serial line, after which what is left of a request is forgotten: 3.5 characters at 9600 Bd are 4 ms, an adapter waits 16."""
BITS = 11
"""Of a character, with parity or a second stop bit."""


class TcpLine:
    """A client of Modbus TCP. A selector watches `fileno`."""

    def __init__(self, connection: socket.socket) -> None:
        connection.settimeout(2.0)
        self._connection = connection
        self.fileno = connection.fileno
        self.close = connection.close

    def serve(self, answer: Answer, turnaround_s: float) -> bool:
        """What has come is answered, so long after. False where the other end has gone."""
        try:
            number, _, length, unit = struct.unpack(">HHHB", self._take(7))
            reply = answer(self._take(length - 1))
            time.sleep(turnaround_s)
            if reply is not None:
                self._connection.sendall(struct.pack(">HHHB", number, 0, len(reply) + 1, unit) + reply)
        except (OSError, EOFError, struct.error):
            return False
        return True

    def _take(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = self._connection.recv(count - len(data))
            if not piece:
                raise EOFError
            data += piece
        return data


class RtuLine:
    """A serial line on which the drive has a number; `path`: a device, or `pty`. OSError, serial.SerialException: it cannot be had."""

    def __init__(self, path: str, baud: int, parity: str, device: int) -> None:
        if sys.platform == "win32":
            raise OSError(
                "a serial line of an ordinary drive is simulated on POSIX systems alone: no selector of Windows takes one"
            )
        self._character_s, self._device = BITS / baud, device
        self._begun, self._heard_s = b"", 0.0
        if path == "pty":
            import tty  # pseudo terminals are POSIX's

            self._descriptor, other = os.openpty()  # held open: it has not gone while nobody speaks
            tty.setraw(other)
            self.address, self._shut = os.ttyname(other), partial(os.close, self._descriptor)
        else:
            import serial

            port = serial.Serial(path, baud, parity=parity, stopbits=1 if parity != "N" else 2, timeout=0)
            self._descriptor, self.address, self._shut = port.fileno(), path, port.close

    def fileno(self) -> int:
        return self._descriptor

    def serve(self, answer: Answer, turnaround_s: float) -> bool:
        """The same. False where the adapter has gone."""
        now = time.monotonic()
        if now - self._heard_s > SILENCE_S:
            self._begun = b""
        self._heard_s = now
        try:
            heard = os.read(self._descriptor, 512)
            self._begun += heard
            for frame in self._whole():
                if frame[0] in (0, self._device) and crc_bytes(frame) == b"\0\0":
                    self._say(frame[0], answer(frame[1:-2]), turnaround_s)
        except OSError:
            return False
        return bool(heard)

    def _say(self, device: int, reply: bytes | None, turnaround_s: float) -> None:
        """Nothing to a request to all."""
        if reply is not None and device:
            said = bytes([device]) + reply
            time.sleep(turnaround_s + (len(said) + 2) * self._character_s)
            os.write(self._descriptor, said + crc_bytes(said))

    def _whole(self) -> Iterator[bytes]:
        while len(self._begun) > 1 and len(self._begun) >= (count := _length(self._begun)):
            frame, self._begun = self._begun[:count], self._begun[count:]
            yield frame

    def close(self) -> None:
        if self._descriptor >= 0:
            self._shut()
        self._descriptor = -1


def _length(begun: bytes) -> int:
    """Bytes of the request that begins so; more than there are where it is not told yet."""
    function = begun[1]
    if function in (15, 16):
        return 9 + begun[6] if len(begun) > 6 else 10
    if function == 23:
        return 13 + begun[10] if len(begun) > 10 else 14
    return {17: 4, 43: 7}.get(function, 8)
