"""Speed, torque and load torque of a running motor within a revolution, from its terminals."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from commissioner.errors import DataRefused, UsageError
from commissioner.monitor.chain import Observation, Refused, Wishes
from commissioner.monitor.contract import MonitoringDocument, PartialMonitoring, RefusedMonitoring, State
from commissioner.monitor.intake.findings import Finding
from commissioner.monitor.intake.states.stretches import states
from commissioner.monitor.partial import Partial, of_currents, refused_audit, without_plate
from commissioner.monitor.result import (
    as_document,
    entry_of,
    entry_of_part,
    partial_document,
    refused_document,
    verdict_document,
)
from commissioner.monitor.trend.indicators import pulses, trendable
from commissioner.monitor.trend.reference import against_encoder, beside_column
from commissioner.monitor.trend.trend import Verdict
from commissioner.operations.events import Began, Observe, nobody
from commissioner.operations.ranges import require_range
from commissioner.operations.recordings.stretches import as_state, in_its_states, longest_steady, said_by_terminals
from commissioner.operations.recordings.trust import trust_from
from commissioner.recordings.baseline import update
from commissioner.recordings.importers import contract_table, has_currents_only, require_running, with_few_voltages_said
from commissioner.recordings.plate import has_no_plate, inertia_overruled, plate_of, start_from
from commissioner.recordings.reading.mapping import read_mapping
from commissioner.recordings.table import Table, to_currents, to_running
from commissioner.records import RunningRecording

LOWEST_LOAD_HZ = 0.01
INERTIA_KG_M2 = (1e-7, 1e6)
"""From a hard disk's to a turbine set's."""


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


@dataclass(frozen=True)
class PartlyMonitored:
    """What the data carry of an answer; every number that is withheld has its reason in `document`."""

    document: PartialMonitoring


def _require_possible(request: MonitorRequest) -> None:
    if request.inertia_kg_m2 is not None:
        require_range("--inertia", request.inertia_kg_m2, *INERTIA_KG_M2)
    if request.learn and request.baseline is None:
        raise UsageError(
            "--learn has no baseline to add to", step="command line", value="--learn", limit="--learn with --baseline FILE",
            remedy="name the file with --baseline, or leave --learn out",
        )  # fmt: skip


def monitor(request: MonitorRequest, observe: Observe = nobody) -> Monitored | PartlyMonitored | NotMonitored:
    """One recording, watched, compared and, where asked for, learned and written out. Partial data give a partial answer.

    UsageError: a wish that cannot be."""
    _require_possible(request)
    table = contract_table(request.file, read_mapping(request.mapping) if request.mapping else None, request.motor)
    if has_currents_only(table):
        return _of_currents(with_few_voltages_said(table), request, observe)
    require_running(table)
    recording = to_running(table)
    for hz in request.load_hz:
        require_range("--load-hz", hz, LOWEST_LOAD_HZ, 0.5 / recording.sample_period_s)
    if request.motor is None and has_no_plate(recording.metadata):
        return _without_plate(recording, request)
    plate = plate_of(recording.metadata, str(request.file), request.motor)
    start = start_from(request.start) if request.start else None
    if request.motor is not None and request.inertia_kg_m2 is None:
        recording = replace(recording, notes=(*recording.notes, *inertia_overruled(recording.metadata, plate)))
    observe(Began("looking for speed and load"))
    wishes = Wishes(request.load_hz, request.inertia_kg_m2, start, trust=trust_from(request.trust))
    whole = recording
    seen, recording, stretches = in_its_states(whole, plate, wishes)
    if isinstance(seen, Refused):
        part = said_by_terminals(seen, stretches, plate)
        if part is not None:
            document_of_part = partial_document(part, stretches, seen.audited)
            document_of_part["reference_speed"] = beside_column(whole, stretches, part.speed_rad_per_s)
            return PartlyMonitored(document_of_part)
        return _refused(seen, request.file, stretches)
    made = pulses(seen)
    indicators = trendable(seen, made)
    verdict, history = (None, None)
    if request.baseline is not None:
        verdict, history = update(request.baseline, entry_of(seen, indicators, str(request.file)), request.learn)
    document = as_document(seen, made, indicators, verdict)
    document["states"] = stretches
    document["reference_speed"] = against_encoder(seen, recording)
    if request.out is not None:
        from commissioner.recordings.monitored import write_results
        from commissioner.report.monitoring.page import page_of

        page = page_of(seen, made, indicators, verdict, history, document, request.file.name)
        document["files"] = write_results(request.out, seen, page)
    return Monitored(document, seen, verdict)


def _of_currents(table: Table, request: MonitorRequest, observe: Observe) -> Monitored | PartlyMonitored | NotMonitored:
    recording = to_currents(table)
    observe(Began("looking for speed and load in the currents"))
    if request.motor is None and has_no_plate(recording.metadata):
        return _without_plate(recording, request)
    plate = plate_of(recording.metadata, str(request.file), request.motor)
    start = start_from(request.start) if request.start else None
    stretches = states(recording, plate)
    part, used = longest_steady(recording, stretches)
    seen = of_currents(part, plate, Wishes(request.load_hz, None, start))
    return _partly(seen, recording, [as_state(s, used=s is used) for s in stretches], request)


def _without_plate(recording: RunningRecording, request: MonitorRequest) -> PartlyMonitored | NotMonitored:
    """ConfigurationError, as for any missing plate, where nothing can be said without one."""
    stretches = states(recording, None)
    part, used = longest_steady(recording, stretches)
    seen = without_plate(part)
    if isinstance(seen, Finding):
        plate_of(recording.metadata, str(request.file), None)
    return _partly(seen, recording, [as_state(s, used=s is used) for s in stretches], request)


def _partly(
    seen: Partial | Finding, recording: RunningRecording, stretches: list[State], request: MonitorRequest
) -> PartlyMonitored | NotMonitored:
    if isinstance(seen, Finding):
        audited = refused_audit(recording, seen)
        return _refused(Refused(audited, seen, audited.findings), request.file, stretches)
    document = partial_document(seen, stretches, refused_audit(recording, None))
    document["reference_speed"] = beside_column(recording, stretches, seen.speed_rad_per_s)
    if request.baseline is not None:
        entry = entry_of_part(seen, str(request.file))
        if entry is None:
            document["withheld"]["trend"] = (
                "a trend needs the speed, to compare like with like, and the rotor's side bands or the phases"
            )
        else:
            verdict, _ = update(request.baseline, entry, request.learn)
            document["trend"] = verdict_document(verdict)
    return PartlyMonitored(document)


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
