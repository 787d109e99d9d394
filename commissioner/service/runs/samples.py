"""The samples of a run as a screen needs them: envelopes of 10 ms, a tenth of a second at a time."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from commissioner.motor.space_vector import axis_current_a
from commissioner.records import SampleBlock
from commissioner.run.archive.blocks import Placed
from commissioner.service.contract.live import SamplesEvent

BIN_S = 0.01


class Envelope:
    """Blocks in, one JSON-ready event out: per bin the least and the largest current along the axis, in amperes."""

    def __init__(self) -> None:
        self._segment, self._time_s, self.blocks = -1, 0.0, 0
        self.energised_s = 0.0

    def of(self, blocks: Sequence[Placed]) -> list[SamplesEvent]:
        """One event for each segment among the blocks; `t_s` runs on over all segments of the run."""
        events: list[SamplesEvent] = []
        self.blocks += len(blocks)
        for segment, block in _joined(blocks):
            is_new = segment != self._segment
            if is_new or not events:
                events.append(
                    {"segment": segment, "axis_deg": block.axis_deg, "bin_s": BIN_S, "is_new": is_new, "t_s": [], "low_a": [],
                     "high_a": [], "blocks": self.blocks}
                )  # fmt: skip
                self._segment = segment
            self._add(events[-1], block)
        return events

    def _add(self, event: SamplesEvent, block: SampleBlock) -> None:
        current = axis_current_a(block.current_u_a, block.current_v_a, block.current_w_a, block.axis_deg)
        self._time_s += block.lost_before * block.sample_period_s
        edges = np.arange(0, current.size, max(1, round(BIN_S / block.sample_period_s)))
        event["t_s"] += [round(self._time_s + float(edge) * block.sample_period_s, 4) for edge in edges]
        event["low_a"] += np.round(np.minimum.reduceat(current, edges), 4).tolist()
        event["high_a"] += np.round(np.maximum.reduceat(current, edges), 4).tolist()
        seconds = (block.count + block.lost_before) * block.sample_period_s
        self._time_s += block.count * block.sample_period_s
        self.energised_s += seconds


def _joined(blocks: Sequence[Placed]) -> Iterator[Placed]:
    """Blocks that follow one another without a gap, as one: a window of the stream is a quarter of a bin."""
    for (segment, axis_deg, _), group in itertools.groupby(_with_run(blocks), key=lambda one: one[0]):
        parts = [block for _, block in group]
        w = (
            None
            if parts[0].current_w_a is None
            else np.concatenate([p.current_w_a for p in parts if p.current_w_a is not None])
        )
        u, v = (np.concatenate([getattr(p, name) for p in parts]) for name in ("current_u_a", "current_v_a"))
        yield segment, replace(parts[0], axis_deg=axis_deg, current_u_a=u, current_v_a=v, current_w_a=w)


def _with_run(blocks: Sequence[Placed]) -> Iterator[tuple[tuple[int, float, int], SampleBlock]]:
    """Each block that holds samples with its segment, axis, and the number of its run without a gap."""
    run = 0
    for segment, block in blocks:
        if block.count:
            run += block.lost_before > 0
            yield (segment, block.axis_deg, run), block
