"""One recording looked at, by the verb the study names: the same operations as on the command line."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any, cast

from commissioner.errors import CommissionerError
from commissioner.motor.circuit import PARAMETERS
from commissioner.study.rows import Row
from commissioner.study.specification import Case


def looked_at(case: Case) -> Row:
    """The row of one file. One that is refused is a row that says why."""
    began = time.process_time()
    row: dict[str, Any] = {"case": case.number, "file": Path(case.file).name, "outcome": "", "reason": ""}
    try:
        row |= {"identify": _identified, "diagnose": _diagnosed, "monitor": _monitored}[case.kind](
            Path(case.file), case.motor or None
        )
    except CommissionerError as error:
        row |= {"outcome": error.outcome, "reason": error.what}
    return cast("Row", row | {"cpu_s": time.process_time() - began})


def _identified(path: Path, motor: str | None) -> dict[str, Any]:
    from commissioner.operations.recordings.identify import IdentifyRequest, identify

    document: Any = identify(IdentifyRequest((path,), motor)).document
    told = {"outcome": document["outcome"], "reason": document["reason"], "remarks": "\n".join(document["remarks"])}
    for name in PARAMETERS:
        measured = (document.get("parameters") or {}).get(name, {})
        told |= {f"{name}_value": measured.get("value"), f"{name}_std": measured.get("std")}
    return told


def _diagnosed(path: Path, motor: str | None) -> dict[str, Any]:
    from commissioner.operations.recordings.diagnose import DiagnoseRequest, diagnose

    document: Any = diagnose(DiagnoseRequest((path,), motor)).document
    causes = " ".join(cause["name"] for cause in document["causes"])
    return {
        "outcome": document["verdict"],
        "reason": document["reason"],
        "remarks": "\n".join(document.get("audit", [])),
        "causes": causes,
        "held_out": document["gain"]["held_out"],
    }


def _monitored(path: Path, motor: str | None) -> dict[str, Any]:
    from commissioner.operations.recordings.monitor import MonitorRequest, NotMonitored, PartlyMonitored, monitor

    seen = monitor(MonitorRequest(path, motor))
    if isinstance(seen, NotMonitored):
        raise seen.error
    document: Any = seen.document
    return {
        "outcome": "partial" if isinstance(seen, PartlyMonitored) else "monitored", "remarks": "\n".join(finding["what"] for finding in document["audit"]["findings"]),
        "mean_speed_rad_per_s": document["mean_speed_rad_per_s"],
        "mean_torque_nm": document["mean_torque_nm"],
    }  # fmt: skip
