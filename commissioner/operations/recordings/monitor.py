"""Speed, torque and load torque of a running motor within a revolution, from its terminals."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from commissioner.errors import DataRefused
from commissioner.monitor.chain import Observation, Refused, Wishes
from commissioner.monitor.contract import MonitoringDocument, RefusedMonitoring, State
from commissioner.monitor.result import as_document, entry_of, refused_document, with_reference
from commissioner.monitor.trend.indicators import pulses, trendable
from commissioner.monitor.trend.reference import against_encoder
from commissioner.monitor.trend.trend import Verdict
from commissioner.operations.events import Began, Observe, nobody
from commissioner.operations.recordings.stretches import in_its_states
from commissioner.operations.recordings.trust import trust_from
from commissioner.recordings.baseline import update
from commissioner.recordings.importers import read_running
from commissioner.recordings.plate import plate_of, start_from
from commissioner.recordings.reading.mapping import read_mapping


@dataclass(frozen=True)
class MonitorRequest:
    """`motor` overrides the metadata; `start`: result of a commissioning run. With `learn` the recording joins `baseline`.
    `out`: a folder for waveforms and the report; `mapping`: what the file's channels are."""

    file: Path
    motor: str | None = None
    start: Path | None = None
    load_hz: tuple[float, ...] = ()
    inertia_kg_m2: float | None = None
    baseline: Path | None = None
    learn: bool = False
    out: Path | None = None
    mapping: Path | None = None
    trust: str | None = None


@dataclass(frozen=True)
class Monitored:
    """`document` is the contract's JSON; `verdict`: against the baseline, where one was given."""

    document: MonitoringDocument
    seen: Observation
    verdict: Verdict | None


@dataclass(frozen=True)
class NotMonitored:
    """The recording cannot carry an answer; `document` still carries what was learned, `error` says why."""

    document: RefusedMonitoring
    seen: Refused
    error: DataRefused


def monitor(request: MonitorRequest, observe: Observe = nobody) -> Monitored | NotMonitored:
    """One recording, watched, compared and, where asked for, learned and written out."""
    recording = read_running(request.file, read_mapping(request.mapping) if request.mapping else None)
    plate = plate_of(recording.metadata, str(request.file), request.motor)
    start = start_from(request.start) if request.start else None
    observe(Began("looking for speed and load"))
    wishes = Wishes(request.load_hz, request.inertia_kg_m2, start, trust=trust_from(request.trust))
    seen, recording, stretches = in_its_states(recording, plate, wishes)
    if isinstance(seen, Refused):
        return _refused(seen, request.file, stretches)
    made = pulses(seen)
    indicators = trendable(seen, made)
    verdict, history = (None, None)
    if request.baseline is not None:
        verdict, history = update(request.baseline, entry_of(seen, indicators, str(request.file)), request.learn)
    document = as_document(seen, made, indicators, verdict)
    document["states"] = stretches
    comparison = against_encoder(seen, recording)
    if comparison is not None:
        document = with_reference(document, comparison)
    if request.out is not None:
        from commissioner.recordings.monitored import write_results
        from commissioner.report.monitoring.page import page_of

        page = page_of(seen, made, indicators, verdict, history, document, request.file.name)
        document["files"] = write_results(request.out, seen, page)
    return Monitored(document, seen, verdict)


def _refused(seen: Refused, file: Path, stretches: list[State]) -> NotMonitored:
    reason = seen.reason
    error = DataRefused(
        f"{file}: {reason.what}",
        step=f"audit ({reason.code})",
        value=reason.value,
        limit=reason.limit,
        remedy=reason.remedy,
    )
    document = refused_document(seen)
    document["states"] = stretches
    document["reason"], document["error"] = error.what, error.as_dict()
    return NotMonitored(document, seen, error)
