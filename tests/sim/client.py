"""A bare Modbus master for the simulator's own tests: no library, so that every byte is seen."""

from __future__ import annotations

import os
import select
import socket
import struct
import time
from typing import Any


class Refused(Exception):
    """A Modbus exception answer; `code` is its code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code}")
        self.code = code


class Silent(Exception):
    """No answer in time; `received` is what came."""

    def __init__(self, received: bytes = b"") -> None:
        super().__init__(f"silence after {received.hex()}")
        self.received = received


def crc_bytes(body: bytes) -> bytes:
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc.to_bytes(2, "little")


def floats(*values: float) -> list[int]:
    return [w for v in values for w in struct.unpack(">HH", struct.pack(">f", v))]


def as_float(words: list[int]) -> float:
    return struct.unpack(">f", struct.pack(">HH", *words))[0]


class Client:
    """Blocking master; `exchange` is raw, the rest are the four function codes of the map."""

    unit = 1

    def ask(self, pdu: bytes) -> bytes:
        answer = self.exchange(pdu)
        if answer[0] & 0x80:
            raise Refused(answer[1])
        return answer

    def exchange(self, pdu: bytes) -> bytes:
        raise NotImplementedError

    def read(self, address: int, count: int) -> list[int]:
        answer = self.ask(struct.pack(">BHH", 3, address, count))
        return list(struct.unpack(f">{(len(answer) - 2) // 2}H", answer[2:]))

    def write(self, address: int, words: list[int]) -> None:
        self.ask(struct.pack(f">BHHB{len(words)}H", 16, address, len(words), 2 * len(words), *words))

    def write_one(self, address: int, word: int) -> list[int]:
        return list(struct.unpack(">HH", self.ask(struct.pack(">BHH", 6, address, word))[1:]))

    def write_read(self, read_at: int, count: int, write_at: int, words: list[int]) -> list[int]:
        body = struct.pack(f">BHHHHB{len(words)}H", 23, read_at, count, write_at, len(words), 2 * len(words), *words)
        answer = self.ask(body)
        return list(struct.unpack(f">{(len(answer) - 2) // 2}H", answer[2:]))

    def window(self, index: int, heartbeat: int, count: int = 125) -> list[int]:
        return self.write_read(256, count, 34, [heartbeat & 0xFFFF, index >> 16, index & 0xFFFF])

    def prepare(
        self,
        *,
        axis_deg: float = 0.0,
        duration_s: float = 1.0,
        watchdog_ms: int = 1000,
        bias_v: float = 5.0,
        tones: tuple[tuple[float, float, float], ...] = ((6.0, 10.0, 0.0),),
        decimation: int = 1,
        mask: int = 0b1111,
        current_limit_a: float = 9.0,
        voltage_limit_v: float = 100.0,
        time_limit_s: float = 60.0,
    ) -> None:
        if watchdog_ms:
            self.write(96, [watchdog_ms])
        self.write(97, floats(current_limit_a, time_limit_s, voltage_limit_v))
        self.write(128, floats(axis_deg, bias_v, 100.0, 1.0, 10.0, duration_s))
        self.write(140, [len(tones), *floats(*[v for tone in tones for v in tone])])
        self.write(189, [mask, decimation])
        self.write_one(33, 1)

    def enable(self) -> int:
        for word in (0x06, 0x07, 0x0F):
            self.write_one(32, word)
        return self.status()

    def status(self) -> int:
        return self.read(48, 1)[0]

    def stream(self, until: int | None = None) -> list[list[int]]:
        """Windows from index 0 until the session ended or `until` samples are there."""
        index, windows = 0, []
        while until is None or index < until:
            window = self.window(index, len(windows) + 1)
            windows.append(window)
            index = (window[1] << 16 | window[2]) + window[3]
            if window[5] & 16:
                break
        return windows


class TcpClient(Client):
    def __init__(self, address: str, timeout_s: float = 5.0, context: Any = None) -> None:
        host, port = address.rsplit(":", 1)
        raw = socket.create_connection((host, int(port)), timeout=timeout_s)
        raw.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket = context.wrap_socket(raw, server_hostname="localhost") if context else raw
        self.transaction = 0
        self.last_header = b""

    @classmethod
    def over(cls, connected: socket.socket) -> TcpClient:
        """On a connection that somebody else has made."""
        client = cls.__new__(cls)
        client.socket, client.transaction, client.last_header = connected, 0, b""
        return client

    def send(self, pdu: bytes) -> None:
        self.transaction = (self.transaction + 1) & 0xFFFF
        self.socket.sendall(struct.pack(">HHHB", self.transaction, 0, len(pdu) + 1, self.unit) + pdu)

    def receive(self) -> bytes:
        self.last_header = self._exactly(7)
        return self._exactly(struct.unpack(">H", self.last_header[4:6])[0] - 1)

    def exchange(self, pdu: bytes) -> bytes:
        self.send(pdu)
        return self.receive()

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            try:
                piece = self.socket.recv(count - len(data))
            except TimeoutError:
                raise Silent(data) from None
            if not piece:
                raise ConnectionError("closed by the drive")
            data += piece
        return data

    def close(self) -> None:
        self.socket.close()

    def __enter__(self) -> TcpClient:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class RtuClient(Client):
    def __init__(self, path: str, timeout_s: float = 2.0) -> None:
        self.descriptor = os.open(path, os.O_RDWR | os.O_NOCTTY)
        self.timeout_s = timeout_s

    def exchange(self, pdu: bytes) -> bytes:
        """The first frame with a good check sum; Silent with all bytes where there is none."""
        self.send(pdu)
        frame = self.receive(enough=self._expected(pdu))
        if len(frame) < 5 or crc_bytes(frame[:-2]) != frame[-2:]:
            raise Silent(frame)
        return frame[1:-2]

    def send(self, pdu: bytes) -> None:
        body = bytes([self.unit]) + pdu
        os.write(self.descriptor, body + crc_bytes(body))

    def receive(self, enough: int = 1 << 20, quiet_s: float = 0.05) -> bytes:
        """Bytes until `enough`, or until the line is quiet after some came."""
        data, deadline = b"", time.monotonic() + self.timeout_s
        while len(data) < enough and time.monotonic() < deadline:
            wait = quiet_s if data else deadline - time.monotonic()
            if not select.select([self.descriptor], [], [], max(wait, 0.0))[0]:
                break
            data += os.read(self.descriptor, min(1024, enough - len(data)))
        return data

    @staticmethod
    def _expected(pdu: bytes) -> int:
        if pdu[0] in (3, 23):
            return 5 + 2 * struct.unpack(">H", pdu[3:5])[0]
        return 8

    def close(self) -> None:
        os.close(self.descriptor)
