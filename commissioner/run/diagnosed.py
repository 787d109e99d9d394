"""The diagnosis every run ends with: what a four-parameter simulation gets wrong about the run's own samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from commissioner.diagnose.diagnosis import Diagnosis, diagnose
from commissioner.diagnose.document import as_document
from commissioner.diagnose.verdict.parameter_shift import parameter_shifts
from commissioner.encoding import plain
from commissioner.errors import CommissionerError
from commissioner.recordings.table import read_table, to_standstill
from commissioner.run.archive.folder import RunFolder

FILE, RECORDING = "diagnosis.json", "recording.parquet"
_OF_A_CAUSE = ("name", "title", "parameters", "confidence", "equivalent", "strength_over_noise")
_KEPT = (
    "gain", "parameters_before", "parameters_after", "detection_limits", "below_materiality", "cannot_tell",
    "next_experiment", "remarks", "is_complete",
)  # fmt: skip
"""Of the whole document: what the run's report shows."""


def diagnose_run(folder: RunFolder, go_on: Callable[[], bool]) -> dict[str, Any]:
    """Short form for the result; the whole document goes to `diagnosis.json`. A recording that cannot be read is said.

    Once `go_on` says no it is given up, unfinished.
    """
    try:
        recording = to_standstill(read_table(folder.path / RECORDING))
    except CommissionerError as error:
        return {
            "verdict": "refused",
            "reason": error.what,
            "causes": [],
            "moved": [],
            "is_complete": True,
            "file": None,
        }
    seen = diagnose([recording], go_on=go_on)
    document = plain(as_document(seen, None))
    folder.save(FILE, document)
    return {
        "verdict": document["verdict"],
        "reason": document["reason"],
        "causes": [{key: cause[key] for key in _OF_A_CAUSE} for cause in document["causes"]],
        "moved": _moved(seen),
        "file": FILE,
    } | {key: document[key] for key in _KEPT if key in document}


def _moved(seen: Diagnosis) -> list[dict[str, Any]]:
    if seen.found is None:
        return []
    return [
        {"parameter": m.parameter, "four_parameters": m.four_parameters, "with_causes": m.with_causes, "cause": m.cause}
        for m in parameter_shifts(seen.found.nominal, seen.found.fit, seen.found.layout)
    ]
