"""STOP, by WebSocket, POST and plain form; and who operates a drive."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import Annotated, Literal

from fastapi import APIRouter, Depends, Request, WebSocket, WebSocketDisconnect
from fastapi.responses import RedirectResponse, Response
from pydantic import BaseModel, ConfigDict
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, HTTPConnection

from commissioner.encoding import JsonObject, read_json
from commissioner.service.access.accounts import Role
from commissioner.service.access.pages import came_from
from commissioner.service.access.visitor import Visitor
from commissioner.service.access.visitors import Operator, parts_of, visitor_of
from commissioner.service.contract.description import Typed
from commissioner.service.contract.drives import ControlDocument
from commissioner.service.contract.runs import Stopped, StopsDocument
from commissioner.service.page.band import Place, band_of
from commissioner.service.page.texts import texts_of, told
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.runs.control import Party
from commissioner.service.runs.desk import LiveRun
from commissioner.service.runs.feed import Feed, Message

router = APIRouter(route_class=Typed)
BAND_S, BAND_BESIDE_NUMBERS_S = 0.4, 0.8
"""The band is sent anew so often: its age must not be older than a second, and a page hears of its service by it where no run's numbers
come."""
UNKNOWN = "somebody at a page"
WORDS_S = 0.2
"""So long a STOP waits for the reason that its request announced; a body of so few bytes comes with its head."""


class StopWish(BaseModel):
    """Why; may stay empty."""

    reason: str = ""


_MAY_SAY_WHY = {"requestBody": {"content": {"application/json": {"schema": StopWish.model_json_schema()}}}}


async def _why(request: Request) -> str:
    """The reason where the body says one: a STOP is never refused for its words, nor waits for the rest of them."""
    with contextlib.suppress(ValueError, ClientDisconnect, TimeoutError):
        said = read_json(await asyncio.wait_for(request.body(), WORDS_S))
        return str(said.get("reason") or "")[:300] if isinstance(said, dict) else ""
    return ""


Why = Annotated[str, Depends(_why)]


async def _target(request: Request) -> tuple[str, str]:
    """Run and drive that a form names; both empty, which stops everything, where it does not come whole or cannot be read."""
    with contextlib.suppress(ValueError, HTTPException, ClientDisconnect, TimeoutError):
        form = await asyncio.wait_for(request.form(), WORDS_S)
        run, drive = (str(form.get(name) or "") for name in ("run", "drive"))
        return run[:200], drive[:60]
    return "", ""


Target = Annotated[tuple[str, str], Depends(_target)]


class ControlWish(BaseModel):
    """ask | grant | refuse | release."""

    model_config = ConfigDict(extra="forbid")
    do: Literal["ask", "grant", "refuse", "release"]


async def stop_runs(connection: HTTPConnection, reason: str, how: str, run: str = "", drive: str = "") -> list[Stopped]:
    """STOP for one run, one drive, or everything here. Needs no log-in; asked before anything is written down."""
    parts, who = parts_of(connection), visitor_of(connection)
    person = who.person or UNKNOWN
    live = parts.desk.runs.get(run)
    word = reason or f"STOP ({how})"
    if live is not None:
        stopped = [await parts.desk.stop(live, person, word)]
    else:
        stopped = await parts.desk.stop_all(person, word, drive or None)
    if parts.stop_tries.wait_s(who.address) == 0.0:
        parts.stop_tries.count(who.address)
        with contextlib.suppress(OSError):
            named = ", ".join(one.run for one in stopped) or "nothing was running"
            await asyncio.to_thread(
                parts.audit.write,
                person,
                who.address,
                "STOP",
                by=how,
                run=named,
                reason=reason,
                zero_volts=all(one.zero_volts for one in stopped),
            )
    return stopped


@router.post("/api/runs/{run}/stop", openapi_extra=_MAY_SAY_WHY)
async def stop(request: Request, run: str, why: Why) -> Stopped:
    """The operator's stop. 200 says when the drive confirmed zero volts; 502: it did not. Needs no log-in."""
    parts = parts_of(request)
    if run not in parts.desk.runs:
        parts.archive.find(run)
        return Stopped(run, None, True, None, 0.0, "ended before")
    stopped = await stop_runs(request, why, "POST", run)
    _check_confirmed(stopped)
    return stopped[0]


@router.post("/api/stop", openapi_extra=_MAY_SAY_WHY)
async def stop_everything(request: Request, why: Why) -> StopsDocument:
    """STOP for every run of this service, also one that is only starting. Needs no log-in."""
    stopped = await stop_runs(request, why, "POST")
    _check_confirmed(stopped)
    return {"stopped": stopped}


@router.post("/stop", include_in_schema=False)
async def stop_by_form(request: Request, target: Target) -> Response:
    """The same from a page without script; back to where it came from."""
    await stop_runs(request, "", "form", *target)
    return RedirectResponse(came_from(request), 303)


def _check_confirmed(stopped: list[Stopped]) -> None:
    silent = [one for one in stopped if not one.zero_volts]
    if silent:
        raise Refusal(
            502,
            "STOP was sent; the drive has not confirmed that its output is off",
            step="stop",
            value=silent[0].state or "no word",
            limit="a status that says so",
            remedy="take the motor as live: use the emergency stop, then isolate the drive's supply",
        )


@router.post("/api/drives/{drive}/control")
async def control(request: Request, drive: str, wish: ControlWish, who: Operator) -> ControlDocument:
    """Ask for control of a drive, or answer who asks."""
    parts = parts_of(request)
    parts.library.drive(drive)
    return change_control(parts, drive, wish.do, who.party)


def change_control(parts: Parts, drive: str, do: str, party: Party) -> ControlDocument:
    """What there is to control, after the wish was granted or not."""
    held = parts.desk.control(drive)
    if do == "ask":
        held.ask(party)
    elif do == "release" and held.is_held_by(party) and parts.desk.live_on(drive) is None:
        held.release()
    elif do in ("grant", "refuse"):
        held.answer(party, grants=do == "grant")
    asking = held.asking
    return {
        "holder": held.holder.person if held.holder else None,
        "asking": asking.person if asking else None,
        "you": held.is_held_by(party),
        "wait_s": round(held.wait_s, 1),
    }


@router.websocket("/api/runs/{run}/control")
async def run_socket(socket: WebSocket, run: str) -> None:
    """A page at a run, or a script: `{"stop": reason}` stops it."""
    await _Socket(socket, run, socket.query_params.get("drive", "")).serve()


@router.websocket("/api/control")
async def page_socket(socket: WebSocket) -> None:
    """Any other page: the band of its drive, and STOP for what goes on."""
    await _Socket(socket, "", socket.query_params.get("drive", "")).serve()


def _together(messages: list[Message]) -> Iterator[str]:
    """As few documents as hold them in their order, each kind once in one."""
    parts = dict[str, str]()
    for message in messages:
        if message.event in parts:
            yield _document(parts)
            parts = {}
        parts[message.event] = message.text
    if parts:
        yield _document(parts)


def _document(parts: dict[str, str]) -> str:
    return "{" + ",".join(f'"{event}":{text}' for event, text in parts.items()) + "}"


class _Socket:
    """One page's line to the service: the band and the numbers out, STOP and control in."""

    def __init__(self, socket: WebSocket, run: str, drive: str) -> None:
        self._socket, self._run, self._drive = socket, run[:200], drive[:60]
        self._parts = parts_of(socket)
        self._sending = asyncio.Lock()
        self._has_numbers = False

    @property
    def _who(self) -> Visitor:
        """Now: a session may have ended since the page was opened, and an account may be gone."""
        return visitor_of(self._socket, is_busy=False)

    async def serve(self) -> None:
        await self._socket.accept()
        who = self._who
        session = who.session.id if who.session else ""
        pages = self._parts.desk.pages
        if session:
            pages.opened(session)
        sending = [asyncio.create_task(self._send_band()), asyncio.create_task(self._send_numbers())]
        closing = asyncio.create_task(self._parts.closing.wait())
        hearing = asyncio.create_task(self._hear())
        try:
            await asyncio.wait([closing, hearing], return_when=asyncio.FIRST_COMPLETED)
        finally:
            if session:
                pages.closed(session)
            for task in (*sending, closing, hearing):
                task.cancel()
            await asyncio.gather(*sending, closing, hearing, return_exceptions=True)
            with contextlib.suppress(Exception):
                await self._socket.close(1012 if self._parts.closing.is_set() else 1000)

    async def _hear(self) -> None:
        with contextlib.suppress(WebSocketDisconnect):
            while True:
                text = await self._socket.receive_text()
                visitor_of(self._socket)
                with contextlib.suppress(ValueError):
                    said = read_json(text)
                    if isinstance(said, dict):
                        await self._take(said)

    async def _take(self, said: JsonObject) -> None:
        if "stop" in said:
            run = self._run or str(said.get("run") or "")
            stopped = await stop_runs(self._socket, str(said["stop"] or "")[:300], "WebSocket", run, self._drive)
            await self._send({"stopped": [asdict(one) for one in stopped]})
        elif "control" in said:
            try:
                await self._change_control(str(said["control"]))
            except Refusal as refusal:
                answer = told(refusal, texts_of(self._socket))
                await self._send({"refused": answer.problem.model_dump(mode="json")})

    async def _change_control(self, do: str) -> None:
        live = self._parts.desk.runs.get(self._run)
        drive = self._drive or (live.drive if live else "")
        who = self._who
        if who.may(Role.OPERATOR) and drive and do in ("ask", "grant", "refuse", "release"):
            await self._send({"control": change_control(self._parts, drive, do, who.party)})

    async def _send(self, document: Mapping[str, object] | str) -> None:
        text = document if isinstance(document, str) else json.dumps(document, separators=(",", ":"))
        async with self._sending:
            with contextlib.suppress(Exception):
                await self._socket.send_text(text)

    async def _send_band(self) -> None:
        texts = texts_of(self._socket)
        while True:
            band = band_of(self._parts, self._who, Place(self._run, self._drive), texts)
            await self._send({"band": asdict(band)})
            await asyncio.sleep(BAND_BESIDE_NUMBERS_S if self._has_numbers else BAND_S)

    async def _send_numbers(self) -> None:
        feed = await self._feed()
        if feed is None or not self._who.may(Role.VIEWER):
            return
        await self._send({"history": feed.state.history})
        with feed.watch(is_page=True) as watcher:
            is_over, self._has_numbers = False, True
            while not watcher.is_lost and not is_over and self._who.may(Role.VIEWER):
                taken = await watcher.take()
                is_over = taken[-1] is None
                for text in _together([message for message in taken if message is not None]):
                    await self._send(text)
        self._has_numbers = False
        await self._send({"over": True})

    async def _feed(self) -> Feed | None:
        """Of the run, once the service knows it."""
        if not self._run:
            return None
        for _ in range(30):
            live: LiveRun | None = self._parts.desk.runs.get(self._run)
            if live is not None:
                return None if live.is_over else live.feed
            await asyncio.sleep(0.1)
        return None
