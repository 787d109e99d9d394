"""The application: parts, routes, gate, and what happens at its begin and end."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from importlib.metadata import version
from pathlib import Path

from fastapi import FastAPI
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

from commissioner.service import problems
from commissioner.service.access.accounts import Role
from commissioner.service.access.gate import HEADERS, Gate
from commissioner.service.access.head import Heads
from commissioner.service.access.visitor import check_role
from commissioner.service.access.visitors import visitor_of
from commissioner.service.contract.description import describe_answers
from commissioner.service.page import views
from commissioner.service.page.frame import prepare, prepare_causes
from commissioner.service.parts import Parts
from commissioner.service.problems import Refusal
from commissioner.service.routes import all_routers

CAUSES_S = 5.0
STATIC = Path(__file__).parent / "page" / "static"


def create_app(parts: Parts, *, url: str = "", ready: Callable[[], None] = lambda: None) -> FastAPI:
    """The service as an ASGI application; it starts its children when it begins and leaves none behind."""

    @contextlib.asynccontextmanager
    async def lifetime(app: FastAPI) -> AsyncIterator[None]:
        _prepare(app)
        work = (parts.desk.look_around(), parts.warm.work(), _prepare_causes())
        tasks = [asyncio.create_task(task) for task in work]
        tell = asyncio.get_running_loop().call_later(0.0, ready)
        try:
            yield
        finally:
            tell.cancel()
            parts.closing.set()
            for task in tasks:
                task.cancel()
            await parts.desk.close()
            await asyncio.gather(*tasks, return_exceptions=True)
            await parts.recordings.close()
            await parts.simulator.close()

    app = FastAPI(
        title="commissioner",
        version=version("commissioner"),
        lifespan=lifetime,
        docs_url=None,
        redoc_url=None,
        responses=problems.RESPONSES,
        middleware=[
            Middleware(
                Gate,
                host_names=parts.settings.host_names(),
                uploads=("/api/recordings", "/recordings"),
                refuse_upload=_refuse_upload,
            ),
            Middleware(Heads),
        ],
    )
    app.state.parts, app.state.url = parts, url
    problems.install(app, views.answer)
    app.add_exception_handler(Exception, _fail)
    views.install(app)
    for router in all_routers():
        app.include_router(router)
    app.include_router(views.router, include_in_schema=False)
    describe_answers(app)
    app.mount("/static", _Static(directory=STATIC), name="static")
    return app


async def _fail(request: Request, error: Exception) -> Response:
    """Outside of the gate, so with its headers."""
    response = views.answer(request, problems.surprise(error))
    response.headers.update(HEADERS)
    return response


def _refuse_upload(request: Request) -> Response | None:
    """None for whoever may upload."""
    try:
        check_role(visitor_of(request), Role.OPERATOR)
    except Refusal as refusal:
        return views.answer(request, refusal)
    return None


def _prepare(app: FastAPI) -> None:
    """What the first request would build, before one is answered: later it would hold up the beat of a run that has begun."""
    prepare()
    for route in app.routes:  # FastAPI makes the checks of a router's requests when it first compares a path with them
        route.matches({"type": "http", "method": "GET", "path": "/", "root_path": ""})


async def _prepare_causes() -> None:
    await asyncio.sleep(CAUSES_S)
    await asyncio.to_thread(prepare_causes)


class _Static(StaticFiles):
    """Files of this version; a browser asks whether they have changed."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        response.headers["cache-control"] = "no-cache"
        return response
