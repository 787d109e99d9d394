"""What to record next: the test that splits a tie or finds an unnamed rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from commissioner.diagnose.effects import CATALOGUE
from commissioner.diagnose.record import Record


def next_experiment(verdict: str, causes: Sequence[Any], record: Record) -> Mapping[str, object] | None:
    """The most useful next test, or None where nothing is open."""
    if verdict == "unexplained":
        return {"splits": ["unknown"], "do": "repeat every segment at half amplitude and one with the shaft blocked"}
    tied = [c for c in causes if c.equivalent]
    if tied:
        cause = max(tied, key=lambda c: c.strength_sigma)
        return {
            "splits": [cause.name, *cause.equivalent],
            "do": CATALOGUE[cause.name].split_by,
            "predicted_sigma": _predicted(cause) if {"dead_time", "device_drop"} <= {cause.name, *cause.equivalent} else None,
        }
    axes = {round(s.axis_deg % 180.0, 3) for s in record.segments}
    if len(axes) < 3:
        return {"splits": ["inductance_anisotropy", "sensor_gain_mismatch"], "do": "add axes 60 and 120 degrees"}
    return None


def _predicted(cause: Any) -> float:
    """Halving the switching frequency halves a dead time's voltage: half its present strength in standard deviations."""
    return float(0.5 * cause.delta_chi2**0.5)
