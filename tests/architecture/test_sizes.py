"""Functions stay short, and what belongs together travels together."""

import ast
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[2] / "commissioner"
COMPILED = {"kernel", "borrowing", "inlined", "njit", "_kernel", "_inlined"}
OPTIONS = ("cli/app.py", "cli/groups/")
"""Verbs of the command line, whose parameters are its options."""
MOST = 10


def functions():
    """(file:name, lines of the body without its docstring, parameters, whether it is compiled) of every function of the product."""
    for path in sorted(HOUSE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                said = isinstance(node.body[0], ast.Expr) and isinstance(node.body[0].value, ast.Constant)
                body = node.body[1:] if said else node.body
                lines = body[-1].end_lineno - body[0].lineno + 1 if body else 0
                given = node.args
                compiled = bool({ast.unparse(d).partition("(")[0] for d in node.decorator_list} & COMPILED)
                count = len(given.posonlyargs) + len(given.args) + len(given.kwonlyargs)
                yield f"{path.relative_to(HOUSE).as_posix()}:{node.name}", lines, count, compiled


@pytest.fixture(scope="module")
def found():
    return list(functions())


def test_bodies_are_short(found):
    lines = sorted(lines for _, lines, _, compiled in found if not compiled)
    assert len(lines) > 3000 and lines[int(0.9 * len(lines))] <= 20
    assert [(name, n) for name, n, _, compiled in found if n > 80 and not compiled] == []


def test_no_function_takes_more_than_ten_parameters(found):
    assert {name for name, _, count, _ in found if count > MOST and not name.startswith(OPTIONS)} == set()
