"""Recordings: uploaded, identified, diagnosed or monitored. Touches no drive."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Annotated, Literal

from fastapi import APIRouter, File, Form, Request, UploadFile
from fastapi.responses import FileResponse, Response
from pydantic import BeforeValidator

from commissioner.service.access.gate import REPORT_CSP
from commissioner.service.access.visitors import Operator, Viewer, parts_of
from commissioner.service.contract.description import Typed, sends
from commissioner.service.contract.recordings import RecordingDocument
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.recordings import Job

router = APIRouter(route_class=Typed)
PIECE, MOST = 1 << 20, 12


def _with_a_name(files: object) -> object:
    """A part of a form that has no `filename` comes as text, not as a file."""
    if isinstance(files, list) and any(isinstance(file, str) for file in files):
        raise ValueError("each with its name (`filename`)")
    return files


Files = Annotated[list[UploadFile], BeforeValidator(_with_a_name)]
"""What is uploaded: some of a form's parts, as files."""


@router.post("/api/recordings", status_code=201)
async def upload(
    request: Request,
    _who: Operator,
    files: Annotated[Files, File(max_length=MOST)],
    verb: Annotated[Literal["identify", "diagnose", "monitor"], Form()] = "identify",
    motor: Annotated[str, Form(max_length=60)] = "",
) -> RecordingDocument:
    """Keep the files and begin; GET the id for the result."""
    job = await take(parts_of(request), files, verb, motor)
    return job.as_document()


async def take(parts: Parts, files: list[UploadFile], verb: str, motor: str) -> Job:
    """The job, begun; `motor`: an id of the library, or empty."""
    plate = parts.library.motor(motor).source if motor else None
    return await parts.recordings.take(verb, plate, _named(files))


async def _named(files: list[UploadFile]) -> AsyncIterator[tuple[str, AsyncIterator[bytes]]]:
    for file in files:
        yield file.filename or "", _pieces(file)


async def _pieces(file: UploadFile) -> AsyncIterator[bytes]:
    while piece := await file.read(PIECE):
        yield piece


@router.get("/api/recordings/{recording}")
async def one(request: Request, recording: str, _who: Viewer) -> RecordingDocument:
    """How far it is; the verb's own document once it is done."""
    return parts_of(request).recordings.find(recording).as_document()


@router.get("/api/recordings/{recording}/report", response_class=Response, responses=sends("text/html"))
async def report(request: Request, recording: str, _who: Viewer) -> Response:
    """The report with its pictures, as one HTML file."""
    path = parts_of(request).recordings.find(recording).report
    if path is None:
        raise Refusal(
            404,
            "there is no report of this recording",
            step="recordings",
            value=recording[:60],
            limit="a verb that is done and makes one",
            remedy="wait, or look at the result",
        )
    return FileResponse(path, media_type="text/html", headers={"content-security-policy": REPORT_CSP})
