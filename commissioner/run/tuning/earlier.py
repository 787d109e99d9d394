"""What earlier runs and recordings found for a motor of the same plate, by the contract's fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.tuned import Earlier
from commissioner.run.archive.catalogue import read_runs
from commissioner.run.archive.summary import RunSummary

MOST = 10
"""The newest so many runs with a result of this plate."""


def earlier_values(runs: Path, plate: Nameplate) -> dict[str, list[Earlier]]:
    """Newest first; empty where the archive holds none."""
    found: dict[str, list[Earlier]] = {}
    taken = 0
    for run in read_runs(runs):
        values = _values(run) if run.motor == asdict(plate) and run.outcome == "commissioned" else {}
        for field, value in values.items():
            found.setdefault(field, []).append(Earlier(run.run, value))
        taken += bool(values)
        if taken >= MOST:
            break
    return found


def _values(run: RunSummary) -> dict[str, float]:
    """Of an identification its parameters, of a tuning its medians."""
    result: Mapping[str, Any] = run.result or {}
    tune = result.get("tune")
    if isinstance(tune, dict):
        rows = [row for row in tune.get("rows") or () if isinstance(row, dict)]
        return {row["field"]: float(row["ours"]) for row in rows if row.get("field") and row.get("ours")}
    parameters = result.get("parameters")
    if not isinstance(parameters, dict):
        return {}
    return {
        name: float(quantity["value"])
        for name, quantity in parameters.items()
        if isinstance(quantity, dict) and isinstance(quantity.get("value"), int | float)
    }
