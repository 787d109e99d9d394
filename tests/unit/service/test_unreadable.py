"""A request whose body is no JSON is told so, by the body and not by the number of a character."""

from __future__ import annotations

import asyncio
import json

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response

from commissioner.service.problems import Refusal, install


def test_a_broken_body_is_called_the_body() -> None:
    app = FastAPI()

    def answer(_request: Request, refusal: Refusal) -> Response:
        return JSONResponse(refusal.problem.model_dump(mode="json"), refusal.problem.status)

    install(app, answer)
    broken = {"type": "json_invalid", "loc": ("body", 4), "msg": "", "input": {}, "ctx": {"error": "Expecting value"}}
    handler = app.exception_handlers[RequestValidationError]
    said = asyncio.run(handler(Request({"type": "http"}), RequestValidationError([broken])))  # type: ignore[arg-type]
    problem = json.loads(bytes(said.body))
    assert (said.status_code, problem["title"], problem["limit"]) == (400, "the body cannot be used", "valid JSON")
