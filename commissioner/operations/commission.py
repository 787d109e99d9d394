"""A motor commissioned through its drive: the whole job, from the first request to the closing diagnosis."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from commissioner.link.files.drive_file import load_profile
from commissioner.operations.events import Observe, nobody
from commissioner.run.archive.seal import read_key
from commissioner.run.commission import Commissioned, Origin, require_capabilities
from commissioner.run.commission import commission as carry_out_and_close
from commissioner.settings import load_motor, load_procedure

DIAGNOSIS_S = 180.0
"""Four tests with five causes in them take 40 s on two quiet cores, 106 s with other work beside: then it is given up, wherever it is."""


@dataclass(frozen=True)
class CommissionRequest:
    """`axes_deg`: None takes the procedure's own. `diagnosis_s` 0 leaves the closing diagnosis out. `seal`: a key file.
    `motor_tag`, `motor_serial`: which motor it is, `place`: where, `cable`: what leads to it and what it drives, as a person says."""

    drive: str
    profile: str
    motor: str
    runs: Path
    procedure: Path | None = None
    axes_deg: tuple[float, ...] | None = None
    write_back: bool = False
    diagnosis_s: float = DIAGNOSIS_S
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
    key = read_key(request.seal) if request.seal is not None else None
    return carry_out_and_close(
        request.drive,
        request.profile,
        load_motor(request.motor),
        load_procedure(request.procedure, axes_deg=request.axes_deg, strict=request.strict),
        write_back=request.write_back,
        runs=request.runs,
        present=observe,
        diagnosis_s=request.diagnosis_s,
        key=key,
        origin=replace(origin, facts={**origin.facts, **_identity(request)}),
    )


def _identity(request: CommissionRequest) -> dict[str, str]:
    """What a person said of the motor, where anything was said."""
    said = {name: str(getattr(request, name)).strip() for name in ("motor_tag", "motor_serial", "place", "cable")}
    return {name: value for name, value in said.items() if value}
