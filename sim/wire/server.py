"""Modbus server of the simulated drive on pymodbus: one drive behind every line, in this process or in a thread."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from sim.scenario import Scenario
from sim.wire.line import lines_of
from sim.wire.station import Drive, Options

TICK_S = 0.005


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
    lines = lines_of(drive, options)
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
