"""One commissioning run through a man in the middle, judged by the simulator's log and answer key alone."""

from __future__ import annotations

import json
import os
import signal
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from commissioner.motor.nameplate import rated_flux
from commissioner.procedure.findings import RunEnded
from commissioner.run.commission import commission
from commissioner.settings import load_motor, load_procedure
from tests.campaigns.combinations import CASES, Case, scenario
from tests.campaigns.hostile_run.middle import Middle
from tests.campaigns.hostile_run.troubles import SENSORS, Trouble
from tests.support.command_line import at_flux, truth
from tests.support.sim_process import SimProcess

MOTORS = ("default", "0k37_large_drive", "1k1_fast_switching", "2k2_ideal_devices", "4k_slow_switching")
"""Of `tests.campaigns.combinations`: motors whose run in real time is short."""
MOST_FLUX, WRONG, SIGMAS = 1.02, 0.03, 3.0
LONGEST_S = 180.0


@dataclass(frozen=True)
class Judged:
    """`flux`: largest true stator flux over the limit; `current`: largest true current over the trip limit of the plan;
    `told`: the largest flux that the result tells; `wrong`: parameters of a commissioned run that are wrong."""

    seed: int
    motor: str
    trouble: Trouble
    ended: str
    reason: str
    flux: float
    current: float
    told: float
    wrong: tuple[str, ...]
    seconds: float

    @property
    def broken(self) -> tuple[str, ...]:
        out = [f"true flux {self.flux:.3f} of its limit"] if self.flux > MOST_FLUX else []
        out += [f"wrong and commissioned: {name}" for name in self.wrong]
        if self.trouble.kind in SENSORS and self.current > 1.0:
            out.append(f"a false sensor let the true current to {self.current:.2f} of its limit")
        if self.ended == "none":
            out.append(self.reason)
        return tuple(out)


def plan(axes: tuple[float, ...] = (0.0,)) -> Any:
    """One axis, a short multitone: every stage of a run, in real time in about twenty seconds."""
    whole = load_procedure(None, axes)
    return replace(
        whole, repeat_first=False, excitation=replace(whole.excitation, seconds=2.5),
        supervision=replace(whole.supervision, standstill_dwell_s=0.05),
    )  # fmt: skip


def run_one(seed: int, motor: str, trouble: Trouble, folder: Path) -> Judged:
    """The run in a process of its own, which can be stopped, over a real wire in real time."""
    case = next(case for case in CASES if case.name == motor)
    name, plate_file, key = _written(case, folder)
    began, ended = time.monotonic(), folder / "ended.json"
    with SimProcess("--scenario", name, "--tcp", "0", "--seed", str(seed), speed="1") as sim:
        port = int(sim.url.rsplit(":", 1)[1].split("?")[0])
        with Middle(port, trouble, seed) as middle:
            child = os.fork()
            if child == 0:
                _child(f"tcp://127.0.0.1:{middle.port}", plate_file, folder, ended)
            _wait(child, middle, trouble)
        log = sim.log()
    return _judge(seed, motor, trouble, key, plate_file, log, ended, time.monotonic() - began)


def _written(case: Case, folder: Path) -> tuple[str, Path, Any]:
    name = case.name
    if case.machine:
        file = folder / f"{case.name}.toml"
        file.write_text(scenario(case), encoding="utf-8")
        name = str(file)
    key = truth(name)
    plate = folder / "plate.toml"
    rows = "".join(f"{k} = {v}\n" for k, v in key["nameplate"].items())
    plate.write_text(rows + 'connection = "star"\n', encoding="utf-8")
    return name, plate, key


def _child(url: str, plate: Path, folder: Path, ended: Path) -> None:
    """The product, as a fork of this process with all its kernels loaded; never returns."""
    try:
        sys.stderr = (folder / "stderr.txt").open("w", encoding="utf-8")
        signal.alarm(int(LONGEST_S))
        done = commission(
            url,
            "simulated",
            load_motor(str(plate)),
            plan(),
            write_back=True,
            runs=folder / "runs",
            present=lambda record: None,
        )
        ended.write_text(json.dumps(_plain(done.ended, done.result)), encoding="utf-8")
    except BaseException as error:
        ended.write_text(json.dumps({"ended": "none", "reason": repr(error), "result": {}}), encoding="utf-8")
    finally:
        os._exit(0)


def _plain(ended: RunEnded, result: Any) -> dict[str, Any]:
    kept = ("parameters", "holds_for_stator_flux_wb", "flux_guard")
    return {"ended": ended.outcome, "reason": ended.reason, "result": {k: result[k] for k in kept if k in result}}


def _wait(child: int, middle: Middle, trouble: Trouble) -> None:
    """Until the child has ended; a host stop is carried out when its moment has come."""
    has_stopped = trouble.kind != "host_stop"
    while os.waitpid(child, os.WNOHANG) == (0, 0):
        began = middle.began(trouble.session)
        if not has_stopped and began and time.time() >= began + trouble.at_s:
            has_stopped = True
            os.kill(child, signal.SIGSTOP)
            time.sleep(trouble.amount)
            os.kill(child, signal.SIGCONT)
        time.sleep(0.005)


def _judge(
    seed: int, motor: str, trouble: Trouble, key: Any, plate_file: Path, log: Any, ended: Path, seconds: float
) -> Judged:
    plate = load_motor(str(plate_file))
    limits = plan().limits
    limit_wb = limits.flux_fraction * rated_flux(plate, key["apparent_stator_resistance_ohm"]).stator_peak_wb
    peaks = [row for row in log if row["event"] == "peaks"]
    said = (
        json.loads(ended.read_text("utf-8")) if ended.is_file() else {"ended": "none", "reason": "no end", "result": {}}
    )
    result = said["result"]
    guard = result.get("flux_guard") or {}
    return Judged(
        seed, motor, trouble, said["ended"], said["reason"],
        max((row["stator_flux_wb"] for row in peaks), default=0.0) / limit_wb,
        max((row["current_a"] for row in peaks), default=0.0) / (limits.trip_fraction * plate.rated_current_peak_a),
        guard.get("peak_fraction") or 0.0,
        _wrong(result, key) if said["ended"] == "commissioned" else (), seconds,
    )  # fmt: skip


def _wrong(result: Any, key: Any) -> tuple[str, ...]:
    """Parameters further off than three standard errors and than three per cent."""
    out = []
    for name, true in at_flux(key, result["holds_for_stator_flux_wb"]).items():
        found = result["parameters"][name]
        off = abs(found["value"] - true)
        if off > SIGMAS * found["std"] and off > WRONG * true:
            out.append(f"{name} {100 * (found['value'] / true - 1):+.1f} %")
    return tuple(out)
