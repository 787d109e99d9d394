"""A drive's own standstill tuning: begun here, its questions answered here."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Request
from pydantic import BaseModel, ConfigDict, Field

from commissioner.registers.tuning import MOST_REPEATS, REPEATS
from commissioner.service.access.visitor import Visitor
from commissioner.service.access.visitors import Operator, parts_of
from commissioner.service.contract.description import Typed
from commissioner.service.contract.runs import Answered, Begun
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.routes.runs import begin
from commissioner.service.runs.desk import LiveRun

router = APIRouter(route_class=Typed)


class TuneWish(BaseModel):
    """A tuning that somebody at the machine takes responsibility for: `confirm` must be true. `hardwired_stop`: a tested one is in
    that person's reach."""

    model_config = ConfigDict(extra="forbid")
    drive: Annotated[str, Field(max_length=60)]
    motor: Annotated[str, Field(max_length=60)]
    repeat: Annotated[int, Field(ge=1, le=MOST_REPEATS)] = REPEATS
    pause_s: Annotated[float | None, Field(ge=0.0, le=3600.0)] = None
    write_back: bool = False
    hardwired_stop: bool = False
    confirm: Literal[True]


class Answer(BaseModel):
    """To question `number` of the run."""

    model_config = ConfigDict(extra="forbid")
    number: Annotated[int, Field(ge=1, le=10_000)]
    done: bool


@router.post("/api/tunings", status_code=201)
async def start(request: Request, wish: TuneWish, who: Operator) -> Begun:
    """Lets the drive energise the motor by its own tuning. 409 names who has the drive."""
    run = await start_tuning(parts_of(request), wish, who)
    return {"id": run.id, "url": f"/runs/{run.id}"}


async def start_tuning(parts: Parts, wish: TuneWish, who: Visitor) -> LiveRun:
    """The tuning, begun."""
    drive, motor = parts.library.drive(wish.drive), parts.library.motor(wish.motor)
    verb = ["tune", "--repeat", str(wish.repeat), *([] if wish.pause_s is None else ["--pause", f"{wish.pause_s:g}"])]
    verb += ["--write-back"] if wish.write_back else []
    verb += ["--hardwired-stop"] if wish.hardwired_stop else []
    return await begin(parts, drive, motor, verb, who, write_back=wish.write_back, tune=wish.repeat)


@router.post("/api/runs/{run}/answer")
async def answer(request: Request, run: str, said: Answer, who: Operator) -> Answered:
    """What the person at the drive has done, or not. 409: that question is not asked."""
    await give_answer(parts_of(request), run, said, who)
    return {"run": run, "number": said.number, "done": said.done}


async def give_answer(parts: Parts, run: str, said: Answer, who: Visitor) -> None:
    """The answer, to the process of the run; the audit has it before."""
    live = parts.desk.runs.get(run)
    asked = live.feed.state.tuning and live.feed.state.tuning.question if live is not None else None
    if live is None or live.child is None or live.is_over or not asked or asked["number"] != said.number:
        raise Refusal(
            409,
            "this is not asked now",
            step="answer",
            value=said.number,
            limit=asked["number"] if asked else "no question",
            remedy="look at the run's page",
        )
    what = "done at the drive" if said.done else "not done at the drive"
    await parts.note(who, what, run=run, reason=str(asked["text"]))
    live.child.answer(said.number, is_done=said.done)
