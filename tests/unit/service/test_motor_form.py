"""The plate's form says its numbers as its reader writes them, and understands them so."""

import re

import pytest
from starlette.testclient import TestClient

from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts


@pytest.mark.parametrize(("language", "said"), [("de", ("2,2", "0,8")), ("en", ("2.2", "0.8"))])
def test_what_the_form_shows_is_the_plate_that_it_knows(tmp_path, language, said):
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    client = TestClient(create_app(parts), base_url="http://127.0.0.1")
    page = client.get("/drives/simulator", params={"lang": language}).text
    shown = dict(re.findall(r'<input id="(\w+)" name="\w+" inputmode="decimal" value="([^"]*)"', page))
    assert (shown["rated_power_kw"], shown["power_factor"]) == said
    csrf = re.search(r'name="csrf" value="([^"]*)"', page)
    assert csrf is not None
    judged = client.post("/plate", data={**shown, "connection": "star", "csrf": csrf[1]}).json()
    assert judged["ok"]
