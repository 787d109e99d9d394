"""`commissioner runs`: list, find, show, index; report, export, compare."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from typing_extensions import TypedDict

from commissioner.cli.screens import screen
from commissioner.encoding import JsonObject
from commissioner.operations.history.runs import Archive, Wanted, find_runs, index_runs, write_runs
from commissioner.operations.history.runs import show_run as look_up
from commissioner.run.archive.documents import Loss
from commissioner.run.archive.summary import RunSummary
from commissioner.text import counted

SHOWN = 50
"""Rows of a list for a person, unless another number is given."""
BESIDE = 46
"""Characters that the columns beside a run's id need; with less its facts stand below it."""


def find(archive: Archive, wanted: Wanted, limit: int | None, out: Path | None, *, as_json: bool) -> None:
    """The runs that are wanted, on the screen or into the file `out`; `limit` None: all of them, of a list for a person `SHOWN`."""
    most = limit if limit is not None else 0 if as_json or out else SHOWN
    wanted = replace(wanted, limit=most)
    if out is not None:
        write_table(archive, out, as_json=as_json, wanted=wanted)
    else:
        list_runs(archive, as_json=as_json, wanted=wanted)


def list_runs(archive: Archive, *, as_json: bool, wanted: Wanted) -> None:
    """The runs that are wanted, newest first."""
    found = find_runs(archive, wanted)
    if as_json:
        screen.emit_texts("runs", [row.document for row in found.rows], total=found.total)
        return
    if not found.rows:
        screen.out.print(
            f"no runs in {screen.text(archive.runs)}/" if wanted == Wanted(limit=wanted.limit) else "no such run"
        )
        return
    rows = [
        (screen.text(row.run), screen.outcome_cell(row.standing), screen.text(row.motor or row.plate), screen.text(row.drive),
         screen.text(row.person), row.holds)
        for row in found.rows
    ]  # fmt: skip
    if max(len(row.run) for row in found.rows) > screen.out.width - BESIDE:
        screen.stacked_rows(rows)
    else:
        _as_table(rows)
    if (more := found.total - len(rows)) > 0:
        screen.out.print(f"[dim]{more} older ones: --limit 0 shows all, `commissioner runs find` looks for some[/]")


def _as_table(rows: Sequence[tuple[str, ...]]) -> None:
    header = ("run", "outcome", "motor", "drive", "person", "holds")
    told = len(header) if any(row[-1] for row in rows) else len(header) - 1
    least = screen.outcome_width(header)
    screen.out.print(screen.table("", header[:told], [row[:told] for row in rows], widths=least))


def write_table(archive: Archive, out: Path, *, as_json: bool, wanted: Wanted) -> None:
    """The runs that are wanted as a file for a spreadsheet or a query."""
    done = write_runs(archive, wanted, out)
    if as_json:
        screen.emit(done)
    else:
        screen.out.print(f"{counted(done.runs, 'run')} in {screen.text(done.table)}", soft_wrap=True)


def index(folder: Path, *, rebuild: bool, database: str | None, as_json: bool) -> None:
    """The index brought into step, or made anew."""
    with screen.busy("reading the folders"):
        done = index_runs(Archive(folder, database), rebuild=rebuild)
    if as_json:
        screen.emit(done)
    else:
        screen.out.print(
            f"{counted(done.runs, 'run')}, {done.read} read, {done.gone} taken out: {screen.text(done.index)}",
            soft_wrap=True,
        )


class ShownRun(TypedDict):
    """`result`: the run's, as it lies in the archive; null where it left none. `losses`: what of it is not as the run left it."""

    run: str
    summary: RunSummary
    result: JsonObject | None
    losses: tuple[Loss, ...]


def show_run(folder: Path, name: str, *, as_json: bool) -> None:
    """One run, as its result says; a run that was cut off is told from its journal."""
    shown = look_up(folder, name)
    summary = shown.summary
    if as_json:
        screen.emit(ShownRun(run=summary.run, summary=summary, result=summary.result, losses=shown.losses))
        return
    _print(summary)
    screen.losses(summary.run, shown.losses)


def _print(summary: RunSummary) -> None:
    mark, motor = (
        screen.outcome_mark(summary.standing),
        " ".join(filter(None, (summary.motor_tag, summary.motor_serial))),
    )
    screen.out.print(f"[bold]{screen.text(summary.run)}[/]  {mark}  {screen.signs(screen.text(summary.reason))}")
    screen.out.print(
        f"  drive       {screen.text(summary.drive)}\n  motor       {screen.text(motor) or 'nobody said which'}"
    )
    screen.out.print(f"  energised   {screen.seconds(summary.energised_s)}")
    screen.out.print(f"  parameters  {screen.text(summary.written)}\n  folder      {screen.text(summary.folder)}")
    if summary.result is not None:
        screen.result(summary.result, summary.standing)


def report_run(folder: Path, name: str, *, as_json: bool) -> None:
    """The path of the run's report, made from its archive where the run could not make it."""
    from commissioner.operations import archive

    with screen.busy("making the report"):
        done = archive.report_run(folder, name)
    if as_json:
        screen.emit(done)
    else:
        screen.out.print(screen.text(done.report), soft_wrap=True)
        screen.losses(done.run, done.losses)


def export_run(folder: Path, name: str, out: Path, form: str, *, as_json: bool, salvage: bool = False) -> None:
    """The run's whole samples as a recording in the contract's format, or its parameters in another form."""
    if form != "samples":
        from commissioner.operations.export import export_model

        model = export_model(folder, name, out, form)
        if as_json:
            screen.emit(model)
        else:
            screen.out.print(f"parameters as {model.form} in {screen.text(model.model)}", soft_wrap=True)
        return
    from commissioner.operations import archive

    done = archive.export_run(folder, name, out, salvage=salvage)
    if as_json:
        screen.emit(done)
    else:
        screen.out.print(f"{done.samples} samples in {screen.text(done.recording)}", soft_wrap=True)
