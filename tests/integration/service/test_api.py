"""The HTTP contract, met as a script meets it."""

import json
import shutil
import time
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from commissioner.service.routes.write import STEPS

PLATE = {
    "rated_power_w": 2200, "rated_voltage_v": 400, "rated_frequency_hz": 50, "rated_current_a": 5, "rated_speed_rpm": 1436,
    "power_factor": 0.8, "pole_pairs": 2, "connection": "star",
}  # fmt: skip


def is_problem(answer: httpx.Response, status: int) -> dict:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert problem["status"] == status
    assert problem["title"] and problem["step"] and problem["remedy"]
    return problem


def test_works_without_a_drive(service):
    health = service.client.get("/api/health").json()
    assert health["status"] == "ok"
    assert health["version"]
    assert [d["id"] for d in service.client.get("/api/drives").json()["drives"]][-1] == "simulator"
    assert service.client.get("/api/motors").json()["motors"][-1]["id"] == "motor_2kw2"
    assert service.client.get("/api/procedures").json()["procedures"][0]["procedure"]["limits"]["flux_fraction"] == 0.9


def test_checks_say_value_limit_and_remedy_and_what_a_run_would_do(service):
    document = service.client.post("/api/checks", json={"drive": "simulator", "motor": "motor_2kw2"}).json()
    assert document["outcome"] == "passed"
    assert all({"name", "has_passed", "value", "limit", "remedy"} <= set(check) for check in document["checks"])
    assert document["limits"]["current_a"] == pytest.approx(2**0.5 * 5.0)
    assert not service.is_energised()


def test_a_plate_is_judged_field_by_field(service):
    judged = service.client.post("/api/nameplates/validate", json=PLATE | {"rated_speed_rpm": 1563}).json()
    assert not judged["ok"]
    assert not judged["fields"]["rated_speed_rpm"]["ok"]
    assert judged["fields"]["rated_power_w"]["ok"]
    asked = service.client.post("/api/nameplates/validate", json=PLATE | {"rated_current_a": 5 * 3**0.5}).json()
    assert not asked["ok"]
    assert "would fit" in str(asked["fields"])


def test_a_run_without_confirmation_is_refused(service):
    wish = {"drive": "simulator", "motor": "motor_2kw2"}
    assert "confirm" in is_problem(service.client.post("/api/runs", json=wish), 422)["title"]
    is_problem(service.client.post("/api/runs", json=wish | {"confirm": False}), 422)
    assert not service.is_energised()


def test_what_does_not_exist_is_named(service):
    wish = {"drive": "nowhere", "motor": "motor_2kw2", "confirm": True}
    assert is_problem(service.client.post("/api/runs", json=wish), 422)["value"] == "nowhere"
    is_problem(service.client.get("/api/runs/none"), 404)
    is_problem(service.client.get("/api/nothing"), 404)
    for path in ("/api/motors/nowhere/trend", "/api/drives/nowhere/state"):
        assert is_problem(service.client.get(path), 404)["value"] == "nowhere"
    is_problem(service.client.post("/api/drives/nowhere/control", json={"do": "ask"}), 404)
    for path in ("/motors/nowhere/trend", "/drives/nowhere", "/drives/nowhere/checks?motor=motor_2kw2"):
        page = httpx.get(
            service.url + path, headers={"accept": "text/html"}, timeout=90.0
        )  # no session for what follows
        assert page.status_code == 404 and "nowhere" in page.text
    is_problem(service.client.post("/api/runs", content=b"{", headers={"content-type": "application/json"}), 400)


def test_a_drive_is_checked_before_it_is_kept(service):
    wrong = {"id": "lab", "name": "Lab", "url": "http://192.168.0.1", "profile": "simulated"}
    assert "tcp://" in is_problem(service.client.post("/api/drives", json=wrong), 422)["limit"]
    kept = service.client.post("/api/drives", json=wrong | {"url": "tcp://127.0.0.1:9?device=1"})
    assert kept.status_code == 201
    is_problem(service.client.post("/api/drives", json=wrong | {"url": "tcp://127.0.0.1:9?device=1"}), 422)
    silent = service.client.post("/api/checks", json={"drive": "lab", "motor": "motor_2kw2"})
    assert "127.0.0.1:9" in json.dumps(is_problem(silent, 502))


def test_the_result_is_the_run_folders_own(service, finished):
    document = service.client.get(f"/api/runs/{finished}").json()
    assert document == json.loads((service.runs / finished / "result.json").read_text("utf-8"))
    assert document["parameters"]["stator_resistance_ohm"]["value"] == pytest.approx(3.7, rel=0.02)
    listed = service.client.get("/api/runs", params={"motor": "motor_2kw2", "outcome": "commissioned"}).json()["runs"]
    assert finished in [row["run"] for row in listed]
    assert service.client.get("/api/runs", params={"since": "2999"}).json()["runs"] == []


def test_events_are_the_journal_and_resume_where_they_were_left(service, finished):
    journal = [json.loads(line) for line in (service.runs / finished / "journal.jsonl").read_text("utf-8").splitlines()]
    everything = events_of(service, finished)
    assert [json.loads(e["data"]) for e in everything if "id" in e] == journal
    assert everything[-1]["event"] == "end"
    rest = events_of(service, finished, after=str(journal[9]["n"]))
    assert [int(e["id"]) for e in rest if "id" in e] == [line["n"] for line in journal[10:]]


def events_of(service, run: str, after: str = "") -> list[dict[str, str]]:
    events: list[dict[str, str]] = []
    headers = {"last-event-id": after} if after else {}
    with service.client.stream("GET", f"/api/runs/{run}/events", headers=headers) as stream:
        event: dict[str, str] = {}
        for line in stream.iter_lines():
            if line:
                key, _, value = line.partition(": ")
                event[key] = value
            elif event:
                events.append(event)
                event = {}
    return events


def test_report_and_exports(service, finished):
    report = service.client.get(f"/api/runs/{finished}/report")
    assert report.status_code == 200
    assert "sandbox" in report.headers["content-security-policy"]
    assert service.client.get(f"/api/runs/{finished}/export/json").json()["run"] == finished
    csv = service.client.get(f"/api/runs/{finished}/export/csv")
    assert csv.status_code == 200
    assert "current_u_a" in csv.text
    assert service.client.get(f"/api/runs/{finished}/export/mat").content[:6] == b"MATLAB"
    assert service.client.get(f"/api/runs/{finished}/export/parquet").content[:4] == b"PAR1"
    is_problem(service.client.get(f"/api/runs/{finished}/export/exe"), 422)


def test_writing_needs_the_token_of_the_table_and_restore_brings_the_old_values(service, finished):
    nothing_yet = httpx.get(f"{service.url}/runs/{finished}/write-back/done")
    assert nothing_yet.headers["location"] == f"/runs/{finished}"
    table = service.client.get(f"/api/runs/{finished}/write-back").json()
    assert {"register", "now", "will_be", "unit", "convention"} <= set(table["rows"][0])
    forged = is_problem(service.client.post(f"/api/runs/{finished}/write-back", json={"token": "another"}), 409)
    assert table["token"] not in str(forged) and forged["limit"] == "the token of the table as it is now"
    done = service.client.post(f"/api/runs/{finished}/write-back", json={"token": table["token"]}).json()
    assert done["outcome"] == "written"
    assert [w["read_back"] for w in done["report"]["written"]] == pytest.approx(
        [r["will_be"] for r in table["rows"]], rel=1e-6
    )
    for _look in range(2):  # a page looked at again writes nothing again
        page = httpx.get(f"{service.url}/runs/{finished}/write-back", follow_redirects=True)
        assert page.url.path.endswith("/write-back/done")
        assert "Written and read back" in page.text
    again = service.client.get(f"/api/runs/{finished}/write-back")
    assert "nothing to write" in is_problem(again, 409)["title"]
    old = service.client.get(f"/api/runs/{finished}/restore").json()
    assert [r["will_be"] for r in old["rows"]] == pytest.approx([r["now"] for r in table["rows"]])
    with ThreadPoolExecutor() as beside:
        asked = beside.submit(service.client.post, f"/api/runs/{finished}/restore", json={"token": old["token"]})
        steps = []
        while not asked.done():
            steps.append(httpx.get(f"{service.url}/api/runs/{finished}/writing").json()["step"])
    assert asked.result().json()["outcome"] == "restored"
    seen = [step for step in dict.fromkeys(steps) if step]
    assert "prove" in seen and seen == [step for step in STEPS if step in seen]
    assert service.client.get(f"/api/runs/{finished}/writing").json()["steps"] == []
    assert "Restored and read back" in httpx.get(f"{service.url}/runs/{finished}/restore/done").text
    page = (service.runs / finished / "report.html").read_text("utf-8")
    assert page.index("Restored on ") < page.index("Written on ") < page.index("SIM-INV-7A")
    told = [entry["what"] for entry in service.client.get("/api/audit").json()["entries"]]
    assert {"wrote", "restored", "asked to energise", "run begun"} <= set(told)
    assert service.client.get("/api/audit").json()["chain"]["is_intact"]


def test_a_run_compares_with_another_and_not_with_itself(service, finished):
    is_problem(service.client.get("/api/compare", params={"a": finished, "b": finished}), 422)
    second = f"{finished}-2"  # the same values, found again later
    service.add_copy(finished, second)
    compared = service.client.get("/api/compare", params={"a": second, "b": finished}).json()
    assert (compared["before"], compared["after"]) == (finished, second)
    assert compared["comparison"]["verdict"] == "same"
    points = [point["run"] for point in service.client.get("/api/motors/motor_2kw2/trend").json()["points"]]
    assert finished in points and points[-1] == second
    shutil.rmtree(service.runs / second)


def test_one_run_at_a_time_on_a_drive_and_stop_twice_is_harmless(service, finished):
    run = service.start_run()
    taken = is_problem(
        service.client.post("/api/runs", json={"drive": "simulator", "motor": "motor_2kw2", "confirm": True}), 409
    )
    assert taken["value"] == run
    is_problem(service.client.post("/api/checks", json={"drive": "simulator", "motor": "motor_2kw2"}), 409)
    is_problem(service.client.post("/api/simulator", json={"scenario": "linear"}), 409)
    assert service.client.post(f"/api/runs/{run}/stop", json={"reason": "enough"}).json()["zero_volts"]
    assert service.client.post(f"/api/runs/{run}/stop").json()["zero_volts"]
    result = service.wait_over(run)
    assert result["outcome"] == "aborted"
    assert result["error"]["value"] == "enough (operator)"


def test_a_recording_is_identified_and_one_that_is_none_is_refused(service, finished):
    recording = (service.runs / finished / "recording.parquet").read_bytes()
    files = {"files": ("run.parquet", recording)}
    job = service.client.post("/api/recordings", files=files, data={"verb": "identify"}).json()
    for _ in range(3000):
        document = service.client.get(f"/api/recordings/{job['id']}").json()
        if document["is_done"]:
            break
        time.sleep(0.02)
    assert document["exit_code"] == 0, document
    assert document["result"]["parameters"]["stator_resistance_ohm"]["value"] == pytest.approx(3.7, rel=0.02)
    pictures = service.client.get(document["report"])
    assert "sandbox" in pictures.headers["content-security-policy"]
    assert "Measured against simulated" in pictures.text and pictures.text.count("<svg") >= 6
    assert str(service.runs) not in pictures.text
    kept = set((service.runs / ".service" / "recordings").iterdir())
    is_problem(
        service.client.post("/api/recordings", files={"files": ("run.exe", b"MZ")}, data={"verb": "identify"}), 415
    )
    assert set((service.runs / ".service" / "recordings").iterdir()) == kept
