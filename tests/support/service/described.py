"""What leaves the program, beside what is said of it - the service's own OpenAPI document, the shipped schemas: every key described,
every described key there."""

from __future__ import annotations

import json
import re
from collections import Counter
from functools import cache
from typing import Any

import httpx
from jsonschema_rs import Draft202012Validator

from commissioner.docs import read_schema

LOOSE = {"type": "object", "additionalProperties": True}
MOST = 40
"""Answers of one route that are looked at in a session: a test that waits asks the same thing a hundred times."""


class Description:
    """An OpenAPI document. `judge` takes an answer; what it does not describe is an AssertionError."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.document = _strict(document)
        self.seen = Counter[str]()
        self._of = cache(self._validator)

    def judge(self, method: str, path: str, status: int, answer: Any) -> None:
        route = self._route(path)
        self.seen[f"{method} {route}"] += 1
        errors = self._of(method.lower(), route, str(status)).iter_errors(answer)
        problems = [f"{'.'.join(map(str, error.instance_path))}: {error.message[:500]}" for error in errors]
        assert problems == [], f"{method} {path}"

    def watch(self, answer: httpx.Response) -> None:
        """For a client: each of its answers."""
        request, path = answer.request, answer.request.url.path
        is_json = answer.headers.get("content-type") == "application/json" and "/export/" not in path
        if not is_json or not path.startswith("/api/") or answer.status_code >= 300:
            return
        if self.seen[f"{request.method} {self._route(path)}"] < MOST:
            self.judge(request.method, path, answer.status_code, json.loads(answer.read()))

    def _route(self, path: str) -> str:
        """The longest one that fits: a name before a parameter."""
        fits = [one for one in self.document["paths"] if re.fullmatch(re.sub(r"{\w+}", "[^/]+", one), path)]
        return min(fits, key=lambda one: one.count("{"))

    def _validator(self, method: str, route: str, status: str) -> Draft202012Validator:
        content = self.document["paths"][route][method]["responses"][status]["content"]
        return Draft202012Validator(content["application/json"]["schema"] | {"components": self.document["components"]})


def judge(name: str, document: Any, *, may_have_more: bool = False) -> None:
    """A document of the command line or of a file; what its shipped schema does not describe is an AssertionError."""
    schema = json.loads(read_schema(name))
    errors = Draft202012Validator(schema if may_have_more else _strict(schema)).iter_errors(
        json.loads(json.dumps(document))
    )
    problems = [f"{'.'.join(map(str, error.instance_path))}: {error.message[:500]}" for error in errors]
    assert problems == [], problems


def _strict(schema: Any) -> Any:
    """No key beside the described ones; no way out by a shape that is open to everything where another one is given."""
    if isinstance(schema, list):
        return [_strict(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    made = {key: _strict(value) for key, value in schema.items()}
    if made.get("type") == "object" and "properties" in made:
        made.setdefault("additionalProperties", False)
    if isinstance(made.get("anyOf"), list) and any("$ref" in one for one in made["anyOf"]):
        made["anyOf"] = [one for one in made["anyOf"] if not LOOSE.items() <= one.items()]
    return made
