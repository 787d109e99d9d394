"""Ways in to the drive: a TCP or TLS port, a serial device, a pseudo terminal; and what faults do to the bytes there."""

from __future__ import annotations

import asyncio
import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.framer import FramerType
from pymodbus.pdu import ExceptionResponse
from pymodbus.server import ModbusSerialServer, ModbusTcpServer, ModbusTlsServer
from pymodbus.server.requesthandler import ServerRequestHandler

from sim.wire.crc import crc_bytes
from sim.wire.faults import SERVER, TARGET_FAILED, WIRE, Fault, deliver
from sim.wire.pace import Pace
from sim.wire.station import Drive, Options, sim_device

FUNCTIONS = (3, 6, 16, 23)
LOOP_LATE_S = 1e-3
"""epoll's resolution: asyncio calls nothing earlier, and by so much later."""


class Handler(ServerRequestHandler):
    """One connection. Counts requests and lets the fault plan at the bytes."""

    def __init__(self, owner: Any, line: Line) -> None:
        super().__init__(owner, None, None, None)
        self.line = line
        self.hits: list[Fault] = []
        self.held = b""
        self.is_deaf = False
        self.undecoded = b""
        self.heard_until = self.turned_at = self.said_until = 0.0

    def data_received(self, data: bytes) -> None:
        """On a paced line once the bytes have been on the wire and the slave has turned round."""
        pace = self.line.pace
        if pace.is_free:
            self.hear(data)
            return
        self.heard_until = max(self.loop.time(), self.heard_until) + pace.bytes_s(len(data))
        silence_s = 2.0 * pace.silence_s if self.said_until < self.loop.time() else pace.silence_s
        turns_at = self.heard_until + max(silence_s, pace.turnaround_s)
        self._at(turns_at, self.turn, data, turns_at)

    def turn(self, data: bytes, at: float) -> None:
        """The slave begins its answer; what its own computing takes is hidden behind the bytes that go out."""
        self.turned_at = at
        self.hear(data)

    def _at(self, when: float, do: Callable[..., None], *arguments: Any) -> None:
        """To the tenth of a millisecond: a loop of asyncio alone may be one late."""
        self.loop.call_at(when - LOOP_LATE_S, self._sleep_until, when, do, arguments)

    def _sleep_until(self, when: float, do: Callable[..., None], arguments: tuple[Any, ...]) -> None:
        time.sleep(max(0.0, when - self.loop.time()))
        do(*arguments)

    def hear(self, data: bytes) -> None:
        if self.is_deaf:
            return
        wait = self.line.drive.stalled_until - time.monotonic()
        if wait > 0.0:
            self.loop.call_later(wait, self.turn, data, self.loop.time() + wait)
            return
        super().data_received(data)

    def callback_data(self, data: bytes, addr: Any = None) -> int:
        self.undecoded = data
        used = super().callback_data(data, addr)
        while self.last_pdu is None and used and used < len(data):  # another station's frame in front of ours
            data = data[used:]
            more = super().callback_data(data, addr)
            if not more:
                break
            used += more
        return used

    def server_send(self, pdu: Any, addr: Any) -> None:
        """pymodbus 3.15 answers what it cannot decode with function 0, exception 1: here with its function and reason."""
        at = 1 if self.line.is_rtu else 7
        if pdu and pdu.function_code == 0x80 and len(self.undecoded) > at:
            if self.undecoded[at - 1] != self.line.drive.map.device_id:
                return
            function = self.undecoded[at]
            pdu.function_code = function | 0x80
            pdu.exception_code = ExcCodes.ILLEGAL_VALUE if function in FUNCTIONS else ExcCodes.ILLEGAL_FUNCTION
        super().server_send(pdu, addr)

    async def handle_request(self) -> None:
        pdu = self.last_pdu
        if pdu is None:
            return
        drive = self.line.drive
        if pdu.dev_id != drive.map.device_id:
            if not self.line.is_rtu:
                self._refuse(pdu, ExcCodes.GATEWAY_NO_RESPONSE)
            return
        self.hits = drive.plan.next_request(drive.firmware, pdu.function_code)
        if any(fault.name == "lost_request" for fault in self.hits):
            return
        kept_back = next((f for f in self.hits if f.name == "gateway" and f.argument != TARGET_FAILED), None)
        if kept_back is not None:
            self.hits = []
            self._refuse(pdu, int(float(kept_back.argument or 0)))
            return
        if not self._server_fault():
            await super().handle_request()

    def _refuse(self, pdu: Any, code: int) -> None:
        answer = ExceptionResponse(pdu.function_code, code)
        answer.transaction_id, answer.dev_id = pdu.transaction_id, pdu.dev_id
        self.server_send(answer, None)

    def _server_fault(self) -> bool:
        """Whether the request dies with the server: half-open line or restart. A stall only delays the answer."""
        fault = next((f for f in self.hits if f.name in SERVER), None)
        if fault is None:
            return False
        if fault.name == "half_open":
            self.is_deaf = True
        elif fault.name == "restart":
            self.line.restart(float(fault.argument or 0.0))
        else:
            self.line.drive.stalled_until = time.monotonic() + float(fault.argument or 0.0)
            self.hits = [*self.hits, replace(fault, name="late")]
            return False
        return True

    def send(self, data: bytes, addr: Any = None) -> None:
        fault = next((f for f in self.hits if f.name in WIRE), None)
        self.recv_buffer = b""
        if fault is None:
            self._put(data, self.turned_at)
            if self.held:
                held, self.held = self.held, b""
                self._put(held, self.turned_at)
            return
        if fault.name == "drops_bytes":
            self._put(self.line.drive.plan.thinned(fault, data), self.turned_at)
            return
        delivery = deliver(fault, data, self.line.is_rtu, self._rebuild(data))
        self.held += delivery.held
        for delay, piece in delivery.pieces:
            if delay:
                self.loop.call_later(delay, self._put, piece, self.loop.time() + delay)
            else:
                self._put(piece, self.turned_at)

    def _rebuild(self, frame: bytes) -> Callable[[bytes], bytes]:
        if not self.line.is_rtu:
            return lambda body: frame[:4] + len(body).to_bytes(2, "big") + body
        return lambda body: body + crc_bytes(body)

    def _put(self, data: bytes, begin: float) -> None:
        pace = self.line.pace
        if pace.is_free:
            self._write(data)
            return
        self.said_until = max(begin, self.said_until) + pace.bytes_s(len(data))
        self._at(self.said_until, self._write, data)

    def _write(self, data: bytes) -> None:
        if self.transport and not self.transport.is_closing():
            self.transport.write(data)


class Line:
    """One way in: a TCP or TLS port, a serial device, or a pty of our own."""

    def __init__(self, drive: Drive, kind: str, make: Callable[..., Any], pace: Pace = Pace()) -> None:  # noqa: B008
        self.drive, self.kind, self.make, self.pace = drive, kind, make, pace
        self.is_rtu = kind == "rtu"
        self.address = ""
        self.server: Any = None
        self.pty_master = -1

    async def open(self) -> None:
        """Listen; OSError where the port or device cannot be had."""
        came_back = not self.is_rtu and bool(self.address)
        self.server = self.make(int(self.address.rsplit(":", 1)[1])) if came_back else self.make()
        self.server.callback_new_connection = lambda: Handler(self.server, self)
        if not await self.server.listen():
            instead = "" if self.is_rtu else ": another program may be there; port 0 takes any free one"
            raise OSError(f"cannot listen on {self.kind} {self.server.comm_params.source_address}{instead}")
        if self.kind != "rtu":
            host, port = self.server.transport.sockets[0].getsockname()[:2]
            self.address = f"{host}:{port}"

    def open_pty(self) -> None:
        """A pseudo terminal: ours is the master side, the path of the other is `address`."""
        import tty  # pseudo terminals are POSIX's

        self.server = self.make()
        self.pty_master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.pty_master, False)
        self.address = os.ttyname(slave)
        self.slave = slave
        self._attach_pty()

    def _attach_pty(self) -> None:
        import termios

        termios.tcflush(self.pty_master, termios.TCIFLUSH)
        handler = Handler(self.server, self)
        transport = PtyTransport(self.pty_master, handler)
        handler.connection_made(transport)
        asyncio.get_running_loop().add_reader(self.pty_master, transport.readable)

    def restart(self, seconds: float) -> None:
        """Communication side goes away and comes back on the same address; the drive itself runs on."""
        loop = asyncio.get_running_loop()
        if self.pty_master >= 0:
            loop.remove_reader(self.pty_master)
            loop.call_later(seconds, self._attach_pty)
            return  # what is asked meanwhile is lost, as on a powered-down port
        for connection in list(self.server.active_connections.values()):
            connection.transport.abort()
        self.server.close()
        loop.call_later(seconds, lambda: asyncio.ensure_future(self.open()))

    async def close(self) -> None:
        if self.pty_master >= 0:
            asyncio.get_running_loop().remove_reader(self.pty_master)
            os.close(self.pty_master)
            os.close(self.slave)
        elif self.server:
            await self.server.shutdown()


class PtyTransport(asyncio.Transport):
    """Writes to, and reads from, the master side of a pseudo terminal."""

    def __init__(self, descriptor: int, protocol: Any) -> None:
        super().__init__()
        self.descriptor, self.protocol = descriptor, protocol

    def readable(self) -> None:
        with contextlib.suppress(BlockingIOError, OSError):
            self.protocol.data_received(os.read(self.descriptor, 4096))

    def write(self, data: Any) -> None:
        with contextlib.suppress(BlockingIOError, OSError):
            os.write(self.descriptor, data)

    def is_closing(self) -> bool:
        return False

    def close(self) -> None:
        pass

    def abort(self) -> None:
        pass


def lines_of(drive: Drive, options: Options) -> list[Line]:
    lines = []
    if options.tcp_port >= 0:
        lines.append(
            Line(
                drive,
                "tcp",
                lambda port=options.tcp_port: ModbusTcpServer(sim_device(drive), address=("127.0.0.1", port)),
            )
        )
    if options.tls_port >= 0:
        lines.append(
            Line(
                drive,
                "tls",
                lambda port=options.tls_port: ModbusTlsServer(
                    sim_device(drive), address=("127.0.0.1", port), sslctx=options.tls_context
                ),
            )
        )
    if options.rtu:
        lines.append(
            Line(
                drive,
                "rtu",
                lambda: ModbusSerialServer(
                    sim_device(drive),
                    framer=FramerType.RTU,
                    port=options.rtu,
                    baudrate=options.baud,
                    parity=options.parity,
                ),
                options.pace,
            )
        )
    return lines
