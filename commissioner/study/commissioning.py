"""One simulated commissioning: the product's own course, runner, guards and verdict, on a drive in this process or behind a
socket. No archive is kept; the row is."""

from __future__ import annotations

import dataclasses
import time
from pathlib import Path
from typing import Any, cast

from commissioner.errors import CommissionerError
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.in_process import InProcessPort
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.course import Findings, course
from commissioner.procedure.energised.excite import warm_up
from commissioner.procedure.findings import RunEnded
from commissioner.procedure.plan import ProcedurePlan
from commissioner.procedure.verdict import PARAMETERS
from commissioner.run.archive.folder import RunFolder
from commissioner.run.job import bounds, make_job, watch_limits
from commissioner.run.runner import Runner
from commissioner.settings import load_procedure
from commissioner.study.simulators import Drawn, simulator
from commissioner.study.specification import Case

PROFILE = "simulated"


class NoArchive:
    """Takes what a run folder takes, and keeps nothing."""

    path = Path()

    def journal(self, kind: str, record: object, *, durable: bool = False) -> None: ...

    def append(self, block: object, segment: int) -> None: ...

    def save(self, name: str, document: object) -> None: ...


def commissioned(case: Case) -> dict[str, Any]:
    """The row of one case. A case that cannot be drawn or carried out is a row that says so."""
    began = time.process_time()
    row: dict[str, Any] = {
        "case": case.number, "seed": case.seed, "motor": case.motor, "outcome": "impossible", "reason": "", "effects": "",
        "energised_s": None, "peak_flux_fraction": None,
    }  # fmt: skip
    row |= {f"{name}_{what}": None for name in PARAMETERS for what in ("true", "value", "std")}
    try:
        drawn = simulator().draw(
            case.motor, case.seed, spread=case.spread, effects=case.effects, noise_a=case.noise_a, faults=case.faults
        )
    except ValueError as error:
        return row | {"reason": str(error), "cpu_s": time.process_time() - began}
    row |= {"effects": " ".join(drawn.effects), "motor": drawn.motor}
    plate = Nameplate(**drawn.plate)
    warm_up(plate)
    findings = Findings()
    ended = _carried_out(drawn, plate, load_procedure(None, axes_deg=case.axes_deg or None), findings)
    return row | _told(drawn, findings, ended) | {"cpu_s": time.process_time() - began}


def _carried_out(drawn: Drawn, plate: Nameplate, plan: ProcedurePlan, findings: Findings) -> RunEnded:
    station, archive = drawn.station, cast("RunFolder", NoArchive())
    profile = load_profile(PROFILE)
    port = InProcessPort(station)
    inverter = Inverter(port, profile, sleep=station.pass_time, clock=lambda: station.now_s)
    try:
        job = make_job(profile, plate, plan, port, write_back=True, now_s=inverter.now_s)
        runner = Runner(inverter, archive, bounds(job), watch_limits(job), lambda _record: None)
        return runner.perform(course(job, findings))
    except CommissionerError as error:
        return RunEnded(error.outcome, error.what, 0.0, error.as_dict())


def _told(drawn: Drawn, findings: Findings, ended: RunEnded) -> dict[str, Any]:
    limit_wb, found = findings.flux_limit_wb, findings.identification
    told: dict[str, Any] = {
        "outcome": ended.outcome, "reason": ended.reason, "energised_s": ended.energised_s,
        "peak_flux_fraction": drawn.highest_flux_wb / limit_wb if limit_wb else None,
    }  # fmt: skip
    if found is None:
        return told
    truth = drawn.parameters_at(found.holds_for_flux_wb)
    for name, std in zip(PARAMETERS, found.std, strict=True):
        told |= {
            f"{name}_true": truth[name],
            f"{name}_value": dataclasses.asdict(found.parameters)[name],
            f"{name}_std": std,
        }
    return told
