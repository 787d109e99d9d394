"""Are a recording's rows a standstill recording at a fixed rate? Kind, numbers, time steps."""

from __future__ import annotations

import numpy as np

from commissioner.identify.intake.stretches import refused
from commissioner.records import StandstillRecording

LONGEST_PERIOD_S = 0.01


def require_standstill(recording: StandstillRecording) -> None:
    """By what the file says of itself."""
    kind = recording.metadata.get("kind", "standstill")
    if kind != "standstill":
        raise refused(
            "this is not a standstill recording",
            f"kind: {kind}",
            "kind: standstill",
            "give a recording of a motor at rest, or use `commissioner monitor` for one that runs",
        )


def require_finite(recording: StandstillRecording) -> None:
    """Numbers everywhere, in two rows at least."""
    columns = {
        "time_s": recording.time_s,
        "axis_deg": recording.axis_deg,
        "voltage_axis_v": recording.voltage_axis_v,
        "current_u_a": recording.current_u_a,
        "current_v_a": recording.current_v_a,
        "current_w_a": recording.current_w_a,
    }
    for name, values in columns.items():
        if values is None:
            continue
        bad = ~np.isfinite(values)
        if bad.any():
            raise refused(
                f"column {name} holds values that are not numbers",
                f"{int(bad.sum())}, first in row {int(np.argmax(bad))}",
                "finite numbers",
                "leave lost samples out as missing rows",
            )
    if recording.time_s.size < 2:
        raise refused("the recording is too short", f"{recording.time_s.size} samples", "2 or more", "record longer")


def require_even_steps(recording: StandstillRecording) -> None:
    """Steps inside a segment are whole multiples of the named period, most of them one."""
    inside = np.diff(np.asarray(recording.segment)) == 0
    in_row = 1 if recording.averaged is None else recording.averaged[:-1][inside]
    steps = np.diff(recording.time_s)[inside] / (recording.sample_period_s * in_row)
    if steps.size == 0:
        raise refused("no segment holds two samples", steps.size, "consecutive samples", "number the segments")
    if recording.sample_period_s > LONGEST_PERIOD_S:
        raise refused(
            "the samples are too far apart",
            f"sample period {recording.sample_period_s:.4g} s",
            f"at most {LONGEST_PERIOD_S:g} s",
            "give time_s in seconds, and record at 1 kHz or faster",
        )
    usual = float(np.median(steps))
    if abs(usual - 1.0) > 0.05:
        raise refused(
            "the time steps are not those of the named sample period",
            f"most are {usual * recording.sample_period_s:.6g} s",
            f"sample_period_s {recording.sample_period_s:.6g} s",
            "give time_s and sample_period_s in seconds",
        )
    off = np.abs(steps - np.maximum(np.round(steps), 1.0))
    if np.max(off) > 0.05:
        worst = int(np.argmax(off))
        raise refused(
            "the time steps are not equal",
            f"{steps[worst] * recording.sample_period_s:.6g} s",
            f"multiples of {recording.sample_period_s:.6g} s",
            "record at a fixed rate",
        )
