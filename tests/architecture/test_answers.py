"""No untyped JSON object leaves a public function, and OpenAPI says of every answer what it is."""

import ast
import re
from pathlib import Path
from typing import Any, get_type_hints

import pytest
from fastapi.routing import iter_route_contexts
from pydantic import TypeAdapter

from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.contract.description import REFERENCE, Typed
from commissioner.service.parts import make_parts

HOUSE = Path(__file__).parents[2] / "commissioner"
UNTYPED = re.compile(r"(dict|Mapping)\[str, (Any|object)\]")


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    folder = tmp_path_factory.mktemp("app")
    return create_app(make_parts(Settings(folder / "runs", folder / "data")))


@pytest.fixture(scope="module")
def answers(app):
    """(route, media type, schema) of every answer that is no refusal."""
    return [
        (f"{method} {path}", kind, content.get("schema"))
        for path, methods in app.openapi()["paths"].items()
        for method, operation in methods.items()
        for status, answer in operation["responses"].items()
        if status.startswith("2")
        for kind, content in (answer.get("content") or {"nothing": {}}).items()
    ]


def test_every_route_says_what_it_answers(answers):
    assert len(answers) > 35
    assert [route for route, kind, schema in answers if kind == "nothing" or not schema] == []


def test_no_route_answers_with_anything(answers):
    named = [route for route, kind, schema in answers if kind == "application/json" and "export" not in route]
    loose = [
        route
        for route, kind, schema in answers
        if route in named and not any("$ref" in one for one in schema.get("anyOf", [schema]))
    ]
    assert loose == []


def test_each_shape_has_one_name_and_each_name_one_shape(app):
    shown = app.openapi()["components"]["schemas"]
    routes = [r for r in iter_route_contexts(app.routes) if isinstance(r.original_route, Typed) and r.include_in_schema]
    kinds = [get_type_hints(r.endpoint)["return"] for r in routes if r.original_route.response_model is Any]
    adapters = [(number, "serialization", TypeAdapter(kind)) for number, kind in enumerate(kinds)]
    _, made = TypeAdapter.json_schemas(adapters, ref_template=REFERENCE)
    assert {name for name, schema in made["$defs"].items() if shown[name] != schema} == set()


def test_no_public_function_answers_with_an_untyped_dict():
    found = {
        f"{path.relative_to(HOUSE).as_posix()}:{node.name}"
        for path in HOUSE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and not node.name.startswith("_")
        if node.returns is not None and UNTYPED.search(ast.unparse(node.returns))
    }
    assert found == set()
