"""What a run learnt, written into its drive; what it found there, written back. The table is the question."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal, cast

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from commissioner.encoding import JsonObject
from commissioner.report.run.contract import WritePlan
from commissioner.run.archive.documents import origin_of
from commissioner.run.archive.follow import JournalFollower
from commissioner.run.ending import WRITING_BEGAN
from commissioner.service.access.visitor import Visitor
from commissioner.service.access.visitors import Operator, Viewer, parts_of
from commissioner.service.contract.description import Typed
from commissioner.service.contract.writing import RestoredDocument, WritingDocument, WrittenDocument
from commissioner.service.library import Drive
from commissioner.service.parts import Parts, Writing
from commissioner.service.problems import Refusal
from commissioner.service.runs.child import succeed

router = APIRouter(route_class=Typed)
Act = Literal["write-back", "restore"]
PLAN_S, ACT_S = 120.0, 1800.0
"""A restore proves first that the run's samples lead to its decisions: minutes on a slow computer; and what writes is not to be killed."""
STEPS = ("prove", "compare", "write", "store", "keep")
"""Of a write-back and of a restore, as the run's journal tells them: the run is proved, its drive compared, the values brought into use and
read back, stored, and the run's folder closed."""
DONE = {"write-back": "wrote", "restore": "restored"}


class Agreement(BaseModel):
    """`token` of the table that was shown."""

    model_config = ConfigDict(extra="forbid")
    token: Annotated[str, Field(min_length=1, max_length=64)]


@router.get("/api/runs/{run}/write-back")
async def write_back_table(request: Request, run: str, _who: Operator) -> WritePlan:
    """Register, now, will be, unit and convention in the drive, and the token of this table. Writes nothing."""
    return await plan(parts_of(request), run, "write-back")


@router.get("/api/runs/{run}/restore")
async def restore_table(request: Request, run: str, _who: Operator) -> WritePlan:
    """The same for the set that the run found."""
    return await plan(parts_of(request), run, "restore")


@router.post("/api/runs/{run}/write-back")
async def write_back(request: Request, run: str, agreement: Agreement, who: Operator) -> WrittenDocument:
    """Write the accepted values: only if the drive still holds what the table showed; read back, stored."""
    return cast("WrittenDocument", await act(parts_of(request), run, "write-back", agreement.token, who))


@router.post("/api/runs/{run}/restore")
async def restore(request: Request, run: str, agreement: Agreement, who: Operator) -> RestoredDocument:
    """Write the set that the run found."""
    return cast("RestoredDocument", await act(parts_of(request), run, "restore", agreement.token, who))


@router.get("/api/runs/{run}/writing")
async def writing(request: Request, run: str, _who: Viewer) -> WritingDocument:
    """How far a write-back or restore that goes on has come, by the run's own records."""
    parts = parts_of(request)
    entry = parts.archive.find(run)
    going = parts.writing.get(entry.run)
    if going is None:
        return {"what": "", "steps": [], "step": None, "seconds": None}
    step = await asyncio.to_thread(step_of, entry.folder / "journal.jsonl", going.offset)
    return {
        "what": going.what,
        "steps": list(STEPS),
        "step": step,
        "seconds": round(time.monotonic() - going.began_s, 1),
    }


def step_of(journal: Path, offset: int) -> str:
    """The one of STEPS that goes on, by what was journalled behind `offset`."""
    step = STEPS[0]
    try:
        lines = JournalFollower(journal, offset).new()
    except OSError:
        return step
    for line in lines:
        record = line["record"] if isinstance(line["record"], dict) else {}
        if line["kind"] == WRITING_BEGAN:
            step = "compare"
        elif line["kind"] == "about_to":
            step = {"stage": "write", "commit": "write", "store": "store"}.get(str(record.get("action")), step)
        elif line["kind"] in ("parameters_written", "snapshot_restored"):
            step = "keep"
    return step


@contextmanager
def _told(parts: Parts, run: str, folder: Path, what: Act, drive: Drive | None) -> Iterator[None]:
    """While it goes on its steps can be asked for. Refusal 409: one goes on already, as where a button was pressed twice."""
    if (going := parts.writing.get(run)) is not None:
        raise Refusal(
            409, "the drive of this run is being written already", step=what, value=going.what, limit="one at a time",
            remedy="wait until it has ended, then look at the run",
        )  # fmt: skip
    journal = folder / "journal.jsonl"
    size = journal.stat().st_size if journal.is_file() else 0
    parts.writing[run] = Writing(what, drive.id if drive is not None else "", size, time.monotonic())
    try:
        yield
    finally:
        del parts.writing[run]


async def plan(parts: Parts, run: str, what: Act) -> WritePlan:
    """The table, read from the drive afresh."""
    entry = parts.archive.find(run)
    drive = drive_of(parts, run)
    arguments = [what, entry.run, *_address(drive), "--plan", *_runs(parts), "--json"]
    return cast("WritePlan", await _with_drive(parts, drive, arguments, PLAN_S))


async def act(parts: Parts, run: str, what: Act, token: str, who: Visitor) -> WrittenDocument | RestoredDocument:
    """Write what the table of `token` showed; the audit has it before and after. Refusal 409: another operates the drive."""
    entry = parts.archive.find(run)
    drive = drive_of(parts, run)
    if drive is not None:
        _must_be_free(parts, drive, what)
        parts.desk.control(drive.id).take(who.party)
    arguments = [what, entry.run, *_address(drive), "--yes", f"--token={token}", *_runs(parts), "--json"]
    with _told(parts, entry.run, entry.folder, what, drive):
        await parts.note(who, f"asked to {what.replace('-', ' ')}", run=run, table=token)
        done = await _with_drive(parts, drive, arguments, ACT_S, may_kill=False)
    rows = (done.get("report") or done).get("written") or []
    await parts.note(who, DONE[what], run=run, registers=len(rows))
    return cast("WrittenDocument | RestoredDocument", done)


async def _with_drive(
    parts: Parts, drive: Drive | None, arguments: list[str], within_s: float, *, may_kill: bool = True
) -> JsonObject:
    if drive is not None:
        _must_be_free(parts, drive, arguments[0])
    watch = parts.desk.watch(drive) if drive is not None else None
    if watch is not None:
        await asyncio.to_thread(watch.pause)
    try:
        return await succeed(arguments, parts.desk.log(arguments[0]), within_s, may_kill=may_kill)
    finally:
        if watch is not None:
            watch.resume()


def _must_be_free(parts: Parts, drive: Drive, step: str) -> None:
    """Refusal 409 where a run has the drive."""
    if parts.desk.live_on(drive.id) or parts.desk.is_starting(drive.id):
        raise Refusal(
            409,
            f"{drive.name} is in use by a run",
            step=step,
            value="a run goes on",
            limit="no run on this drive",
            remedy="wait for its end, or stop it",
        )


def drive_of(parts: Parts, run: str) -> Drive | None:
    """The drive of this library that the run was made on; None for one that is not in it."""
    asked = parts.archive.request(run)
    name = origin_of(asked).get("drive")
    for drive in parts.library.drives():
        if drive.url and (drive.id == name or drive.url == asked.get("url")):
            return drive
    return None


def _address(drive: Drive | None) -> list[str]:
    return ["--drive", drive.url] if drive is not None else []


def _runs(parts: Parts) -> list[str]:
    return ["--runs", str(parts.archive.root)]
