"""A run's result as a file for other programs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from commissioner.export.forms import form_named
from commissioner.export.found import found_in
from commissioner.recordings.whole import whole_file
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.documents import damaged, read_saved
from commissioner.run.archive.verify import refuse_damage, verify


@dataclass(frozen=True)
class ExportedModel:
    """Where the model of a run was written, and in which form."""

    run: str
    form: str
    model: str


def export_model(runs: Path, run: str, out: Path, form: str) -> ExportedModel:
    """The run's parameters in one of `export.forms`. UsageError: no such form or ending. DataRefused: the run accepted no
    parameters, or its folder is damaged."""
    chosen = form_named(form, out)
    summary = find_run(runs, run)
    source = Path(summary.folder)
    refuse_damage(source, verify(source), "export", "result.json", "request.json", "journal.jsonl")
    result, plate = (
        read_saved(source, "result.json", "outcome"),
        read_saved(source, "request.json", "nameplate")["nameplate"],
    )
    if not isinstance(plate, dict):
        raise damaged(source, "request.json", f"nameplate {plate!r}")
    content = chosen.write(found_in(result, plate, summary.started_utc))
    with whole_file(out) as temporary:
        temporary.write_bytes(content)
    return ExportedModel(summary.run, form, str(out))
