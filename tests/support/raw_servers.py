"""Modbus devices written byte by byte, so that a test can make them answer wrongly: over TCP, TLS and a pty.

    with TcpDevice(Bank()) as device:
        device.script = lambda request, answer: [answer[:-1]]     # what to send instead, piece by piece

`request` and `answer` are whole frames (MBAP or RTU). A piece may be bytes to send or a float: seconds to wait.
"""

from __future__ import annotations

import os
import socket
import ssl
import struct
import termios
import threading
import time
import tty
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import TypeVar

from commissioner.errors import LinkError
from tests.support.scripted_port import crc16

Opened = TypeVar("Opened")

Piece = bytes | float
Script = Callable[[bytes, bytes], Sequence[Piece]]


def honest(_: bytes, answer: bytes) -> Sequence[Piece]:
    return [answer]


class Bank:
    """65536 holding registers; register k holds k at first. Counts what was asked."""

    def __init__(self, *, has_exchange: bool = True) -> None:
        self.words = list(range(0x10000))
        self.has_exchange = has_exchange
        self.requests: list[bytes] = []

    def count(self, function: int) -> int:
        """How many requests of the function arrived."""
        return sum(pdu[0] == function for pdu in self.requests)

    def answer(self, pdu: bytes) -> bytes:
        """The right answer to a request, both without framing."""
        self.requests.append(pdu)
        function = pdu[0]
        if function == 0x03:
            return self._read(function, *struct.unpack(">HH", pdu[1:5]))
        if function == 0x05:
            return pdu
        if function == 0x06:
            address, word = struct.unpack(">HH", pdu[1:5])
            self.words[address] = word
            return pdu
        if function == 0x10:
            address, count = struct.unpack(">HH", pdu[1:5])
            self.words[address : address + count] = struct.unpack(f">{count}H", pdu[6:])
            return pdu[:5]
        if function == 0x17 and self.has_exchange:
            address, count, at, written = struct.unpack(">HHHH", pdu[1:9])
            self.words[at : at + written] = struct.unpack(f">{written}H", pdu[10:])
            return self._read(function, address, count)
        return bytes([function | 0x80, 1])

    def _read(self, function: int, address: int, count: int) -> bytes:
        return struct.pack(f">BB{count}H", function, 2 * count, *self.words[address : address + count])


class _Device:
    """One thread that answers; stops with the context."""

    def __init__(self, bank: Bank) -> None:
        self.bank = bank
        self.script: Script = honest
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def __enter__(self) -> _Device:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._close()
        self._thread.join(5)
        assert not self._thread.is_alive()

    def _send(self, send: Callable[[bytes], object], request: bytes, answer: bytes) -> None:
        for piece in self.script(request, answer):
            if isinstance(piece, float):
                time.sleep(piece)
            elif piece:
                send(piece)

    def _serve(self) -> None:
        raise NotImplementedError

    def _close(self) -> None:
        raise NotImplementedError


class TcpDevice(_Device):
    """Modbus TCP on loopback, or Modbus Security with an ssl context."""

    def __init__(self, bank: Bank, context: ssl.SSLContext | None = None) -> None:
        super().__init__(bank)
        self._context = context
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(0.05)
        self.port = self._listener.getsockname()[1]
        self.connections = 0

    def _serve(self) -> None:
        while not self._stop.is_set():
            try:
                plain, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            self.connections += 1
            with plain:
                plain.settimeout(0.05)
                self._talk(plain)

    def _talk(self, plain: socket.socket) -> None:
        try:
            if self._context:
                plain.settimeout(2)
                with self._context.wrap_socket(plain, server_side=True) as secured:
                    secured.settimeout(0.05)
                    self._answer_all(secured)
            else:
                self._answer_all(plain)
        except (OSError, struct.error, IndexError):  # what came was not Modbus: hang up
            return

    def _answer_all(self, line: socket.socket) -> None:
        while not self._stop.is_set():
            header = self._receive(line, 7)
            if not header:
                return
            tid, _, length, unit = struct.unpack(">HHHB", header)
            pdu = self._receive(line, length - 1)
            answer = self.bank.answer(pdu)
            frame = struct.pack(">HHHB", tid, 0, len(answer) + 1, unit) + answer
            self._send(line.sendall, header + pdu, frame)

    def _receive(self, line: socket.socket, count: int) -> bytes:
        data = b""
        while len(data) < count and not self._stop.is_set():
            try:
                piece = line.recv(count - len(data))
            except TimeoutError:
                continue
            if not piece:
                return b""
            data += piece
        return data

    def _close(self) -> None:
        self._listener.close()


def once_free(connect: Callable[[], Opened], within_s: float = 5.0) -> Opened:
    """What `connect` opens. A pty's number comes back at once: a client of the device before may still be trying for its line."""
    end = time.monotonic() + within_s
    while True:
        try:
            return connect()
        except LinkError as error:
            if "another program holds" not in str(error) or time.monotonic() > end:
                raise
            time.sleep(0.05)


class RtuDevice(_Device):
    """Modbus RTU at one end of a pty; `path` is the other end."""

    def __init__(self, bank: Bank, unit: int = 1) -> None:
        super().__init__(bank)
        self.unit = unit
        self._master, self._slave = os.openpty()
        tty.setraw(self._master, termios.TCSANOW)
        tty.setraw(self._slave, termios.TCSANOW)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)

    def inject(self, data: bytes) -> None:
        """Bytes on the line that nobody asked for."""
        os.write(self._master, data)

    def _serve(self) -> None:
        data = b""
        while not self._stop.is_set():
            try:
                data += os.read(self._master, 512)
            except BlockingIOError:
                time.sleep(0.0005)
            except OSError:
                return
            data = self._answer_frames(data)

    def _answer_frames(self, data: bytes) -> bytes:
        while len(data) >= 8:
            length = {0x10: lambda d: 9 + d[6], 0x17: lambda d: 13 + d[10] if len(d) > 10 else 999}.get(
                data[1], lambda d: 8
            )(data)
            if len(data) < length:
                return data
            frame, data = data[:length], data[length:]
            if crc16(frame[:-2]) == int.from_bytes(frame[-2:], "little") and frame[0] == self.unit:
                answer = bytes([frame[0]]) + self.bank.answer(frame[1:-2])
                self._send(lambda piece: os.write(self._master, piece), frame, rtu_frame(answer))
        return data

    def _close(self) -> None:
        self._thread.join(5)
        os.close(self._master)
        os.close(self._slave)


def rtu_frame(unit_and_pdu: bytes) -> bytes:
    """With its CRC, low byte first."""
    return unit_and_pdu + crc16(unit_and_pdu).to_bytes(2, "little")
