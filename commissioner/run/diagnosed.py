"""The closing diagnosis of a run: what a four-parameter simulation gets wrong about the run's own samples. Made from the archive, when
the drive is let go and the run is over; it joins the archive when it is ready."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any, cast

from commissioner.diagnose.diagnosis import Diagnosis, diagnose
from commissioner.diagnose.document import as_document
from commissioner.diagnose.verdict.parameter_shift import parameter_shifts
from commissioner.encoding import plain
from commissioner.errors import CommissionerError, DataRefused
from commissioner.procedure.findings import Diagnosing
from commissioner.recordings.table import read_table, to_standstill
from commissioner.report.run.contract import RunDocument
from commissioner.report.run.summary import diagnosis_sentences
from commissioner.run.archive.documents import read_result
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.replay import learn_again
from commissioner.run.archive.report import write_report
from commissioner.run.runner import kind_of

FILE, RECORDING = "diagnosis.json", "recording.parquet"
_OF_A_CAUSE = ("name", "title", "parameters", "confidence", "equivalent", "strength_over_noise")
_KEPT = (
    "gain", "parameters_before", "parameters_after", "detection_limits", "below_materiality", "cannot_tell",
    "next_experiment", "remarks", "is_complete",
)  # fmt: skip
"""Of the whole document: what the run's report shows."""


def diagnose_run(path: Path, seconds: float, key: bytes | None = None) -> RunDocument:
    """The result of the run in `path` with its diagnosis, which stands in the archive from then on: result, report, and the whole
    document in `diagnosis.json`. A recording that cannot be read is said. After so many `seconds` it is given up, unfinished.

    `key`: of a sealed folder. DataRefused: the run identified nothing, or its archive is damaged.
    """
    result = read_result(path) or {}
    if not result.get("parameters") or not (path / RECORDING).is_file():
        raise DataRefused(
            f"{path.name} identified nothing that a diagnosis could explain", step="diagnose a run",
            value="no parameters in its result", limit="a run that identified a motor", remedy="choose another run",
        )  # fmt: skip
    _tell(path, key, Diagnosing(seconds))
    end = time.monotonic() + seconds
    short, whole = _diagnosed(path / RECORDING, lambda: time.monotonic() < end)
    _, findings = learn_again(path)
    with closing(RunFolder(path, key)) as folder:
        if whole is not None:
            folder.save(FILE, whole)
        folder.journal("diagnosed", {"verdict": short["verdict"]}, durable=True)
        completed = _completed(read_result(path) or result, short)
        write_report(folder, completed, findings)
    return completed


def _tell(path: Path, key: bytes | None, state: Diagnosing) -> None:
    """To the journal, which others follow."""
    with closing(RunFolder(path, key)) as folder:
        folder.journal(kind_of(state), state)


def _completed(result: dict[str, Any], diagnosis: dict[str, Any]) -> RunDocument:
    """The result with this diagnosis and its sentences in the place of an earlier one's."""
    said = diagnosis_sentences(result["diagnosis"], result["parameters"]) if result.get("diagnosis") else ()
    remarks = [remark for remark in result.get("remarks") or () if remark not in said]
    remarks += diagnosis_sentences(diagnosis, result["parameters"])
    return cast("RunDocument", {**result, "diagnosis": diagnosis, "remarks": remarks})


def _diagnosed(recording: Path, go_on: Callable[[], bool]) -> tuple[dict[str, Any], dict[str, Any] | None]:
    """What a result keeps, and the whole document; None where the recording was refused."""
    try:
        samples = to_standstill(read_table(recording))
    except CommissionerError as error:
        refused = {"verdict": "refused", "reason": error.what, "causes": [], "moved": [], "is_complete": True}
        return refused | {"file": None}, None
    seen = diagnose([samples], go_on=go_on)
    document = plain(as_document(seen))
    short = {
        "verdict": document["verdict"],
        "reason": document["reason"],
        "causes": [{key: cause[key] for key in _OF_A_CAUSE} for cause in document["causes"]],
        "moved": _moved(seen),
        "file": FILE,
    } | {key: document[key] for key in _KEPT if key in document}
    return short, document


def _moved(seen: Diagnosis) -> list[dict[str, Any]]:
    if seen.found is None:
        return []
    return [
        {"parameter": m.parameter, "four_parameters": m.four_parameters, "with_causes": m.with_causes, "cause": m.cause}
        for m in parameter_shifts(seen.found.nominal, seen.found.fit, seen.found.layout)
    ]
