"""Does the drive apply what it was asked for? Judged on every block of a test with tones: another master that raises the
amplitude is seen so before the next poll for it."""

from __future__ import annotations

from commissioner.records import Signal, peak
from commissioner.safety.watch import StopReason

MOST_APPLIED = 1.25
"""Of the tones asked for, at their largest within the block."""
ROOM = 0.1
"""Besides, of those tones all at their peaks: ramps, delays, the converter's own."""


def judge_applied(seen_v: Signal, asked_v: Signal, peaks_v: float, bias_v: float) -> StopReason | None:
    """The reason to stop that a block's voltages `(n,)` give; `asked_v` `(m,)` are the tones about its instants at the amplitude asked
    for, `peaks_v` the same tones all at their peaks, `bias_v` the direct voltage asked for; all along the axis."""
    most_v = abs(bias_v) + MOST_APPLIED * peak(asked_v) + ROOM * peaks_v
    largest_v = peak(seen_v)
    if largest_v <= most_v:
        return None
    return StopReason(
        "the drive applies more than it was asked for", largest_v, most_v,
        "see that nothing else writes to this drive: a second master, a panel, a program on another computer",
        unit="V",
    )  # fmt: skip
