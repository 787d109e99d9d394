"""A third current or line voltage that is the others' negative sum to the printing step is no sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from commissioner.records import ReadingNote, Signal, StandstillRecording

COMPUTED = "computed_current_w_a"
WHICH = (
    "Which of the three was computed cannot be told from the sum: a gain, offset or clipped peak of one sensor stands in the computed "
    "one as well, and is looked for in each pair"
)
SAMPLED = 20_000
MOST_DIGITS = 15


def without_computed_third(recording: StandstillRecording) -> StandstillRecording:
    """The recording without a third current that only repeats the other two, and with a note of it; else as it is."""
    w = recording.current_w_a
    if w is None or not is_negative_sum(recording.current_u_a, recording.current_v_a, w):
        return recording
    note = ReadingNote(
        COMPUTED, f"third current computed from two (the three sum to zero to the last digit): not used. {WHICH}"
    )
    return replace(recording, current_w_a=None, notes=(*recording.notes, note))


def other_pairs(recording: StandstillRecording) -> list[tuple[str, StandstillRecording]]:
    """The recording as it is where another of the three columns is the computed one, with that column's name: the two others
    stand as u and v of a frame turned to them."""
    u, v = recording.current_u_a, recording.current_v_a
    w = -(u + v)
    turned = [("u", v, w, 120.0), ("v", w, u, 240.0)]
    return [
        (name, replace(recording, current_u_a=a, current_v_a=b, axis_deg=(recording.axis_deg - turn) % 360.0))
        for name, a, b, turn in turned
    ]


def is_negative_sum(u: Signal, v: Signal, w: Signal) -> bool:
    """Whether the three sum to zero to the step in which each value was printed, in every row that has all three."""
    good = np.isfinite(u) & np.isfinite(v) & np.isfinite(w)
    if np.sum(good) < 16 or any(not np.any(x[good]) for x in (u, v, w)):
        return False
    parts = [x[good] for x in (u, v, w)]
    if np.any(
        np.abs(parts[0][:SAMPLED] + parts[1][:SAMPLED] + parts[2][:SAMPLED]) > 0.05 * max(np.ptp(x) for x in parts)
    ):
        return False
    step = sum(0.5 * printed_step(x) for x in parts)
    return bool(np.all(np.abs(parts[0] + parts[1] + parts[2]) <= 1.02 * step))


LEAST_VALUE = 1e-280
"""Below it a value (of damaged bits) has no digits that a power of ten could raise to a whole number."""


def printed_step(x: Signal) -> Signal:
    """The last digit's worth of every value: of a fixed number of decimals or of significant digits, whichever is coarser.

    A float that no digits describe has the spacing of its kind.
    """
    sample = x[:: max(1, x.size // SAMPLED)]
    sample = sample[sample != 0.0]
    is_single = bool(np.all(sample == sample.astype(np.float32)))
    spacing = (
        4.0 * float(np.finfo(np.float32 if is_single else np.float64).eps) * np.maximum(np.abs(x), np.max(np.abs(x)))
    )
    decade = np.floor(np.log10(np.maximum(np.abs(x), 1e-300)) + 1e-9)
    own = np.floor(np.log10(np.maximum(np.abs(sample), LEAST_VALUE)) + 1e-9)
    decimals = next((d for d in range(-3, MOST_DIGITS) if _is_whole(sample * 10.0**d)), MOST_DIGITS)
    digits = next((n for n in range(1, MOST_DIGITS) if _is_whole(sample * 10.0 ** (n - 1 - own))), MOST_DIGITS)
    printed = np.maximum(10.0**-decimals, 10.0 ** (decade + 1 - digits))
    return np.asarray(np.maximum(printed, spacing))


def _is_whole(x: Signal) -> bool:
    return bool(np.all(np.abs(x - np.round(x)) <= 1e-9 * np.maximum(np.abs(x), 1.0) + 1e-7))
