"""Recordings of a running motor: which files are, their diagnosis, their identification, and a model of one played."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from commissioner.diagnose.contract import DiagnosisDocument
from commissioner.diagnose.search.journal import Said
from commissioner.encoding import plain
from commissioner.errors import ConfigurationError, DataRefused
from commissioner.estimation.record import CARRIER
from commissioner.identify.contract import RunningDocument
from commissioner.motor.nameplate import Nameplate
from commissioner.operations.events import GoOn, Observe
from commissioner.operations.recordings.trust import unlike_plate
from commissioner.recordings.importers import read_running
from commissioner.recordings.plate import plate_of
from commissioner.recordings.table import Table, to_running, write_table
from commissioner.recordings.whole import write_texts
from commissioner.records import RunningRecording
from commissioner.running.diagnosis import Diagnosis
from commissioner.running.search import Step


def readable(tables: Sequence[Table], motor: str | None, step: str) -> tuple[list[RunningRecording], Nameplate]:
    """The tables as recordings of one motor. DataRefused where a table is not of a running motor, or of another one."""
    odd = [t for t in tables if not t.is_running]
    if odd:
        raise DataRefused(
            f"{odd[0].source}: some of the files are of a running motor and this one is not", step=step, value=odd[0].source,
            limit="recordings of one kind", remedy="give running and standstill recordings one kind at a time",
        )  # fmt: skip
    plates = [plate_of(t.metadata, t.source, motor) for t in tables]
    for plate, table in zip(plates, tables, strict=True):
        if (plate.rated_power_w, plate.rated_voltage_v, plate.rated_current_a) != (
            plates[0].rated_power_w, plates[0].rated_voltage_v, plates[0].rated_current_a,
        ):  # fmt: skip
            raise DataRefused(
                f"{table.source}: its plate is of another motor than the first file's", step=step, value=plate.rated_power_w,
                limit=plates[0].rated_power_w, remedy="give the files of one motor, or --motor",
            )  # fmt: skip
    return [to_running(t) for t in tables], plates[0]


def diagnosed(
    tables: Sequence[Table], motor: str | None, out: Path | None, excluded: Sequence[str], observe: Observe, go_on: GoOn
) -> tuple[DiagnosisDocument, Diagnosis]:
    """The document and what it was made from; with `out` the page, the model and the document are written there."""
    from commissioner.running.contract import as_document
    from commissioner.running.diagnosis import diagnose
    from commissioner.running.export import model_document

    recordings, plate = readable(tables, motor, "diagnose")

    def say(step: Step) -> None:
        words = {
            "accepted": "helps",
            "dropped": "is no longer needed",
            "exchanged": f"gives way to {step.why.replace('_', ' ')}",
        }
        if step.what in words:
            observe(Said(f"{step.cause.replace('_', ' ')} {words[step.what]}"))

    seen = diagnose(recordings, plate, excluded=excluded, observe=say, go_on=go_on)
    document = as_document(seen)
    document["remarks"] = [*_of_reading(recordings), *unlike_plate(seen.parameters_after, plate), *document["remarks"]]
    if out is not None:
        from commissioner.report.page import render
        from commissioner.report.running.page import page_of

        texts = {}
        if seen.found is not None and seen.record is not None:
            document["model_file"] = str(out / "model.json")
            texts["model.json"] = json.dumps(plain(model_document(seen.found, seen.record)), indent=1)
        texts["report.html"] = render(page_of(seen, document, ", ".join(Path(t.source).name for t in tables)))
        texts["diagnosis.json"] = json.dumps(plain(document), indent=2)
        write_texts(out, texts)
    return document, seen


def identified(tables: Sequence[Table], motor: str | None, out: Path | None = None) -> RunningDocument:
    """The document of an identification from a start, load steps or several steady loads. DataRefused where they cannot carry it.

    `out`: a folder for its report.
    """
    from commissioner.running.identification import as_document, identify

    recordings, plate = readable(tables, motor, "identify")
    found = identify(recordings, plate)
    document = cast("RunningDocument", plain(as_document(found)))
    document["remarks"] = [*_of_reading(recordings), *unlike_plate(found.parameters, plate), *document["remarks"]]
    if out is not None:
        from commissioner.report.page import render
        from commissioner.report.running.identified import page_of

        text = render(page_of(found, document, ", ".join(Path(t.source).name for t in tables)))
        write_texts(out, {"report.html": text, "identification.json": json.dumps(document, indent=2)})
    return document


def _of_reading(recordings: Sequence[RunningRecording]) -> list[str]:
    """What was taken for something else, or left out, when the files were read."""
    return [f"{Path(r.source).name}: {n.what}." for r in recordings for n in r.notes]


def is_running_model(document: Mapping[str, Any]) -> bool:
    """Whether a `model.json` is that of a running diagnosis."""
    return document.get("kind") == "running" and "numbers" in document


def played(
    document: Mapping[str, Any], source: str, out: Path, like: Path | None, noise_a: float, seed: int, *, is_plain: bool
) -> tuple[int, tuple[str, ...]]:
    """The extended model driven by the voltages (and speed) of the recording `like`, or started on the plate's mains.

    Samples, and the effects in it. ConfigurationError where the model cannot be played.
    """
    from commissioner.running.export import machine_of
    from commissioner.running.playback import play

    try:
        machine, scales, plate = machine_of(document, is_plain=is_plain)
    except (KeyError, ValueError, TypeError) as error:
        raise ConfigurationError(
            file=source, key="document", value=str(error), expected="a model.json written by `commissioner diagnose`"
        ) from error
    recording = read_running(like) if like is not None else None
    period = recording.sample_period_s if recording is not None else float(document["sample_period_s"])
    columns = play(machine, scales, plate, period, recording, document.get("scenario", {}), noise_a, seed)
    if not all(np.isfinite(x).all() for x in columns.values()):
        raise ConfigurationError(
            file=source, key="numbers", value="currents that run away", expected="numbers of a motor"
        )
    keys = {k: v for k, v in document["nameplate"].items() if isinstance(v, int | float | str)}
    if recording is not None and (carrier := recording.metadata.get(CARRIER)):
        keys[CARRIER] = carrier
    write_table(out, columns, {**keys, "sample_period_s": period})
    return int(columns["time_s"].size), () if is_plain else tuple(document["effects"])
