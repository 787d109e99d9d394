"""Did the DC link stand still from segment to segment? A drive that does not correct its voltage for the link applies more or less than
it was commanded, in proportion: every value of such a test is off by as much. A motor at standstill takes too little power to move it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.identify.intake.stretches import Stretch
from commissioner.records import StandstillRecording

TOLD = 0.01
"""Doubt from which a result speaks of it: a rectifier's ripple and what a test draws leave 0.003."""


@dataclass(frozen=True)
class LinkCourse:
    """Mean DC link in V: of all segments the lowest and the highest, and of each test; NaN of one in which it moved itself."""

    lowest_v: float
    highest_v: float
    tests_v: tuple[float, ...]

    @property
    def doubt(self) -> float:
        """Of every value, relative, where the drive does not correct for the link: half of what it moved by."""
        return _half_of(self.lowest_v, self.highest_v)

    @property
    def remark(self) -> str:
        """One sentence; empty where the link stood still."""
        if self.doubt <= TOLD:
            return ""
        return (
            f"the DC link moved between {self.lowest_v:.4g} and {self.highest_v:.4g} V: every value of a drive that does not correct "
            f"its voltage for that is uncertain by {100 * self.doubt:.2g} %"
        )


def link_course(recording: StandstillRecording, tests: Sequence[Sequence[Stretch]]) -> LinkCourse | None:
    """None where the link was not recorded throughout."""
    link_v = recording.dc_link_v
    if link_v is None or not np.all(np.isfinite(link_v) & (link_v > 0.0)):
        return None
    numbers, place, counts = np.unique(recording.segment, return_inverse=True, return_counts=True)
    means_v = np.bincount(place.ravel(), link_v) / counts
    of_segment = dict(zip(numbers.tolist(), means_v.tolist(), strict=True))
    tests_v = tuple(_of_test([of_segment[stretch.segment] for stretch in test]) for test in tests)
    return LinkCourse(float(np.min(means_v)), float(np.max(means_v)), tests_v)


def _of_test(segments_v: Sequence[float]) -> float:
    moved = _half_of(min(segments_v), max(segments_v))
    return float(np.mean(segments_v)) if moved <= TOLD else math.nan


def _half_of(low_v: float, high_v: float) -> float:
    return (high_v - low_v) / (high_v + low_v)
