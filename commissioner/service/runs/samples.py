"""The samples of a run as a screen needs them: envelopes of 10 ms, a tenth of a second at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from commissioner.motor.space_vector import axis_current_a
from commissioner.records import SampleBlock

BIN_S = 0.01


class Envelope:
    """Blocks in, one JSON-ready event out: per bin the least and the largest current along the axis, in amperes."""

    def __init__(self) -> None:
        self._segment, self._time_s, self.blocks = -1, 0.0, 0
        self.energised_s = 0.0

    def of(self, blocks: Sequence[tuple[int, SampleBlock]]) -> list[dict[str, Any]]:
        """One event for each segment among the blocks; `t_s` runs on over all segments of the run."""
        events: list[dict[str, Any]] = []
        for segment, block in blocks:
            self.blocks += 1
            if block.count == 0:
                continue
            is_new = segment != self._segment
            if is_new or not events:
                events.append(
                    {"segment": segment, "axis_deg": block.axis_deg, "bin_s": BIN_S, "is_new": is_new, "t_s": [], "low_a": [],
                     "high_a": []}
                )  # fmt: skip
                self._segment = segment
            self._add(events[-1], block)
        for event in events:
            event["blocks"] = self.blocks
        return events

    def _add(self, event: dict[str, Any], block: SampleBlock) -> None:
        current = axis_current_a(block.current_u_a, block.current_v_a, block.current_w_a, block.axis_deg)
        self._time_s += block.lost_before * block.sample_period_s
        edges = np.arange(0, current.size, max(1, round(BIN_S / block.sample_period_s)))
        event["t_s"] += [round(self._time_s + float(edge) * block.sample_period_s, 4) for edge in edges]
        event["low_a"] += np.round(np.minimum.reduceat(current, edges), 4).tolist()
        event["high_a"] += np.round(np.maximum.reduceat(current, edges), 4).tolist()
        seconds = (block.count + block.lost_before) * block.sample_period_s
        self._time_s += block.count * block.sample_period_s
        self.energised_s += seconds
