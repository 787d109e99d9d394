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


@pytest.mark.parametrize("path", ["/", "/runs", "/api/health", "/api/runs", "/api/runs/none", "/static/js/page.js"])
def test_head_is_what_get_would_answer_without_its_body(client, path):
    """It was refused, and of two routes with one path the answer named the other's method alone."""
    asked, headed = client.get(path), client.head(path)
    assert (headed.status_code, headed.content) == (asked.status_code, b"")
    assert headed.headers["content-type"] == asked.headers["content-type"]


@pytest.mark.parametrize(
    ("path", "takes"),
    [
        ("/api/runs", "GET, POST, HEAD"),
        ("/api/stop", "POST"),
        ("/api/accounts/x", "DELETE"),
        ("/api/runs/x/restore", "GET, POST, HEAD"),
    ],
)
def test_a_method_that_is_not_offered_is_told_with_all_that_are(client, path, takes):
    for method in ("PATCH", "OPTIONS"):
        answer = client.request(method, path)
        assert (answer.status_code, answer.headers["allow"]) == (405, takes)
        assert answer.headers["content-type"] == "application/problem+json"


PAGE = {"accept": "text/html"}


@pytest.mark.parametrize(
    ("form", "page"), [("/drives", "/"), ("/drives/simulator/motor", "/drives/simulator"), ("/plate", "/"), ("/recordings", "/"),
                       ("/drives/simulator/checks", "/drives/simulator"), ("/drives/simulator/energise", "/drives/simulator")],
)  # fmt: skip
def test_the_address_of_a_form_leads_to_its_page(client, form, page):
    """A browser stands there after a refusal: language, STOP or a reload led to `this method is not offered here`."""
    answer = client.get(form, headers=PAGE, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, page)


def test_a_refused_page_leads_back_to_where_the_browser_was(client):
    here = "http://127.0.0.1/runs?outcome=aborted"
    for method in ("GET", "POST"):
        said = client.request(
            method, "/compare" if method == "GET" else "/drives", headers=PAGE | {"referer": here}
        ).text
        assert 'href="/runs?outcome=aborted">Back' in said or method == "GET"
    assert 'name="back" value="/runs?outcome=aborted"' in said  # the language is changed there, not at the form
    assert (
        client.post("/stop", headers={"referer": here}, follow_redirects=False).headers["location"]
        == "/runs?outcome=aborted"
    )
    assert client.post("/stop", headers={"referer": "http://evil/x"}, follow_redirects=False).headers["location"] == "/"


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
