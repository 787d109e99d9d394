"""A recording that was uploaded, and what its verb said."""

from __future__ import annotations

from typing import Any, NotRequired

from typing_extensions import TypedDict

from commissioner.diagnose.contract import DiagnosisDocument
from commissioner.errors import ErrorDocument
from commissioner.identify.contract import AnyIdentification
from commissioner.monitor.contract import MonitoringDocument, PartialMonitoring, RefusedMonitoring


class FailureDocument(TypedDict):
    """Why there is no result: as a problem of the API, or as the verb's own error."""

    title: str | None
    step: str | None
    value: Any
    limit: Any
    remedy: str
    type: NotRequired[str]
    status: NotRequired[int]
    detail: NotRequired[str]
    kind: NotRequired[str]
    what: NotRequired[str]


class FailedVerb(TypedDict):
    """What a verb prints that could not do it."""

    outcome: str
    reason: str
    error: ErrorDocument


class NothingYet(TypedDict):
    """It works, or waits for another one."""


SaidOfIt = (
    AnyIdentification
    | DiagnosisDocument
    | MonitoringDocument
    | PartialMonitoring
    | RefusedMonitoring
    | FailedVerb
    | NothingYet
)


class RecordingDocument(TypedDict):
    """`verb`: identify | diagnose | monitor. `result`: the verb's own document, empty until it is done; `exit_code`: as on the command
    line, null while it works; `report`: where the page with its pictures is."""

    id: str
    verb: str
    files: list[str]
    begun_utc: str
    is_done: bool
    exit_code: int | None
    result: SaidOfIt
    problem: FailureDocument | None
    report: str | None
