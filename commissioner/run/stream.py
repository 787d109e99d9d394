"""The samples of one energised session as they come: each block with its age, and read in one go where the host is behind."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from commissioner.errors import DriveFault
from commissioner.link.drive.inverter import Inverter
from commissioner.records import DriveStatus, SampleBlock
from commissioner.registers.window import StreamCursor
from commissioner.safety.freshness import Counted, DriveClock
from commissioner.safety.sensors import SensorWatch
from commissioner.safety.watch import WatchLimits, judge_status, stop_if

EMPTY_FETCH_PAUSE_S = 0.002
"""Wait after a window without new samples: a drive in real time needs a moment."""
LATE_S = 0.05
"""A sample that may be older than this: the drive is asked how many it has made, as often as this at the most."""
GATHER_S, FILLED = 0.004, 0.7
"""A request costs both sides the same however few samples it brings: after one that left none behind, the next is sent when
so much of a window can be there, or so long after it. Never a whole window: its last sample need not be the newest."""
WINDOWS = 2.0
"""Over a slow link even the newest sample is older, by this many times what its window took to come."""
ROOM = 1.2
"""More room in a window than samples can be there: some are made while the request is under way."""
CATCH_UP_S, CATCH_UP_WINDOWS = 0.02, 8
"""Behind by this much: so many windows are read before anything is computed from them."""
CATCH_UP_LONGEST_S = 0.1
"""Of reading them: a link that has become slower than its samples is for the watch to judge."""


class Stream:
    """Owned by the runner, one per session; `enable` was asked for at `began_s` on the monotonic clock."""

    def __init__(
        self, inverter: Inverter, cursor: StreamCursor, began_s: float, sensors: SensorWatch, watch: WatchLimits
    ) -> None:
        self.sensors = sensors
        self.is_over = False
        """The motor is de-energised: what the drive has kept has no age that matters."""
        self._inverter, self._cursor, self._watch = inverter, cursor, watch
        self._clock = DriveClock(began_s, cursor.stream.sample_period_s)
        self._asked_s, self._took_s = -math.inf, 0.0
        self._not_before_s = -math.inf
        self._waiting: SampleBlock | None = None

    def next_block(self, longest_s: float) -> SampleBlock | None:
        """The next block with the largest age its last sample can have; None once the drive has ended the session.

        DriveFault: no sample for `longest_s`.
        """
        block, self._waiting = self._waiting or self._await_block(longest_s), None
        if block is None or self.is_over:
            return block
        end_s = self._inverter.now_s() + CATCH_UP_LONGEST_S
        for _ in range(CATCH_UP_WINDOWS - 1):
            if self._age_s(block) < CATCH_UP_S + WINDOWS * self._took_s or self._inverter.now_s() > end_s:
                break
            more = self._fetch()
            if more is None:
                break
            if more.lost_before:  # a hole has its place between two blocks
                self._waiting = more
                break
            block = _joined(block, more)
        age_s = self._age_s(block)
        if age_s > LATE_S + WINDOWS * self._took_s and self._inverter.now_s() - self._asked_s > LATE_S:
            self.ask_status()
            age_s = self._age_s(block)
        return block.aged(age_s)

    def supervise(self) -> DriveStatus:
        """As `ask_status`, where nobody reads samples: how many there are tells how fast the drive's time passes."""
        status = self.ask_status()
        if status.is_energised and status.samples_produced > 0:
            self._pin(Counted(status.samples_produced, self._asked_s, self._inverter.now_s()))
        return status

    def ask_status(self) -> DriveStatus:
        """Judge the drive's status, and take from it how many samples there are and how large the newest is."""
        self._asked_s = self._inverter.now_s()
        status = self._inverter.read_status()
        stop_if(judge_status(status, self._watch))
        if status.samples_produced > 0:
            self._clock = self._clock.at_most(status.samples_produced, self._asked_s)
        self.sensors.claim(status)
        return status

    def _await_block(self, longest_s: float) -> SampleBlock | None:
        asked_s = self._inverter.now_s()
        deadline = asked_s + longest_s
        if asked_s < self._not_before_s:
            self._inverter.sleep(self._not_before_s - asked_s)
        while True:
            asked_s = self._inverter.now_s()
            if asked_s > deadline:
                raise DriveFault(
                    "the drive sends no samples", step="stream", value=f"nothing for {longest_s:g} s",
                    limit="new samples within the watchdog's time",
                    remedy="check the drive's status; the output has been switched off",
                )  # fmt: skip
            block = self._fetch()
            if block is not None:
                return block
            if self._has_ended:
                stop_if(judge_status(self._inverter.read_status(), self._watch))
                return None
            self._inverter.sleep(EMPTY_FETCH_PAUSE_S)

    def _fetch(self) -> SampleBlock | None:
        """One window. A window that is not full ends with the newest sample, which pins the drive's clock."""
        asked_s = self._inverter.now_s()
        most = self._most(asked_s)
        window = self._inverter.fetch(self._cursor, most)
        self._took_s = self._inverter.now_s() - asked_s
        self._cursor, self._has_ended = window.cursor, window.has_ended
        block = window.block
        if block is None:
            return None
        if block.count < (most or self._cursor.stream.samples_per_window) and not (self.is_over or window.has_ended):
            self._pin(Counted(self._cursor.next_index, asked_s, asked_s + self._took_s))
            self._not_before_s = asked_s + min(GATHER_S, self._window_s)
        return block

    @property
    def _window_s(self) -> float:
        """What filling a window to `FILLED` takes, on our clock."""
        stream = self._cursor.stream
        return FILLED * stream.samples_per_window * stream.sample_period_s / self._clock.rate

    def _pin(self, counted: Counted) -> None:
        stop_if(self._clock.judge(counted))
        self._clock = self._clock.counted(counted)

    def _most(self, now_s: float) -> int | None:
        """Samples that can be there: over a slow link room for more would only delay them. None: a whole window."""
        stream = self._cursor.stream
        if stream.averaged == 1 or self.is_over:
            return None
        there = self._clock.most_made(now_s) - self._cursor.next_index
        return min(stream.samples_per_window, math.ceil(ROOM * max(there, 0.0)) + 2)

    def _age_s(self, block: SampleBlock) -> float:
        return self._clock.age_s(block.first_index + block.count, self._inverter.now_s())


def _joined(first: SampleBlock, second: SampleBlock) -> SampleBlock:
    """Two blocks without a hole between them as one."""
    third = None
    if first.current_w_a is not None and second.current_w_a is not None:
        third = np.concatenate([first.current_w_a, second.current_w_a])
    return replace(
        first,
        voltage_axis_v=np.concatenate([first.voltage_axis_v, second.voltage_axis_v]),
        current_u_a=np.concatenate([first.current_u_a, second.current_u_a]),
        current_v_a=np.concatenate([first.current_v_a, second.current_v_a]),
        current_w_a=third,
        dc_link_v=second.dc_link_v,
        clipped=first.clipped or second.clipped,
    )
