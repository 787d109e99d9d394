"""What the service survives, and what it says afterwards: killed processes, a full disk, clocks that jump, others at the drive."""

import asyncio
import datetime as dt
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from starlette.testclient import TestClient

from commissioner.service import parts as service_parts
from commissioner.service.application import create_app
from commissioner.service.configuration import Settings
from commissioner.service.runs.desk import Desk, LiveRun
from commissioner.service.runs.feed import Feed
from commissioner.service.serving import OPEN_FILES
from tests.support.service.service_process import ServiceProcess
from tests.support.sim_process import SimProcess

ZERO_VOLTS_S, WATCHDOG_S = 0.5, 0.5
SEEN_S = 2.0
"""A run of another process is on the page so soon after it has a folder."""


@pytest.fixture(scope="module")
def bench():
    """A drive that outlives every service."""
    with SimProcess("--tcp", "0") as sim:
        yield sim


def serve(folder, bench, **more) -> ServiceProcess:
    drive = f'[[drives]]\nid = "bench"\nname = "Bench"\nurl = "{bench.url}?device=1"\nprofile = "simulated"\n'
    return ServiceProcess(folder, more=drive, **more)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("survival")


@pytest.fixture(scope="module")
def service(folder, bench):
    with serve(folder, bench, speed="1") as made:
        made.start_simulator()
        yield made


def dead_after_s(bench, since_wall, timeout_s=5.0):
    """Seconds from `since_wall` to zero volts at the bench, by the simulator's log."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        events = [line for line in bench.log() if line["event"] in ("energised", "de_energised")]
        if events[-1]["event"] == "de_energised":
            return max(0.0, events[-1]["wall"] - since_wall)
        time.sleep(0.01)
    raise AssertionError("still energised")


def state_of(service, drive="bench"):
    """What the page's band goes by: the drive's word, as soon as it is fresh."""
    for _ in range(300):
        state = service.client.get(f"/api/drives/{drive}/state").json()
        if state["age_s"] is not None and state["age_s"] < 1.0 and not state["error"]:
            return state
        time.sleep(0.05)
    raise AssertionError(state)


def test_two_drives_each_with_its_run_and_one_whose_process_is_killed(service, bench):
    """The one of the simulator is killed: its drive has a watchdog fault then, which nobody resets."""
    runs = {"bench": service.start_run(drive="bench"), "simulator": service.start_run()}
    processes = service.run_processes()
    assert set(runs.values()) <= set(service.client.get("/api/health").json()["runs_live"])
    for drive, run in runs.items():
        answer = service.client.post("/api/runs", json={"drive": drive, "motor": "motor_2kw2", "confirm": True})
        assert (answer.status_code, answer.json()["value"]) == (409, run)
    service.wait_energised(runs["simulator"])
    began = time.time()
    os.kill(next(pid for drive, pid in processes.items() if drive not in bench.url), signal.SIGKILL)
    assert service.wait_dead(began) <= WATCHDOG_S + ZERO_VOLTS_S
    service.wait_over(runs["simulator"])
    assert runs["bench"] in service.client.get("/api/health").json()["runs_live"]
    assert service.client.post(f"/api/runs/{runs['bench']}/stop").json()["zero_volts"]
    cut = service.client.get(f"/api/runs/{runs['simulator']}").json()
    assert cut["outcome"] == "cut off"
    page = service.page(f"/runs/{runs['simulator']}")
    assert "The run was cut off" in page and "the drive’s watchdog switched the output off" in page
    assert state_of(service, "simulator")["is_energised"] is False
    told = [
        entry for entry in service.client.get("/api/audit").json()["entries"] if entry.get("run") == runs["simulator"]
    ]
    assert told[0]["what"] == "run ended: cut off"
    service.wait_over(runs["bench"])


def test_a_run_from_the_command_line_is_shown_and_can_be_stopped_from_the_page(service, bench):
    command = [sys.executable, "-m", "commissioner", "run", "--drive", f"{bench.url}?device=1", "--motor", "motor_2kw2", "--axes", "0", "--yes",
               "--no-diagnosis", "--runs", str(service.runs), "--json"]  # fmt: skip
    before = {row["run"] for row in service.client.get("/api/runs").json()["runs"]}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            while not (found := set(service.client.get("/api/health").json()["runs_live"]) - before):
                assert process.poll() is None, process.stdout.read()
                time.sleep(0.02)
            (run,) = found
            first = (service.runs / run / "journal.jsonl").read_text("utf-8").splitlines()[0]
            assert time.time() - dt.datetime.fromisoformat(json.loads(first)["utc"]).timestamp() <= SEEN_S
            service.wait_energised(run)
            taken = service.client.post("/api/checks", json={"drive": "bench", "motor": "motor_2kw2"})
            assert (taken.status_code, taken.json()["value"]) == (409, run)
            began = time.time()
            stopped = service.client.post(f"/api/runs/{run}/stop", json={"reason": "seen on the page"}).json()
            assert stopped["zero_volts"] and dead_after_s(bench, began) <= ZERO_VOLTS_S
            document = json.loads(process.communicate(timeout=60)[0])
        finally:
            process.kill()
    assert process.returncode == 4
    assert document["error"]["value"] == "seen on the page (operator)"


def test_a_killed_service_leaves_zero_volts_and_its_successor_explains_what_was(folder, service, bench):
    run = service.start_run(drive="bench")
    service.wait_energised(run)
    began = time.time()
    service.kill()
    assert dead_after_s(bench, began) <= ZERO_VOLTS_S
    with serve(folder, bench) as successor:
        result = successor.wait_over(run)
        assert (result["outcome"], result["error"]["what"]) == ("aborted", "stopped by the service")
        assert "the service that started this run is gone" in result["error"]["value"]
        assert successor.client.get("/api/health").json()["runs_live"] == []
        assert state_of(successor)["is_energised"] is False
        page = successor.page(f"/runs/{run}")
        assert "Stopped by the service" in page and "the service that started this run is gone" in page
        assert successor.client.get("/api/audit").json()["chain"]["is_intact"]
        again = successor.start_run(drive="bench")
        successor.wait_energised(again)
        assert successor.client.post(f"/api/runs/{again}/stop").json()["zero_volts"]
        successor.wait_over(again)


# --- in the application alone -------------------------------------------------------------------------------------
@pytest.fixture
def client(tmp_path):
    parts = service_parts.make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    parts.library.simulator_url = "tcp://127.0.0.1:9?device=1"
    return TestClient(create_app(parts), base_url="http://127.0.0.1:8321", raise_server_exceptions=False)


def test_on_a_full_disk_nothing_is_begun_and_stop_works(client, monkeypatch):
    def full(*_facts, **_more):
        raise OSError(errno.ENOSPC, "No space left on device")

    def never(*_facts, **_more):
        raise AssertionError("a run was started")

    monkeypatch.setattr("commissioner.service.audit.Audit.write", full)
    monkeypatch.setattr(Desk, "start", never)
    answer = client.post("/api/runs", json={"drive": "simulator", "motor": "motor_2kw2", "confirm": True})
    assert answer.status_code == 507 and answer.headers["content-type"] == "application/problem+json"
    assert answer.json()["value"] == "No space left on device" and "make room" in answer.json()["remedy"]
    assert client.post("/api/stop").status_code == 200
    page = client.get("/runs", headers={"accept": "text/html"})
    assert page.status_code == 200


def test_the_service_may_open_as_many_files_as_the_system_lets_it():
    """Each reader is one; some systems give 256 unless asked."""
    resource = pytest.importorskip("resource")
    code = "import resource as r; from commissioner.service.serving import _open_more_files as more; most = r.getrlimit(r.RLIMIT_NOFILE)[1]; "
    code += "r.setrlimit(r.RLIMIT_NOFILE, (256, most)); more(); print(r.getrlimit(r.RLIMIT_NOFILE)[0])"
    most = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert int(said) == (OPEN_FILES if most == resource.RLIM_INFINITY else min(OPEN_FILES, most))


class Chronicle:
    """A run's folder, written by hand; its clock is off by `hours`."""

    def __init__(self, folder: Path, hours: float) -> None:
        self.folder, self._hours, self._n = folder, hours, 0
        folder.mkdir(parents=True)
        (folder / "blocks.bin").touch()

    def write(self, kind, **record):
        utc = (dt.datetime.now(dt.UTC) + dt.timedelta(hours=self._hours)).isoformat()
        line = {"n": self._n, "kind": kind, "utc": utc, "record": record}
        self._n += 1
        with (self.folder / "journal.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")


def test_a_folder_that_cannot_be_read_holds_up_no_stop(client, tmp_path, monkeypatch):
    """As where the system has no file left to open."""
    desk, told = client.app.state.parts.desk, list[tuple[str, str]]()
    chronicle = Chronicle(tmp_path / "runs" / "20260101-000000-simulated", 0.0)
    chronicle.write("about_to", action="energise")
    feed = Feed(chronicle.folder)
    feed.poll()
    (chronicle.folder / "journal.jsonl").unlink()
    (chronicle.folder / "journal.jsonl").mkdir()
    child = SimpleNamespace(stop=lambda *word: told.append(word))
    desk.runs[chronicle.folder.name] = LiveRun(chronicle.folder.name, "simulator", "motor_2kw2", feed, None, child)
    monkeypatch.setattr("commissioner.service.runs.desk.CONFIRM_S", 0.05)
    answer = client.post("/api/stop")
    assert answer.status_code == 502 and "emergency stop" in answer.json()["remedy"]
    assert told == [("operator", "STOP (POST)")]


@pytest.mark.parametrize("hours", [-30.0, 30.0])
def test_a_clock_that_jumps_makes_no_stop_late_and_no_word_old(client, tmp_path, hours):
    import asyncio

    desk = client.app.state.parts.desk
    chronicle = Chronicle(tmp_path / "runs" / "20260101-000000-simulated", hours)
    chronicle.write("about_to", action="energise")
    feed = Feed(chronicle.folder)
    feed.poll()
    run = LiveRun(chronicle.folder.name, "simulator", "motor_2kw2", feed, None)
    desk.runs[run.id] = run

    async def stop():
        stopping = asyncio.create_task(desk.stop(run, "somebody", "enough"))
        await asyncio.sleep(0.1)
        chronicle.write("disarmed", verified={"is_confirmed": True, "state": "switch-on disabled"})
        return await stopping

    with ThreadPoolExecutor(1) as apart:  # a browser's tests before this one keep a loop in the main thread
        stopped = apart.submit(asyncio.run, stop()).result()
    assert stopped.zero_volts and 0.05 < stopped.after_s < 2.0
    chronicle.write("run_ended", outcome="aborted", reason="stopped by the operator")
    feed.poll()
    assert feed.age_s < 2.0
    assert "data 0." in client.get(f"/runs/{run.id}", headers={"accept": "text/html"}).text or feed.state.is_over


def test_a_folder_that_was_taken_away_under_a_run_is_said_to_be_gone(client, tmp_path):
    """Its page stood there as of a test in progress."""
    chronicle = Chronicle(tmp_path / "runs" / "20260101-000000-simulated", 0.0)
    chronicle.write("about_to", action="energise")
    feed = Feed(chronicle.folder)
    feed.poll()
    run = LiveRun(chronicle.folder.name, "simulator", "motor_2kw2", feed, None, is_over=True)
    client.app.state.parts.desk.runs[run.id] = run
    shutil.rmtree(chronicle.folder)
    answer = client.get(f"/runs/{run.id}", headers={"accept": "text/html"})
    assert answer.status_code == 404 and "in progress" not in answer.text
    assert f"The folder of {run.id} is gone" in answer.text and "check the drive and start anew" in answer.text


def test_a_run_that_could_not_write_its_end_is_told_with_what_its_process_said(client, tmp_path):
    """On a full disk it was told as one whose process is gone, and whose drive went silent."""
    chronicle = Chronicle(tmp_path / "runs" / "20260101-000000-simulated", 0.0)
    chronicle.write("about_to", action="energise")
    chronicle.write("disarmed", verified={"is_confirmed": True, "state": "switch-on disabled"})
    error = {
        "what": "no room left",
        "step": "archive",
        "value": "x",
        "limit": "a disk with room",
        "remedy": "make room",
    }

    async def wait():
        return {"outcome": "faulted", "error": error}

    run = LiveRun(
        chronicle.folder.name, "simulator", "motor_2kw2", Feed(chronicle.folder), None, SimpleNamespace(wait=wait)
    )
    desk = client.app.state.parts.desk
    desk.runs[run.id] = run
    with ThreadPoolExecutor(1) as apart:
        apart.submit(asyncio.run, desk._follow(run)).result()
    page = client.get(f"/runs/{run.id}", headers={"accept": "text/html"}).text
    assert (
        "The run was cut off" in page and "No room left" in page and "Make room" in page and "went silent" not in page
    )
