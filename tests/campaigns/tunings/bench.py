"""One emulated drive and one `tune` on it, in one process, on a clock that jumps; the person at the keypad included."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

from commissioner.errors import ReplyTimeout, RequestRefused
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.port import LinkStats, Words
from commissioner.run import restore as restoring
from commissioner.run.archive.catalogue import find_run
from commissioner.run.commission import Commissioned
from commissioner.run.tuning.tune import Clock, TuneOrder, order_of, tune
from commissioner.settings import load_motor, load_procedure
from sim.vendors.drive import BUSY, Habits, VendorDrive
from sim.vendors.face import read_face

REQUEST_S = 0.02


class JumpingClock:
    """Seconds that pass only when somebody waits."""

    def __init__(self) -> None:
        self.t = 0.0

    def now(self) -> float:
        return self.t

    def sleep(self, seconds: float) -> None:
        self.t += seconds


class VendorPort:
    """A port whose other end is the emulated drive itself: requests as their bytes, no wire between."""

    def __init__(self, drive: VendorDrive, clock: JumpingClock, lost_after: int | None = None) -> None:
        self.stats = LinkStats()
        self.read_retries, self.patience_s = 0, 0.0
        self.reply_timeout_s = 0.5
        self._drive, self._clock, self._lost_after = drive, clock, lost_after

    def read(self, address: int, count: int) -> Words:
        reply = self._ask(struct.pack(">BHH", 3, address, count))
        return tuple(struct.unpack(f">{count}H", reply[2:]))

    def write(self, address: int, values: Sequence[int]) -> None:
        if len(values) == 1 and 6 in self._drive.face.functions:
            self._ask(struct.pack(">BHH", 6, address, values[0]))
        else:
            count = len(values)
            self._ask(struct.pack(f">BHHB{count}H", 16, address, count, 2 * count, *values))

    def write_coil(self, address: int, value: bool) -> None:
        self._ask(struct.pack(">BHH", 5, address, 0xFF00 * value))

    def read_coil(self, address: int) -> bool:
        return bool(self._ask(struct.pack(">BHH", 1, address, 1))[2])

    def exchange(
        self, write_address: int, values: Sequence[int], read_address: int, count: int, *, proves_itself: bool = False
    ) -> Words:
        self.write(write_address, values)
        return self.read(read_address, count)

    def doubt(self) -> None:
        pass

    def close(self) -> None:
        pass

    def _ask(self, pdu: bytes) -> bytes:
        """As the real port does: a drive that is busy is asked again for as long as a reply may take."""
        end = self._clock.now() + self.reply_timeout_s
        while True:
            reply = self._ask_once(pdu)
            if not reply[0] & 0x80:
                return reply
            if reply[1] not in (BUSY, self._drive.face.busy_code) or self._clock.now() > end:
                raise RequestRefused(
                    f"exception {reply[1]}", step="request", value=reply[1], limit="a reply", remedy="see the manual"
                )

    def _ask_once(self, pdu: bytes) -> bytes:
        self._clock.sleep(REQUEST_S)
        self.stats.requests += 1
        is_lost = self._lost_after is not None and self.stats.requests > self._lost_after
        reply = None if is_lost else self._drive.answer(pdu)
        if reply is None:
            self._clock.sleep(self.reply_timeout_s)
            raise ReplyTimeout(
                "no answer", step="request", value="silence", limit="an answer", remedy="check the cable"
            )
        self.stats.latencies_s.append(REQUEST_S)
        return reply


@dataclass
class Person:
    """Does at the drive what the tool asks for, and says what is true. `stops_at`: motor time of a Ctrl-C."""

    drive: VendorDrive
    clock: JumpingClock
    stops_at: float | None = None
    asked: list[str] = field(default_factory=list)

    def does(self, text: str) -> bool:
        self.asked.append(text)
        if "nobody is at the motor" in text:
            self.drive.press_tune()
            self.clock.sleep(2 * self.drive.habits.tuning_s)
            self.drive.answer(b"\x03\x00\x00\x00\x01")
            return True
        if "ended its tuning" in text:
            return self.drive.tunings[-1].end == "done" and self.drive.turned == 0
        if "bus control" in text:
            self.drive.press_remote()
        if "Stop the drive" in text:
            self.drive.press_stop()
        if "Save the parameters" in text:
            self.drive.press_save()
        if "off, wait" in text:
            self.drive.power_cycle()
        return True

    def wants_stop(self) -> str:
        return "Ctrl-C" if self.stops_at is not None and self.clock.t > self.stops_at else ""


@dataclass(frozen=True)
class Tried:
    """What `tune` said, and what was true."""

    done: Commissioned
    truth: dict[str, Any]
    before: dict[str, float]
    drive: VendorDrive
    person: Person


def try_tune(
    name: str,
    folder: Path,
    *,
    habits: Habits | None = None,
    seed: int = 0,
    repeat: int = 3,
    write_back: bool = True,
    power_cycle: bool = True,
    pause_s: float = 60.0,
    stops_at: float | None = None,
    lost_after: int | None = None,
) -> Tried:
    """One `tune` from its first request to its result. `lost_after`: the link is gone after so many requests."""
    clock = JumpingClock()
    drive = VendorDrive(read_face(name), clock.now, habits=habits, seed=seed)
    before = drive.truth()["held"]
    profile = load_profile(name)
    order = order_of(
        f"tcp://127.0.0.1:{20000 + seed % 30000}",
        profile,
        load_motor("motor_2kw2"),
        load_procedure(None),
        write_back=write_back,
    )
    person = Person(drive, clock, stops_at)

    @contextmanager
    def opened() -> Any:
        yield VendorPort(drive, clock, lost_after)

    wanted = TuneOrder(order, repeat, pause_s, hardwired_stop=True, power_cycle=power_cycle)
    done = tune(wanted, folder, person, lambda _: None, open_port=opened, clock=Clock(clock.sleep, clock.now))
    return Tried(done, drive.truth(), before, drive, person)


def take_back(folder: Path, drive: VendorDrive, clock: JumpingClock) -> None:
    """`restore` of the last run in this archive, on the drive and its clock."""
    on_its_clock = partial(Inverter, sleep=clock.sleep, clock=clock.now)
    port = VendorPort(drive, clock)
    with patch.multiple(restoring, open_port=lambda *_, **__: port, Inverter=on_its_clock):
        restoring.restore(find_run(folder, "last"), None)
