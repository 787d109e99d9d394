"""What a run identified, as comparisons and trends take it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from commissioner.errors import DataRefused
from commissioner.identify.estimate.axes import Combined
from commissioner.identify.estimate.common_ground import Result
from commissioner.motor.circuit import PARAMETERS, InverseGamma
from commissioner.procedure.states import State
from commissioner.run.archive.documents import identified, is_quantity, number
from commissioner.run.archive.summary import NO_RESULT, RunSummary


def has_result(run: RunSummary) -> bool:
    """True where the run's document has all four parameters, finite and above zero."""
    return identified(run.result or {}) is not None


def result_of(run: RunSummary) -> Result:
    """A run's combined result as its document holds it. DataRefused: it identified nothing."""
    if run.lacks_result:
        raise DataRefused(
            f"{run.run} has no result: {NO_RESULT}", step="compare", value=run.standing.value, limit="a run with parameters",
            remedy=f"`commissioner runs report {run.run}` makes it from the samples, where the run took some",
        )  # fmt: skip
    if not has_result(run):
        raise DataRefused(
            f"{run.run} identified nothing", step="compare", value=f"{run.outcome}, no parameters", limit="a run with parameters",
            remedy="compare runs of which `commissioner runs show RUN` shows the four parameters",
        )  # fmt: skip
    result = result_from(run.result or {}, run.run)
    return result if run.outcome == State.COMMISSIONED.value else replace(result, ended=run.outcome)


def result_from(document: Mapping[str, Any], name: str) -> Result:
    """Of a document of `run` or `identify` that has parameters."""
    parameters = document["parameters"]
    values = [parameters[key]["value"] for key in PARAMETERS]
    std = np.array([parameters[key]["std"] for key in PARAMETERS])
    combined = Combined(InverseGamma(*values), np.diag(std**2), (0.0, 0.0, 0.0, 0.0), (), ())
    return Result(
        name,
        combined,
        number(document.get("holds_for_stator_flux_wb")),
        _curve(document),
        number(document.get("winding_temperature_degc")),
    )


def flux_level(parameters: Mapping[str, Any]) -> float | None:
    """The peak stator flux, Wb, that a run's L_M and T_R hold at; None where it said none."""
    return number((parameters.get("magnetizing_inductance_h") or {}).get("at_stator_flux_wb"))


def _curve(document: Mapping[str, Any]) -> tuple[tuple[float, float, float], ...]:
    points = document.get("magnetizing_curve") or ()
    return tuple(
        (float(point["stator_flux_wb"]), float(point["magnetizing_inductance_h"]["value"]),
         float(point["magnetizing_inductance_h"]["std"]))
        for point in points
        if isinstance(point, dict) and is_quantity(point.get("magnetizing_inductance_h")) and "stator_flux_wb" in point
    )  # fmt: skip
