"""One drive answering register requests: its pace, its faults, and pymodbus's description of its registers.

Pace. At `max` only requests move motor time: a window read just as far as the window needs, any other request a fixed
step; the watchdog alone looks at the wall clock, so a dead client leaves a dead drive. At speed N motor time is N times
wall time and everything, the watchdog too, lives in it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pymodbus.constants import ExcCodes
from pymodbus.simulator import DataType, SimData, SimDevice

from sim.drive.drive_map import DriveMap, load_map
from sim.drive.firmware import Firmware, warm_up
from sim.drive.memory import Memory
from sim.drive.registers import Registers
from sim.drive.states import Answer
from sim.scenario import Scenario
from sim.wire.faults import Plan, parse
from sim.wire.pace import Pace
from sim.wire.state_log import StateLog

STEP_ENERGISED_S = 0.001
STEP_OFF_S = 0.010


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
    pace: Pace = Pace()  # noqa: RUF009
    """Of serial lines: a pseudo terminal passes bytes at once, unless it is told how long they take."""


def ready_url(kind: str, address: str, options: Options) -> str:
    """The drive URL of a line of ours, for a command line; to be quoted there, since shells read ? and &."""
    if kind == "rtu":
        return f"rtu://{address}?baud={options.baud}&parity={options.parity}&device={load_map().device_id}"
    files = "ca=FILE&cert=FILE&key=FILE&" if kind == "tls" else ""
    return f"{kind}://{address}?{files}device={load_map().device_id}"


class Drive:
    """The firmware with its pace and its faults; answers register requests."""

    def __init__(
        self, scenario: Scenario, options: Options, *, keeps_motor_time: bool = False, is_paced: bool = False
    ) -> None:
        """`keeps_motor_time`: the watchdog lives in motor time at `max` too, for a client without a wall clock. `is_paced`:
        whoever carries the requests lets their time pass, none passes here."""
        self.is_paced = is_paced
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
            time.monotonic if options.speed == 0.0 and not keeps_motor_time else None,
        )
        self.registers = Registers(self.firmware)
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
        if self.is_paced:
            return
        if self.speed:
            self.keep_pace()
        else:
            self.firmware.advance(STEP_ENERGISED_S if self.firmware.is_energised else STEP_OFF_S)

    def fill_window(self, count: int) -> None:
        """Motor time up to the last sample of the window asked for (at max), or up to now."""
        if self.is_paced:
            return
        if self.speed:
            self.keep_pace()
            return
        samples = self.firmware.samples
        wanted = samples.behind_gaps(int(self.firmware.values["window_index"])) + samples.fitting(count)
        self.firmware.run_until_sample(wanted)
        self.firmware.check_watchdog()

    async def action(
        self, function: int, start: int, address: int, count: int, registers: list[int], values: Any
    ) -> ExcCodes | None:
        """pymodbus's hook for every access: writes go to the firmware, reads are refreshed from it."""
        if values is not None:
            return _exception(self.write(address, list(values), takes_time=function != 23))
        if function == 6:  # its own echo
            return None
        words = self.read(address, count)
        if isinstance(words, Answer):
            return _exception(words)
        registers[address - start : address - start + count] = words
        return None

    def read(self, address: int, count: int) -> list[int] | Answer:
        """Registers as they are once the request's time has passed."""
        if address == self.map.window_address:
            self.fill_window(count)
        else:
            self.pass_time()
        return self.registers.read(address, count)

    def write(self, address: int, values: list[int], *, takes_time: bool = True) -> Answer:
        """Registers written; in a write and read of one transaction the read alone takes time."""
        if takes_time:
            self.pass_time()
        return self.registers.write(address, values)


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
