"""`commissioner serve` as a process of its own, with its archive in a folder that goes away.

with ServiceProcess(tmp_path, speed="max") as service:
    service.client.get("/api/health")
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import httpx

START_S = 30.0
SIX_AXES_DEG = [0, 60, 120, 180, 240, 300]


class ServiceProcess:
    """`url` is where it serves. Ended at the end, with all that it started."""

    def __init__(
        self,
        folder: Path,
        *,
        speed: str = "max",
        more: str = "",
        port: int = 0,
        settings: str = "",
        diagnosis: bool = False,
    ) -> None:
        self.folder, self.runs = folder, folder / "runs"
        self.config = folder / "service.toml"
        folder.mkdir(parents=True, exist_ok=True)
        service = f"[service]\ndiagnosis = {'true' if diagnosis else 'false'}\n{settings}\n"
        self.config.write_text(f'{service}[simulator]\nspeed = "{speed}"\n{more}', encoding="utf-8")
        self._port = port

    def __enter__(self) -> ServiceProcess:
        began = time.monotonic()
        self.process = subprocess.Popen(
            [sys.executable, "-m", "commissioner", "serve", "--port", str(self._port), "--config", str(self.config),
             "--runs", str(self.runs), "--json"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True, start_new_session=True,
        )  # fmt: skip
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line.startswith('{"url"'):
            raise AssertionError(f"the service did not start: {line}{self.process.communicate()[1]}")
        self.ready_s = time.monotonic() - began
        self.url: str = json.loads(line)["url"]
        self.port = int(self.url.rsplit(":", 1)[1])
        self.client = httpx.Client(base_url=self.url, timeout=90.0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.client.close()
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.communicate(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.communicate()
        for pid in self._children("sim"):
            with suppress(ProcessLookupError):  # it was ending by itself
                os.kill(pid, signal.SIGKILL)

    def add_copy(self, run: str, name: str) -> None:
        """A run of the archive once more under another name, there at once and whole: one that is still being copied looks like one that
        somebody has just begun, and has the drive."""
        aside = self.folder / "aside"
        shutil.copytree(self.runs / run, aside)
        aside.rename(self.runs / name)

    def page(self, path: str) -> str:
        """A page as a browser gets it that was never here before; the scripts' client stays without a session."""
        return httpx.get(self.url + path, headers={"accept": "text/html"}, timeout=90.0).text

    def start_simulator(self, scenario: str = "default") -> None:
        answer = self.client.post("/api/simulator", json={"scenario": scenario})
        assert answer.status_code == 201, answer.text

    def start_run(self, **more: Any) -> str:
        """A run on the simulator, of six tests so that it is there when it is to be stopped; its id."""
        wish = {"drive": "simulator", "motor": "motor_2kw2", "axes_deg": SIX_AXES_DEG, "confirm": True} | more
        end = time.monotonic() + 15.0
        while True:
            answer = self.client.post("/api/runs", json=wish)
            if answer.status_code != 409 or "operates" not in answer.text or time.monotonic() > end:
                break
            time.sleep(0.1)  # a page that has just been closed is still being missed
        assert answer.status_code == 201, answer.text
        return str(answer.json()["id"])

    def wait_for(self, run: str, reached: Any, timeout_s: float = 200.0) -> dict[str, Any]:
        """The run's document as soon as `reached` says so of it; not waited for where the run has ended without."""
        end, document = time.monotonic() + timeout_s, dict[str, Any]()
        while time.monotonic() < end and document.get("outcome") is None:
            document = self.client.get(f"/api/runs/{run}").json()
            if reached(document):
                return document
            time.sleep(0.03)
        raise AssertionError(f"not reached within {timeout_s} s: {document}")

    def wait_energised(self, run: str) -> None:
        self.wait_for(run, lambda document: (document.get("live") or {}).get("output") == "on")

    def wait_over(self, run: str, timeout_s: float = 300.0) -> dict[str, Any]:
        """The result, once its process has gone."""
        self.wait_for(run, lambda document: document.get("outcome") is not None, timeout_s)
        end = time.monotonic() + timeout_s
        while run in self.client.get("/api/health").json()["runs_live"] and time.monotonic() < end:
            time.sleep(0.05)
        return dict(self.client.get(f"/api/runs/{run}").json())

    def truth(self) -> list[dict[str, Any]]:
        """What was really true at the simulated drive so far."""
        path = self.runs / ".service" / "logs" / "simulator.jsonl"
        lines = path.read_text("utf-8").splitlines() if path.is_file() else []
        return [json.loads(line) for line in lines if line.endswith("}")]

    def energised_times(self) -> int:
        """How often so far, by the simulator's own log: a run pauses between its sessions."""
        return sum(line["event"] == "energised" for line in self.truth())

    def is_energised(self) -> bool:
        """By the simulator's own log."""
        events = [line["event"] for line in self.truth() if line["event"] in ("energised", "de_energised")]
        return bool(events) and events[-1] == "energised"

    def wait_dead(self, since_wall: float, timeout_s: float = 5.0) -> float:
        """Seconds from `since_wall` to zero volts by the simulator's log; zero where it was dead before."""
        end = time.monotonic() + timeout_s
        while self.is_energised() and time.monotonic() < end:
            time.sleep(0.01)
        assert not self.is_energised(), "still energised"
        last = [line for line in self.truth() if line["event"] == "de_energised"][-1]
        return max(0.0, float(last["wall"]) - since_wall)

    def run_processes(self) -> dict[str, int]:
        """The processes of the runs that this service has started, by host and port of their drive."""
        found = {}
        for pid in self._children("--dead-man"):
            command = (Path("/proc") / str(pid) / "cmdline").read_bytes().decode("utf-8", "replace").split("\0")
            url = command[command.index("--drive") + 1]
            found[url.partition("//")[2].partition("?")[0]] = pid
        return found

    def kill(self) -> None:
        """SIGKILL to the service alone."""
        self.process.kill()
        self.process.wait()

    def _children(self, word: str) -> list[int]:
        """Processes whose command line names this archive and `word`."""
        found = []
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    command = (entry / "cmdline").read_bytes().decode("utf-8", "replace")
                except OSError:
                    continue
                if word in command and str(self.folder) in command:
                    found.append(int(entry.name))
        return found
