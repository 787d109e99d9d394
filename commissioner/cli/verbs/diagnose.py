"""`commissioner diagnose FILE...`: what the simulation gets wrong about recordings or test points, by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.errors import DataRefused

if TYPE_CHECKING:
    from commissioner.recordings.table import Table
    from commissioner.records import StandstillRecording

RUNNING_COLUMNS = ("voltage_u_v", "voltage_uv_v", "speed_rad_per_s")
STANDSTILL_COLUMNS = frozenset(
    ["time_s", "segment", "axis_deg", "voltage_axis_v", "current_u_a", "current_v_a", "current_w_a", "dc_link_v"]
)


def diagnose(
    files: Sequence[Path],
    motor: str | None = None,
    out: Path | None = None,
    as_json: bool = False,
    mapping: Path | None = None,
) -> None:
    """Diagnose recordings of one motor at standstill, or tables of steady-state points.

    With `out`, writes `report.html`, `model.json` and `diagnosis.json` there. Exit code 3 where the data cannot carry
    an answer.
    """
    from commissioner.recordings.importers import contract_table
    from commissioner.recordings.reading.mapping import read_mapping

    said = read_mapping(mapping) if mapping else None
    tables = [contract_table(Path(path), said) for path in files]
    if out is not None:
        from commissioner.recordings.whole import folder_to_write

        folder_to_write(out)
    from commissioner.diagnose.points.table import is_points_table

    if all(is_points_table(list(t.columns)) for t in tables):
        _points(tables, out, as_json)
    else:
        _recordings(tables, motor, out, as_json)


def _recordings(tables: Sequence[Table], motor: str | None, out: Path | None, as_json: bool) -> None:
    from commissioner.cli.screens.diagnosis_progress import BEGIN, Progress
    from commissioner.diagnose.diagnosis import diagnose as analyse
    from commissioner.diagnose.document import as_document
    from commissioner.report.diagnosis.uncertain import uncertain

    recordings, remarks = _standstill(tables, motor)
    _same_motor(recordings)
    recordings, copies = _without_copies(recordings)
    remarks += copies
    progress = Progress(is_quiet=as_json)
    progress.say(BEGIN)
    seen = analyse(recordings, report=progress)
    document = as_document(seen, None)
    document["audit"] = [*remarks, *document["audit"]]
    document["uncertain"] = uncertain(seen, progress.withdrawn({c.name for c in (*seen.causes, *seen.unsure)}))
    document["dc_link_v"] = seen.found.record.facts.dc_link_v if seen.found else None
    if out is not None:
        from commissioner.report.diagnosis.page import page_of
        from commissioner.report.page import render

        document["model_file"] = str(out / "model.json") if seen.model else None
        page = render(page_of(seen, document, ", ".join(Path(t.source).name for t in tables)))
        _write(out, document, seen.model, page)
    _finish(document, out, as_json)


def _standstill(tables: Sequence[Table], motor: str | None) -> tuple[list[StandstillRecording], list[str]]:
    """The tables as recordings; a running motor is refused, unknown columns are named and left out."""
    from dataclasses import replace

    from commissioner.recordings.table import to_standstill

    remarks, recordings = [], []
    for table in tables:
        running = [c for c in RUNNING_COLUMNS if c in table.columns]
        if running and "voltage_axis_v" not in table.columns:
            raise DataRefused(
                f"{table.source}: this is a recording of a running motor (column {running[0]})",
                step="diagnose",
                value=", ".join(table.columns),
                limit="a standstill recording or a table of test points",
                remedy="use `commissioner monitor` for a running motor",
            )
        unknown = sorted(set(table.columns) - STANDSTILL_COLUMNS)
        if unknown:
            remarks.append(f"{Path(table.source).name}: unknown columns left out: {', '.join(unknown)}.")
        recording = to_standstill(table)
        remarks += [f"{Path(table.source).name}: {note.what}." for note in recording.notes]
        recordings.append(replace(recording, metadata={**recording.metadata, **_plate(motor)}))
    return recordings, remarks


def _without_copies(recordings: Sequence[StandstillRecording]) -> tuple[list[StandstillRecording], list[str]]:
    """Each recording once, and which were copies: their noise would be none."""
    import numpy as np

    kept: list[StandstillRecording] = []
    remarks = []
    for one in recordings:
        same = next(
            (
                k
                for k in kept
                if np.array_equal(k.current_u_a, one.current_u_a) and np.array_equal(k.time_s, one.time_s)
            ),
            None,
        )
        if same is None:
            kept.append(one)
        else:
            remarks.append(f"{Path(one.source).name} holds the same samples as {Path(same.source).name}: taken once.")
    return kept, remarks


def _plate(motor: str | None) -> dict[str, float | str]:
    if motor is None:
        return {}
    from dataclasses import asdict

    from commissioner.settings import load_motor

    return {k: v for k, v in asdict(load_motor(motor)).items() if v is not None}


def _same_motor(recordings: Sequence[StandstillRecording]) -> None:
    """Files with different plates are not one motor."""
    for key in ("rated_power_w", "rated_voltage_v", "rated_current_a", "rated_frequency_hz"):
        seen = {r.metadata[key]: r.source for r in recordings if key in r.metadata}
        if len(seen) > 1:
            raise DataRefused(
                f"the files are of different motors: {key} is {' and '.join(str(k) for k in seen)}",
                step="diagnose",
                value=", ".join(seen.values()),
                limit="recordings of one motor",
                remedy="diagnose them one by one",
            )
    periods = {r.sample_period_s for r in recordings}
    if max(periods) > 1.000001 * min(periods):
        raise DataRefused(
            "the files are sampled at different rates",
            step="diagnose",
            value=", ".join(f"{p:g} s" for p in periods),
            limit="one sample period",
            remedy="diagnose them one by one",
        )


def _points(tables: Sequence[Table], out: Path | None, as_json: bool) -> None:
    """Each table on its own; the stator resistance of a locked-rotor table serves the others."""
    from commissioner.diagnose.document import points_document, refused_document
    from commissioner.diagnose.points.diagnosis import diagnose_points
    from commissioner.diagnose.points.table import Points, read_points

    read = [read_points(t.columns, Path(t.source).stem) for t in tables]
    known = [p.resistance_ohm.mean() for p in read if isinstance(p, Points) and p.resistance_ohm is not None]
    documents = []
    for points in read:
        if isinstance(points, DataRefused):
            documents.append(refused_document(points, "points"))
        else:
            documents.append(points_document(diagnose_points(points, float(known[0]) if known else None)))
    document = documents[0] if len(documents) == 1 else _joined(documents, tables)
    if out is not None:
        from commissioner.report.diagnosis.page import points_page
        from commissioner.report.page import render

        for one, file in zip(documents, _names(tables), strict=True):
            name = str(Path(file).with_suffix(""))
            _write(out, document, {}, render(points_page(one, name)), page_name=f"report_{name.replace('/', '_')}.html")
    _finish(document, out, as_json)


def _joined(documents: Sequence[dict[str, Any]], tables: Sequence[Table]) -> dict[str, Any]:
    """One document: all causes together, every table's own result under `tables`."""
    verdicts = [d["verdict"] for d in documents]
    order = ("unexplained", "explained", "nothing_significant", "refused")
    verdict = next((v for v in order if v in verdicts), verdicts[0])
    return {
        **documents[0],
        "verdict": verdict,
        "reason": " ".join(d["reason"] for d in documents),
        "causes": [c for d in documents for c in d["causes"]],
        "tables": dict(zip(_names(tables), documents, strict=True)),
    }


def _names(tables: Sequence[Table]) -> list[str]:
    """The files' names, with their folder where two are called the same."""
    paths = [Path(t.source) for t in tables]
    names = [p.name for p in paths]
    return [p.name if names.count(p.name) == 1 else f"{p.parent.name}/{p.name}" for p in paths]


def _write(
    out: Path, document: Mapping[str, Any], model: Mapping[str, Any], page: str, page_name: str = "report.html"
) -> None:
    import json

    from commissioner.recordings.whole import whole_file
    from commissioner.run.archive.folder import plain

    texts = {page_name: page, "diagnosis.json": json.dumps(plain(document), indent=2)}
    if model:
        texts["model.json"] = json.dumps(plain(model), indent=1)
    for name, text in texts.items():
        with whole_file(out / name) as temporary:
            temporary.write_text(text, encoding="utf-8")


def _finish(document: Mapping[str, Any], out: Path | None, as_json: bool) -> None:
    import typer

    from commissioner.cli.screens.screen import emit

    if as_json:
        emit(document)
    else:
        from commissioner.cli.screens.diagnosis import show

        show(document, out)
    if "refused" in {document["verdict"], *(one["verdict"] for one in document.get("tables", {}).values())}:
        raise typer.Exit(3)
