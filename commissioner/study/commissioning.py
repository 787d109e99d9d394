"""One simulated commissioning: the product's own course, runner, guards and verdict, on a drive in this process or behind a
socket. No archive is kept; the row is."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from commissioner.errors import CommissionerError
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.in_process import InProcessPort
from commissioner.motor.circuit import PARAMETERS
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.course import Findings, Job, course
from commissioner.procedure.energised.excite import warm_up
from commissioner.procedure.findings import RunEnded
from commissioner.procedure.plan import ProcedurePlan
from commissioner.run.archive.folder import RunFolder
from commissioner.run.job import bounds, make_job, open_drive, watch_limits
from commissioner.run.runner import Runner
from commissioner.settings import load_procedure
from commissioner.study.drawing import draw
from commissioner.study.own_process import simulated_inverter
from commissioner.study.rows import Row
from commissioner.study.simulators import Drawn
from commissioner.study.specification import Case

PROFILE = "simulated"


class NoArchive:
    """Takes what a run folder takes, and keeps nothing."""

    path = Path()

    def journal(self, kind: str, record: object, *, durable: bool = False) -> None: ...

    def append(self, block: object, segment: int) -> None: ...

    def save(self, name: str, document: object) -> None: ...


def commissioned(case: Case) -> Row:
    """The row of one case. A case that cannot be drawn or carried out is a row that says so."""
    began = time.process_time()
    row: dict[str, Any] = {
        "case": case.number, "seed": case.seed, "motor": case.motor, "outcome": "impossible", "reason": "", "effects": "",
        "rated_power_w": None, "energised_s": None, "peak_flux_fraction": None,
    }  # fmt: skip
    row |= {f"{name}_{what}": None for name in PARAMETERS for what in ("true", "value", "std")}
    try:
        drawn = draw(case)
    except ValueError as error:
        return cast("Row", row | {"reason": str(error), "cpu_s": time.process_time() - began})
    row |= {
        "effects": " ".join(drawn.effects),
        "motor": drawn.motor,
        "rated_power_w": float(drawn.plate["rated_power_w"]),
    }
    plate = Nameplate(**drawn.plate)
    warm_up(plate)
    findings = Findings()
    plan = load_procedure(None, axes_deg=case.axes_deg or None)
    try:
        if case.links == "tcp":
            ended, highest_flux_wb = _over_tcp(case, drawn, plate, plan, findings)
        else:
            ended = _in_memory(drawn, plate, plan, findings)
            highest_flux_wb = drawn.highest_flux_wb
    except CommissionerError as error:
        ended = RunEnded(error.outcome, error.what, 0.0, error.as_dict())
        highest_flux_wb = drawn.highest_flux_wb if case.links == "memory" else 0.0
    told = row | _told(drawn, findings, ended, highest_flux_wb, plan.axes_deg) | {"cpu_s": time.process_time() - began}
    return cast("Row", told)


def _in_memory(drawn: Drawn, plate: Nameplate, plan: ProcedurePlan, findings: Findings) -> RunEnded:
    """In motor time: nothing sleeps, and the same seed gives the same run."""
    station, profile = drawn.station, load_profile(PROFILE)
    port = InProcessPort(station)
    inverter = Inverter(port, profile, sleep=station.pass_time, clock=lambda: station.now_s)
    job = make_job(profile, plate, plan, port, write_back=True, now_s=inverter.now_s)
    return _perform(inverter, job, findings)


def _over_tcp(
    case: Case, drawn: Drawn, plate: Nameplate, plan: ProcedurePlan, findings: Findings
) -> tuple[RunEnded, float]:
    """Over a real socket to a simulator of its own process; with the highest true flux by that one's log."""
    profile = load_profile(PROFILE)
    with tempfile.TemporaryDirectory() as folder:
        scenario, log = Path(folder) / "case.json", Path(folder) / "log.jsonl"
        scenario.write_text(json.dumps({"scenario": drawn.document}, default=float), "utf-8")
        faults = [word for fault in case.faults for word in ("--fault", fault)]
        more = ["--state-log", str(log), *faults]
        with (
            simulated_inverter(str(scenario), "max", case.seed, more) as url,
            open_drive(url, profile, plan) as port,
        ):
            job = make_job(profile, plate, plan, port, write_back=True)
            ended = _perform(Inverter(port, profile), job, findings)
        seen = [json.loads(line).get("stator_flux_wb", 0.0) for line in log.read_text("utf-8").splitlines()]
    return ended, max(seen, default=0.0)


def _perform(inverter: Inverter, job: Job, findings: Findings) -> RunEnded:
    archive = cast("RunFolder", NoArchive())
    runner = Runner(inverter, archive, bounds(job), watch_limits(job), lambda _record: None)
    return runner.perform(course(job, findings))


def _told(
    drawn: Drawn, findings: Findings, ended: RunEnded, highest_flux_wb: float, axes_deg: Sequence[float]
) -> dict[str, Any]:
    limit_wb, found = findings.flux_limit_wb, findings.identification
    told: dict[str, Any] = {
        "outcome": ended.outcome, "reason": ended.reason, "energised_s": ended.energised_s,
        "peak_flux_fraction": highest_flux_wb / limit_wb if limit_wb else None,
    }  # fmt: skip
    if found is None:
        return told
    truth = drawn.parameters_at(found.holds_for_flux_wb, axes_deg)
    for name, value, std in zip(PARAMETERS, found.parameters.as_tuple(), found.std, strict=True):
        told |= {f"{name}_true": truth[name], f"{name}_value": value, f"{name}_std": std}
    return told
