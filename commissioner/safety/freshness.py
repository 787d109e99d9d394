"""How old is the newest sample? Counted on our own clock, because a drive's ring hides how late its samples arrive.

A session's sample k ends (k + 1) periods after the drive began. When that was, our clock can only bracket: not before
the request that enabled the drive was sent; and a drive that was asked at `sent_s` and had made no more than n samples
began not before `sent_s` less n + 1 periods. The latest of these is the tightest. From it follows the largest age that a
sample can have. Nothing here reads a clock: times are data.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class DriveClock:
    """Of one energised session. Times in s, on one monotonic clock of the host."""

    began_after_s: float
    sample_period_s: float

    def at_most(self, samples: int, sent_s: float) -> DriveClock:
        """The answer to a request sent at `sent_s` showed that the drive had made `samples` and no more."""
        began_after_s = sent_s - (samples + 1) * self.sample_period_s
        return replace(self, began_after_s=max(self.began_after_s, began_after_s))

    def age_s(self, samples: int, now_s: float) -> float:
        """The largest time that can have passed since sample number `samples` - 1 ended."""
        return max(0.0, now_s - self.began_after_s - samples * self.sample_period_s)
