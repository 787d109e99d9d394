"""What the samples of a run are, so that the link can carry them: channels of a sample, and control periods in its mean.

A drive takes a sample each control period; a window of its memory is asked for at a time. Where all of them do not pass, the
third current is left out, which follows from the other two, and then samples become means over so many control periods as
it takes. Voltage and currents are averaged alike, so that the model between them stays exact (`identify.intake.averaged`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from commissioner.safety.commands import ALL_CHANNELS, TWO_CURRENTS

BITS_PER_REGISTER, OVERHEAD_BITS = 22, 430
"""On a serial line of 11 bits a character: of a window and of the request, answer head and silences around it."""
FOR_SAMPLES = 0.8
"""Of the link's time, for windows; the rest is for commands and status readings."""
LONGEST_SAMPLE_S = 1.5e-3
"""A motor's fast time constant is 2 to 20 ms: longer means leave tones of a few hertz, which hardly tell its leakage."""
LONGEST_LEVEL_SAMPLE_S = 20e-3
"""Direct currents settle in tenths of a second."""
EASE = 2.0
"""Means of levels are longer than the link asks for by this: shorter windows, and steering is answered sooner."""
KEPT_SAMPLE_S, LONGEST_TEST_S = 1e-3, 7.0
"""Means that are kept in the drive, where its memory holds the longest test of them."""
LONGEST_REQUEST_S = 0.12
"""A staircase of direct current waits for about a hundred answers: 12 s of the 16 s that the drive allows one test. At 150 ms a request
it took 15.0 s with nothing else on the host, and the drive ended it otherwise."""
HIGHEST_TONE = 0.05
"""Of the sampling frequency: the highest tone of a test (`identify.excite.tones`)."""


@dataclass(frozen=True)
class StreamPace:
    """What the link carries: the fastest of a few reads of a whole sample window, made before anything is energised, the
    samples (all channels) and registers of one window, those of its data, the longest mean the drive makes, in control
    periods, the samples its memory keeps, the slowest of those reads: what a busy host adds now and then is caught up
    with from the drive's memory, and must fit there; and the fastest answer of any length."""

    round_trip_s: float
    samples: int
    registers: int
    data_registers: int = 0
    most_averaged: int = 1
    kept_samples: int = 0
    slowest_s: float = 0.0
    request_s: float = 0.0

    @property
    def can_steer(self) -> bool:
        """Whether direct current can be steered to its levels within the time that a test may take."""
        return self.request_s <= LONGEST_REQUEST_S

    def whole_s(self, control_period_s: float) -> float:
        """In which the link must pass a window of all channels, each control period a sample."""
        return FOR_SAMPLES * self.samples * control_period_s

    def window_s(self, mean: float, control_period_s: float) -> float:
        """In which the link must pass a window of two currents, each sample the mean of so many control periods."""
        return FOR_SAMPLES * (self.data_registers // len(TWO_CURRENTS)) * mean * control_period_s

    def least_mean(self, control_period_s: float) -> float:
        """Control periods in the shortest mean of which windows pass; infinite where a window holds none."""
        one_s = self.window_s(1.0, control_period_s)
        return self.round_trip_s / one_s if one_s else math.inf

    def longest_mean(self, longest_s: float, control_period_s: float) -> int:
        """Control periods in the longest mean that the drive makes and that a sample may last."""
        return min(self.most_averaged, int(longest_s / control_period_s + 1e-9))

    def is_kept(self, plan: LinkPlan, control_period_s: float) -> bool:
        """Whether the drive's memory holds what the slowest answer keeps waiting."""
        return not self.kept_samples or self.slowest_s <= self.kept_samples * plan.averaged * control_period_s


@dataclass(frozen=True)
class LinkPlan:
    """`averaged`: control periods in each sample's mean; 1: every control period is a sample of its own. `captured`: the same
    of a test with tones, where the drive keeps its samples and they are downloaded afterwards; 0: they are streamed."""

    channels: tuple[str, ...] = ALL_CHANNELS
    averaged: int = 1
    captured: int = 0

    @property
    def of_tones(self) -> int:
        """Control periods in the mean of a sample of a test with tones."""
        return self.captured or self.averaged

    @property
    def is_reduced(self) -> bool:
        return self.averaged > 1 or len(self.channels) < len(ALL_CHANNELS)

    def sentence(self, control_period_s: float) -> str:
        """The plan and what it costs, for people."""
        if not self.is_reduced:
            return "every sample of the drive, all channels"
        left_out = "voltage and two currents a sample, the third is the others' negative sum"
        if self.averaged == 1:
            return f"{left_out}; no accuracy is lost but the check of the sum"
        means = (
            f"each the mean of {self.of_tones} control periods, {1.0 / (self.of_tones * control_period_s):.0f} a second"
        )
        highest = f"tones up to {HIGHEST_TONE / (self.of_tones * control_period_s):.0f} Hz"
        cost = "standard errors of leakage and L_M up to half as large again, and no diagnosis of the samples"
        if not self.captured:
            return f"{left_out}; {means}; {highest}; {cost}"
        return (
            f"{left_out}; tests with tones run without a sample seen, their amplitude as no motor, then this one at its worst, "
            f"can pass the flux limit with; the drive keeps their samples, {means}, for the download; {highest}; DC levels "
            f"are steered by means of {1e3 * self.averaged * control_period_s:.0f} ms; {cost}"
        )


def plan_link(pace: StreamPace | None, control_period_s: float) -> LinkPlan | None:
    """The least reduction that the link carries; None where it carries none. Without a pace nothing is reduced."""
    if pace is None or pace.round_trip_s <= pace.whole_s(control_period_s):
        return LinkPlan()
    if not pace.can_steer:
        return None
    least = pace.least_mean(control_period_s)
    if least <= pace.longest_mean(LONGEST_SAMPLE_S, control_period_s):
        return LinkPlan(TWO_CURRENTS, max(1, math.ceil(least - 1e-9)))
    return _captured(pace, control_period_s)


def _captured(pace: StreamPace, control_period_s: float) -> LinkPlan | None:
    """Tones kept in the drive, DC levels streamed as slowly as windows come."""
    least, most = pace.least_mean(control_period_s), pace.longest_mean(LONGEST_LEVEL_SAMPLE_S, control_period_s)
    if least > most or not pace.kept_samples:
        return None
    kept = max(KEPT_SAMPLE_S, LONGEST_TEST_S / pace.kept_samples) / control_period_s
    captured = math.ceil(kept - 1e-9)
    if captured > pace.longest_mean(LONGEST_SAMPLE_S, control_period_s):
        return None
    return LinkPlan(TWO_CURRENTS, min(most, math.ceil(EASE * least)), captured)


def least_baud(pace: StreamPace, control_period_s: float, *, is_reduced: bool) -> float:
    """The serial rate from which on every sample passes; `is_reduced`: from which on a plan exists."""
    bits = BITS_PER_REGISTER * pace.registers + OVERHEAD_BITS
    whole_s = pace.samples * control_period_s
    longest_s = LONGEST_LEVEL_SAMPLE_S if pace.kept_samples else LONGEST_SAMPLE_S
    means_s = pace.window_s(pace.longest_mean(longest_s, control_period_s), control_period_s)
    return bits / (max(whole_s, means_s) if is_reduced else whole_s)
