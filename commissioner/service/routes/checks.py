"""Everything that can be known without energising or writing."""

from __future__ import annotations

import asyncio
import datetime as dt
from typing import Annotated, cast

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from commissioner.service.access.visitors import Operator, parts_of
from commissioner.service.contract.description import Typed
from commissioner.service.contract.drives import CheckedDocument
from commissioner.service.library import Drive, Motor, must_be_there
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.runs.child import ask_for

router = APIRouter(route_class=Typed)


class CheckWish(BaseModel):
    """Which drive and which motor, by their ids."""

    model_config = ConfigDict(extra="forbid")
    drive: Annotated[str, Field(max_length=60)]
    motor: Annotated[str, Field(max_length=60)]


@router.post("/api/checks")
async def checks(request: Request, wish: CheckWish, _who: Operator) -> CheckedDocument:
    """The checks, each with value, limit and remedy; energises and writes nothing. 502: the drive does not answer."""
    parts = parts_of(request)
    return await make_checks(parts, parts.library.drive(wish.drive), parts.library.motor(wish.motor))


async def make_checks(parts: Parts, drive: Drive, motor: Motor) -> CheckedDocument:
    """The document of `commissioner check`, with the time it was made. Refusal: a run has the drive, or it is silent."""
    must_be_there(drive, "check")
    live = parts.desk.live_on(drive.id)
    if live is not None or parts.desk.is_starting(drive.id):
        raise Refusal(
            409,
            f"{drive.name} is in use by a run",
            step="check",
            value=live.id if live else "starting",
            limit="no run on this drive",
            remedy="wait for its end, or stop it",
        )
    axes = ",".join(f"{axis:g}" for axis in parts.settings.file.service.axes_deg)
    call = ["check", "--drive", drive.url, "--profile", drive.profile, "--motor", motor.source]
    more = ["--axes", axes] if axes else []
    watch = parts.desk.watch(drive)
    await asyncio.to_thread(watch.pause)
    try:
        document = await ask_for("checks", [*call, *more, "--json"], parts.desk.log("check", drive.id))
    finally:
        watch.resume()
    document["checked_utc"] = dt.datetime.now(dt.UTC).isoformat(timespec="seconds")
    checked = cast("CheckedDocument", document)
    parts.checks[f"{drive.id} {motor.id}"] = checked
    while len(parts.checks) > 200:
        parts.checks.pop(next(iter(parts.checks)))
    return checked
