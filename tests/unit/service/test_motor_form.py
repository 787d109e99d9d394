"""The plate's form says its numbers as its reader writes them, and understands them so."""

import re

import pytest
from starlette.testclient import TestClient

from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.library import Drive
from commissioner.service.page import band, work
from commissioner.service.page.texts import Texts
from commissioner.service.parts import make_parts
from commissioner.service.runs.watch import Seen


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


@pytest.mark.parametrize(
    ("name", "kept"),
    [("Kühlung Größe 2", "kuehlung_groesse_2"), ("Čerpadlo", "cerpadlo"), ("<b>x</b>", "b_x_b"), ("泵", "motor")],
)
def test_an_id_is_spelt_from_the_name_that_a_person_gave(name, kept):
    """`Kühlung` was `k_hlung` in every list."""
    assert work._slug(name, set()) == kept and work._slug(name, {kept}) == f"{kept}_2"


@pytest.mark.parametrize(
    ("language", "said"), [("en", "no connection to tcp://pump"), ("de", "Keine Verbindung zu tcp://pump")]
)
def test_why_a_drive_does_not_answer_is_told_in_the_readers_language(tmp_path, language, said):
    drive = Drive("pump", "Pump", "tcp://pump", "simulated", "added")
    seen = Seen(at_s=0.0, error="no connection to tcp://pump")
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    assert said.lower() in band._at_rest(parts, None, drive, seen, Texts(language)).small.lower()
