"""A recording prepared for diagnosis: segments in alpha/beta, masks, and the known functions of time effects may use."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import wait
from contextvars import ContextVar, copy_context
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import threads
from commissioner.records import Signal

Result = TypeVar("Result")
Named = tuple[Sequence[str], list[NDArray[np.float64]]]
LEAST_SHARE = 1500
WORTH_THREADS = 30_000
"""Samples of a record below which threads wait for one another longer than they help: a fifth of the CPU time of 15 000."""

PHASE_ANGLES_RAD = np.array([0.0, 2.0 * np.pi / 3.0, -2.0 * np.pi / 3.0])
TO_PHASES = np.stack([np.cos(PHASE_ANGLES_RAD), np.sin(PHASE_ANGLES_RAD)], axis=1)
"""(3, 2): phase currents of an amplitude-invariant (alpha, beta) vector without zero sequence."""


@dataclass(frozen=True)
class Segment:
    """One stretch from de-energised to de-energised, without holes. Signals `(n,)`, currents `(phases, n)`."""

    number: int
    file: int
    axis_deg: float
    time_s: Signal
    voltage_axis_v: Signal
    currents_a: NDArray[np.float64]
    is_good: NDArray[np.bool_]
    link_ratio: Signal
    starts_at_rest: bool = True
    uid: int = 0
    flux_before_wb: tuple[float, float] = (0.0, 0.0)
    """Rotor flux (alpha, beta) at the end of the segment before, of which a part may be left at the start."""
    iron_before_wb: NDArray[np.float64] | None = None
    """(2, m): the iron's flux in the segments before, to the pause's end; what it remembers of them may outlive the pause."""
    age_s: float = 0.0
    """Time of the first sample since the first one of its file."""
    link_swing: Signal | None = None
    """The recorded DC link over its median, less one; None where it was not recorded or is a constant."""

    @cached_property
    def period_s(self) -> float:
        return float(self.time_s[-1] - self.time_s[0]) / (self.count - 1) if self.count > 1 else 1e-4

    @property
    def count(self) -> int:
        return int(self.time_s.shape[0])

    @cached_property
    def good_count(self) -> int:
        """Samples that are not masked."""
        return int(self.is_good.sum())

    @cached_property
    def voltage_ab_v(self) -> NDArray[np.float64]:
        angle = np.deg2rad(self.axis_deg)
        return np.stack([self.voltage_axis_v * np.cos(angle), self.voltage_axis_v * np.sin(angle)])

    @property
    def axis_current_a(self) -> Signal:
        """Least-squares projection of the measured phase currents on the excited axis."""
        angle = np.deg2rad(self.axis_deg)
        weights = TO_PHASES[: self.currents_a.shape[0]] @ np.array([np.cos(angle), np.sin(angle)])
        projected: Signal = weights @ self.currents_a / float(weights @ weights)
        return projected

    @cached_property
    def idle(self) -> int:
        """Samples before the first command."""
        return int(np.argmax(self.voltage_axis_v != 0.0))

    @property
    def left_before_wb(self) -> Signal:
        """(4,) flux that decays after the segment before, and flux that the iron keeps."""
        kept = (0.0, 0.0) if self.iron_before_wb is None else self.iron_before_wb[:, -1]
        return np.array([*self.flux_before_wb, *kept])

    @cached_property
    def memories(self) -> dict[bytes, NDArray[np.float64]]:
        """(s, 2) what memory operators of some radii have kept of the segments before, by the radii's bytes, as far as it was asked for."""
        return {}

    def first(self, samples: int) -> Segment:
        """The segment cut so many samples after its first command."""
        return self.between(0, self.idle + samples)

    def between(self, begin: int, end: int) -> Segment:
        """Its samples from `begin` on, before `end`."""
        here = slice(begin, end)
        return replace(
            self,
            time_s=self.time_s[here],
            voltage_axis_v=self.voltage_axis_v[here],
            currents_a=self.currents_a[:, here],
            is_good=self.is_good[here],
            link_ratio=self.link_ratio[here],
            link_swing=None if self.link_swing is None else self.link_swing[here],
        )


@dataclass(frozen=True)
class Facts:
    """Scales of the machine and of the data. Currents and voltages are peak phase values."""

    sample_period_s: float
    rated_current_peak_a: float
    rated_power_w: float
    rated_flux_wb: float
    current_peak_a: float
    switching_frequency_hz: float | None
    dc_link_v: float | None
    phases: int
    metadata: Mapping[str, float | str] = field(default_factory=dict)


@dataclass(frozen=True)
class Record:
    """Segments plus `channels[k]` (n_k, c), the known functions of time, named by `channel_names`."""

    segments: tuple[Segment, ...]
    facts: Facts
    channel_names: tuple[str, ...] = ()
    channels: tuple[NDArray[np.float64], ...] = ()

    @property
    def samples(self) -> int:
        return sum(segment.count for segment in self.segments)

    @property
    def commanded(self) -> int:
        """Samples of the longest segment from its first command on: `first(commanded)` leaves it as it is."""
        return max(s.count - s.idle for s in self.segments)

    def channel(self, name: str) -> int:
        return self.channel_names.index(name)

    def shown(self, k: int, channel: int) -> float:
        """Sum over segment `k` of the squared voltage times a channel: how much the command would show of it. Summed once."""
        key = k, channel
        if key not in self._shown:
            self._shown[key] = float(self.segments[k].voltage_axis_v ** 2 @ self.channels[k][:, channel])
        return self._shown[key]

    @cached_property
    def _shown(self) -> dict[tuple[int, int], float]:
        return {}

    def with_channels(self, *named: Named) -> Record:
        """The record with more known functions of time appended: names, and one array (n_k, len(names)) per segment, each.

        Takes the lists over and empties them: channels are most of what a search holds, and none is to be there twice.
        """
        parts = [*([list(self.channels)] if self.channels else []), *(channels for _, channels in named)]
        channels = tuple(np.hstack([part.pop(0) for part in parts]) for _ in self.segments)
        names = (name for some, _ in named for name in some)
        return Record(self.segments, self.facts, (*self.channel_names, *names), channels)

    def subset(self, keep: tuple[int, ...], samples: int | None = None) -> Record:
        """Only the segments at the positions `keep`, each cut `samples` after its first command."""
        cut = [self.segments[k] if samples is None else self.segments[k].first(samples) for k in keep]
        if not self.channels:
            return Record(tuple(cut), self.facts)
        channels = tuple(np.ascontiguousarray(self.channels[k][: s.count]) for k, s in zip(keep, cut, strict=True))
        return Record(tuple(cut), self.facts, self.channel_names, channels)

    def first(self, samples: int) -> Record:
        """So many samples of every segment from its first command on, and the rest before it."""
        return self.subset(tuple(range(len(self.segments))), samples)

    def share_of(self, samples: int) -> int:
        """Samples of each segment when all of them get so many together; some tenths of a second at least."""
        return max(samples // max(len(self.segments), 1), LEAST_SHARE)

    def beginning(self, samples: int) -> Record:
        """The first part of every segment, about so many samples together."""
        return self.first(self.share_of(samples))


def each_segment(of_segment: Callable[[int], Result], record: Record) -> list[Result]:
    """`of_segment(position)` of every segment, in order; the compiled kernels let other threads run meanwhile."""
    count = len(record.segments)
    if count == 1 or record.samples < WORTH_THREADS or _IS_WITHIN.get():
        return [of_segment(k) for k in range(count)]

    def one(position: int) -> Result:
        _IS_WITHIN.set(True)
        return of_segment(position)

    begun = [threads().submit(copy_context().run, one, k) for k in range(count)]
    wait(begun)
    return [done.result() for done in begun]


_IS_WITHIN = ContextVar("_IS_WITHIN", default=False)
"""Whether this is one segment's part already: a part that waited for others could take the last thread from them."""
