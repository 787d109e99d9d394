"""Drives, motors, procedures, and the judgement of a nameplate."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from fastapi import APIRouter, Body, Request
from pydantic import BaseModel, ConfigDict

from commissioner.encoding import JsonObject
from commissioner.service.access.visitor import Visitor
from commissioner.service.access.visitors import Operator, Viewer, parts_of
from commissioner.service.configuration import DriveTable, Identifier
from commissioner.service.contract.description import Typed
from commissioner.service.contract.drives import (
    DrivesDocument,
    DriveStateDocument,
    MotorDocument,
    MotorsDocument,
    ProcedureDocument,
    ProceduresDocument,
)
from commissioner.service.contract.plates import JudgedPlate
from commissioner.service.library import SIMULATOR, Drive, Motor, Procedure, judge_plate, must_be_there
from commissioner.service.problems import Refusal
from commissioner.service.runs.watch import describe
from commissioner.service.simulator import SCENARIOS
from commissioner.settings import MotorFile, ProcedureFile, read_toml

router = APIRouter(route_class=Typed)


class NewMotor(MotorFile):
    """A motor's plate with the id under which it is kept."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    id: Identifier


class NewProcedure(BaseModel):
    """A procedure, as its file says it, with the id under which it is kept."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    id: Identifier
    procedure: ProcedureFile


class SimulatorWish(BaseModel):
    """Which simulated inverter is wanted."""

    model_config = ConfigDict(extra="forbid")
    scenario: str = "default"


@router.get("/api/drives")
async def drives(request: Request, _who: Viewer) -> DrivesDocument:
    """All drives; addresses without what is secret."""
    from commissioner.link.wire.url import without_secrets

    parts = parts_of(request)
    return {"drives": [replace(d, url=without_secrets(d.url)) for d in parts.library.drives()]}


@router.post("/api/drives", status_code=201)
async def add_drive(request: Request, table: DriveTable, who: Operator) -> Drive:
    """Check and keep a drive. It is not asked for yet: POST /api/checks does."""
    parts = parts_of(request)
    drive = parts.library.add_drive(table)
    await parts.note(who, "added a drive", drive=drive.id)
    return drive


@router.get("/api/drives/{drive}/state")
async def drive_state(request: Request, drive: str, _who: Viewer) -> DriveStateDocument:
    """The drive's own word while no run has it, and how old that is. The first call begins to look."""
    parts = parts_of(request)
    found = parts.library.drive(drive)
    must_be_there(found, "drive", "POST /api/simulator starts it")
    watch = parts.desk.watch(found)
    watch.want()
    live = parts.desk.live_on(found.id)
    return {**describe(watch.seen), "run": live.id if live else None}


@router.get("/api/motors")
async def motors(request: Request, _who: Viewer) -> MotorsDocument:
    """All motors with their plates."""
    return {"motors": [_motor(motor) for motor in parts_of(request).library.motors()]}


def _motor(motor: Motor) -> MotorDocument:
    return {"id": motor.id, "name": motor.name, "origin": motor.origin, "nameplate": motor.plate}


@router.post("/api/motors", status_code=201)
async def put_motor(request: Request, motor: NewMotor, _who: Operator) -> MotorDocument:
    """Check and keep a plate."""
    table = MotorFile(**motor.model_dump(exclude={"id"}))
    return _motor(parts_of(request).library.put_motor(motor.id, table))


@router.get("/api/procedures")
async def procedures(request: Request, _who: Viewer) -> ProceduresDocument:
    """The procedure that ships with the product, then added ones, as their files say."""
    return {"procedures": [_procedure(one) for one in parts_of(request).library.procedures()]}


def _procedure(one: Procedure) -> ProcedureDocument:
    return {"id": one.id, "origin": one.origin, "procedure": read_toml(one.path)}


@router.post("/api/procedures", status_code=201)
async def put_procedure(request: Request, new: NewProcedure, who: Operator) -> ProcedureDocument:
    """Check and keep a procedure; POST /api/runs takes its id."""
    parts = parts_of(request)
    kept = parts.library.put_procedure(new.id, new.procedure)
    await parts.note(who, "added a procedure", procedure=kept.id)
    return _procedure(kept)


@router.post("/api/nameplates/validate")
async def validate(plate: Annotated[JsonObject, Body()], _who: Viewer) -> JudgedPlate:
    """Per field: ok, or what is wrong and the remedy; then what the whole plate implies."""
    return judge_plate(plate)


@router.post("/api/simulator", status_code=201)
async def simulator(request: Request, wish: SimulatorWish, who: Operator) -> Drive:
    """Start the packaged simulator, or change what it is."""
    return await start_simulator(request, wish.scenario, who)


async def start_simulator(request: Request, scenario: str, who: Visitor) -> Drive:
    """The simulator's drive. Refusal where a run has it."""
    parts = parts_of(request)
    if scenario not in SCENARIOS:
        raise Refusal(
            422,
            "there is no such scenario",
            step="simulator",
            value=scenario[:40],
            limit=", ".join(SCENARIOS),
            remedy="choose one of these",
        )
    if parts.desk.live_on(SIMULATOR) or parts.desk.is_starting(SIMULATOR):
        raise Refusal(
            409,
            "the simulator is in use",
            step="simulator",
            value="a run goes on",
            limit="no run",
            remedy="wait for its end, or stop it",
        )
    is_new = not parts.simulator.is_running or parts.simulator.scenario != scenario
    await parts.simulator.start(scenario)
    if is_new:
        await parts.note(who, "started the simulator", scenario=scenario)
    return parts.library.drive(SIMULATOR)
