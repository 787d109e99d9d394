"""The pages of a drive's own tuning: what will happen, the person's answers while it runs, what came of it."""

from __future__ import annotations

import shlex
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response

from commissioner.registers.tuning import Tuning
from commissioner.service.access.accounts import Role
from commissioner.service.access.visitors import parts_of
from commissioner.service.archive import Entry
from commissioner.service.library import Drive, Motor
from commissioner.service.page.band import Place
from commissioner.service.page.frame import View, enter, enter_form, go, refused, render
from commissioner.service.page.hold import NOT_MEANT, is_meant, to_the_run
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.routes.tuning import Answer, TuneWish, give_answer, start_tuning
from commissioner.service.runs.desk import LiveRun
from commissioner.service.runs.others import request_of
from commissioner.service.runs.state import OwnTuning

router = APIRouter()
TUNE = View("work/tune.html", "What will happen to the motor", 4)
TUNING = View("work/tuning.html", "The drive tunes itself", 5)
TUNED = View("work/tuned.html", "Result", 6)


def tuning_of(drive: Drive) -> Tuning | None:
    """The drive's own standstill tuning, where its file knows one."""
    from commissioner.link.files.drive_file import load_profile

    return load_profile(drive.profile).tuning


def call_of(drive: Drive, motor: Motor) -> str:
    """The same tuning from the command line."""
    call = ["commissioner", "tune", "--drive", drive.url, "--profile", drive.profile, "--motor", motor.source]
    return shlex.join(call)


@router.get("/drives/{drive}/tune")
async def tune(request: Request, drive: str, motor: str = "") -> Response:
    """What the drive will do by itself; then the button to hold."""
    enter(request, Role.OPERATOR)
    if not motor:
        return go(f"/drives/{drive}")
    parts = parts_of(request)
    return _tune_page(request, parts.library.drive(drive), parts.library.motor(motor))


def _tune_page(request: Request, drive: Drive, motor: Motor, message: str = "", status: int = 200) -> Response:
    from commissioner.link.files.drive_file import load_profile

    parts, profile = parts_of(request), load_profile(drive.profile)
    document = parts.checks.get(f"{drive.id} {motor.id}")
    if document is None or document["outcome"] != "passed" or profile.tuning is None:
        return go(f"/drives/{drive.id}/checks?motor={motor.id}")
    return render(
        request,
        TUNE,
        Place(drive=drive.id),
        status=status,
        drive=drive,
        motor=motor,
        tuning=profile.tuning,
        needs_hardwired=profile.tuning.form == "remote" and profile.watchdog is None,
        can_write=profile.parameters is not None and "restore" in profile.capabilities,
        message=message,
    )


@router.post("/drives/{drive}/tune")
async def do_tune(request: Request, drive: str) -> Response:
    """The button was held."""
    who, fields = await enter_form(request)
    parts = parts_of(request)
    known, motor = parts.library.drive(drive), parts.library.motor(fields.get("motor", ""))
    if not is_meant(fields, motor):
        return _tune_page(request, known, motor, NOT_MEANT, 422)
    repeat = fields.get("repeat", "")
    wish = TuneWish(
        drive=known.id,
        motor=motor.id,
        repeat=int(repeat) if repeat in ("1", "3", "5") else 3,
        write_back=fields.get("write_back") == "yes",
        hardwired_stop=fields.get("hardwired_stop") == "yes",
        confirm=True,
    )
    return await to_the_run(request, start_tuning(parts, wish, who), known, motor)


@router.post("/runs/{run}/answer")
async def answer(request: Request, run: str) -> Response:
    """What the person at the drive has done, or not; a question that is not asked any more changes nothing."""
    who, fields = await enter_form(request)
    number = fields.get("number", "")
    if number.isascii() and number.isdigit() and 0 < int(number) <= 10_000:
        said = Answer(number=int(number), done=fields.get("done") == "yes")
        try:
            await give_answer(parts_of(request), run, said, who)
        except Refusal as refusal:
            return refused(request, refusal, Place(run=run), f"/runs/{run}")
    return go(f"/runs/{run}")


def tuning_page(request: Request, run: LiveRun) -> Response | None:
    """While a tuning goes on; None for another run."""
    state, asked = run.feed.state, request_of(run.feed.folder)
    if "tune" not in asked:
        return None
    tuning, profile = state.tuning or OwnTuning(), _profile_of(parts_of(request), run)
    question = tuning.question["number"] if tuning.question else ""
    return render(
        request,
        TUNING,
        Place(run=run.id, drive=run.drive),
        run=run,
        tuning=tuning,
        repeat=int((asked.get("tune") or {}).get("repeat") or 1),
        form=profile.form if profile else "",
        shown=f"{len(tuning.done)} {question}",
    )


def _profile_of(parts: Parts, run: LiveRun) -> Tuning | None:
    drive = parts.library.known_drive(run.drive)
    return tuning_of(drive) if drive is not None else None


def tuned_page(request: Request, place: Place, entry: Entry, **facts: Any) -> Response:
    """A tuning that was judged."""
    from commissioner.procedure.tuned import FEWEST  # with numpy behind it

    return render(request, TUNED, place, entry=entry, fewest=FEWEST, **facts)
