"""STOP at random instants of runs: `python -m tests.campaigns.page.stops --stops 200 [--seed N] [--speed 1]`.

Each run is started over the API on the simulated drive and stopped at an instant of its motor time that is drawn evenly, by
WebSocket, POST or plain form in turn. From the press to zero volts by the simulator's own log. Broken: later than 0.5 s, or a
stop that says confirmed while the log says energised.
"""

from __future__ import annotations

import argparse
import json
import random
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

from tests.support.service_process import ServiceProcess

LONGEST_S = 0.5
MOTOR_TIME_S = 11.0
"""Of one axis; a run that is past its last volt is stopped, too."""


@dataclass(frozen=True)
class Stop:
    """`zero_volts_s` None: the output was off when STOP was pressed."""

    way: str
    at_motor_s: float
    zero_volts_s: float | None
    answer_s: float
    is_confirmed: bool


def by_post(service: ServiceProcess, run: str, _line: ClientConnection) -> bool:
    return service.client.post(f"/api/runs/{run}/stop", json={"reason": "campaign"}).status_code == 200


def by_form(service: ServiceProcess, run: str, _line: ClientConnection) -> bool:
    return service.client.post("/stop", data={"run": run}, follow_redirects=False).status_code == 303


def by_socket(_service: ServiceProcess, _run: str, line: ClientConnection) -> bool:
    line.send('{"stop": "campaign"}')
    while "stopped" not in (said := json.loads(line.recv())):
        pass
    return all(one["zero_volts"] for one in said["stopped"])


WAYS: tuple[Callable[[ServiceProcess, str, ClientConnection], bool], ...] = (by_socket, by_post, by_form)


def one_stop(service: ServiceProcess, number: int, draw: random.Random) -> Stop:
    """A run, begun, stopped, judged by the simulator's log."""
    run, way, wanted_s = service.start_run(), WAYS[number % len(WAYS)], draw.uniform(0.0, MOTOR_TIME_S)

    def is_there(document: dict[str, Any]) -> bool:
        live = document.get("live")
        return live is None or (bool(live["tests"]) and live["tests"][0]["energised_s"] >= wanted_s and wanted_s > 0.0)

    with connect(
        f"ws://127.0.0.1:{service.port}/api/runs/{run}/control", max_queue=None
    ) as line:  # a page's is open before
        service.wait_for(run, is_there, 120)
        was_energised, pressed, began = service.is_energised(), time.time(), time.monotonic()
        is_confirmed = way(service, run, line)
        answer_s = time.monotonic() - began
    zero_volts_s = service.wait_dead(pressed)
    service.wait_over(run)
    is_late_edge = was_energised and zero_volts_s == 0.0  # it went off by itself between look and press
    return Stop(
        way.__name__, wanted_s, zero_volts_s if was_energised and not is_late_edge else None, answer_s, is_confirmed
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stops", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--speed", default="max")
    asked = parser.parse_args()
    draw, stops = random.Random(asked.seed), []
    with tempfile.TemporaryDirectory() as folder, ServiceProcess(Path(folder) / "s", speed=asked.speed) as service:
        service.start_simulator()
        for number in range(asked.stops):
            stops.append(one_stop(service, number, draw))
            print(json.dumps(vars(stops[-1])), file=sys.stderr, flush=True)
    energised = [stop.zero_volts_s for stop in stops if stop.zero_volts_s is not None]
    broken = sum(s > LONGEST_S for s in energised) + sum(not stop.is_confirmed for stop in stops)
    report = {
        "stops": len(stops),
        "energised": len(energised),
        "median_s": round(statistics.median(energised), 4) if energised else None,
        "worst_s": round(max(energised), 4) if energised else None,
        "median_answer_s": round(statistics.median(stop.answer_s for stop in stops), 4),
        "broken": broken,
    }
    print(json.dumps(report))
    return 3 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
