"""One request, one answer, nothing repeated and nothing believed: the kit's own way to the wire.

The service's port proves and repeats; here the raw answer is the evidence.
"""

from __future__ import annotations

import struct
import time
from contextlib import suppress

from pymodbus.exceptions import ConnectionException

from commissioner.conformance.records import Ask, Reply, Wait
from commissioner.errors import LinkUnreachable
from commissioner.link.wire.clients import SerialClient, make_client
from commissioner.link.wire.rtu import find_answers
from commissioner.link.wire.trust import longest_frames_s
from commissioner.link.wire.unopened import unopened
from commissioner.link.wire.url import DriveUrl
from commissioner.registers.codec import crc16_bytes


class Line:
    """A connected line; `perform` sends one request or waits. LinkUnreachable where it cannot be opened."""

    def __init__(self, url: DriveUrl, device: int, reply_timeout_s: float) -> None:
        self._url, self._device, self._timeout_s = url, device, reply_timeout_s + longest_frames_s(url)
        self._client = make_client(url, device)
        self._transaction = 0
        self._connect()
        self._began = time.monotonic()

    def perform(self, step: Ask | Wait) -> Reply:
        """The answer, or silence, to a request; an empty reply after a wait."""
        if isinstance(step, Wait):
            time.sleep(step.seconds)
            return Reply(at_s=time.monotonic() - self._began)
        start = time.monotonic()
        device = self._device if step.device is None else step.device
        try:
            pdu, flaw = self._ask(step.pdu, device)
        except (OSError, ConnectionException) as error:
            pdu, flaw = None, f"the connection broke: {error}"
            self._reopen()
        now = time.monotonic()
        return Reply(pdu, start - self._began, now - start, flaw)

    def close(self) -> None:
        with suppress(Exception):  # closing what is gone may fail
            self._client.close()  # type: ignore[no-untyped-call]

    def _connect(self) -> None:
        try:
            self._client.comm_params.timeout_connect = max(self._timeout_s, 2.0)
            self._client.connect()
        except Exception as error:  # pyserial lets system errors through
            raise unopened(self._url, error, "an open line") from error

    def _reopen(self) -> None:
        self.close()
        self._client.socket = None
        with suppress(LinkUnreachable):
            self._connect()

    def _ask(self, pdu: bytes, device: int) -> tuple[bytes | None, str]:
        self._client.comm_params.timeout_connect = self._timeout_s
        if isinstance(self._client, SerialClient):
            return self._ask_serial(self._client, bytes([device]) + pdu)
        self._transaction = (self._transaction + 1) & 0xFFFF
        self._client.send(struct.pack(">HHHB", self._transaction, 0, len(pdu) + 1, device) + pdu)
        return self._socket_answer(device)

    def _socket_answer(self, device: int) -> tuple[bytes | None, str]:
        """Frames until the one of this transaction; (PDU or None, what is wrong with its header)."""
        while True:
            header = self._exactly(7)
            if len(header) < 7:
                return None, "a header that breaks off" if header else ""
            transaction, protocol, length, unit = struct.unpack(">HHHB", header)
            pdu = self._exactly(max(length - 1, 0))
            if transaction != self._transaction:
                continue
            if protocol or unit != device or len(pdu) != length - 1:
                return (
                    pdu,
                    f"a header that does not fit: protocol {protocol}, unit {unit}, {len(pdu)} of {length - 1} bytes",
                )
            return pdu, ""

    def _exactly(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = self._client.recv(count - len(data))
            if not piece:
                break
            data += piece
        return data

    def _ask_serial(self, client: SerialClient, body: bytes) -> tuple[bytes | None, str]:
        """Whatever device number the answer bears: another's is a flaw, not silence."""
        client.drain()
        client.device = body[0]
        client.send(body + crc16_bytes(body).to_bytes(2, "little"))
        frame = client.recv(None)
        if frame:
            return frame[1:-2], ""
        seen = bytes(client.received)
        for device in range(1, 248):
            if seen and find_answers(seen, device):
                return None, f"device {device} answered a request to device {body[0]}"
        return None, f"{len(seen)} bytes that are no answer: {seen[:16].hex()}" if seen else ""
