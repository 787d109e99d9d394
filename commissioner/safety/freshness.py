"""How old is the newest sample? Counted on our own clock, because a drive's ring hides how late its samples arrive.

A session's sample k ends (k + 1) periods after the drive began. When that was, our clock can only bracket: not before
the request that enabled the drive was sent; and a drive that was asked at `sent_s` and had made no more than n samples
began not before `sent_s` less n + 1 periods. The latest of these is the tightest. From it follows the largest age that a
sample can have. Nothing here reads a clock: times are data.

A window that was not full ends with the newest sample there was: two of them tell how fast the drive's time passes. All
inductances are as wrong as the period that the drive states, and ages are too small where it is too long.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from commissioner.safety.watch import StopReason

MOST_OFF, SLACK_S = 0.005, 0.01
"""Of the time between two counts, and besides: what the drive's time may differ from ours. Samples may be counted in bursts."""
OTHER_TIME = 1.5
"""A time that passes so many times as fast is meant to: a simulated inverter's (`--speed N`)."""
TOLD_FROM_S = 0.125
"""Between two counts that tell by how many times."""
LOOSENS = 0.02
"""Of the time since an answer: what it says of the drive's beginning may be off by now. More than `MOST_OFF`, which is told only after
seconds; little beside the age of a sample, for answers come many times a second."""


@dataclass(frozen=True)
class Counted:
    """The drive had made `samples`, no more and no less, at some moment from `sent_s` to `answered_s` of our clock."""

    samples: int
    sent_s: float
    answered_s: float


@dataclass(frozen=True)
class DriveClock:
    """Of one energised session. Times in s, on one monotonic clock of the host; ages in s of the drive's time, which passes `rate` times as fast."""

    began_after_s: float
    sample_period_s: float
    first: Counted | None = None
    rate: float = 1.0
    told_s: float | None = None
    """When the request was sent from whose answer `began_after_s` is; None: it is the request that enabled the drive."""
    made: int = 0
    """The most samples that an answer showed: an older one is as old as those behind it last, whatever time passes by any clock."""

    def at_most(self, samples: int, sent_s: float) -> DriveClock:
        """The answer to a request sent at `sent_s` showed that the drive had made `samples` and no more."""
        clock = replace(self, made=max(self.made, samples))
        began_after_s = sent_s - (samples + 1) * self.sample_period_s / self.rate
        if began_after_s < self._began_after_s(sent_s):
            return clock
        return replace(clock, began_after_s=began_after_s, told_s=sent_s)

    def most_made(self, now_s: float) -> float:
        """Samples that the drive can have made by now."""
        return max(0.0, (now_s - self._began_after_s(now_s)) * self.rate / self.sample_period_s)

    def age_s(self, samples: int, now_s: float) -> float:
        """The largest time that can have passed since sample number `samples` - 1 ended."""
        return max(0.0, (max(self.most_made(now_s), self.made) - samples) * self.sample_period_s)

    def _began_after_s(self, now_s: float) -> float:
        told_s = self.began_after_s if self.told_s is None else self.told_s
        return self.began_after_s - LOOSENS * max(0.0, now_s - told_s)

    def counted(self, now: Counted) -> DriveClock:
        """After another count; where it tells that the drive's time is meant to pass faster, that rate and this count alone say how old samples are."""
        first = self.first or now
        clock = replace(self, first=first)
        drive_s, ours_s = (now.samples - first.samples) * self.sample_period_s, now.answered_s - first.sent_s
        if ours_s < TOLD_FROM_S or drive_s < OTHER_TIME * ours_s:
            return clock.at_most(now.samples, now.sent_s)
        return replace(clock, rate=drive_s / ours_s, began_after_s=-math.inf, told_s=None).at_most(
            now.samples, now.sent_s
        )

    def judge(self, now: Counted) -> StopReason | None:
        """Whether the drive's time between the first count and this one contradicts ours."""
        if self.first is None:
            return None
        drive_s = (now.samples - self.first.samples) * self.sample_period_s
        least_s, most_s = now.sent_s - self.first.answered_s, now.answered_s - self.first.sent_s
        allowed_s = SLACK_S + self.sample_period_s
        is_near = most_s / OTHER_TIME < drive_s < least_s * OTHER_TIME
        if not is_near or least_s * (1.0 - MOST_OFF) - allowed_s <= drive_s <= most_s * (1.0 + MOST_OFF) + allowed_s:
            return None
        ours_s = 0.5 * (least_s + most_s)
        return StopReason(
            "the drive's samples do not come as often as it says", ours_s / (now.samples - self.first.samples),
            f"{self.sample_period_s:.6g} s within {MOST_OFF:.1%}, by this computer's clock",
            "check the control period that the firmware states, and the clock of this computer", is_fault=True, unit="s",
        )  # fmt: skip
