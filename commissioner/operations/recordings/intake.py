"""Files of one motor, before a diagnosis looks at them: which are recordings, are they independent, are they of one motor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.motor.channels.rows import row_marks
from commissioner.recordings.table import Table, to_standstill
from commissioner.records import StandstillRecording
from commissioner.settings import load_motor

MOST_SHARED = 0.5
"""Part of the shorter recording whose currents may be alike in a row of samples, as they are only in copies."""
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


def require_independent(tables: Sequence[Table]) -> None:
    """DataRefused where most of a recording stands in another one too: a copy or an excerpt under another name is no second measurement."""
    known: list[tuple[str, NDArray[np.uint64]]] = []
    for table in tables if len(tables) > 1 else ():
        own = _rows(table)
        for source, theirs in known:
            shared = np.intersect1d(own, theirs, assume_unique=True).size / max(min(own.size, theirs.size), 1)
            if shared > MOST_SHARED:
                raise DataRefused(
                    f"{table.source} holds the same measured samples as {source}", step="read recordings", value=f"{100 * shared:.0f} % of the samples",
                    limit="every measurement once: a copy would narrow the errors and measure nothing", remedy="leave one of the two out",
                )  # fmt: skip
        known.append((table.source, own))


def _rows(table: Table) -> NDArray[np.uint64]:
    """A number for every row of `IN_A_ROW` samples of the currents in which one flows, each once."""
    currents = [np.nan_to_num(x) for name, x in sorted(table.columns.items()) if name.startswith("current_")]
    marks = row_marks(currents)
    return np.unique(marks[np.any(currents, axis=0)[: marks.size]]) if marks.size else marks


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
