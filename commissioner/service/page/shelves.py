"""The pages beside the work: archive, compare, trend, report, recordings, audit, log-in, language and appearance."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, File, Form, Request
from fastapi.responses import Response
from pydantic import ValidationError

from commissioner.report.run.standing import Standing
from commissioner.service.access.accounts import Role
from commissioner.service.access.pages import local
from commissioner.service.access.visitor import check_token
from commissioner.service.access.visitors import COOKIE, parts_of
from commissioner.service.page.band import Place
from commissioner.service.page.frame import View, enter, enter_form, go, refused, remember, render
from commissioner.service.problems import Refusal
from commissioner.service.routes.access import Credentials, log_in, log_out, set_cookie
from commissioner.service.routes.history import compared, trend_of
from commissioner.service.routes.recordings import MOST, Files, take

router = APIRouter()
ARCHIVE = View("shelves/archive.html", "Archive", nav="archive")
COMPARE = View("shelves/compare.html", "Which parameter moved?", nav="archive")
TREND = View("shelves/trend.html", "A motor over the years", nav="archive")
REPORT = View("shelves/report.html", "Report", nav="archive")
RECORDING = View("shelves/recording.html", "Recording", nav="commission")
AUDIT = View("frame/audit.html", "Audit", nav="audit")
LOGIN = View("frame/login.html", "Log in", nav="")


@router.get("/runs")
async def archive(request: Request, motor: str = "", outcome: str = "", since: str = "", limit: int = 100) -> Response:
    """The list with its filters."""
    enter(request)
    parts = parts_of(request)
    limit = max(1, min(limit, 1000))
    found = await asyncio.to_thread(
        lambda: parts.archive.entries(motor=motor[:80], outcome=outcome[:40], since=since[:32], limit=limit)
    )
    live = {run.id for run in parts.desk.without_result()}
    return render(
        request, ARCHIVE, found=found, live=live, motor=motor[:80], outcome=outcome[:40], since=since[:32], limit=limit,
        standings=list(Standing),
    )  # fmt: skip


@router.get("/compare")
async def compare(request: Request, run: list[str] | None = None) -> Response:
    """Two runs beside each other."""
    enter(request)
    parts = parts_of(request)
    chosen = request.query_params.getlist("run")
    if len(chosen) != 2:
        refusal = Refusal(
            422,
            "two runs are compared",
            step="compare",
            value=f"{len(chosen)} chosen",
            limit="2",
            remedy="choose two runs in the archive",
        )
        return refused(request, refusal, back="/runs")
    document = await compared(parts, *chosen)
    before, after = parts.archive.find(document["before"]), parts.archive.find(document["after"])
    return render(request, COMPARE, document=document, before=before, after=after)


@router.get("/motors/{motor}/trend")
async def trend(request: Request, motor: str) -> Response:
    """Every parameter of a motor with its intervals, over time."""
    enter(request)
    document = await asyncio.to_thread(trend_of, parts_of(request), motor)
    return render(request, TREND, motor=motor, document=document)


@router.get("/runs/{run}/report")
async def report(request: Request, run: str) -> Response:
    """The report inside the page, so that STOP stays in view."""
    enter(request)
    entry = parts_of(request).archive.find(run)
    return render(request, REPORT, Place(), run=entry.run, source=f"/api/runs/{entry.run}/report")


@router.post("/recordings")
async def recordings(
    request: Request,
    files: Annotated[Files, File(max_length=MOST)],
    verb: Annotated[str, Form()] = "identify",
    motor: Annotated[str, Form()] = "",
    csrf: Annotated[str, Form()] = "",
) -> Response:
    """Files from the form or dropped on it."""
    who = enter(request, Role.OPERATOR)
    check_token(who, csrf)
    job = await take(parts_of(request), [file for file in files if file.filename], verb, motor)
    return go(f"/recordings/{job.id}")


@router.get("/recordings/{recording}")
async def recording(request: Request, recording: str) -> Response:
    """How far it is, then the answer and its pictures."""
    enter(request)
    job = parts_of(request).recordings.find(recording)
    response = render(request, RECORDING, job=job, document=job.document)
    if not job.is_done:
        response.headers["refresh"] = "2"
    return response


@router.get("/audit")
async def audit(request: Request, limit: int = 200) -> Response:
    """Who did what; the chain verified."""
    enter(request, Role.OPERATOR)
    parts = parts_of(request)
    chain = await asyncio.to_thread(parts.audit.verify)
    entries = await asyncio.to_thread(parts.audit.newest, max(1, min(limit, 2000)))
    return render(request, AUDIT, chain=chain, entries=entries)


@router.get("/login")
async def login(request: Request, next: str = "/") -> Response:
    """Name and password. STOP works without."""
    return render(request, LOGIN, message="", next=local(next), name="")


@router.post("/login")
async def do_login(request: Request) -> Response:
    form = await request.form(max_files=0, max_fields=10)
    name, password, back = (str(form.get(key, "")) for key in ("name", "password", "next"))
    try:
        session = await log_in(request, Credentials(name=name, password=password))
    except ValidationError:
        return render(
            request, LOGIN, status=422, message="name or password is too long", next=local(back), name=name[:40]
        )
    except Refusal as refusal:
        problem = refusal.problem
        return render(request, LOGIN, status=problem.status, message=problem.title, next=local(back), name=name[:40])
    response = go(back or "/")
    set_cookie(parts_of(request), response, session)
    return response


@router.post("/logout")
async def logout(request: Request) -> Response:
    who, _fields = await enter_form(request, Role.VIEWER)
    await log_out(parts_of(request), who)
    response = go("/login")
    response.delete_cookie(COOKIE, path="/")
    return response


@router.post("/appearance")
async def appearance(request: Request) -> Response:
    """Language, light or dark; remembered by the browser."""
    form = await request.form(max_files=0, max_fields=10)
    fields = {key: value for key, value in form.items() if isinstance(value, str)}
    response = go(fields.get("back", "/"))
    remember(response, fields)
    return response
