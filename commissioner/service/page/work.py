"""The pages of the work, in its order: start, motor, checks, what will happen, run, write-back, restore."""

from __future__ import annotations

import asyncio
import contextlib
import re
import unicodedata
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, Response
from jinja2 import UndefinedError
from pydantic import ValidationError

from commissioner.errors import CommissionerError
from commissioner.report.run.standing import Held
from commissioner.report.sheet.marks import capitalised
from commissioner.report.sheet.words import typeset
from commissioner.run.archive.documents import damaged, identified, origin_of
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.verify import losses_at_sight
from commissioner.service.access.accounts import Role
from commissioner.service.access.visitors import parts_of
from commissioner.service.configuration import DriveTable
from commissioner.service.contract.plates import JudgedPlate, SaidPlate
from commissioner.service.library import OF_INERTIA, PLATE_FIELDS, SIMULATOR, Drive, Motor, judge_plate, number_of
from commissioner.service.page.band import Place
from commissioner.service.page.frame import View, enter, enter_form, go, refused, render
from commissioner.service.page.hold import NOT_MEANT, is_meant, to_the_run
from commissioner.service.page.texts import UNIT_SIGNS, Texts, texts_of
from commissioner.service.page.tuning import call_of, tuned_page, tuning_of, tuning_page
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.routes.checks import make_checks
from commissioner.service.routes.library import start_simulator
from commissioner.service.routes.runs import RunWish, start_run
from commissioner.service.routes.write import Act, act, plan
from commissioner.service.runs.control import Party
from commissioner.service.runs.feed import whole
from commissioner.service.runs.live import live_document
from commissioner.service.simulator import SCENARIOS
from commissioner.settings import MotorFile
from commissioner.validation import first_problem

router = APIRouter()
START = View("work/start.html", "What do you want to measure?", 1)
MOTOR = View("work/motor.html", "What does the nameplate say?", 2)
CHECKS = View("work/checks.html", "May this motor be energised?", 3)
ENERGISE = View("work/energise.html", "What will happen to the motor", 4)
LIVE = View("work/live.html", "Test in progress", 5)
ENDED = View("work/ended.html", "The run has ended", 5)
RESULT = View("work/result.html", "Result", 6)
DONE = replace(RESULT, step=8)
WRITE = View("work/write.html", "What would be written into the drive", 7)
JOURNALLED: Mapping[Act, str] = {"write-back": "parameters_written", "restore": "snapshot_restored"}
"""Records of a run's journal that say what was written into its drive."""
LEFT: Mapping[Act, Held] = {"write-back": Held.NEW, "restore": Held.RESTORED}
"""What the drive holds after each."""
WRITTEN = View("work/written.html", "Written, read back and stored", 8)


@router.get("/")
async def start(request: Request) -> Response:
    """Where to begin: a drive, the simulator, a recording."""
    enter(request)
    parts = parts_of(request)
    drives = [drive for drive in parts.library.drives() if drive.id != SIMULATOR]
    newest = await asyncio.to_thread(lambda: parts.archive.entries(limit=8))
    live = parts.desk.without_result()
    open_ends = await asyncio.to_thread(parts.archive.open_ends)
    return render(
        request,
        START,
        drives=drives,
        newest=newest,
        live=live,
        open_ends=[entry for entry in open_ends if entry.run not in {run.id for run in parts.desk.live()}],
        scenarios=SCENARIOS,
        profiles=parts.library.profiles(),
        scenario=parts.simulator.scenario,
        motors=parts.library.motors(),
    )


@router.post("/simulator")
async def simulator(request: Request) -> Response:
    """Try it without a drive."""
    who, fields = await enter_form(request)
    await start_simulator(request, fields.get("scenario", "default"), who)
    return go(f"/drives/{SIMULATOR}")


@router.post("/drives")
async def add_drive(request: Request) -> Response:
    """Keep a drive, then its motor."""
    who, fields = await enter_form(request)
    parts = parts_of(request)
    name = fields.get("name", "").strip()
    table = _drive_table(parts, name, fields)
    parts.library.add_drive(table)
    await parts.note(who, "added a drive", drive=table.id)
    return go(f"/drives/{table.id}")


def _drive_table(parts: Parts, name: str, fields: dict[str, str]) -> DriveTable:
    identifier = _slug(name, {drive.id for drive in parts.library.drives()})
    try:
        return DriveTable(
            id=identifier, name=name, url=fields.get("url", "").strip(), profile=fields.get("profile", "")
        )
    except ValidationError as error:
        problem = first_problem(error, DriveTable)
        raise Refusal(
            422,
            f"{problem.key} cannot be used",
            step="add a drive",
            value=str(problem.value)[:100],
            limit=problem.expected,
            remedy=f"correct {problem.key}",
        ) from error


@router.get("/drives/{drive}")
async def motor(request: Request, drive: str, motor: str = "") -> Response:
    """The nameplate, as a form."""
    enter(request, Role.OPERATOR)
    parts = parts_of(request)
    known = parts.library.drive(drive)
    chosen = next((m for m in parts.library.motors() if m.id == motor), None) or parts.library.motors()[0]
    texts = texts_of(request)
    values = {key: _typed(value, texts) for key, value in asdict(chosen.plate).items()}
    values["rated_power_kw"] = texts.typed(chosen.plate.rated_power_w / 1000)
    return _motor_page(request, known, chosen, values, judge_plate(asdict(chosen.plate)), chosen.name)


def _motor_page(
    request: Request,
    drive: Drive,
    chosen: Motor | None,
    values: dict[str, str],
    judged: JudgedPlate,
    name: str,
    status: int = 200,
) -> Response:
    return render(
        request,
        MOTOR,
        Place(drive=drive.id),
        status=status,
        drive=drive,
        chosen=chosen,
        values=values,
        judged=judged,
        said=say_plate(judged, texts_of(request)),
        motors=parts_of(request).library.motors(),
        name=name,
    )


def say_plate(judged: JudgedPlate, t: Texts) -> SaidPlate:
    """A judged plate in words: per field what is wrong and what to do, then what the whole plate means."""
    fields = {
        key: "" if field["ok"] else typeset(f"{capitalised(t.tell(field['what']))}: {t.tell(field['remedy'])}")
        for key, field in judged["fields"].items()
    }
    if judged["efficiency"] is None or judged["usual_efficiency"] is None:
        return {"ok": False, "fields": fields, "verdict": "", "reason": "", "is_odd": False}
    eta, is_odd = t.number(100 * judged["efficiency"], 1, "%"), bool(judged["questions"])
    if is_odd:
        reason = " ".join(
            t.tell(question) if question == OF_INERTIA
            else t.say("It implies an efficiency of %(eta)s: %(question)s", eta=eta, question=t.tell(question))
            for question in judged["questions"]
        )  # fmt: skip
        reason = typeset(capitalised(reason))
    else:
        low, high = judged["usual_efficiency"]
        reason = " ".join(
            (
                t.say("The plate means an efficiency of %(eta)s.", eta=eta),
                t.say(
                    "Motors of this size have %(low)s … %(high)s.",
                    low=t.number(100 * low, 0),
                    high=t.number(100 * high, 0, "%"),
                ),
            )
        )
    verdict = t.gettext("Is this plate read right?" if is_odd else "Plausible.")
    return {"ok": judged["ok"], "fields": fields, "verdict": verdict, "reason": reason, "is_odd": is_odd}


@router.post("/plate")
async def judge(request: Request) -> Response:
    """The form's plate as it is being typed, judged in the page's language: what `POST /api/nameplates/validate` finds."""
    _who, fields = await enter_form(request)
    return JSONResponse(say_plate(judge_plate(_si(_plate_values(fields))), texts_of(request)))


def _plate_values(fields: dict[str, str]) -> dict[str, str]:
    return {key: fields.get(key, "").strip() for key in (*PLATE_FIELDS, "rated_power_kw")}


@router.post("/drives/{drive}/motor")
async def take_motor(request: Request, drive: str) -> Response:
    """Keep the plate, then check the drive: the next page is the answer."""
    who, fields = await enter_form(request)
    parts = parts_of(request)
    known = parts.library.drive(drive)
    values = _plate_values(fields)
    judged = judge_plate(_si(values))
    name = fields.get("name", "").strip()[:80]
    if not judged["ok"]:
        return _motor_page(request, known, None, values, judged, name, 422)
    chosen = _kept(parts, fields.get("known", ""), name, values)
    return await _checked(request, parts, known, chosen, who.party)


def _si(values: dict[str, str]) -> dict[str, Any]:
    """The form in the plate's own keys: power from kilowatts to watts."""
    plate: dict[str, Any] = {key: value for key, value in values.items() if key in PLATE_FIELDS and value != ""}
    text = values.get("rated_power_kw", "").replace(",", ".").strip()
    try:
        plate["rated_power_w"] = float(f"{1000 * float(text):.10g}")
    except ValueError:
        plate["rated_power_w"] = text
    return plate


def _kept(parts: Parts, known: str, name: str, values: dict[str, str]) -> Motor:
    """The motor of the form: a known one where nothing differs, else kept under its name."""
    table = MotorFile.model_validate({key: number_of(value) for key, value in _si(values).items()} | {"name": name})
    found = next((m for m in parts.library.motors() if m.id == known), None)
    plate = table.model_dump(exclude={"name"})
    if found is not None and plate == asdict(found.plate) and name in ("", found.name):
        return found
    if found is not None and found.origin == "added" and name == found.name:
        return parts.library.put_motor(found.id, table)
    identifier = _slug(name, {m.id for m in parts.library.motors()})
    return parts.library.put_motor(identifier, table)


async def _checked(request: Request, parts: Parts, drive: Drive, motor: Motor, party: Party) -> Response:
    """The checks, made now; the page that shows them. A drive that does not answer is shown as what it is."""
    place, back = Place(drive=drive.id), f"/drives/{drive.id}?motor={motor.id}"
    try:
        parts.desk.control(drive.id).take(party)
        await make_checks(parts, drive, motor)
    except Refusal as refusal:
        return refused(request, refusal, place, back)
    return go(f"/drives/{drive.id}/checks?motor={motor.id}")


@router.post("/drives/{drive}/checks")
async def check_again(request: Request, drive: str) -> Response:
    """The same checks once more."""
    who, fields = await enter_form(request)
    parts = parts_of(request)
    motor = parts.library.motor(fields.get("motor", ""))
    return await _checked(request, parts, parts.library.drive(drive), motor, who.party)


@router.get("/drives/{drive}/checks")
async def checks(request: Request, drive: str, motor: str = "") -> Response:
    """What was seen, with the time; exceptions first."""
    enter(request, Role.OPERATOR)
    parts = parts_of(request)
    if not motor:
        return go(f"/drives/{drive}")
    known, chosen = parts.library.drive(drive), parts.library.motor(motor)
    document = parts.checks.get(f"{known.id} {chosen.id}")
    if document is None:
        return go(f"/drives/{known.id}?motor={chosen.id}")
    return render(
        request,
        CHECKS,
        Place(drive=known.id),
        drive=known,
        motor=chosen,
        document=document,
        tuning=tuning_of(known),
        call=call_of(known, chosen),
    )


@router.get("/drives/{drive}/energise")
async def energise(request: Request, drive: str, motor: str = "") -> Response:
    """What will happen to the motor, in volts, amperes and seconds; then the button to hold."""
    enter(request, Role.OPERATOR)
    parts = parts_of(request)
    if not motor:
        return go(f"/drives/{drive}")
    return _energise_page(request, parts.library.drive(drive), parts.library.motor(motor))


def _energise_page(request: Request, drive: Drive, motor: Motor, message: str = "", status: int = 200) -> Response:
    parts = parts_of(request)
    document = parts.checks.get(f"{drive.id} {motor.id}")
    if document is None or document["outcome"] != "passed" or not document.get("limits"):
        return go(f"/drives/{drive.id}/checks?motor={motor.id}")
    return render(
        request,
        ENERGISE,
        Place(drive=drive.id),
        status=status,
        drive=drive,
        motor=motor,
        limits=document["limits"],
        document=document,
        message=message,
        page_lost_s=parts.settings.file.service.page_lost_s,
    )


@router.post("/drives/{drive}/energise")
async def do_energise(request: Request, drive: str) -> Response:
    """The button was held."""
    who, fields = await enter_form(request)
    parts = parts_of(request)
    known, motor = parts.library.drive(drive), parts.library.motor(fields.get("motor", ""))
    if not is_meant(fields, motor):
        return _energise_page(request, known, motor, NOT_MEANT, 422)
    wish = RunWish(drive=known.id, motor=motor.id, write_back=fields.get("write_back") == "yes", confirm=True)
    return await to_the_run(request, start_run(parts, wish, who), known, motor)


@router.get("/runs/{run}")
async def run(request: Request, run: str) -> Response:
    """A run, whatever state it is in."""
    enter(request)
    parts = parts_of(request)
    live = parts.desk.runs.get(run)
    if live is not None and not live.has_result:
        state = live.feed.state
        if (page := tuning_page(request, live)) is not None:
            return page
        document = live_document(state, live.feed.current_now_a)
        return render(request, LIVE, Place(run=run, drive=live.drive), state=state, live=document, run=live)
    if live is not None and not live.feed.folder.is_dir():
        raise _gone(run)
    entry = parts.archive.find(run)
    asked = parts.archive.request(run)
    result: Mapping[str, Any] = parts.archive.result(run)
    place = Place(run=run, drive=str(origin_of(asked).get("drive", "")))
    state = live.feed.state if live is not None else whole(entry.folder).state
    is_over = live is None or live.is_over
    facts: dict[str, Any] = {
        "entry": entry,
        "result": result,
        "asked": asked,
        "state": state,
        "is_diagnosing": not is_over,
        "losses": await asyncio.to_thread(losses_at_sight, entry.folder) if is_over else (),
        "has_report": (entry.folder / "report.html").is_file(),
        "later": await asyncio.to_thread(parts.archive.written_later, entry),
    }
    try:
        return _ended_page(request, place, facts)
    except (TypeError, ValueError, LookupError, AttributeError, ArithmeticError, UndefinedError) as error:
        raise damaged(entry.folder, "result.json", str(error)) from error


def _gone(run: str) -> Refusal:
    """Of a run of this service whose folder somebody took away while it was at work, or with a disk that was unplugged."""
    return Refusal(
        404, f"the folder of {run} is gone", step="archive", value="no folder", limit="the folder that the run wrote into",
        remedy="bring the disk or the folder back and load this page again; else what it measured is lost: check the drive and start anew",
    )  # fmt: skip


def _ended_page(request: Request, place: Place, facts: Mapping[str, Any]) -> Response:
    entry, result = facts["entry"], facts["result"]
    if (result.get("tune") or {}).get("rows"):
        return tuned_page(request, place, **facts)
    if identified(result) is not None and entry.outcome in ("commissioned", "rejected"):
        return render(request, DONE if entry.standing.is_written else RESULT, place, **facts)
    return render(request, ENDED, place, **facts)


@router.get("/runs/{run}/write-back")
async def write_back_table(request: Request, run: str) -> Response:
    """What the run learnt: register, now, will be."""
    return await _table(request, run, "write-back")


@router.get("/runs/{run}/restore")
async def restore_table(request: Request, run: str) -> Response:
    """What the run found there: register, now, will be."""
    return await _table(request, run, "restore")


@router.post("/runs/{run}/write-back")
async def write_back(request: Request, run: str) -> Response:
    """It was agreed to."""
    return await _written(request, run, "write-back")


@router.post("/runs/{run}/restore")
async def restore(request: Request, run: str) -> Response:
    """It was agreed to."""
    return await _written(request, run, "restore")


async def _table(request: Request, run: str, what: Act) -> Response:
    """The table is the question."""
    enter(request, Role.OPERATOR)
    parts = parts_of(request)
    place = _place(parts, run)
    if what == "write-back" and parts.archive.find(run).standing.is_written:
        return go(f"/runs/{run}/{what}/done")
    try:
        table = await plan(parts, run, what)
    except Refusal as refusal:
        return refused(request, refusal, place, f"/runs/{run}")
    return render(request, WRITE, place, run=run, what=what, table=table)


async def _written(request: Request, run: str, what: Act) -> Response:
    who, fields = await enter_form(request)
    parts = parts_of(request)
    place = _place(parts, run)
    try:
        await act(parts, run, what, fields.get("token", ""), who)
    except Refusal as refusal:
        is_open = await asyncio.to_thread(lambda: parts.archive.find(run).is_unknown)
        return refused(request, refusal, place, f"/runs/{run}" if is_open else f"/runs/{run}/{what}", restore=is_open)
    return go(f"/runs/{run}/{what}/done")


@router.get("/runs/{run}/{what}/done")
async def written(request: Request, run: str, what: Act) -> Response:
    """What was written last, as the run's journal has it: looked at again, nothing is written again."""
    enter(request)
    parts = parts_of(request)
    entry = parts.archive.find(run)
    lines = await asyncio.to_thread(read_journal, entry.folder / "journal.jsonl")
    done = next((line for line in reversed(lines) if line["kind"] == JOURNALLED[what]), None)
    if done is None:
        return go(f"/runs/{run}")
    return render(
        request,
        WRITTEN,
        _place(parts, run),
        run=run,
        what=what,
        done=done["record"],
        units=await asyncio.to_thread(_units, parts, run),
        written_utc=done["utc"],
        since="" if entry.held is LEFT[what] else entry.written,
        later=await asyncio.to_thread(parts.archive.written_later, entry),
        motor=str(origin_of(parts.archive.request(run)).get("motor", "")),
    )


def _units(parts: Parts, run: str) -> dict[str, str]:
    """Of the drive's items by the drive file as the run had it, in the signs of a page; empty where none is kept."""
    from commissioner.operations.write import RunRequest, items_of  # late: numpy

    items: Mapping[str, Any] = {}
    with contextlib.suppress(CommissionerError):
        items = items_of(RunRequest(parts.archive.root, run))
    return {name: UNIT_SIGNS.get(item.unit, item.unit) for name, item in items.items()}


def _place(parts: Parts, run: str) -> Place:
    return Place(run=run, drive=str(origin_of(parts.archive.request(run)).get("drive", "")))


_SPELT = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss", "ø": "oe", "å": "aa", "æ": "ae", "ł": "l"})


def _slug(name: str, taken: set[str]) -> str:
    """An id from a name that a person gave, not taken yet."""
    spelt = unicodedata.normalize("NFKD", name.lower().translate(_SPELT)).encode("ascii", "ignore").decode("ascii")
    plain = re.sub(r"[^a-z0-9]+", "_", spelt).strip("_")[:30].strip("_") or "motor"
    return next(one for one in (plain, *(f"{plain}_{k}" for k in range(2, 1000))) if one not in taken)


def _typed(value: float | str | None, texts: Texts) -> str:
    """A value of the plate as it stands in its field."""
    return texts.typed(value) if isinstance(value, int | float) else value or ""
