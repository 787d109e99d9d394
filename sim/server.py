"""Modbus server of the simulated drive: TCP, TLS and RTU on pymodbus, one drive behind all of them.

Pace. At `max` only requests move motor time: a window read just as far as the window needs, any other request a fixed
step; the watchdog alone looks at the wall clock, so a dead client leaves a dead drive. At speed N motor time is N times
wall time and everything, the watchdog too, lives in it.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import termios
import threading
import time
import tty
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.framer import FramerType
from pymodbus.pdu import ExceptionResponse
from pymodbus.server import ModbusSerialServer, ModbusTcpServer, ModbusTlsServer
from pymodbus.server.requesthandler import ServerRequestHandler
from pymodbus.simulator import DataType, SimData, SimDevice

from sim.drive_map import DriveMap, load_map
from sim.faults import SERVER, WIRE, Fault, Plan, deliver, parse
from sim.firmware import Firmware, warm_up
from sim.memory import Memory
from sim.scenario import Scenario
from sim.state_log import StateLog
from sim.states import Answer

STEP_ENERGISED_S = 0.001
STEP_OFF_S = 0.010
TICK_S = 0.005


@dataclass(frozen=True)
class Options:
    """How to serve. `speed` 0 means max; `tcp_port` -1 means none, 0 any; `rtu` a path or `pty`."""

    speed: float = 0.0
    seed: int = 0
    nvm: Path | None = None
    state_log: Path | None = None
    faults: tuple[str, ...] = ()
    tcp_port: int = -1
    tls_port: int = -1
    tls_context: Any = None
    rtu: str = ""
    baud: int = 115200
    parity: str = "N"


class Drive:
    """The firmware with its pace and its faults; answers register requests."""

    def __init__(self, scenario: Scenario, options: Options) -> None:
        self.plan = Plan([parse(text) for text in (*scenario.faults, *options.faults)])
        self.speed = options.speed
        self.map: DriveMap = load_map(shift=scenario.map_shift or self.plan.map_shift)
        warm_up(scenario.plant, self.map)
        setup = replace(scenario.setup, interlocks=dict(scenario.setup.interlocks))
        factory = [
            float(value) / self.map.items[name].scale
            for name, value in zip(self.map.document["parameters"]["order"], setup.parameters, strict=True)
        ]
        self.firmware = Firmware(
            scenario.plant,
            self.map,
            setup,
            Memory(options.nvm, factory),
            options.seed,
            StateLog(options.state_log),
            time.monotonic if options.speed == 0.0 else None,
        )
        self.firmware.before_command = lambda command: self.plan.before_command(command, self.firmware)
        self.plan.arm(self.firmware)
        self.started = time.monotonic()
        self.stalled_until = 0.0

    def keep_pace(self) -> None:
        """At speed N: let motor time catch up with the wall."""
        if self.speed:
            target = (time.monotonic() - self.started) * self.speed
            if target > self.firmware.t:
                self.firmware.advance(target - self.firmware.t)
        self.firmware.check_watchdog()

    def pass_time(self) -> None:
        """Motor time a request takes when it is not a window."""
        if self.speed:
            self.keep_pace()
        else:
            self.firmware.advance(STEP_ENERGISED_S if self.firmware.is_energised else STEP_OFF_S)

    def fill_window(self, count: int) -> None:
        """Motor time up to the last sample of the window asked for (at max), or up to now."""
        if self.speed:
            self.keep_pace()
            return
        wanted = int(self.firmware.values["window_index"]) + self.firmware.samples.fitting(count)
        self.firmware.run_until_sample(wanted)
        self.firmware.check_watchdog()

    async def action(
        self, function: int, start: int, address: int, count: int, registers: list[int], values: Any
    ) -> ExcCodes | None:
        """pymodbus's hook for every access: writes go to the firmware, reads are refreshed from it."""
        if values is not None:
            if function != 23:
                self.pass_time()
            return _exception(self.firmware.registers.write(address, list(values)))
        if function == 6:  # its own echo
            return None
        is_window = address == self.map.window_address
        if is_window:
            self.fill_window(count)
        else:
            self.pass_time()
        words = self.firmware.registers.read(address, count)
        if isinstance(words, Answer):
            return _exception(words)
        registers[address - start : address - start + count] = words
        return None


def _exception(answer: Answer) -> ExcCodes | None:
    return None if answer is Answer.DONE else ExcCodes(answer.value)


def sim_device(drive: Drive) -> SimDevice:
    """pymodbus's description of the register space: one block per run of mapped addresses."""
    addresses = sorted(
        {*drive.map.by_address, *range(drive.map.window_address, drive.map.window_address + drive.map.window_words)}
    )
    blocks: list[list[int]] = []
    for address in addresses:
        if blocks and address == blocks[-1][-1] + 1:
            blocks[-1].append(address)
        else:
            blocks.append([address])
    data = [SimData(b[0], count=len(b), values=0, datatype=DataType.REGISTERS) for b in blocks]
    return SimDevice(drive.map.device_id, data, action=drive.action)


class Handler(ServerRequestHandler):
    """One connection. Counts requests and lets the fault plan at the bytes."""

    def __init__(self, owner: Any, line: Line) -> None:
        super().__init__(owner, None, None, None)
        self.line = line
        self.hits: list[Fault] = []
        self.held = b""
        self.is_deaf = False

    def data_received(self, data: bytes) -> None:
        if self.is_deaf:
            return
        wait = self.line.drive.stalled_until - time.monotonic()
        if wait > 0.0:
            self.loop.call_later(wait, self.data_received, data)
            return
        super().data_received(data)

    def callback_data(self, data: bytes, addr: Any = None) -> int:
        used = super().callback_data(data, addr)
        while self.last_pdu is None and used and used < len(data):  # another station's frame in front of ours
            data = data[used:]
            more = super().callback_data(data, addr)
            if not more:
                break
            used += more
        return used

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
        if not self._server_fault():
            await super().handle_request()

    def _refuse(self, pdu: Any, code: ExcCodes) -> None:
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
            self._put(data)
            if self.held:
                held, self.held = self.held, b""
                self._put(held)
            return
        delivery = deliver(fault, data, self.line.is_rtu, self._rebuild(data))
        self.held += delivery.held
        for delay, piece in delivery.pieces:
            if delay:
                self.loop.call_later(delay, self._put, piece)
            else:
                self._put(piece)

    def _rebuild(self, frame: bytes) -> Callable[[bytes], bytes]:
        if not self.line.is_rtu:
            return lambda body: frame[:4] + len(body).to_bytes(2, "big") + body
        return lambda body: body + _crc_bytes(body)

    def _put(self, data: bytes) -> None:
        if self.transport and not self.transport.is_closing():
            self.transport.write(data)


def _crc_bytes(body: bytes) -> bytes:
    """CRC-16/MODBUS of a frame, low byte first as RTU sends it."""
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return crc.to_bytes(2, "little")


class Line:
    """One way in: a TCP or TLS port, a serial device, or a pty of our own."""

    def __init__(self, drive: Drive, kind: str, make: Callable[..., Any]) -> None:
        self.drive, self.kind, self.make = drive, kind, make
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
            raise OSError(f"cannot listen on {self.kind} {self.server.comm_params.source_address}")
        if self.kind != "rtu":
            host, port = self.server.transport.sockets[0].getsockname()[:2]
            self.address = f"{host}:{port}"

    def open_pty(self) -> None:
        """A pseudo terminal: ours is the master side, the path of the other is `address`."""
        self.server = self.make()
        self.pty_master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.pty_master, False)
        self.address = os.ttyname(slave)
        self.slave = slave
        self._attach_pty()

    def _attach_pty(self) -> None:
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


def _lines(drive: Drive, options: Options) -> list[Line]:
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
            )
        )
    return lines


async def serve(
    scenario: Scenario,
    options: Options,
    announce: Callable[[str], None],
    stop: asyncio.Event | None = None,
    ready: Callable[[Drive], None] | None = None,
) -> None:
    """Serve until `stop` is set or the task is cancelled; `announce` gets one `listening KIND ADDRESS` per line."""
    logging.getLogger("pymodbus_internal").setLevel(logging.CRITICAL)
    logging.getLogger("pymodbus").setLevel(logging.CRITICAL)
    drive = Drive(scenario, options)
    lines = _lines(drive, options)
    for line in lines:
        if line.is_rtu and options.rtu == "pty":
            line.open_pty()
        else:
            await line.open()
        announce(f"listening {line.kind} {line.address or options.rtu}")
    if ready:
        ready(drive)
    try:
        await _tick(drive, stop or asyncio.Event())
    finally:
        for line in lines:
            await line.close()
        drive.firmware.power_off()
        drive.firmware.log.close()


async def _tick(drive: Drive, stop: asyncio.Event) -> None:
    """Wall-clock duty: the watchdog, and motor time at speed N."""
    while not stop.is_set():
        drive.keep_pace()
        due = drive.firmware.watchdog_due_in()
        pause = min(max(due, 0.0) + 5e-4, 0.05) if drive.speed == 0.0 else TICK_S
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(stop.wait(), pause)


@dataclass
class Running:
    """A server in a thread of this process: where it listens and the drive behind it (look, do not touch)."""

    addresses: dict[str, str]
    drive: Drive


@contextlib.contextmanager
def run_in_thread(scenario: Scenario, options: Options) -> Iterator[Running]:
    """Serve in a thread for the length of a `with` block. Raises what the server raised while starting."""
    addresses: dict[str, str] = {}
    drives: list[Drive] = []
    failure: list[BaseException] = []
    started = threading.Event()
    handle: dict[str, Any] = {}

    def announce(text: str) -> None:
        _, kind, address = text.split(" ", 2)
        addresses[kind] = address

    def ready(drive: Drive) -> None:
        drives.append(drive)
        started.set()

    async def main() -> None:
        handle["loop"], handle["stop"] = asyncio.get_running_loop(), asyncio.Event()
        await serve(scenario, options, announce, handle["stop"], ready)

    def target() -> None:
        try:
            asyncio.run(main())
        except BaseException as error:
            failure.append(error)
        finally:
            started.set()

    thread = threading.Thread(target=target, daemon=True)
    thread.start()
    started.wait(120.0)
    if failure:
        raise failure[0]
    try:
        yield Running(addresses, drives[0])
    finally:
        handle["loop"].call_soon_threadsafe(handle["stop"].set)
        thread.join(10.0)
