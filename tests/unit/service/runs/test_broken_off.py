"""Requests that stall or break off half way, and a console that takes no more: the service goes on, and STOP stops."""

from __future__ import annotations

import asyncio
import logging
import threading
from pathlib import Path
from typing import Any, cast

import pytest

from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts
from commissioner.service.runs import desk
from commissioner.service.runs.desk import Stopped
from commissioner.service.runs.feed import Feed
from commissioner.service.serving import MOST_RECORDS, _told_apart
from tests.support.archive.synthetic import MACHINE, make_run, result_of

HELD_S = 60.0


FORM = "application/x-www-form-urlencoded"


async def _ask(
    app: Any, path: str, *, breaks_off: bool, body: bytes = b"{", kind: str = "application/json"
) -> tuple[int, float]:
    """Status of a POST that announced 50 bytes, sent fewer, and then went or went silent; seconds until it came."""
    sent: list[Any] = [{"type": "http.request", "body": body, "more_body": len(body) < 50}]
    said: list[Any] = []

    async def receive() -> Any:
        if sent:
            return sent.pop()
        if not breaks_off:
            await asyncio.sleep(HELD_S)
        return {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        said.append(message)

    headers = [(b"host", b"127.0.0.1"), (b"content-length", b"50"), (b"content-type", kind.encode())]
    scope = {
        "type": "http", "method": "POST", "path": path, "raw_path": path.encode(), "query_string": b"", "headers": headers, "scheme": "http",
        "server": ("127.0.0.1", 80), "client": ("127.0.0.1", 5), "root_path": "", "http_version": "1.1", "asgi": {"version": "3.0"},
    }  # fmt: skip
    began = asyncio.get_running_loop().time()
    await app(scope, receive, send)
    return said[0]["status"], asyncio.get_running_loop().time() - began


Stops = list[tuple[str, str | None]]


@pytest.fixture
def stopping(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Any, Stops]:
    """A service at which one run goes on, and what was stopped at it: why, and which run or drive (None: everything)."""
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    stopped: Stops = []

    async def stop_all(_person: str, reason: str, drive: str | None) -> list[Any]:
        stopped.append((reason, drive))
        return []

    async def stop(run: str, _person: str, reason: str) -> Stopped:
        stopped.append((reason, run))
        return Stopped("this", None, True, None, 0.1, "ready")

    monkeypatch.setattr(parts.desk, "stop_all", stop_all)
    monkeypatch.setattr(parts.desk, "stop", stop)
    monkeypatch.setattr(parts.desk, "runs", {"this": "this"})
    return create_app(parts), stopped


@pytest.mark.parametrize("breaks_off", [True, False])
@pytest.mark.parametrize(
    ("path", "body", "kind", "status", "expected"),
    [
        ("/api/stop", b"{", "application/json", 200, ("STOP (POST)", None)),
        ("/api/runs/this/stop", b"{", "application/json", 200, ("STOP (POST)", "this")),
        ("/stop", b"run=th", FORM, 303, ("STOP (form)", None)),
        ("/stop", b"--x\r\n", "multipart/form-data; boundary=x", 303, ("STOP (form)", None)),
    ],
)
def test_a_stop_whose_words_do_not_come_stops_all_the_same(
    stopping: tuple[Any, Stops], path: str, body: bytes, kind: str, status: int, expected: object, breaks_off: bool
) -> None:
    """It raised behind the route, told as a defect on the console, and stopped nothing; one that stalled waited for ever. A form that
    does not say which run stops everything."""
    app, stopped = stopping
    found, after_s = asyncio.run(_ask(app, path, breaks_off=breaks_off, body=body, kind=kind))
    assert found == status and stopped == [expected] and after_s < HELD_S / 4


@pytest.mark.parametrize(
    ("body", "kind", "expected"),
    [
        (b"run=this", FORM, "this"),
        (b"run=&drive=lathe", FORM, "lathe"),
        (b"run=" + 300 * b"x", FORM, None),
        (b"\xff\xfe;;=%zz", FORM, None),
        (b"no parts at all", "multipart/form-data; boundary=x", None),
        (b"no parts at all", "multipart/form-data", None),
        (b"{}", "application/json", None),
        (b"", "", None),
    ],
)
def test_a_stop_is_refused_for_no_form(
    stopping: tuple[Any, Stops], body: bytes, kind: str, expected: str | None
) -> None:
    """A run's name of 201 letters, and a body that is no form, were refused: nothing stopped."""
    app, stopped = stopping
    whole = body + (50 - len(body)) * b"&" if kind == FORM else body + (50 - len(body)) * b" "
    assert asyncio.run(_ask(app, "/stop", breaks_off=True, body=whole, kind=kind))[0] == 303
    assert stopped == [("STOP (form)", expected)]


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


@pytest.mark.parametrize(("has_result", "is_ours", "asked"), [(False, True, 1), (True, True, 0), (False, False, 0)])
def test_a_run_of_ours_that_was_killed_before_its_result_gets_it_without_being_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, has_result: bool, is_ours: bool, asked: int
) -> None:
    name = "20240105-081500-simulated-000abc"
    folder = make_run(tmp_path / "runs", name, result=result_of(name, MACHINE) if has_result else None)
    calls: list[list[str]] = []

    async def ask_for(_wanted: str, arguments: list[str], _log: Path) -> dict[str, Any]:
        calls.append(arguments)
        return {}

    monkeypatch.setattr(desk, "ask_for", ask_for)
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    run = desk.LiveRun(name, "simulator", "pump", Feed(folder), None, cast("Any", object()) if is_ours else None)
    asyncio.run(parts.desk._make_result(run))
    run.feed.close()
    assert [call[:3] for call in calls] == [["runs", "report", name]] * asked
