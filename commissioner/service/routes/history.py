"""Two runs beside each other, and a motor over the years."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Annotated, cast

from fastapi import APIRouter, Query, Request

from commissioner.errors import CommissionerError
from commissioner.identify.contract import Measured
from commissioner.run.archive.catalogue import DATED_AHEAD, is_ahead
from commissioner.service.access.visitors import Viewer, parts_of
from commissioner.service.archive import Entry
from commissioner.service.contract.description import Typed
from commissioner.service.contract.history import ComparedDocument, LeftOut, TrendChange, TrendDocument, TrendPoint
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.runs.child import ask_for

router = APIRouter(route_class=Typed)
Run = Annotated[str, Query(min_length=1, max_length=200)]
_compared: dict[tuple[str, str], ComparedDocument] = {}


@router.get("/api/compare")
async def compare(request: Request, a: Run, b: Run, _who: Viewer) -> ComparedDocument:
    """Same motor, changed (which parameter, how significant), or another one."""
    return await compared(parts_of(request), a, b)


async def compared(parts: Parts, a: str, b: str) -> ComparedDocument:
    """What `commissioner runs compare` says of the two, the earlier one first."""
    first, second = sorted((parts.archive.find(a).run, parts.archive.find(b).run))
    if first == second:
        raise Refusal(
            422,
            "a run cannot be compared with itself",
            step="compare",
            value=first,
            limit="two runs",
            remedy="choose another one",
        )
    if (first, second) not in _compared:
        arguments = ["runs", "compare", first, second, "--runs", str(parts.archive.root), "--json"]
        document = await ask_for("comparison", arguments, parts.desk.log("compare"))
        if len(_compared) > 500:
            _compared.clear()
        _compared[first, second] = cast("ComparedDocument", document)
    return _compared[first, second]


@router.get("/api/motors/{motor}/trend")
async def trend(request: Request, motor: str, _who: Viewer) -> TrendDocument:
    """Every accepted result of a motor with its standard errors, oldest first."""
    parts = parts_of(request)
    return await asyncio.to_thread(trend_of, parts, motor)


def trend_of(parts: Parts, motor: str) -> TrendDocument:
    """The points, and of each parameter the change from the first to the last as the two are compared. Unknown: no motor is called so, and
    none of the archive was."""
    runs = [e for e in parts.archive.entries(motor=motor, limit=1000) if motor in e.motor_names]
    if not runs:
        parts.library.motor(motor)
    entries = [e for e in runs if e.outcome == "commissioned" and not is_ahead(e.utc)]
    left_out: list[LeftOut] = [{"run": e.run, "why": DATED_AHEAD} for e in runs if is_ahead(e.utc)]
    points = [_point(entry, entry.parameters) for entry in reversed(entries) if entry.parameters]
    changes = _changes(parts, points) if len(points) > 1 else {}
    return {"motor": motor, "points": points, "changes": changes, "left_out": left_out}


def _point(entry: Entry, parameters: Mapping[str, Measured]) -> TrendPoint:
    return {"run": entry.run, "utc": entry.utc, "flux_wb": entry.flux_wb, "parameters": parameters}


def _changes(parts: Parts, points: list[TrendPoint]) -> dict[str, TrendChange]:
    from commissioner.operations.history.compare import compare_runs  # late: numpy

    try:
        compared = compare_runs(parts.archive.root, points[0]["run"], points[-1]["run"]).comparison
    except CommissionerError:  # one of the two tells not all four, or no error of one
        return {}
    return {
        change.parameter: {
            "relative": change.relative_change,
            "sigmas": change.sigmas,
            "is_beyond_chance": change.sigmas > compared.limit_sigmas,
        }
        for change in compared.changes
    }
