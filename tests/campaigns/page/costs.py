"""What the service costs: `python -m tests.campaigns.page.costs [--runs N] [--viewers 20] [--hours 8]`; CPU in seconds of one core.

ready: process start to the first answer. paint: first contentful paint of the start page and of a result. viewers: CPU of the
service over one live run with so many pages and scripts watching, the largest delay of a record, records and blocks missed.
memory: resident size of the service after each of N runs, then over `--hours` of motor time of runs that a simulated one's journal
and blocks are played from, as a run of another process writes them, each looked at as a page and as a result.
overhead: service and run together, a page at the run, against `commissioner run`.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from tests.support.service.browser import chromium, technician
from tests.support.service.service_process import ServiceProcess

PAINTED = "() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? null"
PIECES, TOGETHER = 8, 16
TICKS = os.sysconf("SC_CLK_TCK")


def cpu_s(pid: int, *, with_children: bool = False) -> float:
    """User and system time of a process, and of those of its children that have ended."""
    fields = Path(f"/proc/{pid}/stat").read_text("utf-8").rsplit(")", 1)[1].split()
    return sum(int(fields[k]) for k in ((11, 12, 13, 14) if with_children else (11, 12))) / TICKS


def resident_mb(pid: int) -> float:
    """Megabytes."""
    line = next(x for x in Path(f"/proc/{pid}/status").read_text("utf-8").splitlines() if x.startswith("VmRSS"))
    return int(line.split()[1]) / 1024


@dataclass
class Viewer:
    """One script at the event stream: records and blocks seen, and how late the latest record was."""

    service: ServiceProcess
    run: str
    records: list[int] = field(default_factory=list)
    blocks: int = 0
    latest_s: float = 0.0

    def watch(self) -> None:
        import datetime as dt

        import httpx

        with (
            httpx.Client(base_url=self.service.url, timeout=120) as client,
            client.stream("GET", f"/api/runs/{self.run}/events") as stream,
        ):
            event, began = "", time.time()
            for line in stream.iter_lines():
                if line.startswith("event: "):
                    event = line[7:]
                    if event == "end":
                        return
                elif line.startswith("data: "):
                    document = json.loads(line[6:])
                    if event == "samples":
                        self.blocks = document["blocks"]
                    elif "n" in document:
                        self.records.append(document["n"])
                        written = dt.datetime.fromisoformat(document["utc"]).timestamp()
                        if written > began:
                            self.latest_s = max(self.latest_s, time.time() - written)


def page(service: ServiceProcess, run: str) -> None:
    """One page's line; it only listens."""
    try:
        with connect(f"ws://127.0.0.1:{service.port}/api/runs/{run}/control") as socket:
            while "over" not in json.loads(socket.recv()):
                pass
    except ConnectionClosed:
        pass


def viewers(service: ServiceProcess, count: int) -> dict[str, object]:
    """One run, half of the watchers scripts and half pages."""
    run = service.start_run(axes_deg=[0])
    scripts = [Viewer(service, run) for _ in range(count // 2)]
    threads = [threading.Thread(target=viewer.watch) for viewer in scripts]
    threads += [threading.Thread(target=page, args=(service, run)) for _ in range(count - count // 2)]
    before_s, began = cpu_s(service.process.pid), time.monotonic()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(600)
    seconds, used_s = time.monotonic() - began, cpu_s(service.process.pid) - before_s
    lines = len((service.runs / run / "journal.jsonl").read_text("utf-8").splitlines())
    return {
        "viewers": count,
        "of_a_core_percent": round(100 * used_s / seconds, 1),
        "cpu_s": round(used_s, 2),
        "latest_record_s": round(max(viewer.latest_s for viewer in scripts), 3),
        "records_missed": sum(lines - len(set(viewer.records)) for viewer in scripts),
        "blocks_seen": sorted({viewer.blocks for viewer in scripts}),
    }


def play_again(service: ServiceProcess, run: str, name: str) -> None:
    """The run once more under another name: journal and blocks in pieces, while the service follows; then what it saved at its end."""
    source, target = service.runs / run, service.runs / name
    target.mkdir()
    shutil.copy(source / "request.json", target)
    for part in range(PIECES):
        for file in ("blocks.bin", "journal.jsonl"):
            data = (source / file).read_bytes()
            with (target / file).open("ab") as out:
                out.write(data[part * len(data) // PIECES : (part + 1) * len(data) // PIECES])
        if part == PIECES // 2:
            service.page(f"/runs/{name}")
        time.sleep(0.25)
    for path in source.iterdir():
        if not (target / path.name).exists():
            shutil.copy(path, target)


def memory_over(service: ServiceProcess, run: str, hours: float) -> dict[str, object]:
    """Megabytes while runs of so many hours of motor time go by, `TOGETHER` at a time; each is followed to its end and forgotten."""
    each_s = float(json.loads((service.runs / run / "result.json").read_text("utf-8"))["energised_s"])
    count, seen = max(TOGETHER, round(3600.0 * hours / each_s)), []
    for first in range(0, count, TOGETHER):
        names = [f"20990101-{number:06d}-simulated" for number in range(first, min(first + TOGETHER, count))]
        with ThreadPoolExecutor(TOGETHER) as pool:
            list(pool.map(lambda name: play_again(service, run, name), names))
        while set(names) & set(service.client.get("/api/health").json()["runs_live"]):
            time.sleep(0.1)
        service.page(f"/runs/{names[0]}")
        for name in names:
            shutil.rmtree(service.runs / name)
        seen.append(resident_mb(service.process.pid))
    known = len(service.client.get("/api/health").json()["runs_live"])
    every = max(1, len(seen) // 12)
    return {
        "runs": count,
        "motor_hours": round(count * each_s / 3600.0, 2),
        "mb": [round(mb, 1) for mb in seen[::every]],
        "live_after": known,
    }


def paint(service: ServiceProcess, run: str) -> dict[str, float]:
    """Milliseconds from the navigation to the first contentful paint: median of four visits after the first."""
    found = dict[str, float]()
    with chromium() as browser, technician(browser, service) as hand:
        for name, path in (("start", "/"), ("result", f"/runs/{run}")):
            times = []
            for _ in range(5):
                hand.go(path)
                while (ms := hand.page.evaluate(PAINTED)) is None:
                    hand.page.wait_for_timeout(20)
                times.append(ms)
            found[name] = statistics.median(times[1:])
    return {name: round(ms) for name, ms in found.items()}


def command_line_s(service: ServiceProcess) -> float:
    """CPU of the same run by `commissioner run`, on the same simulator."""
    url = next(d["url"] for d in service.client.get("/api/drives").json()["drives"] if d["id"] == "simulator")
    command = [sys.executable, "-m", "commissioner", "run", "--drive", url, "--motor", "motor_2kw2", "--axes", "0", "--yes", "--no-diagnosis",
               "--runs", str(service.folder / "by_hand"), "--json"]  # fmt: skip
    before = os.times()
    subprocess.run(command, check=True, capture_output=True)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--speed", default="1")
    parser.add_argument("--hours", type=float, default=8.0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, ServiceProcess(Path(folder) / "s", speed=asked.speed) as service:
        pid = service.process.pid
        report: dict[str, object] = {"ready_s": round(service.ready_s, 2), "ready_cpu_s": round(cpu_s(pid), 2)}
        service.start_simulator()
        service.wait_over(service.start_run(axes_deg=[0]), 600)
        memory, through_page = [round(resident_mb(pid), 1)], []
        for _ in range(asked.runs):
            before = cpu_s(pid, with_children=True)
            page(service, service.start_run(axes_deg=[0]))
            time.sleep(0.5)
            through_page.append(round(cpu_s(pid, with_children=True) - before, 2))
            memory.append(round(resident_mb(pid), 1))
        run = service.client.get("/api/runs").json()["runs"][0]["run"]
        report |= {"memory_mb": memory, "through_the_service_cpu_s": through_page}
        report["command_line_cpu_s"] = round(min(command_line_s(service) for _ in range(2)), 2)
        report["paint_ms"] = paint(service, run)
        report["watched"] = viewers(service, asked.viewers)
        report["memory_over"] = memory_over(service, run, asked.hours)
    print(json.dumps(report))
    return 0


if __name__ == "__main__":
    sys.exit(main())
