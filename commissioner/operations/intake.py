"""Files of one motor, before a diagnosis looks at them: which are recordings, which were copies, are they of one motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from commissioner.errors import DataRefused
from commissioner.recordings.table import Table, to_standstill
from commissioner.records import StandstillRecording
from commissioner.settings import load_motor

STANDSTILL_COLUMNS = frozenset(
    ["time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a", "current_w_a", "dc_link_v"]
)


def standstill(tables: Sequence[Table], motor: str | None) -> tuple[list[StandstillRecording], list[str]]:
    """The tables as recordings; unknown columns are named and left out."""
    remarks, recordings = [], []
    for table in tables:
        unknown = sorted(set(table.columns) - STANDSTILL_COLUMNS)
        if unknown:
            remarks.append(f"{Path(table.source).name}: unknown columns left out: {', '.join(unknown)}.")
        recording = to_standstill(table)
        remarks += [f"{Path(table.source).name}: {note.what}." for note in recording.notes]
        recordings.append(replace(recording, metadata={**recording.metadata, **plate_metadata(motor)}))
    return recordings, remarks


def plate_metadata(motor: str | None) -> dict[str, float | str]:
    """A named motor's plate as a recording's metadata; nothing where none is named."""
    if motor is None:
        return {}
    return {k: v for k, v in asdict(load_motor(motor)).items() if v is not None}


def without_copies(recordings: Sequence[StandstillRecording]) -> tuple[list[StandstillRecording], list[str]]:
    """Each recording once, and which were copies: their noise would be none."""
    kept: list[StandstillRecording] = []
    remarks = []
    for one in recordings:
        same = next((k for k in kept if _holds_the_same(k, one)), None)
        if same is None:
            kept.append(one)
        else:
            remarks.append(f"{Path(one.source).name} holds the same samples as {Path(same.source).name}: taken once.")
    return kept, remarks


def _holds_the_same(one: StandstillRecording, other: StandstillRecording) -> bool:
    return np.array_equal(one.current_u_a, other.current_u_a) and np.array_equal(one.time_s, other.time_s)


def require_one_motor(recordings: Sequence[StandstillRecording]) -> None:
    """DataRefused where plates or sample periods differ."""
    for key in ("rated_power_w", "rated_voltage_v", "rated_current_a", "rated_frequency_hz"):
        seen = {r.metadata[key]: r.source for r in recordings if key in r.metadata}
        if len(seen) > 1:
            raise DataRefused(
                f"the files are of different motors: {key} is {' and '.join(str(k) for k in seen)}",
                step="diagnose",
                value=", ".join(seen.values()),
                limit="recordings of one motor",
                remedy="diagnose them one by one",
            )
    periods = {r.sample_period_s for r in recordings}
    if max(periods) > 1.000001 * min(periods):
        raise DataRefused(
            "the files are sampled at different rates",
            step="diagnose",
            value=", ".join(f"{p:g} s" for p in periods),
            limit="one sample period",
            remedy="diagnose them one by one",
        )
