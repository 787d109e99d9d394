"""Can this recording carry an answer? Cuts it into stretches, names what each is, refuses by name what cannot be
used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from commissioner.identify.intake.currents import (
    besides_the_axis,
    require_balanced,
    require_current,
    require_on_axis,
    require_power,
    require_unclipped,
)
from commissioner.identify.intake.rows import require_even_steps, require_finite, require_standstill
from commissioner.identify.intake.stretches import Stretch, cut, refused
from commissioner.records import StandstillRecording

SHORTEST_S = 0.5
MOST_STRETCHES = 200


@dataclass(frozen=True)
class Audit:
    stretches: tuple[Stretch, ...]
    gaps: int
    lost_samples: int
    duration_s: float
    remarks: tuple[str, ...]


def audit(recording: StandstillRecording) -> Audit:
    """The recording's stretches; DataRefused where it is too short, not finite, clipped, unevenly sampled, off its
    axis or without excitation."""
    require_standstill(recording)
    require_finite(recording)
    require_even_steps(recording)
    stretches = cut(recording)
    excited = [s for s in stretches if s.is_excited]
    if not excited:
        raise refused(
            "no segment is excited",
            f"largest |voltage_axis_v| {np.max(np.abs(recording.voltage_axis_v), initial=0):.3g} V",
            "a voltage that drives current along the axis",
            "record with the test voltage on, in the commanded unit (volts)",
        )
    seconds = sum(s.voltage_v.size for s in excited) * recording.sample_period_s
    if seconds < SHORTEST_S:
        raise refused(
            "the recording is too short", f"{seconds:.3g} s excited", f"{SHORTEST_S} s", "record several seconds"
        )
    if len(excited) > MOST_STRETCHES:
        raise refused(
            "the recording is in too many pieces",
            f"{len(excited)} stretches without a hole",
            f"at most {MOST_STRETCHES}",
            "record without losing samples, and number the segments by when the drive was energised",
        )
    for stretch in excited:
        require_current(stretch)
        require_on_axis(stretch)
        require_power(stretch)
    require_unclipped(recording)
    require_balanced(recording)
    remarks = tuple(
        f"segment {s.segment} holds no excitation and was used for noise and offset only"
        for s in stretches
        if not s.is_excited and s.voltage_v.size * recording.sample_period_s > SHORTEST_S
    )
    beside = [r for s in excited if (r := besides_the_axis(s)) is not None]
    gaps = [s.lost_before for s in stretches if s.lost_before > 0]
    return Audit(
        tuple(stretches),
        len(gaps),
        sum(gaps),
        seconds,
        (*(note.what for note in recording.notes), *remarks, *beside[:3]),
    )
