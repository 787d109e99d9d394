"""Runs: start, list, look at, take away."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated, Any, Literal

from fastapi import APIRouter, Query, Request
from fastapi.responses import FileResponse, Response
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from commissioner.run.archive.verify import refuse_changed
from commissioner.service.access.gate import REPORT_CSP
from commissioner.service.access.visitor import Visitor
from commissioner.service.access.visitors import Operator, Viewer, parts_of
from commissioner.service.archive import Entry
from commissioner.service.contract.description import Typed, sends
from commissioner.service.contract.runs import Begun, RunAnswer, RunRow, RunsDocument
from commissioner.service.library import STANDARD, Drive, Motor, must_be_there
from commissioner.service.parts import Parts
from commissioner.service.runs.child import ask_for, succeed
from commissioner.service.runs.desk import LiveRun
from commissioner.service.runs.live import live_document
from commissioner.settings import TestAngle

router = APIRouter(route_class=Typed)
USUAL = 100
RECORD = ("request.json", "journal.jsonl")
"""What a run is known by: nothing of it is exported where these are not as it left them."""
Given = BeforeValidator(lambda value: value or USUAL)
"""A filter that a form left empty is none."""


class RunWish(BaseModel):
    """A commissioning that somebody takes responsibility for: `confirm` must be true."""

    model_config = ConfigDict(extra="forbid")
    drive: Annotated[str, Field(max_length=60)]
    motor: Annotated[str, Field(max_length=60)]
    axes_deg: Annotated[list[TestAngle], Field(max_length=12)] = []
    write_back: bool = False
    procedure: Annotated[str, Field(max_length=60)] = STANDARD
    confirm: Literal[True]


@router.post("/api/runs", status_code=201)
async def start(request: Request, wish: RunWish, who: Operator) -> Begun:
    """Energises the motor, after the run has made its checks. 409 names who has the drive."""
    run = await start_run(parts_of(request), wish, who)
    return {"id": run.id, "url": f"/runs/{run.id}"}


async def start_run(parts: Parts, wish: RunWish, who: Visitor) -> LiveRun:
    """The run, begun. The audit says so before anything moves."""
    drive, motor = parts.library.drive(wish.drive), parts.library.motor(wish.motor)
    procedure = parts.library.procedure(wish.procedure)
    verb = parts.desk.commissioning(wish.axes_deg, write_back=wish.write_back, procedure=procedure)
    return await begin(parts, drive, motor, verb, who, write_back=wish.write_back)


async def begin(parts: Parts, drive: Drive, motor: Motor, verb: list[str], who: Visitor, **told: Any) -> LiveRun:
    """The run of this verb, begun; the audit says so before anything moves."""
    must_be_there(drive, "start a run")
    facts = {"drive": drive.id, "motor": motor.id, **told}
    await parts.note(who, "asked to energise", **facts)
    run = await parts.desk.start(drive, motor, verb, who.party)
    await parts.note(who, "run begun", run=run.id)
    return run


@router.get("/api/runs")
async def runs(
    request: Request,
    _who: Viewer,
    motor: Annotated[str, Query(max_length=80)] = "",
    drive: Annotated[str, Query(max_length=80)] = "",
    outcome: Annotated[str, Query(max_length=40)] = "",
    since: Annotated[str, Query(max_length=32)] = "",
    limit: Annotated[int, Query(ge=1, le=1000), Given] = USUAL,
) -> RunsDocument:
    """The archive, newest first."""
    parts = parts_of(request)
    found = await asyncio.to_thread(
        lambda: parts.archive.entries(motor=motor, drive=drive, outcome=outcome, since=since, limit=limit)
    )
    return {"runs": [_row(entry) for entry in found]}


@router.get("/api/runs/{run}")
async def one(request: Request, run: str, _who: Viewer) -> RunAnswer:
    """The result document; of a run that goes on, its state under `live`."""
    parts = parts_of(request)
    live = parts.desk.runs.get(run)
    if live is not None and not live.has_result:
        return {"run": run, "outcome": None, "live": live_document(live.feed.state, live.feed.current_now_a)}
    return parts.archive.result(run)


@router.get("/api/runs/{run}/report", response_class=Response, responses=sends("text/html"))
async def report(request: Request, run: str, _who: Viewer) -> Response:
    """The report as one HTML file; made again where the run could not make it."""
    parts = parts_of(request)
    entry = parts.archive.find(run)
    if entry.lacks_result or not (entry.folder / "report.html").is_file():
        arguments = ["runs", "report", entry.run, "--runs", str(parts.archive.root), "--json"]
        await ask_for("report", arguments, parts.desk.log("report"))
    return FileResponse(
        parts.archive.file(run, "report.html"), media_type="text/html", headers={"content-security-policy": REPORT_CSP}
    )


@router.get(
    "/api/runs/{run}/export/{format}",
    response_class=Response,
    responses=sends("text/csv", "application/json", "application/octet-stream"),
)
async def export(
    request: Request, run: str, format: Literal["csv", "json", "mat", "parquet"], _who: Viewer
) -> Response:
    """The samples as CSV, MATLAB 5 or Parquet, or the result as JSON; nothing past a damaged journal, as on the command line."""
    parts = parts_of(request)
    entry = parts.archive.find(run)
    if format == "json":
        result = parts.archive.file(run, "result.json")
        await asyncio.to_thread(refuse_changed, entry.folder, "export", "result.json", *RECORD)
        return FileResponse(result, filename=f"{run}.json")
    target = await _exported(parts, entry, format)
    return FileResponse(target, filename=f"{run}.{format}")


async def _exported(parts: Parts, entry: Entry, ending: str) -> Path:
    """The file, made by the command line's own export; kept beside the service's logs while the samples stay what they were."""
    target = parts.settings.data / "exports" / f"{entry.run}.{ending}"
    await asyncio.to_thread(refuse_changed, entry.folder, "export", *RECORD)
    samples = parts.archive.file(entry.run, "blocks.bin")
    if target.is_file() and target.stat().st_mtime_ns > samples.stat().st_mtime_ns:
        return target
    target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
    arguments = ["runs", "export", entry.run, str(target), "--runs", str(parts.archive.root), "--json"]
    await succeed(arguments, parts.desk.log("export"))
    return target


def _row(entry: Entry) -> RunRow:
    return {
        "run": entry.run,
        "utc": entry.utc,
        "motor": entry.motor,
        "nameplate": entry.motor_text,
        "drive": entry.drive,
        "person": entry.person,
        "outcome": entry.outcome,
        "standing": entry.standing.value,
        "reason": entry.reason,
        "energised_s": entry.energised_s,
        "holds": entry.written,
        "parameters": entry.parameters,
    }
