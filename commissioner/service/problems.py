"""Every refusal of the API as a problem document (RFC 9457) with step, value, limit and remedy."""

from __future__ import annotations

import errno
import math
from collections.abc import Callable, Container, Mapping, Sequence
from pathlib import Path
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from pydantic import BaseModel
from starlette.datastructures import UploadFile
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import Match

from commissioner.errors import NOTHING, OF_DISK, Aborted, CommissionerError, DataRefused, DriveError, UsageError
from commissioner.validation import wanted

MEDIA_TYPE = "application/problem+json"


class Problem(BaseModel):
    """RFC 9457, extended by the four facts of every error of this program."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str = ""
    step: str = ""
    value: Any = None
    limit: Any = None
    remedy: str = ""


RESPONSES: dict[int | str, dict[str, Any]] = {
    status: {"model": Problem, "description": what, "content": {MEDIA_TYPE: {"schema": Problem.model_json_schema()}}}
    for status, what in (
        (400, "The request cannot be read."),
        (401, "Nobody is logged in."),
        (403, "Not allowed: role, origin or token."),
        (404, "There is no such thing."),
        (409, "The state of run or drive does not allow it."),
        (413, "Too large."),
        (415, "Another media type is wanted."),
        (422, "A field cannot be right."),
        (429, "Too often."),
        (502, "The drive or the link failed."),
        (503, "Not ready yet."),
        (507, "The disk takes no more."),
    )
}
"""For OpenAPI: what any route may answer beside its success."""


class Refusal(Exception):
    """A request that is refused, with its HTTP status."""

    def __init__(self, status: int, title: str, *, headers: Mapping[str, str] | None = None, **facts: Any) -> None:
        super().__init__(title)
        self.headers = dict(headers or {})
        self.problem = Problem(title=title, status=status, **facts)


class Unknown(UsageError):
    """There is no drive, motor or procedure of this id. `kind`: which of them, as a route's path calls it."""

    def __init__(self, kind: str, what: str, **facts: Any) -> None:
        super().__init__(what, **facts)
        self.kind = kind


def refusal_of(error: CommissionerError, named: Container[str] = ()) -> Refusal:
    """An error of the core as a refusal. `named`: what the request's path names; where that is unknown, it is not found."""
    status = next((code for kind, code in _STATUS if isinstance(error, kind)), 500)
    if isinstance(error, Unknown) and error.kind in named:
        status = 404
    return Refusal(
        status, error.what, detail=error.what, step=error.step, value=_shown(error.value), limit=_shown(error.limit),
        remedy=error.remedy,
    )  # fmt: skip


def surprise(error: Exception) -> Refusal:
    """What nobody foresaw, in the form of every refusal: the page keeps its STOP. The server writes the traceback into its log."""
    return Refusal(
        500, "the service failed at this", step="answer", value=type(error).__name__, limit="an answer",
        remedy="go back; STOP works; the service's log says where it failed",
    )  # fmt: skip


FULL = OF_DISK - {errno.EROFS, errno.EIO}
FORBIDDEN = {errno.EACCES, errno.EPERM, errno.EROFS}
GONE = {errno.ENOENT, errno.ENOTDIR}


def disk_refuses(failure: OSError) -> Refusal:
    """What needs an entry on the disk is not done without one: what the disk says is told, with what mends it."""
    seen: dict[str, Any] = {
        "detail": str(failure)[:200],
        "step": "write down",
        "value": failure.strerror or str(failure)[:200],
    }
    if failure.errno == errno.ENAMETOOLONG:
        name = Path(str(failure.filename)).name
        return Refusal(
            422, "a name is too long for a file", step="write down", value=name[:200], limit=f"255 bytes, this one has {len(name.encode())}",
            remedy="give a shorter name; a letter beyond ASCII counts for two bytes or more",
        )  # fmt: skip
    if failure.errno in FULL:
        return Refusal(507, "the disk takes no more", **seen, limit="room for an entry before anything is done",
                       remedy="make room on the service's disk, then repeat; STOP works without")  # fmt: skip
    if failure.errno in FORBIDDEN:
        return Refusal(507, "the service may not write here", **seen, limit="a folder that the service may write",
                       remedy="give the service's user the right to write to its folders, then repeat; STOP works without")  # fmt: skip
    if failure.errno in GONE:
        return Refusal(409, "a file of the service has just gone", **seen | {"step": "read a file"}, limit="a file that is there",
                       remedy="load the page again; what was deleted by hand does not come back")  # fmt: skip
    return Refusal(507, "the disk did not do this", **seen, limit="a disk that reads and writes",
                   remedy="look at the service's disk, then repeat; STOP works without")  # fmt: skip


_STATUS: Sequence[tuple[type[CommissionerError], int]] = (
    (UsageError, 422), (DataRefused, 422), (Aborted, 409), (DriveError, 502), (CommissionerError, 409),
)  # fmt: skip


def respond(refusal: Refusal) -> Response:
    """The problem document."""
    return JSONResponse(
        refusal.problem.model_dump(mode="json"), refusal.problem.status, headers=refusal.headers, media_type=MEDIA_TYPE
    )


def install(app: FastAPI, answer: Callable[[Request, Refusal], Response]) -> None:
    """Every way a request can fail, answered in one form."""

    @app.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> Response:
        first = error.errors()[0]
        unreadable = first["type"] == "json_invalid"  # its place is then a character's number
        expected = "valid JSON" if unreadable else wanted(first)
        inner = [] if unreadable else [str(part) for part in first["loc"] if part not in ("body", "query", "path")]
        where = ".".join(inner)
        return answer(
            request,
            Refusal(
                400 if unreadable else 422,
                f"{where or 'the body'} cannot be used",
                detail=expected,
                step="read the request",
                value=_shown(first.get("input")),
                limit=expected,
                remedy=f"correct {where or 'the body'}; /openapi.json describes it",
            ),
        )

    @app.exception_handler(ClientDisconnect)
    async def gone(request: Request, _error: ClientDisconnect) -> Response:
        """Nobody reads it; without it each such request is told on the console as a defect."""
        return answer(
            request,
            Refusal(
                400, "the request broke off before its end", step="read the request", value="a part of its body",
                limit="as much as its head said", remedy="send it again",
            ),
        )  # fmt: skip

    @app.exception_handler(HTTPException)
    async def plain(request: Request, error: HTTPException) -> Response:
        if error.status_code == 400:  # a form that its reader gave up
            return answer(request, _unreadable_form(str(error.detail)))
        title = {404: "there is no such page or route", 405: "this method is not offered here"}.get(
            error.status_code, str(error.detail)
        )
        headers = {name.lower(): value for name, value in (error.headers or {}).items()} | (
            {"allow": _allowed(request)} if error.status_code == 405 else {}
        )
        return answer(
            request,
            Refusal(
                error.status_code,
                title,
                headers=headers,
                step="route",
                value=_shown(f"{request.method} {request.url.path}"),
                limit="a route and a method of /openapi.json",
                remedy="/openapi.json lists what there is",
            ),
        )


METHODS = ("GET", "POST", "PUT", "DELETE", "PATCH")


def _allowed(request: Request) -> str:
    """All that the path takes: of two routes with one path, each knows only its own."""
    taken = [
        one
        for one in METHODS
        if any(r.matches({**request.scope, "method": one})[0] is Match.FULL for r in request.app.routes)
    ]
    return ", ".join([*taken, *(["HEAD"] if "GET" in taken else [])])


def _unreadable_form(said: str) -> Refusal:
    return Refusal(
        400, "the form cannot be read", detail=said, step="read the request", value=said,
        limit="a whole form of at most 1000 files and 1000 fields, a field of at most 1 MB",
        remedy="send it as a browser does: multipart/form-data with its boundary",
    )  # fmt: skip


def _shown(value: Any) -> Any:
    """A value that fits into JSON and onto a screen; a file is shown by its name."""
    if value is None:
        return NOTHING
    if isinstance(value, list):
        return ", ".join(str(_shown(each)) for each in value[:20])[:200]
    if isinstance(value, UploadFile):
        return str(value.filename)[:200]
    if isinstance(value, bool | int) or (isinstance(value, float) and math.isfinite(value)):
        return value
    return str(value)[:200]
