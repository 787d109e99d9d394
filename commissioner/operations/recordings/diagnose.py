"""What the simulation gets wrong about recordings of one motor, at standstill or running, or about tables of test points, by name."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

from commissioner.diagnose.causes import CATALOGUE
from commissioner.diagnose.contract import DiagnosisDocument
from commissioner.diagnose.diagnosis import Diagnosis
from commissioner.diagnose.diagnosis import diagnose as analyse
from commissioner.diagnose.document import as_document, points_document, refused_document
from commissioner.diagnose.export.contract import ModelDocument
from commissioner.diagnose.intake.points import Points
from commissioner.diagnose.points.diagnosis import diagnose_points as analyse_points
from commissioner.diagnose.points.rows import LEAST_COLUMNS
from commissioner.diagnose.points.table import LEAST_POINTS, read_points
from commissioner.diagnose.search.journal import Accepted, Step
from commissioner.encoding import plain
from commissioner.errors import DataRefused
from commissioner.identify.intake.plate import NAMEPLATE_KEYS, nameplate_from
from commissioner.motor.circuit import PARAMETERS, InverseGamma
from commissioner.motor.computed import COMPUTED, other_pairs
from commissioner.operations.events import GoOn, Observe, always, nobody
from commissioner.operations.ranges import require_distinct
from commissioner.operations.recordings import catalogue
from commissioner.operations.recordings.intake import (
    plate_metadata,
    require_independent,
    require_one_motor,
    standstill,
)
from commissioner.operations.recordings.running import diagnosed
from commissioner.operations.recordings.sheets import (
    are_sheets,
    are_three,
    by_test,
    direct_current,
    notes_of,
    of_circuit,
    require_whole_sheets,
    with_line_values,
)
from commissioner.operations.recordings.sheets import diagnosed as of_three_tests
from commissioner.operations.recordings.trust import Trust, judged, trust_from
from commissioner.recordings.catalogue.reading import sheet_of
from commissioner.recordings.importers import contract_table
from commissioner.recordings.reading.mapping import read_mapping
from commissioner.recordings.table import Table
from commissioner.recordings.whole import folder_to_write, write_texts
from commissioner.records import DiagnosisVerdict, StandstillRecording
from commissioner.running.diagnosis import Diagnosis as RunningDiagnosis

VERDICTS: tuple[DiagnosisVerdict, ...] = ("unexplained", "explained", "nothing_significant", "refused")
"""Of several tables the first of these that one has is the verdict of all."""


OWN_PHASES = "uvw"
"""Of a diagnosis, where none of the recording's currents was taken for a computed one but w."""


@dataclass(frozen=True)
class DiagnoseRequest:
    """`motor` overrides the recordings' metadata. `out`: a folder for `report.html`, `model.json` and `diagnosis.json`.
    `mapping`: what the files' channels are."""

    files: tuple[Path, ...]
    motor: str | None = None
    out: Path | None = None
    excluded: tuple[str, ...] = ()
    mapping: Path | None = None
    trust: str | None = None


@dataclass(frozen=True)
class Diagnosed:
    """`document` is the contract's JSON; of several tables of points, each one's own lies under `tables`. `seen`: of recordings at
    standstill, `running`: of a running motor."""

    document: DiagnosisDocument
    out: Path | None
    seen: Diagnosis | None = None
    running: RunningDiagnosis | None = None

    @property
    def is_refused(self) -> bool:
        """Whether the data, or those of one table, could not carry an answer."""
        tables = self.document.get("tables", {})
        return "refused" in {self.document["verdict"], *(one["verdict"] for one in tables.values())}


def withdrawn(steps: Iterable[Step], left: Collection[str]) -> list[str]:
    """Named on the way and not among those that are `left`."""
    kept = (step.name for step in steps if isinstance(step, Accepted))
    return [name for name in dict.fromkeys(kept) if name not in left]


def diagnose(request: DiagnoseRequest, observe: Observe = nobody, go_on: GoOn = always) -> Diagnosed:
    """Recordings together, of one motor at standstill or running; where all files are tables of test points, each on its own.

    Data that cannot carry an answer are a result, `refused`. DataRefused: the files are not of one motor, or not of one kind.
    A no of `go_on` ends the search; the document says so, and names nothing that was not weighed.
    """
    require_distinct([Path(path) for path in request.files])
    said = read_mapping(request.mapping) if request.mapping else None
    if request.out is not None:
        folder_to_write(request.out)
    if (sheet := sheet_of(request.files, said)) is not None:
        return Diagnosed(catalogue.diagnosed(sheet, request.motor, request.trust, request.out), request.out)
    read = [contract_table(Path(path), said, request.motor) for path in request.files]
    tables = with_line_values(read, request.motor)
    if are_sheets(tables):
        return _points(tables, request)
    require_whole_sheets(tables)
    if any(t.is_running for t in tables):
        require_independent(tables)
        document, running = diagnosed(tables, request.motor, request.out, request.excluded, observe, go_on)
        return Diagnosed(document, request.out, running=running)
    return _recordings(tables, request, observe, go_on)


def _recordings(tables: Sequence[Table], request: DiagnoseRequest, observe: Observe, go_on: GoOn) -> Diagnosed:
    from commissioner.report.diagnosis.uncertain import uncertain

    recordings, remarks = standstill(tables, request.motor)
    require_one_motor(recordings)
    require_independent(tables)
    seen = analyse(recordings, excluded=request.excluded, report=observe, go_on=go_on)
    is_computed = all(any(n.code == COMPUTED for n in r.notes) for r in recordings)
    phases = OWN_PHASES
    if is_computed and (seen.verdict == "unexplained" or len(seen.causes) > 1):
        seen, said, phases = _of_another_pair(recordings, seen, request.excluded, observe, go_on)
        remarks = [*said, *remarks]
    document = as_document(seen)
    for cause in document["causes"]:
        cause["parameters"] = {_named_by(phases, key): value for key, value in cause["parameters"].items()}
    decided = _against_plate(document, {**recordings[0].metadata}, trust_from(request.trust))
    remarks = [*decided, *remarks]
    document["audit"] = [*remarks, *document["audit"]]
    document["uncertain"] = uncertain(seen, withdrawn(seen.steps, {c.name for c in (*seen.causes, *seen.unsure)}))
    document["dc_link_v"] = seen.found.record.facts.dc_link_v if seen.found else None
    if request.out is not None:
        _write_recordings(request.out, seen, document, tables)
    return Diagnosed(document, request.out, seen)


def _of_another_pair(
    recordings: Sequence[StandstillRecording], seen: Diagnosis, excluded: tuple[str, ...], observe: Observe, go_on: GoOn
) -> tuple[Diagnosis, list[str], str]:
    """The diagnosis with the computed current in another column, where that explains the data by fewer causes, and which phases of the
    recording its u, v and w are."""
    choices = [other_pairs(r) for r in recordings]
    best, said, phases = seen, [], OWN_PHASES
    fewest = len(seen.causes) if seen.verdict == "explained" else len(CATALOGUE)
    for k, (name, _) in enumerate(choices[0]):
        other = analyse([c[k][1] for c in choices], excluded=excluded, report=observe, go_on=go_on)
        if other.verdict == "explained" and len(other.causes) < fewest:
            pair = {"u": ("v", "w"), "v": ("w", "u")}[name]
            best, fewest, phases = other, len(other.causes), "".join((*pair, name))
            said = [
                f"Explained by the fewest causes where current {name} is the computed one: phases u and v of this diagnosis are {pair[0]} "
                f"and {pair[1]} of the recording, axes are counted from there; the sizes of causes are named by the recording's phases."
            ]
    return best, said, phases


def _named_by(phases: str, key: str) -> str:
    """A size's name with the recording's phases: gain_v_over_u is gain_w_over_v where u and v are the recording's v and w."""
    return "_".join(phases[OWN_PHASES.index(word)] if word in tuple(OWN_PHASES) else word for word in key.split("_"))


def _against_plate(document: DiagnosisDocument, plate: Mapping[str, float | str], trust: Trust | None) -> list[str]:
    """What the circuit says against the plate, where both are known; DataRefused unless the data are to be trusted."""
    values = document["parameters_after"]
    if any(key not in plate for key in NAMEPLATE_KEYS) or any(name not in values for name in PARAMETERS):
        return []
    circuit = InverseGamma(*(float(values[name]["value"] or 0.0) for name in PARAMETERS))
    return judged(circuit, nameplate_from(plate), trust)


def _write_recordings(out: Path, seen: Diagnosis, document: DiagnosisDocument, tables: Sequence[Table]) -> None:
    from commissioner.report.diagnosis.page import page_of
    from commissioner.report.page import render

    document["model_file"] = str(out / "model.json") if seen.model else None
    page = render(page_of(seen, document, ", ".join(Path(t.source).name for t in tables)))
    _write(out, document, seen.model, page, "report.html")


def _points(tables: Sequence[Table], request: DiagnoseRequest) -> Diagnosed:
    """The circuit that a few rows of different tests make, and a document for each test with rows enough of its own."""
    out, given, tables = request.out, tables[0], by_test(tables)
    if are_three(tables):
        enough = [t for t in tables if t.columns[LEAST_COLUMNS[0]].size >= LEAST_POINTS]
        one = of_three_tests(tables, request.motor, trust_from(request.trust))
        ohm = one["parameters_after"]["stator_resistance_ohm"]["value"]
        own = [(t, d) for t, d in _series(enough, ohm, (), request.motor) if d["verdict"] != "refused"]
        every = [(replace(given, source="circuit"), of_circuit(one)), *own] if own else [(given, one)]
    else:
        every = _series(*direct_current(tables, request.motor), request.motor)
    documents = [document for _, document in every]
    names = _names([table for table, _ in every])
    document = documents[0] if len(documents) == 1 else _joined(documents, names)
    if out is not None:
        _write_points(out, document, documents, names)
    return Diagnosed(document, out)


def _series(
    tables: Sequence[Table], ohm: float | None, how: Sequence[str], motor: str | None
) -> list[tuple[Table, DiagnosisDocument]]:
    """What each table of one test says. `ohm`: the stator's resistance where it is known, else that of a locked-rotor table serves all."""
    plate = plate_metadata(motor)
    read = [read_points(t.columns, Path(t.source).stem, {**t.metadata, **plate}) for t in tables]
    known = [float(p.resistance_ohm.mean()) for p in read if isinstance(p, Points) and p.resistance_ohm is not None]
    ohm = next(iter(known), None) if ohm is None else ohm
    documents = [
        refused_document(points, "points")
        if isinstance(points, DataRefused)
        else points_document(analyse_points(points, ohm))
        for points in read
    ]
    for table, one in zip(tables, documents, strict=True):
        one["remarks"] = [*notes_of([table]), *how, *one.get("remarks", [])]
    return list(zip(tables, documents, strict=True))


def _write_points(
    out: Path, document: DiagnosisDocument, documents: Sequence[DiagnosisDocument], names: Sequence[str]
) -> None:
    from commissioner.report.diagnosis.page import points_page
    from commissioner.report.page import render

    for one, file in zip(documents, names, strict=True):
        name = str(Path(file).with_suffix(""))
        _write(out, document, None, render(points_page(one, name)), f"report_{name.replace('/', '_')}.html")


def _joined(documents: Sequence[DiagnosisDocument], names: Sequence[str]) -> DiagnosisDocument:
    """One document: all causes together, every table's own result under `tables`."""
    verdicts = [d["verdict"] for d in documents]
    joined = {
        **documents[0],
        "verdict": next((v for v in VERDICTS if v in verdicts), verdicts[0]),
        "reason": " ".join(d["reason"] for d in documents),
        "causes": [c for d in documents for c in d["causes"]],
        "tables": dict(zip(names, documents, strict=True)),
    }
    return cast("DiagnosisDocument", joined)


def _names(tables: Sequence[Table]) -> list[str]:
    """The files' names, with their folder where two are called the same."""
    paths = [Path(t.source) for t in tables]
    names = [p.name for p in paths]
    return [p.name if names.count(p.name) == 1 else f"{p.parent.name}/{p.name}" for p in paths]


def _write(out: Path, document: Mapping[str, Any], model: ModelDocument | None, page: str, page_name: str) -> None:
    texts = {page_name: page, "diagnosis.json": json.dumps(plain(document), indent=2)}
    if model is not None:
        texts["model.json"] = json.dumps(plain(model), indent=1)
    write_texts(out, texts)
