"""Two runs of one drive: the same motor, changed, or another one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from commissioner.errors import DataRefused, UsageError
from commissioner.identify.estimate.axes import Combined, Comparison, compare
from commissioner.identify.estimate.common_ground import CommonGround, Result, brought_together
from commissioner.motor.circuit import InverseGamma
from commissioner.procedure.verdict import PARAMETERS
from commissioner.run.archive.catalogue import RunSummary, find_run


@dataclass(frozen=True)
class Compared:
    """`common`: the flux at which L_M and the temperature at which resistances were compared, and in words."""

    before: str
    after: str
    comparison: Comparison
    common: CommonGround


def compare_runs(runs: Path, before: str, after: str) -> Compared:
    """UsageError: not two runs. DataRefused: one of them identified nothing."""
    first, second = find_run(runs, before), find_run(runs, after)
    if first.run == second.run:
        raise UsageError(
            "a run cannot be compared with itself", step="compare", value=first.run, limit="two runs",
            remedy=f"`commissioner runs list --runs {runs}` shows the ids",
        )  # fmt: skip
    old, new, common = brought_together(_result(first), _result(second))
    comparison = compare(old, new, temperature_is_known=common.temperature_degc is not None)
    return Compared(first.run, second.run, comparison, common)


def _result(run: RunSummary) -> Result:
    """A run's combined result as its document holds it."""
    document = run.result or {}
    parameters = document.get("parameters")
    if not isinstance(parameters, dict) or not all(_is_quantity(parameters.get(name)) for name in PARAMETERS):
        raise DataRefused(
            f"{run.run} identified nothing", step="compare", value=run.outcome, limit="a run with parameters",
            remedy="compare runs that ended as commissioned or rejected",
        )  # fmt: skip
    values = [parameters[name]["value"] for name in PARAMETERS]
    std = np.array([parameters[name]["std"] for name in PARAMETERS])
    combined = Combined(InverseGamma(*values), np.diag(std**2), (0.0, 0.0, 0.0, 0.0), (), ())
    return Result(
        run.run,
        combined,
        _number(document.get("holds_for_stator_flux_wb")),
        _curve(document),
        _number(document.get("winding_temperature_degc")),
    )


def _curve(document: Mapping[str, Any]) -> tuple[tuple[float, float, float], ...]:
    points = document.get("magnetizing_curve") or ()
    return tuple(
        (float(point["stator_flux_wb"]), float(point["magnetizing_inductance_h"]["value"]),
         float(point["magnetizing_inductance_h"]["std"]))
        for point in points
        if isinstance(point, dict) and _is_quantity(point.get("magnetizing_inductance_h")) and "stator_flux_wb" in point
    )  # fmt: skip


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _is_quantity(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(value.get(key), int | float) for key in ("value", "std"))
