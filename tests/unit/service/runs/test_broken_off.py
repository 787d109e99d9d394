"""Requests that stall or break off half way, and a console that takes no more: the service goes on, and STOP stops."""

from __future__ import annotations

import asyncio
import logging
import threading
from pathlib import Path
from typing import Any

import pytest

from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts
from commissioner.service.serving import MOST_RECORDS, _told_apart

HELD_S = 60.0


async def _ask(app: Any, path: str, *, breaks_off: bool) -> tuple[int, float]:
    """Status of a POST that announced 50 bytes, sent one, and then went or went silent; seconds until it came."""
    sent: list[Any] = [{"type": "http.request", "body": b"{", "more_body": True}]
    said: list[Any] = []

    async def receive() -> Any:
        if sent:
            return sent.pop()
        if not breaks_off:
            await asyncio.sleep(HELD_S)
        return {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        said.append(message)

    headers = [(b"host", b"127.0.0.1"), (b"content-length", b"50"), (b"content-type", b"application/json")]
    scope = {
        "type": "http", "method": "POST", "path": path, "raw_path": path.encode(), "query_string": b"", "headers": headers, "scheme": "http",
        "server": ("127.0.0.1", 80), "client": ("127.0.0.1", 5), "root_path": "", "http_version": "1.1", "asgi": {"version": "3.0"},
    }  # fmt: skip
    began = asyncio.get_running_loop().time()
    await app(scope, receive, send)
    return said[0]["status"], asyncio.get_running_loop().time() - began


@pytest.mark.parametrize("breaks_off", [True, False])
def test_a_stop_whose_words_do_not_come_stops_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, breaks_off: bool
) -> None:
    """It raised behind the route, told as a defect on the console, and stopped nothing; one that stalled waited for ever."""
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    stopped: list[str] = []

    async def stop_all(_person: str, reason: str, _drive: str | None) -> list[Any]:
        stopped.append(reason)
        return []

    monkeypatch.setattr(parts.desk, "stop_all", stop_all)
    status, after_s = asyncio.run(_ask(create_app(parts), "/api/stop", breaks_off=breaks_off))
    assert status == 200 and stopped == ["STOP (POST)"] and after_s < HELD_S / 4


@pytest.mark.parametrize("path", ["/api/runs", "/api/recordings", "/api/nameplates/validate"])
def test_a_request_that_breaks_off_is_no_defect(tmp_path: Path, path: str) -> None:
    app = create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data")))
    assert asyncio.run(_ask(app, path, breaks_off=True))[0] in (400, 422)


def test_a_console_that_takes_no_more_holds_up_nobody() -> None:
    """A held terminal, a pipe that nobody reads: the first line beyond what it takes stood the service still, STOP included."""
    may_go_on, told = threading.Event(), list[str]()

    class Stuck(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            may_go_on.wait(HELD_S)
            told.append(record.getMessage())

    logger = logging.Logger("uvicorn")
    logger.handlers = before = [Stuck()]
    with _told_apart(logger):
        for number in range(2 * MOST_RECORDS):
            logger.error("line %d", number)
        assert told == []
        may_go_on.set()
    assert logger.handlers == before
    assert told[0] == "line 0" and len(told) <= MOST_RECORDS + 1
