"""pymodbus's clients, connecting so that the reason of a failure is not lost and a server's name is verified.

TLS after MODBUS/TCP Security Protocol Specification v21: port 802, certificates on both sides, MBAP inside.
"""

from __future__ import annotations

import logging
import socket
import ssl
import time
from typing import NoReturn

import serial
from pymodbus.client import ModbusSerialClient, ModbusTcpClient, ModbusTlsClient
from pymodbus.exceptions import ConnectionException

from commissioner.errors import UsageError
from commissioner.link.wire.rtu import find_answers
from commissioner.link.wire.url import DriveUrl, RtuUrl, TcpUrl, TlsUrl

LONGEST_READ = 4096
UNIT = 6
"""Where the device's number stands in a TCP frame, behind transaction, protocol and length."""
LAST_DEVICE = 247
READ = b"\x03"
SILENCE_S = 0.05
"""A frame has no hole this long: USB converters hold bytes back for 16 ms at most by default (FTDI AN232B-04)."""


logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # what it would print is raised by the port instead


class _Deadline(ModbusTcpClient):
    """One deadline from sending to the whole answer, whatever trickles in meanwhile.

    pymodbus 3.15 grants each piece the whole time again, on the wall clock, and never looks at it within a TLS record.
    Python's sockets keep their time-out, on the monotonic clock, within a record too.
    """

    _end = 0.0
    _asked, _units = 0, frozenset[int]()
    _transaction = b""
    received = bytearray()
    """As of a serial line."""

    def other_device(self) -> int | None:
        """The device whose answer came since the last request was sent, where it was not the one that was asked."""
        return next(iter(self._units - {self._asked}), None)

    def part(self) -> str:
        """What the head of an answer of our device tells that came since and was not whole or not to this request; empty without one."""
        head = bytes(self.received[: UNIT + 1])
        if len(head) <= UNIT or head[2:4] != b"\0\0" or head[UNIT] != self._asked:
            return ""
        if head[:2] != self._transaction:
            return f"an answer to transaction {int.from_bytes(head[:2])}, not {int.from_bytes(self._transaction)}"
        return f"{len(self.received)} of the answer's {UNIT + int.from_bytes(head[4:6])} bytes"

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        wanted = self.comm_params.timeout_connect
        self._transaction = request[:2]
        self._asked, self._units, self.received = request[UNIT], frozenset(), bytearray()
        self._end = time.monotonic() + wanted
        if self.socket is None:
            raise ConnectionException("the connection is closed")  # type: ignore[no-untyped-call]
        self.socket.settimeout(wanted)
        self.socket.sendall(request)
        return len(request)

    def recv(self, size: int | None) -> bytes:
        """What is there, at least one byte; empty when the time since sending is over."""
        left = self._end - time.monotonic()
        if left <= 0.0:
            return b""
        if self.socket is None:
            raise ConnectionException("the connection is closed")  # type: ignore[no-untyped-call]
        self.socket.settimeout(left)
        try:
            data = bytes(self.socket.recv(size or LONGEST_READ))
        except TimeoutError:
            return b""
        if not data:
            self.close()  # type: ignore[no-untyped-call]
            raise ConnectionException("the other end closed the connection")  # type: ignore[no-untyped-call]
        self.received += data
        if len(data) > UNIT and data[2:4] == b"\0\0":
            self._units |= {data[UNIT]}
        return data


class TcpClient(_Deadline):
    def connect(self) -> bool:
        """True when connected. Raises OSError with the reason where it fails; so do the other two."""
        if self.socket is None:
            self.socket = _open_socket(self)
        return True


class TlsClient(_Deadline, ModbusTlsClient):
    def connect(self) -> bool:
        """As TcpClient; ssl.SSLError, an OSError, where a certificate or the name on it is not accepted."""
        if self.socket is None:
            plain = _open_socket(self)
            context = self.comm_params.sslctx
            assert context is not None
            try:
                self.socket = context.wrap_socket(plain, server_hostname=self.comm_params.host)
            except BaseException:
                plain.close()
                raise
        return True


class SerialClient(ModbusSerialClient):
    """Hands pymodbus whole answers of our device only, whatever noise or neighbours stand around them.

    pymodbus 3.15 takes a stray byte before a short answer for the head of a longer one and waits until the time-out.
    `received` keeps every byte since the last request was sent.
    """

    device = 1
    received = bytearray()
    sent = b""

    def connect(self) -> bool:
        if self.socket is None:
            wanted = self.comm_params
            self.socket = serial.serial_for_url(
                wanted.host,
                timeout=wanted.timeout_connect,
                bytesize=wanted.bytesize,
                stopbits=wanted.stopbits,
                baudrate=wanted.baudrate,
                parity=wanted.parity,
                exclusive=True,
            )
        return True

    def send(self, request: bytes, addr: tuple[str, int] | None = None) -> int:
        self.received, self.sent = bytearray(), bytes(request)
        return super().send(request, addr)

    def hears_itself(self) -> bool:
        """Whether the line gave back a request to read, whose answer never looks like it; one to write a register looks like its answer."""
        return self.sent[1:2] == READ and self.sent in self.received

    def recv(self, size: int | None) -> bytes:
        """One whole answer; empty where none came in time, or where the line fell silent after something else."""
        end = time.monotonic() + self.comm_params.timeout_connect
        while True:
            answers = find_answers(bytes(self.received), self.device)
            if answers:
                return answers[0]
            left = end - time.monotonic()
            if not self._take(min(left, SILENCE_S) if self.received else left):
                return b""

    def other_device(self) -> int | None:
        """As over TCP."""
        data = bytes(self.received)
        seen = {data[k] for k in range(len(data)) if 0 < data[k] <= LAST_DEVICE and data[k] != self.device}
        return next((device for device in sorted(seen) if find_answers(data, device)), None)

    def part(self) -> str:
        """As over TCP; without a transaction's number nothing tells."""
        return ""

    def waiting(self) -> int:
        """Bytes on the line that nobody has read; 0 where the line is gone, which the next request will tell."""
        try:
            return int(self.socket.in_waiting) if self.socket else 0
        except (
            Exception
        ):  # what pyserial lets through differs by system: OSError, TypeError, termios.error, ctypes' errors
            return 0

    def drain(self) -> int:
        """Take what waits into `received`; how much it was."""
        return self._take(0.0)

    def _take(self, patience_s: float) -> int:
        """Bytes taken: at least one unless none came in time."""
        if self.socket is None:
            return 0
        self.socket.timeout = max(patience_s, 0.0)
        data = self.socket.read(max(1, self.waiting()))
        self.received += data
        return len(data)


Client = TcpClient | TlsClient | SerialClient


def make_client(url: DriveUrl, device: int) -> Client:
    """A client that repeats nothing, not yet connected. UsageError: a TLS file that cannot be used."""
    if isinstance(url, TcpUrl):
        return TcpClient(url.host, port=url.port, retries=0)
    if isinstance(url, RtuUrl):
        client = SerialClient(url.path, baudrate=url.baud, parity=url.parity, stopbits=url.stop_bits, retries=0)
        client.device = device
        return client
    return TlsClient(url.host, port=url.port, sslctx=client_context(url), retries=0)


def client_context(url: TlsUrl) -> ssl.SSLContext:
    """Server certificate and name verified, TLS 1.2 at least, our certificate shown. UsageError: an unusable file."""
    try:
        context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=str(url.ca) if url.ca else None)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        if url.cert and url.key:
            context.load_cert_chain(url.cert, url.key, password=_refuse_password)
    except (ssl.SSLError, OSError) as error:
        raise UsageError(
            f"the TLS files for {url} cannot be used",
            step="read TLS files",
            value=error.strerror or str(error),
            limit="PEM files: CA certificates, our certificate and its key",
            remedy="check ca=, cert= and key=",
        ) from error
    return context


def _open_socket(client: ModbusTcpClient) -> socket.socket:
    wanted = client.comm_params
    plain = socket.create_connection((wanted.host, wanted.port), timeout=wanted.timeout_connect)
    plain.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return plain


def _refuse_password() -> NoReturn:
    raise UsageError(
        "the TLS key is encrypted",
        step="read TLS files",
        value="key=",
        limit="a key without a pass phrase",
        remedy="give a key file that only this user can read, without a pass phrase",
    )
