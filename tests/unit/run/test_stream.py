"""How old the samples are that a session's stream hands on, beside a drive that counts on a clock of its own."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.records import SampleBlock
from commissioner.registers.window import StreamCursor, StreamFormat
from commissioner.run.stream import Stream
from commissioner.safety.sensors import SensorWatch
from commissioner.safety.watch import WatchLimits

PERIOD_S, WINDOW = 2e-4, 29
WATCH = WatchLimits(math.inf, 1.0, 60.0, 0.02, 0.45, (0.0, 1e3), 90.0, 120.0)


class Drive:
    """Samples come `rate` times as fast as by our clock; every answer takes `answer_s`, half before and half behind the drive's part."""

    profile = None

    def __init__(self, rate: float, answer_s: float) -> None:
        self.rate, self.answer_s, self.time_s = rate, answer_s, 100.0
        self.asked: list[int | None] = []

    @property
    def made(self) -> int:
        return int(self.rate * (self.time_s - 100.0) / PERIOD_S)

    def now_s(self) -> float:
        return self.time_s

    def sleep(self, seconds: float) -> None:
        self.time_s += seconds

    def _answer(self, value):
        self.sleep(0.5 * self.answer_s)
        answer = value()
        self.sleep(0.5 * self.answer_s)
        return answer

    def fetch(self, cursor: StreamCursor, most: int | None):
        self.asked.append(most)
        count = self._answer(lambda: min(most or WINDOW, self.made - cursor.next_index))
        zero = np.zeros(count)
        block = SampleBlock(3, cursor.next_index, PERIOD_S, 0.0, zero, zero, zero, zero, 540.0) if count else None
        return SimpleNamespace(
            cursor=StreamCursor(cursor.stream, cursor.next_index + count), has_ended=False, block=block
        )

    def read_status(self):
        return SimpleNamespace(
            fault_code=0, heatsink_degc=30.0, winding_degc=30.0, dc_link_v=540.0, is_energised=True,
            samples_produced=self._answer(lambda: self.made), current_magnitude_a=math.nan,
        )  # fmt: skip


def stream_of(drive: Drive, averaged: int = 1) -> Stream:
    layout = SimpleNamespace(data_registers=4 * WINDOW, header_words=8)
    form = StreamFormat(layout, 3, 0.0, 15, PERIOD_S, 0.01, 1e-3, 0.02, averaged)
    return Stream(drive, StreamCursor(form), drive.now_s(), SensorWatch(math.inf), WATCH)


@pytest.mark.parametrize(("rate", "answer_s"), [(1.0, 0.004), (1.004, 0.004), (0.996, 0.004)])
def test_an_age_covers_a_drive_whose_time_runs_off_ours(rate, answer_s):
    drive = Drive(rate, answer_s)
    stream = stream_of(drive)
    read = 0
    for n in range(400):
        drive.sleep(0.05 if n % 40 == 39 else 0.0)
        block = stream.next_block(1.0)
        read += block.count
        assert block.age_s >= (drive.made - read) * PERIOD_S - 1e-9
    assert drive.time_s > 101.0


@pytest.mark.parametrize(("rate", "answer_s"), [(4.0, 0.005), (2.0, 0.012), (1.2, 0.007)])
def test_a_drive_that_is_never_caught_up_with_is_seen_by_what_it_says_it_has_made(rate, answer_s):
    """Every window was full and told nothing: a drive four times as fast was 3 s ahead of samples that were called new."""
    drive = Drive(rate, answer_s)
    stream = stream_of(drive)
    read = 0
    while drive.time_s < 101.0:
        block = stream.next_block(1.0)
        read += block.count
        made = drive.made
        stream.ask_status()
        assert stream._age_s(block) >= (made - read) * PERIOD_S
    assert drive.made - read > 200


def test_over_a_slow_link_room_is_asked_for_as_many_samples_as_a_fast_time_makes():
    drive = Drive(4.0, 0.0)
    stream = stream_of(drive, averaged=2)
    for _ in range(2):
        drive.sleep(0.2)
        stream.supervise()
    while stream._cursor.next_index < drive.made:
        stream.next_block(1.0)
    drive.sleep(0.001)  # 20 samples of its time, 5 of ours
    stream.next_block(1.0)
    assert drive.asked[-1] >= 20
