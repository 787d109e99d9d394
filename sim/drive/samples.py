"""The sample ring of one session and the idempotent window into it."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np

from sim.drive.drive_map import DriveMap
from sim.drive.live import CHANNELS, HISTORY, write_window
from sim.physics import layout as at

VOLTAGE_STEP_V = 0.01
LINK_STEP_V, LINK_ROOM = 0.02, 1.15
"""V per count of the link's signed word, which so ends at 655 V; what it must hold of the nominal link."""


def link_step_v(nominal_v: float) -> float:
    """V per count of this link: a multiple of the finest where the word would wrap, as at the 975 V of a 690 V drive."""
    return LINK_STEP_V * max(1, math.ceil(LINK_ROOM * nominal_v / (0x7FFF * LINK_STEP_V)))


class SampleRing:
    """Samples of one session, all channels; `mask` says which of them a window shows. Counters are the kernel's."""

    def __init__(self, drive_map: DriveMap, capacity: int, mask: int, decimation: int) -> None:
        self.map, self.capacity, self.mask = drive_map, capacity, mask
        self.c = np.zeros(at.C_COUNT, np.int64)
        self.c[at.C_DECIMATION] = decimation
        self.history, self.means = np.zeros((HISTORY, at.POINTS, 2)), np.zeros(CHANNELS)
        self.ring, self.flags = np.zeros((capacity, CHANNELS), np.int16), np.zeros(capacity, np.uint8)
        self.gaps: list[tuple[int, int]] = []
        self.next_unread = 0
        self.first_kept = 0
        self.overruns = 0
        self.has_ended = True

    @property
    def produced(self) -> int:
        return int(self.c[at.C_PRODUCED])

    def periods_until(self, index: int) -> int:
        """Control periods until this many samples are there."""
        return (index - self.produced) * int(self.c[at.C_DECIMATION]) - int(self.c[at.C_IN_MEAN])

    def largest_count(self) -> float:
        """Largest phase current of the last sample, in counts."""
        return float(np.max(np.abs(self.ring[(self.produced - 1) % self.capacity, 1:])))

    @cached_property
    def channels(self) -> list[int]:
        return [k for k in range(CHANNELS) if self.mask >> k & 1]

    def fitting(self, registers: int) -> int:
        """Samples that fit a read of this many registers from the window's start."""
        data = min(registers, self.map.window_words) - self.map.window_header_words
        return max(data, 0) // len(self.channels)

    def window(self, wanted: int, samples: int, session: int, link_count: int, *, is_running: bool) -> list[int]:
        """Header, CRC and data from sample `wanted` on; the oldest kept sample instead where that one is gone."""
        oldest = max(self.first_kept, self.produced - self.capacity)
        self.overruns += max(0, oldest - self.next_unread)
        first = max(wanted, oldest)
        first, count = self._around_gaps(first, samples)
        self.next_unread = max(self.next_unread, oldest, first + count)
        words, header = np.zeros(self.map.window_words, np.int64), self.map.window_header_words
        flags = self._flags(first + count, was_overrun=wanted < oldest, is_running=is_running)
        write_window(
            self.ring, self.flags, first, count, self.mask, (session, flags, link_count & 0xFFFF), words, header
        )
        return words.tolist()

    def forget(self) -> None:
        """Fault knob: all that nobody has read yet is overwritten, as in a ring that is shorter than it claims."""
        self.first_kept = self.produced

    def behind_gaps(self, index: int) -> int:
        """The sample of this index, or the first that exists behind what was lost."""
        index = max(index, self.first_kept)
        for start, length in self.gaps:
            if start <= index < start + length:
                index = start + length
        return index

    def _around_gaps(self, first: int, samples: int) -> tuple[int, int]:
        """(first, count) of up to so many samples. Fault knob: samples the drive lost; a window ends before them or starts behind them."""
        if not self.gaps:
            return first, max(0, min(samples, self.produced - first))
        first = self.behind_gaps(first)
        count = min(samples, self.produced - first, *(start - first for start, _ in self.gaps if start > first))
        return first, max(0, count)

    def _flags(self, end: int, *, was_overrun: bool, is_running: bool) -> int:
        names = self.map.flags
        flags = names["running"] * is_running | names["overrun"] * was_overrun
        return flags | names["ended"] * (self.has_ended and end >= self.produced)
