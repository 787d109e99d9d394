"""What was written into a drive; what would be: `report.run.contract.WritePlan`."""

from __future__ import annotations

from typing_extensions import TypedDict


class WritingDocument(TypedDict):
    """How far a write-back or restore of the run has come: of `steps`, in their order, `step` is the one that goes on, begun `seconds` ago
    with the first; all empty or null while none goes on."""

    what: str
    steps: list[str]
    step: str | None
    seconds: float | None


class ReadBackRow(TypedDict):
    """One parameter in the drive's own unit and convention: before, as written, as read back."""

    name: str
    register: int
    before: float | None
    after: float | None
    read_back: float | None


class WriteReportDocument(TypedDict):
    """`written` is empty where the drive had the values already; `store_count`: of the drive's memory, null where it does not count."""

    written: list[ReadBackRow]
    is_stored: bool
    store_count_before: int | None
    store_count_after: int | None
    endurance_writes: int | None
    fault: str


class WrittenDocument(TypedDict):
    """The accepted result of a run, written."""

    outcome: str
    reason: str
    run: str
    report: WriteReportDocument


class RestoredDocument(TypedDict):
    """The set that the run found, written back. `wear_fraction`: of the drive's memory."""

    outcome: str
    reason: str
    run: str
    written: list[ReadBackRow]
    store_count: int | None
    wear_fraction: float | None
    is_stored: bool
    fault: str
