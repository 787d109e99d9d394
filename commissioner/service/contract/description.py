"""What `/openapi.json` says of the answers: taken from the return types of the routes when somebody asks for it, not at the start."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine, Iterator
from typing import Any, get_type_hints

from fastapi import FastAPI, Request, Response
from fastapi.routing import APIRoute, iter_route_contexts

from commissioner.encoding import JsonObject, read_json

ANSWER = "application/json"
REFERENCE = "#/components/schemas/{model}"
_KINDS = {
    "text/html": {"type": "string"},
    "text/csv": {"type": "string"},
    "text/event-stream": {"type": "string"},
    ANSWER: {"type": "object"},
}


def sends(*media_types: str) -> dict[int | str, JsonObject]:
    """For OpenAPI, of a route that answers with a file or a stream of one of these kinds."""
    content = {kind: {"schema": _KINDS.get(kind, {"type": "string", "format": "binary"})} for kind in media_types}
    return {200: {"description": "The file, or the stream.", "content": content}}


class _Asked(Request):
    async def json(self) -> Any:
        """JSONDecodeError, which FastAPI tells as what the body is not, for everything that `read_json` refuses."""
        try:
            return read_json(await self.body())
        except ValueError as error:
            raise json.JSONDecodeError(str(error), "", 0) from error


class Typed(APIRoute):
    """A route whose body is read as all JSON from outside, and whose answer is sent as it was made: mypy checks its type, OpenAPI
    shows it, nothing is filtered or converted."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **more: Any) -> None:
        said = more.get("response_class")
        is_json = said is None or not isinstance(said, type)
        super().__init__(path, endpoint, **more | ({"response_model": Any} if is_json else {}))

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        answer = super().get_route_handler()

        async def asked(request: Request) -> Response:
            return await answer(_Asked(request.scope, request.receive))

        return asked


def describe_answers(app: FastAPI) -> None:
    """The schema of each answer in the app's OpenAPI document."""
    plain: Callable[[], JsonObject] = app.openapi
    told: list[JsonObject] = []

    def described() -> JsonObject:
        if not told:
            told.append(_with_answers(plain(), app))
        return told[0]

    app.openapi = described  # type: ignore[method-assign]


def _with_answers(document: JsonObject, app: FastAPI) -> JsonObject:
    from pydantic import TypeAdapter

    answers = list(_answers(document, app))
    adapters = [(number, "serialization", TypeAdapter[Any](kind)) for number, (_, kind) in enumerate(answers)]
    schemas, shared = TypeAdapter.json_schemas(adapters, ref_template=REFERENCE)  # type: ignore[arg-type]
    for number, (content, _) in enumerate(answers):
        content["schema"] = schemas[number, "serialization"]
    known = document["components"]["schemas"]
    known.update({name: schema for name, schema in shared.get("$defs", {}).items() if name not in known})
    return document


def _answers(document: JsonObject, app: FastAPI) -> Iterator[tuple[JsonObject, Any]]:
    """Where each answer stands in the document, and the type of it."""
    for route in iter_route_contexts(app.routes):
        original = route.original_route
        if isinstance(original, Typed) and route.include_in_schema and original.response_model is Any:
            path = document["paths"][route.path_format]
            for method in route.methods or ():
                status = str(route.status_code or 200)
                yield (
                    path[method.lower()]["responses"][status]["content"][ANSWER],
                    get_type_hints(route.endpoint)["return"],
                )
