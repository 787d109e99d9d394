"""The journal's records as server-sent events, resumable; the samples beside them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Request
from sse_starlette import EventSourceResponse, ServerSentEvent

from commissioner.service.access.visitors import Viewer, parts_of
from commissioner.service.contract.description import Typed, sends
from commissioner.service.parts import Parts
from commissioner.service.runs.feed import Feed, Message, whole

router = APIRouter(route_class=Typed)


@router.get("/api/runs/{run}/events", response_class=EventSourceResponse, responses=sends("text/event-stream"))
async def events(
    request: Request, run: str, _who: Viewer, last_event_id: Annotated[str, Header(max_length=20)] = ""
) -> EventSourceResponse:
    """Every record of the run from its begin, or after `Last-Event-ID`; `samples` while it lives; `end` when it is over."""
    parts = parts_of(request)
    after = int(last_event_id) if last_event_id.isascii() and last_event_id.isdigit() else -1
    live = parts.desk.runs.get(run)
    feed = live.feed if live is not None else whole(parts.archive.find(run).folder)
    return EventSourceResponse(_stream(parts, feed, after), ping=5)


async def _stream(parts: Parts, feed: Feed, after: int) -> AsyncIterator[bytes]:
    closing = asyncio.create_task(parts.closing.wait())
    try:
        with feed.watch(after) as watcher:
            while not watcher.is_lost:
                taking = asyncio.create_task(watcher.take())
                try:
                    await asyncio.wait([taking, closing], return_when=asyncio.FIRST_COMPLETED)
                finally:
                    taking.cancel()  # where the reader has gone; one that is done stays so
                if closing.done():
                    return
                taken = taking.result()
                yield b"".join(map(_encoded, taken))
                if taken[-1] is None:
                    return
    finally:
        closing.cancel()


def _encoded(message: Message | None) -> bytes:
    if message is None:
        return ServerSentEvent(data="{}", event="end").encode()
    number = None if message.number is None else str(message.number)
    return ServerSentEvent(data=message.text, event=message.event, id=number).encode()
