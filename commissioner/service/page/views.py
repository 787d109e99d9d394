"""All pages, and what a browser sees where a request was refused."""

from __future__ import annotations

from urllib.parse import quote

from fastapi import APIRouter, FastAPI, Request
from fastapi.responses import RedirectResponse, Response

from commissioner.errors import CommissionerError
from commissioner.service.access.pages import came_from, seen_at
from commissioner.service.access.visitors import visitor_of
from commissioner.service.page import shelves, tuning, work
from commissioner.service.page.frame import ToLogin, refused
from commissioner.service.page.texts import texts_of, told
from commissioner.service.problems import Refusal, disk_refuses, refusal_of, respond

router = APIRouter()
router.include_router(shelves.router)
router.include_router(work.router)
router.include_router(tuning.router)


def install(app: FastAPI) -> None:
    """Refusals as pages where a person asks for a page; as problem documents under /api."""

    @app.exception_handler(ToLogin)
    async def to_login(_request: Request, wanted: ToLogin) -> Response:
        return RedirectResponse(f"/login?next={quote(wanted.path)}", 303)

    @app.exception_handler(Refusal)
    async def refuse(request: Request, refusal: Refusal) -> Response:
        return answer(request, refusal)

    @app.exception_handler(CommissionerError)
    async def fail(request: Request, error: CommissionerError) -> Response:
        return answer(request, refusal_of(error, request.path_params))

    @app.exception_handler(OSError)
    async def lost(request: Request, failure: OSError) -> Response:
        return answer(request, disk_refuses(failure))


def answer(request: Request, refusal: Refusal) -> Response:
    """The refusal in the form that was asked for."""
    wants_page = not request.url.path.startswith("/api/") and "text/html" in request.headers.get("accept", "")
    if request.url.path.startswith("/api/"):
        return respond(refusal)
    if not wants_page:
        return respond(told(refusal, texts_of(request)))
    if refusal.problem.status == 405 and request.method == "GET":
        return RedirectResponse(request.url.path.rpartition("/")[0] or "/", 303)  # a form's address, looked at
    if refusal.problem.status == 401 or visitor_of(request).role is None:
        return RedirectResponse(f"/login?next={quote(seen_at(request))}", 303)
    return refused(request, refusal, back=came_from(request))
