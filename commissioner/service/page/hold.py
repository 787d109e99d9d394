"""The button that is held to energise: whether a form meant it, and the way from there to the run."""

from __future__ import annotations

from collections.abc import Awaitable, Mapping

from fastapi import Request
from fastapi.responses import JSONResponse, Response

from commissioner.service.library import Drive, Motor
from commissioner.service.page.band import Place
from commissioner.service.page.frame import go, refused
from commissioner.service.problems import Refusal
from commissioner.service.runs.desk import LiveRun

NOT_MEANT = "Nothing was energised: confirm the three points and type the motor’s name."


def is_meant(fields: Mapping[str, str], motor: Motor) -> bool:
    """Three points confirmed, and the button held; or, by whoever cannot hold one, the motor's name typed."""
    is_held = fields.get("held") == "yes" or fields.get("word", "").strip() == motor.id
    return is_held and all(fields.get(f"confirm{k}") == "yes" for k in (1, 2, 3))


async def to_the_run(request: Request, starting: Awaitable[LiveRun], drive: Drive, motor: Motor) -> Response:
    """The page of the run that begins, or why it does not; for a script as JSON."""
    wants_json = "application/json" in request.headers.get("accept", "")
    try:
        run = await starting
    except Refusal as refusal:
        if wants_json:
            raise
        return refused(request, refusal, Place(drive=drive.id), f"/drives/{drive.id}/checks?motor={motor.id}")
    return JSONResponse({"url": f"/runs/{run.id}"}, 201) if wants_json else go(f"/runs/{run.id}")
