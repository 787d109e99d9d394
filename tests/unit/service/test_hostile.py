"""What no page of ours sends is answered in the one form, and a STOP stops whatever its words."""

import pytest
from starlette.testclient import TestClient

from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts

JSON, FORM = {"content-type": "application/json"}, {"content-type": "multipart/form-data; boundary=b"}
ENGLISH = 'lang="en"'
"""Of what is shown without a German text."""


@pytest.fixture
def client(tmp_path):
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    return TestClient(create_app(parts), base_url="http://127.0.0.1", raise_server_exceptions=False)


@pytest.mark.parametrize(
    "body", ["{", "[" * 100_000, '{"reason": 7}', '{"reason": "\\ud800"}', '{"reason": "' + 400 * "x" + '"}']
)
def test_a_stop_is_never_refused_for_its_words(client, body):
    answer = client.post("/api/stop", content=body, headers=JSON)
    assert (answer.status_code, answer.json()) == (200, {"stopped": []})


@pytest.mark.parametrize("body", ["[" * 100_000, '{"drive": "\\ud800", "motor": "\\ud800"}', f'{{"drive": {10**400}}}'])
def test_json_that_is_none_of_ours_is_a_problem_document(client, body):
    answer = client.post("/api/checks", content=body, headers=JSON)
    assert answer.status_code in (400, 422)
    assert answer.json()["limit"] and answer.json()["remedy"]


def test_an_address_that_is_none_is_another_sites(client):
    assert client.post("/api/stop", headers={"origin": "http://["}).status_code == 403
    assert client.post("/stop", headers={"referer": "http://["}, follow_redirects=False).headers["location"] == "/"


@pytest.mark.parametrize("asked", ["since=05.11.2026", "since=2026-13", "outcome=nonsense"])
def test_a_filter_that_cannot_be_is_told_and_no_archive_without_runs(client, asked):
    page = client.get(f"/runs?{asked}", headers={"accept": "text/html", "accept-language": "de"})
    assert page.status_code == client.get(f"/api/runs?{asked}").status_code == 422
    assert "ist kein Datum" in page.text or "So endet kein Lauf" in page.text


@pytest.mark.parametrize("path", ["/api/recordings", "/recordings"])
@pytest.mark.parametrize(
    ("parts", "status", "value", "limit"),
    [
        (['name="files"'], 422, "1,2", "files: each with its name (`filename`)"),
        (
            ['name="files"; filename="a.csv"', 'name="files"'],
            422,
            "a.csv, 1,2",
            "files: each with its name (`filename`)",
        ),
        (['name="files"; filename="a.csv"', 'name="motor"; filename="m"'], 422, "m", "motor: text"),
        (['name="files"; filename="a.csv"'] * 13, 422, ", ".join(["a.csv"] * 13), "files: at most 12 entries"),
        (
            ['name="x"'] * 1001,
            400,
            "Too many fields. Maximum number of fields is 1000.",
            "at most 1000 files and 1000 fields",
        ),
    ],
    ids=["no file", "one of two", "a file as motor", "too many", "far too many"],
)
def test_a_form_that_no_page_sends_is_refused_in_words_of_ours(client, path, parts, status, value, limit):
    body = "".join(f"--b\r\ncontent-disposition: form-data; {part}\r\n\r\n1,2\r\n" for part in parts) + "--b--\r\n"
    answer = client.post(path, content=body, headers=FORM)
    problem = answer.json()
    assert (answer.status_code, problem["value"]) == (status, value)
    assert limit in problem["limit"] and "UploadFile" not in answer.text and "route" not in problem["limit"]
    page = client.post(path, content=body, headers=FORM | {"accept": "text/html", "accept-language": "de"})
    assert page.status_code == status and ENGLISH not in page.text.partition("<main")[2].partition("</main")[0]
