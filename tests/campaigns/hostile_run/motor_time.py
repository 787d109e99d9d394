"""Drive, host and what lies between them in one process and in motor time: nothing sleeps, the same seed gives the same run.

The product's own Modbus TCP port speaks frames to a socket that is none; each frame is an event at a time. The drive lives on
between them as one in real time does: a window holds the samples that there are by then. Of the product this knows nothing
but the published map.
"""

from __future__ import annotations

import heapq
import itertools
import random
import struct
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sim.scenario import Scenario
from sim.wire.in_process import Station
from sim.wire.station import Drive, Options
from tests.campaigns.hostile_run.falsified import WINDOW, falsified
from tests.campaigns.hostile_run.troubles import FOREIGN, SENSORS, Link, Trouble

CONTROL_WORD, ENABLE, WRITE, EXCHANGE = 32, 0x0F, 0x10, 0x17
STEP_S = 0.002
"""The watchdog is looked at so often."""
SLACK_S = 0.0005


class _RealTimeDrive(Drive):
    """One that lives by itself: no request moves its time."""

    def pass_time(self) -> None:
        self.firmware.check_watchdog()

    def fill_window(self, count: int) -> None:
        self.firmware.check_watchdog()


class World:
    """Everything beyond the product's socket. `now_s` is the host's clock and the drive's; only `live` moves it."""

    def __init__(
        self, scenario: Scenario, trouble: Trouble, link: Link, seed: int, noise_seed: int, state_log: Path
    ) -> None:
        self.station = Station(scenario, noise_seed)
        options = Options(seed=noise_seed, state_log=state_log)
        self.station.drive = _RealTimeDrive(scenario, options, keeps_motor_time=True)
        self.trouble, self.link = trouble, link
        self.now_s = 0.0
        self._rng, self._host_rng = random.Random(seed), random.Random(noise_seed)
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._began = {0: 0.0}
        self._is_spent = False
        self._held: list[tuple[int, ...]] = []

    @property
    def firmware(self) -> Any:
        return self.station.drive.firmware

    def at(self, time_s: float, event: Callable[[], None]) -> None:
        heapq.heappush(self._events, (time_s, next(self._order), event))

    def live(self, until_s: float) -> None:
        """Let motor time pass, and happen what happens meanwhile."""
        while self._events and self._events[0][0] <= until_s:
            time_s, _, event = heapq.heappop(self._events)
            self._advance(time_s)
            event()
        self._advance(until_s)

    def sleep(self, seconds: float) -> None:
        """The host waits, and no shorter than a system lets it."""
        self.live(self.now_s + seconds + SLACK_S)

    def next_event_s(self) -> float:
        return self._events[0][0] if self._events else float("inf")

    def compute(self) -> None:
        """What the host does between an answer and its next request; where it is stopped, it is stopped here."""
        self.live(self.now_s + self.link.host_s * self._host_rng.uniform(0.5, 1.5))
        if self.acts("host_stop"):
            self.live(self.now_s + self.trouble.amount)
        if self.acts("second_master"):
            address, values = self._foreign_write()
            self.station.drive.write(address, values)

    def acts(self, *kinds: str) -> bool:
        """Whether the trouble is one of these kinds, and now; a single stall is spent once it has struck."""
        t = self.trouble
        if t.kind not in kinds or t.session not in self._began or self._is_spent:
            return False
        passed = self.now_s - self._began[t.session] - t.at_s
        if t.length_s == 0.0 and passed >= 0.0:
            self._is_spent = True
            return True
        return 0.0 <= passed < t.length_s

    def answer(self, pdu: bytes) -> bytes:
        """The drive's, with the energisings counted by the control words that pass."""
        answer = self.station.answer(pdu)
        if pdu[0] == WRITE and struct.unpack_from(">H", pdu, 1)[0] == CONTROL_WORD and pdu[7] == ENABLE:
            self._began[len(self._began)] = self.now_s
        return answer

    def passed_on(self, question: bytes, answer: bytes) -> tuple[list[bytes], float]:
        """What the man in the middle makes of an answer: once, twice or not at all; and how long he keeps it."""
        t, rng, delay_s = self.trouble, self._rng, 0.0
        if self.acts("late", "spell", "stall"):
            delay_s = t.amount
        if self.acts("jitter"):
            delay_s = rng.uniform(0.0, t.amount)
        is_hit = rng.random() < t.amount
        if self.acts("drop") and is_hit:
            return [], delay_s
        if self.acts("corrupt") and is_hit and len(answer) > 2:
            place = rng.randrange(2, len(answer))
            answer = answer[:place] + bytes([answer[place] ^ (1 << rng.randrange(8))]) + answer[place + 1 :]
        is_window = question[0] == EXCHANGE and struct.unpack_from(">H", question, 1)[0] == WINDOW
        if is_window and not answer[0] & 0x80 and self.acts(*SENSORS):
            words = struct.unpack(f">{answer[1] // 2}H", answer[2:])
            answer = answer[:2] + struct.pack(f">{len(words)}H", *falsified(t, words, self._held))
        return [answer] * (2 if self.acts("duplicate") and is_hit else 1), delay_s

    def _foreign_write(self) -> tuple[int, list[int]]:
        """One write to what matters, by somebody else."""
        name, value = FOREIGN[int(self.trouble.amount)]
        item = self.station.drive.map.items[name]
        return item.address, item.encode(value)

    def _advance(self, until_s: float) -> None:
        firmware = self.firmware
        while firmware.t < until_s - 1e-9:
            before_s = firmware.t
            firmware.advance(min(STEP_S, until_s - before_s))
            if firmware.t <= before_s:  # less than half a control period is left
                break
        self.now_s = max(self.now_s, until_s)


@dataclass
class Socket:
    """What pymodbus takes for a connected socket. Frames that were sent to a connection arrive there or nowhere."""

    world: World
    _inbox: list[tuple[float, bytes]] = field(default_factory=list)
    _timeout_s: float = 0.25
    _busy_until_s: float = 0.0

    def settimeout(self, seconds: float) -> None:
        self._timeout_s = seconds

    def close(self) -> None:
        self._inbox.clear()

    def sendall(self, frame: bytes) -> None:
        self.world.compute()
        arrives_s = self.world.now_s + self.world.link.wire_s
        self.world.at(arrives_s, lambda: self._at_the_middle(frame))

    def recv(self, _size: int) -> bytes:
        """The next whole frame. TimeoutError as a socket's."""
        end_s = self.world.now_s + self._timeout_s
        while True:
            if self._inbox and self._inbox[0][0] <= self.world.now_s:
                return self._inbox.pop(0)[1]
            next_s = min(self._inbox[0][0] if self._inbox else end_s, self.world.next_event_s(), end_s)
            self.world.live(next_s)
            if next_s >= end_s and not (self._inbox and self._inbox[0][0] <= end_s):
                raise TimeoutError

    def _at_the_middle(self, frame: bytes) -> None:
        """One question after the other."""
        world = self.world
        if self._busy_until_s > world.now_s:
            world.at(self._busy_until_s, lambda: self._at_the_middle(frame))
        elif world.acts("request_stall"):
            self._busy_until_s = world.now_s + world.trouble.amount
            world.at(self._busy_until_s, lambda: self._at_the_drive(frame))
        else:
            self._at_the_drive(frame)

    def _at_the_drive(self, frame: bytes) -> None:
        world, question = self.world, frame[7:]
        if world.acts("busy"):
            self._deliver(frame, bytes([question[0] | 0x80, int(world.trouble.amount)]), 0.0)
            return
        answers, delay_s = world.passed_on(question, world.answer(question))
        self._busy_until_s = world.now_s + delay_s
        for answer in answers:
            self._deliver(frame, answer, delay_s)

    def _deliver(self, frame: bytes, answer: bytes, delay_s: float) -> None:
        arrives_s = self.world.now_s + delay_s + self.world.link.wire_s
        self._inbox.append((arrives_s, frame[:4] + struct.pack(">H", 1 + len(answer)) + frame[6:7] + answer))
