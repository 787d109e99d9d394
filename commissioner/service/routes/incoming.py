"""Runs pushed by other computers: what is here of one, a piece of a file, and its arrival."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Path, Query, Request
from pydantic import BaseModel, ConfigDict, Field

from commissioner.operations.history.send import FILE, RUN
from commissioner.operations.history.share import Moved
from commissioner.service.access.visitors import Operator, parts_of
from commissioner.service.contract.description import Typed
from commissioner.service.contract.incoming import KeptPiece, OfferedRun
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.runs.incoming import LARGEST, MOST_FILES

router = APIRouter(route_class=Typed)
Run = Annotated[str, Path(pattern=RUN)]
File = Annotated[str, Path(pattern=FILE)]


class Arrival(BaseModel):
    """The names of all files of the run; `sha256`: of each as it was sent, so that no other push's piece stands in it."""

    model_config = ConfigDict(extra="forbid")
    files: Annotated[list[Annotated[str, Field(pattern=FILE)]], Field(min_length=1, max_length=MOST_FILES)]
    sha256: Annotated[dict[str, str], Field(max_length=MOST_FILES)] = {}


@router.get("/api/incoming/{run}")
async def offered(
    request: Request, run: Run, _who: Operator, journal_bytes: Annotated[int, Query(ge=0, le=LARGEST)] = 0
) -> OfferedRun:
    """What is here of a run that somebody wants to push, so that only the rest is sent."""
    return await asyncio.to_thread(parts_of(request).incoming.offered, run, journal_bytes)


@router.put("/api/incoming/{run}/{file}")
async def piece(
    request: Request, run: Run, file: File, _who: Operator, start: Annotated[int, Query(ge=0, le=LARGEST)] = 0
) -> KeptPiece:
    """The body is a piece of the file, from byte `start` on: what stands there already is left, else what followed goes; empty, it
    ends the file there. 409: a piece before it is missing."""
    body = await request.body()
    held = await asyncio.to_thread(parts_of(request).incoming.keep, run, file, start, body)
    return {"run": run, "file": file, "bytes": held}


@router.post("/api/incoming/{run}")
async def arrived(request: Request, run: Run, arrival: Arrival, who: Operator) -> Moved:
    """Everything is here: proved by its chain, then put in place. `what`: copied, updated, there already, newer there, left, conflict."""
    parts = parts_of(request)
    _check_at_rest(parts, run)
    moved = await asyncio.to_thread(parts.incoming.arrive, run, arrival.files, arrival.sha256)
    await parts.note(who, "took in a pushed run", run=run, reason=moved.what)
    return moved


def _check_at_rest(parts: Parts, run: str) -> None:
    live = parts.desk.runs.get(run)
    if live is not None and not live.is_over:
        raise Refusal(409, "this run goes on here", step="push", value=run, limit="a run that has ended",
                      remedy="wait for its end, then push again")  # fmt: skip
