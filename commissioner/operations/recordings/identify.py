"""A motor identified from recordings: at standstill with the estimators that a live run uses, or running."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

import numpy as np

from commissioner.encoding import plain
from commissioner.errors import DataRefused
from commissioner.identify.analysis import Identification
from commissioner.identify.analysis import identify as analyse
from commissioner.identify.contract import (
    FluxReached,
    IdentifiedDocument,
    RunningDocument,
    SheetDocument,
    ThreeTestsDocument,
)
from commissioner.identify.document import document as identification_document
from commissioner.identify.estimate.axis import Estimator
from commissioner.identify.intake.plate import nameplate_from
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.plate_match import contradiction, rated_point, sure_mismatch
from commissioner.operations.events import Began, Observe, nobody
from commissioner.operations.ranges import require_distinct
from commissioner.operations.recordings.intake import require_independent
from commissioner.operations.recordings.trust import (
    Trust,
    doubts,
    refused,
    trust_from,
    trusted_data,
    trusted_plate,
    with_currents_over,
)
from commissioner.recordings.catalogue.reading import sheet_of
from commissioner.recordings.importers import contract_table
from commissioner.recordings.reading.mapping import read_mapping
from commissioner.recordings.table import Table, to_standstill
from commissioner.recordings.whole import folder_to_write, write_texts
from commissioner.records import StandstillRecording
from commissioner.settings import load_motor, load_procedure

PAUSE_S = 10.0
"""Between two recordings that are joined: longer than any motor remembers."""


@dataclass(frozen=True)
class IdentifyRequest:
    """`motor` overrides the recordings' metadata; `estimator`: pao | lyapunov | nls; `mapping`: what their channels are.
    `trust`: plate | data, where the two contradict each other. `out`: a folder for `report.html` and `identification.json`."""

    files: tuple[Path, ...]
    motor: str | None = None
    estimator: str = "pao"
    mapping: Path | None = None
    trust: str | None = None
    out: Path | None = None


@dataclass(frozen=True)
class Identified:
    """`document` is the contract's JSON; `found` the numbers behind it."""

    document: IdentifiedDocument
    found: Identification
    nameplate: Nameplate
    files: tuple[Path, ...]


@dataclass(frozen=True)
class IdentifiedRunning:
    """Of a running motor; nothing is written into a drive from it."""

    document: RunningDocument
    files: tuple[Path, ...]


@dataclass(frozen=True)
class IdentifiedCatalogue:
    """Of a manufacturer's sheet; nothing is written into a drive from it."""

    document: SheetDocument
    files: tuple[Path, ...]


@dataclass(frozen=True)
class IdentifiedSheets:
    """Of test sheets: direct current, no load, locked rotor; nothing is written into a drive from them."""

    document: ThreeTestsDocument
    files: tuple[Path, ...]


def identify_any(
    request: IdentifyRequest, observe: Observe = nobody
) -> Identified | IdentifiedRunning | IdentifiedSheets | IdentifiedCatalogue:
    """As `identify`; recordings of a running motor (a direct start, several loads) by a fit of the running machine, test sheets
    by their three tests, a manufacturer's sheet by its values."""
    from commissioner.operations.recordings.sheets import are_sheets, require_whole_sheets, with_line_values
    from commissioner.operations.recordings.sheets import identified as of_sheets

    require_distinct(request.files)
    said = read_mapping(request.mapping) if request.mapping else None
    if request.out is not None:
        folder_to_write(request.out)
    if (sheet := sheet_of(request.files, said)) is not None:
        from commissioner.operations.recordings import catalogue

        made = catalogue.identified(sheet, request.motor, request.trust, request.out)
        return IdentifiedCatalogue(made, request.files)
    tables = with_line_values([contract_table(path, said, request.motor) for path in request.files], request.motor)
    if are_sheets(tables):
        return IdentifiedSheets(of_sheets(tables, request.motor, trust_from(request.trust)), request.files)
    require_whole_sheets(tables)
    require_independent(tables)
    if not any(t.is_running for t in tables):
        return _of_standstill(tables, request, observe)
    from commissioner.operations.recordings.running import identified

    observe(Began("identifying"))
    return IdentifiedRunning(identified(tables, request.motor, request.out), request.files)


def identify(request: IdentifyRequest, observe: Observe = nobody) -> Identified:
    """DataRefused where the recordings cannot carry an answer; UsageError for a file or an estimator that does not exist."""
    said = read_mapping(request.mapping) if request.mapping else None
    _require_measured(request.files, said)
    return _of_standstill([contract_table(path, said) for path in request.files], request, observe)


def _of_standstill(tables: Sequence[Table], request: IdentifyRequest, observe: Observe) -> Identified:
    recording = joined([to_standstill(table) for table in tables])
    plate = None if request.motor is None else load_motor(request.motor)
    plate = plate or nameplate_from(recording.metadata, recording.source)
    trust = trust_from(request.trust)
    observe(Began("identifying"))
    found, decided = _with_the_plate(recording, plate, cast("Estimator", request.estimator), trust)
    document: IdentifiedDocument = {**identification_document(found), "flux_guard": _flux_reached(found), "written": []}
    document["remarks"] = [*decided, *document["remarks"]]
    if request.out is not None:
        _write(request, found, document)
    return Identified(document, found, plate, request.files)


def _require_measured(files: Sequence[Path], said: object) -> None:
    """DataRefused: a manufacturer's sheet, from which no drive is set."""
    if sheet_of(files, said) is not None:
        raise DataRefused(
            f"{files[0]}: a manufacturer's sheet is no measurement of the motor at the drive", step="identify", value=str(files[0]),
            limit="a recording at standstill", remedy="use `commissioner identify` without --write-back, or measure",
        )  # fmt: skip


def _write(request: IdentifyRequest, found: Identification, document: IdentifiedDocument) -> None:
    from commissioner.report.identification.page import identification_page

    assert request.out is not None
    text = identification_page(found, document, ", ".join(path.name for path in request.files))
    write_texts(
        folder_to_write(request.out),
        {"report.html": text, "identification.json": json.dumps(plain(document), indent=2)},
    )


def _with_the_plate(
    recording: StandstillRecording, plate: Nameplate, estimator: Estimator, trust: Trust | None
) -> tuple[Identification, list[str]]:
    """What was identified, and what was decided where it contradicts the plate. DataRefused: nobody decided."""
    found = analyse(recording, plate, estimator)
    rated = rated_point(found.parameters, plate)
    against, said = contradiction(rated, plate), doubts(rated, plate)
    other = sure_mismatch(found.parameters, found.std[0], plate)
    if against is None and other is None:
        return found, said
    if trust == "data":
        return found, [trusted_data(against) if against else f"{other.what}: the data were trusted" if other else ""]
    if trust == "plate" and against is not None and against.likely is not None:
        again = analyse(with_currents_over(recording, against.likely), plate, estimator)
        return again, [trusted_plate(against.likely)]
    if against is not None:
        raise refused(against)
    assert other is not None
    raise DataRefused(
        f"the data do not belong to this plate: {other.what}", step="compare data and plate",
        value=f"{other.value:.3g} from the data, 1 from the plate", limit=other.limit,
        remedy=f"{other.remedy}; or say which is right by --trust data",
    )  # fmt: skip


def _flux_reached(found: Identification) -> FluxReached:
    """As a run's: the largest flux of the recording, of the limit that the shipped procedure would have had."""
    limit_wb = load_procedure().limits.flux_fraction * found.rated_flux.stator_peak_wb
    peak_wb = max(axis.peak_stator_flux_wb for axis in found.axes)
    return {"peak_fraction": peak_wb / limit_wb, "acted": False, "limit_wb": limit_wb}


def joined(recordings: Sequence[StandstillRecording]) -> StandstillRecording:
    """Several recordings of one motor as one, in the order given; their segments are renumbered and time runs on."""
    first = recordings[0]
    if len(recordings) == 1:
        return first
    for other in recordings[1:]:
        _require_same_rate(first, other)
    has_w = all(r.current_w_a is not None for r in recordings)
    has_link = all(r.dc_link_v is not None for r in recordings)
    time, segment, time_offset, segment_offset = [], [], 0.0, 0
    for r in recordings:
        time.append(r.time_s - r.time_s[0] + time_offset)
        segment.append(r.segment - r.segment.min() + segment_offset)
        time_offset = float(time[-1][-1]) + PAUSE_S
        segment_offset = int(segment[-1].max()) + 1
    return StandstillRecording(
        time_s=np.concatenate(time),
        segment=np.concatenate(segment),
        axis_deg=np.concatenate([r.axis_deg for r in recordings]),
        voltage_axis_v=np.concatenate([r.voltage_axis_v for r in recordings]),
        current_u_a=np.concatenate([r.current_u_a for r in recordings]),
        current_v_a=np.concatenate([r.current_v_a for r in recordings]),
        current_w_a=np.concatenate([r.current_w_a for r in recordings if r.current_w_a is not None]) if has_w else None,
        dc_link_v=np.concatenate([r.dc_link_v for r in recordings if r.dc_link_v is not None]) if has_link else None,
        sample_period_s=first.sample_period_s,
        metadata=first.metadata,
        source=", ".join(r.source for r in recordings),
        notes=tuple(replace(n, what=f"{Path(r.source).name}: {n.what}") for r in recordings for n in r.notes),
    )


def _require_same_rate(first: StandstillRecording, other: StandstillRecording) -> None:
    if abs(other.sample_period_s / first.sample_period_s - 1.0) > 1e-6:
        raise DataRefused(
            f"{other.source}: sampled at another rate than {first.source}",
            step="join recordings",
            value=other.sample_period_s,
            limit=first.sample_period_s,
            remedy="identify the files one by one",
        )
