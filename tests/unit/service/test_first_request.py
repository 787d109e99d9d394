"""A loop that is held holds up the beats of a run: what a service builds once is built before it answers."""

import jinja2
import pydantic
import pytest
from starlette.testclient import TestClient

from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts
from commissioner.service.warm import WarmUp


@pytest.mark.parametrize("path", ["/", "/runs", "/api/runs"])
def test_the_first_answer_builds_no_template_and_no_check_of_requests(tmp_path, monkeypatch, path):
    async def nothing(_self):
        """Kernels are another child's work."""

    built = []
    for owner, name in ((jinja2.Environment, "compile"), (pydantic.TypeAdapter, "__init__")):
        monkeypatch.setattr(owner, name, _counted(built, name, getattr(owner, name)))
    monkeypatch.setattr(WarmUp, "work", nothing)
    app = create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data")))
    with TestClient(app, base_url="http://127.0.0.1") as client:
        assert "__init__" in built
        built.clear()
        assert client.get(path).status_code == 200
    assert built == []


def _counted(built, name, function):
    def counted(*args, **kwargs):
        built.append(name)
        return function(*args, **kwargs)

    return counted
