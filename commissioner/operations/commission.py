"""A motor commissioned through its drive: the whole job, from the first request to the closing diagnosis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from commissioner.link.files.drive_file import load_profile
from commissioner.operations.closing import DIAGNOSIS_S, await_diagnosis, begin_diagnosis
from commissioner.operations.events import Observe, nobody
from commissioner.procedure.findings import Diagnosing
from commissioner.report.run.contract import RunDocument
from commissioner.run.archive.documents import read_result
from commissioner.run.archive.seal import read_key
from commissioner.run.commission import Commissioned, Origin, require_capabilities
from commissioner.run.commission import commission as carry_out_and_close
from commissioner.run.stopping.operator_stop import OperatorStop
from commissioner.settings import load_motor, load_procedure


@dataclass(frozen=True)
class CommissionRequest:
    """`axes_deg`: None takes the procedure's own. `diagnosis_s` 0 leaves the closing diagnosis out; `waits` for it, otherwise it
    joins the archive later. `seal`: a key file.
    `motor_tag`, `motor_serial`: which motor it is, `place`: where, `cable`: what leads to it and what it drives, as a person says."""

    drive: str
    profile: str
    motor: str
    runs: Path
    procedure: Path | None = None
    axes_deg: tuple[float, ...] | None = None
    write_back: bool = False
    diagnosis_s: float = DIAGNOSIS_S
    waits: bool = False
    seal: Path | None = None
    strict: bool = False
    motor_tag: str = ""
    motor_serial: str = ""
    place: str = ""
    cable: str = ""


def check_request(request: CommissionRequest) -> None:
    """ConfigurationError or UsageError where the request cannot be carried out on any drive of its profile."""
    load_motor(request.motor)
    load_procedure(request.procedure, axes_deg=request.axes_deg)
    require_capabilities(load_profile(request.profile), write_back=request.write_back)
    if request.seal is not None:
        read_key(request.seal)


def commission(request: CommissionRequest, observe: Observe = nobody, origin: Origin | None = None) -> Commissioned:
    """Energises the motor. Configuration errors are raised; from the first request on, every end is a run with a folder.

    `observe` gets the records of `procedure.findings`.
    """
    origin = origin or Origin()
    stop = origin.stop or OperatorStop()
    done = carry_out_and_close(
        request.drive,
        request.profile,
        load_motor(request.motor),
        load_procedure(request.procedure, axes_deg=request.axes_deg, strict=request.strict),
        write_back=request.write_back,
        runs=request.runs,
        present=observe,
        key=read_key(request.seal) if request.seal is not None else None,
        origin=replace(origin, facts={**origin.facts, **_identity(request)}, stop=stop),
    )
    if request.diagnosis_s > 0.0 and done.result["parameters"] and not stop.asked:
        return _diagnosed(request, done, observe, stop)
    return done


def _diagnosed(request: CommissionRequest, done: Commissioned, observe: Observe, stop: OperatorStop) -> Commissioned:
    """The diagnosis begun, and waited for where that is wanted; then it is part of the result."""
    process = begin_diagnosis(done.folder, request.diagnosis_s, request.seal)
    if not request.waits:
        return replace(done, is_being_diagnosed=True)
    observe(Diagnosing(request.diagnosis_s))
    await_diagnosis(process, done.folder, stop)
    return replace(done, result=cast("RunDocument", read_result(done.folder) or done.result))


def _identity(request: CommissionRequest) -> dict[str, str]:
    """What a person said of the motor, where anything was said."""
    said = {name: str(getattr(request, name)).strip() for name in ("motor_tag", "motor_serial", "place", "cable")}
    return {name: value for name, value in said.items() if value}
