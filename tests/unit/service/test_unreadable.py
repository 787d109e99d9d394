"""What cannot be read: a body that is no JSON, a run that somebody changed, and what nobody foresaw."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, Response
from starlette.testclient import TestClient

from commissioner.errors import DataRefused
from commissioner.operations.export import export_model
from commissioner.run.archive.folder import RunFolder
from commissioner.service.access.gate import CSP
from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.parts import make_parts
from commissioner.service.problems import Refusal, install
from tests.support.archive.killed import die
from tests.support.archive.synthetic import MACHINE, make_run, result_of


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


SPOILT = (
    lambda result: result["parameters"].pop("stator_resistance_ohm"),
    lambda result: result["parameters"]["rotor_resistance_ohm"].update(value=None),
    lambda result: result["parameters"]["leakage_inductance_h"].update(std=None),
    lambda result: result["parameters"].update(rotor_time_constant_s={}),
    lambda result: result.update(axes=[None]),
    lambda result: result.update(dispersion=None, axes=[{"axis_deg": 0.0}]),
)


@pytest.mark.parametrize("spoil", SPOILT)
def test_a_result_that_somebody_changed_ends_no_list_and_no_page(tmp_path: Path, spoil: Callable[[Any], Any]) -> None:
    good, bad = "20240105-081500-simulated-000abc", "20240620-081500-simulated-001abc"
    for name in (good, bad):
        result = result_of(name, MACHINE)
        if name == bad:
            spoil(result)
        make_run(tmp_path / "runs", name, result=result)
    app = create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data")))
    client = TestClient(app, base_url="http://127.0.0.1", raise_server_exceptions=False)
    page = {"accept": "text/html"}
    assert good in (said := client.get("/runs", headers=page).text) and bad in said
    assert [run["run"] for run in client.get("/api/runs").json()["runs"]] == [bad, good]
    shown = client.get(f"/runs/{bad}", headers=page)
    assert shown.status_code == 200 or (shown.status_code == 422 and "is damaged" in shown.text)


def test_a_run_whose_write_back_was_killed_is_not_told_as_written(tmp_path: Path) -> None:
    run = "20240105-081500-simulated-000abc"
    writing = RunFolder(make_run(tmp_path / "runs", run, result=result_of(run, MACHINE)))
    writing.journal("about_to", {"action": "commit", "values": {}}, durable=True)
    die(writing)
    (writing.path / "snapshot.json").write_text("{}", "utf-8")
    app = create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data")))
    client = TestClient(app, base_url="http://127.0.0.1", headers={"accept": "text/html"})
    said = client.get(f"/runs/{run}").text
    assert "Measured and written" not in said and f"/runs/{run}/write-back" not in said
    assert (
        "The drive holds its old or its new parameters: restore the old ones." in said
        and f"/runs/{run}/restore" in said
    )
    assert "commissioned, old or new" in client.get("/runs").text


@pytest.mark.parametrize("is_open", [True, False])
def test_a_write_back_that_broke_off_half_way_leads_to_the_old_values(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_open: bool
) -> None:
    """Its page said to restore first, and led back to the table of the same write-back alone."""
    run = "20240105-081500-simulated-000abc"
    writing = RunFolder(make_run(tmp_path / "runs", run, result=result_of(run, MACHINE)))
    if is_open:
        writing.journal("about_to", {"action": "commit", "values": {}}, durable=True)
    die(writing)

    async def broke(*_: object, **__: object) -> None:
        raise Refusal(502, "no answer", step="write", value="nothing", limit="an answer", remedy="see the cable")

    monkeypatch.setattr("commissioner.service.routes.write.succeed", broke)
    app = create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data")))
    client = TestClient(app, base_url="http://127.0.0.1", headers={"accept": "text/html"})
    csrf = re.findall(r'name="csrf" value="([^"]+)"', client.get("/").text)[0]
    answer = client.post(
        f"/runs/{run}/write-back", data={"csrf": csrf, "token": "x"}, headers={"origin": "http://127.0.0.1"}
    )
    assert answer.status_code == 502 and "No answer" in answer.text
    assert (f'href="/runs/{run}/restore"' in answer.text) is is_open
    assert (f'href="/runs/{run}/write-back"' in answer.text) is not is_open


def said_at_the_start(root: Path) -> str:
    """What a run has left to look after, as the start page has it."""
    client = TestClient(create_app(make_parts(Settings(root / "runs", root / "data"))), base_url="http://127.0.0.1")
    return (
        client.get("/", headers={"accept": "text/html"}).text.partition('<div class="cols3">')[0].partition("<h1>")[2]
    )


@pytest.mark.parametrize("has_ended", [True, False])
def test_the_start_page_says_what_a_write_that_did_not_end_has_left_now(tmp_path: Path, has_ended: bool) -> None:
    """It told of the run for as long as that was among the newest, also when the drive was restored long since."""
    run, later = "20240105-081500-simulated-000abc", "20240620-081500-simulated-001abc"
    folder = make_run(tmp_path / "runs", run, result=result_of(run, MACHINE), closed=has_ended)
    for kind, record in (("about_to", {"action": "commit"}), ("snapshot_restored", {"is_stored": True})):
        writing = RunFolder(folder)
        writing.journal(kind, record, durable=True)
        die(writing)
        said = said_at_the_start(tmp_path)
        if kind == "about_to":
            assert ("was cut off" if not has_ended else f"of {run} did not end") in said and "old or new" in said
        else:
            assert "old or new" not in said and "What to do" not in said and "note caution" not in said
            assert ("The drive has its old values again" in said) is not has_ended
    make_run(tmp_path / "runs", later)
    assert run not in said_at_the_start(tmp_path)


def test_what_was_written_is_told_as_what_it_was_once_it_has_changed(tmp_path: Path) -> None:
    """`The drive works with these values now` stood there after the restore, and after another run's write-back."""
    run, later = "20240105-081500-simulated-000abc", "20240620-081500-simulated-001abc"
    client = TestClient(
        create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data"))), base_url="http://127.0.0.1"
    )

    def write(name: str, kind: str) -> None:
        writing = RunFolder(tmp_path / "runs" / name)
        writing.journal(kind, {"is_stored": True, "written": []}, durable=True)
        die(writing)

    def said(path: str) -> str:
        return client.get(f"/runs/{run}{path}", headers={"accept": "text/html"}).text

    for name in (run, later):
        make_run(tmp_path / "runs", name, result=result_of(name, MACHINE))
    write(run, "parameters_written")
    assert "works with these values now" in said("/write-back/done") and "A later run" not in said("")
    write(later, "parameters_written")
    assert "works with these values now" not in said("/write-back/done")
    assert "A later run has changed what the drive holds:" in said("") and f'href="/runs/{later}"' in said("")
    write(run, "snapshot_restored")
    assert "A later run" not in said("") and "Since then, parameters in the drive: as before (restored)" in said(
        "/write-back/done"
    )
    assert "works with these values now" in said("/restore/done")


def test_the_start_page_tells_of_a_run_that_was_cut_off_until_its_drive_was_met_again(tmp_path: Path) -> None:
    cut, other, again = (f"2024010{n}-081500-simulated-000abc" for n in (1, 2, 3))
    make_run(tmp_path / "runs", cut, closed=False)
    make_run(tmp_path / "runs", other, drive=7)
    assert cut in said_at_the_start(tmp_path)
    make_run(tmp_path / "runs", again, outcome="aborted")
    assert cut not in said_at_the_start(tmp_path)


def test_the_page_of_a_run_whose_result_was_not_kept_says_so_and_offers_to_make_it(tmp_path: Path) -> None:
    run = "20240105-081500-simulated-000abc"
    (make_run(tmp_path / "runs", run) / "blocks.bin").write_bytes(b"x")
    client = TestClient(
        create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data"))), base_url="http://127.0.0.1"
    )
    said = client.get(f"/runs/{run}", headers={"accept": "text/html"}).text
    assert (
        "the process ended before its result was kept" in said and f'href="/runs/{run}/report">Make the result' in said
    )
    assert "commissioned, result not kept" in client.get("/runs", headers={"accept": "text/html"}).text
    (row,) = client.get("/api/runs").json()["runs"]
    assert (row["outcome"], row["standing"]) == ("commissioned", "commissioned, result not kept")


def test_a_damaged_journal_ends_every_export_as_on_the_command_line(tmp_path: Path) -> None:
    run, runs = "20240105-081500-simulated-000abc", tmp_path / "runs"
    folder = make_run(runs, run, result=result_of(run, MACHINE))
    kept = tmp_path / "data" / "exports" / f"{run}.csv"  # made when the run was asked for before
    kept.parent.mkdir(parents=True)
    kept.write_text("time_s\n", "utf-8")
    client = TestClient(create_app(make_parts(Settings(runs, tmp_path / "data"))), base_url="http://127.0.0.1")
    assert client.get(f"/api/runs/{run}/export/json").json()["run"] == run
    assert client.get(f"/api/runs/{run}/export/csv").text == "time_s\n"
    journal = folder / "journal.jsonl"
    journal.write_text(journal.read_text("utf-8").replace("SIM-INV-7A", "SIM-INV-7B"), "utf-8")
    with pytest.raises(DataRefused) as refused:
        export_model(runs, run, tmp_path / "out.json", "json")
    for form in ("json", "csv"):
        answer = client.get(f"/api/runs/{run}/export/{form}")
        assert answer.status_code == 422
        assert [answer.json()[key] for key in ("title", "step", "value")] == [
            refused.value.what, refused.value.step, refused.value.value,
        ]  # fmt: skip


def test_what_nobody_foresaw_is_a_page_with_its_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    app = create_app(make_parts(Settings(tmp_path / "runs", tmp_path / "data")))
    client = TestClient(app, base_url="http://127.0.0.1", raise_server_exceptions=False)
    monkeypatch.setattr("commissioner.service.archive.Archive.entries", lambda *_a, **_k: 1 / 0)
    page = client.get("/runs", headers={"accept": "text/html"})
    assert page.status_code == 500 and "The service failed at this" in page.text and 'action="/stop"' in page.text
    assert page.headers["content-security-policy"] == CSP
    assert client.get("/api/runs").json()["value"] == "ZeroDivisionError"
