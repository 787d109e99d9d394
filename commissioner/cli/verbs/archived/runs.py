"""`commissioner runs`: the archive."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.operations import archive
from commissioner.operations.compare import Compared
from commissioner.operations.compare import compare_runs as carry_out
from commissioner.run.archive.catalogue import OLD_OR_NEW, RunSummary


def list_runs(folder: Path, *, as_json: bool) -> None:
    """All runs, newest first."""
    found = archive.list_runs(folder, with_results=as_json)
    if as_json:
        screen.emit({"runs": found})
        return
    if not found:
        screen.out.print(f"no runs in {folder}/")
        return
    rows = [
        (run.run, screen.outcome_mark(run.standing), run.drive, OLD_OR_NEW if run.is_unknown else "") for run in found
    ]
    screen.out.print(screen.table("", ("run", "outcome", "drive", "holds"), rows))


def show_run(folder: Path, name: str, *, as_json: bool) -> None:
    """One run, as its result says; a run that was cut off is told from its journal."""
    summary = archive.show_run(folder, name)
    if as_json:
        screen.emit({"run": summary.run, "summary": summary, "result": summary.result})
        return
    _print(summary)


def _print(summary: RunSummary) -> None:
    screen.out.print(f"[bold]{summary.run}[/]  {screen.outcome_mark(summary.standing)}  {summary.reason}")
    screen.out.print(f"  drive       {summary.drive}\n  energised   {summary.energised_s:.1f} s")
    screen.out.print(f"  parameters  {summary.written}\n  folder      {summary.folder}")
    if summary.result is not None:
        screen.result(summary.result, summary.standing)


def report_run(folder: Path, name: str, *, as_json: bool) -> None:
    """The path of the run's report, made from its archive where the run could not make it."""
    with screen.busy("making the report"):
        done = archive.report_run(folder, name)
    if as_json:
        screen.emit(done)
    else:
        screen.out.print(done.report, soft_wrap=True)


def export_run(folder: Path, name: str, out: Path, form: str, *, as_json: bool, salvage: bool = False) -> None:
    """The run's whole samples as a recording in the contract's format, or its parameters in another form."""
    if form != "samples":
        from commissioner.operations.export import export_model

        model = export_model(folder, name, out, form)
        if as_json:
            screen.emit(model)
        else:
            screen.out.print(f"{model.form}: {screen.text(model.model)}", soft_wrap=True)
        return
    done = archive.export_run(folder, name, out, salvage=salvage)
    if as_json:
        screen.emit(done)
    else:
        screen.out.print(f"{done.samples} samples in {done.recording}", soft_wrap=True)


def compare_runs(folder: Path, before: str, after: str, *, as_json: bool) -> None:
    """Same motor, changed, or another one."""
    done = carry_out(folder, before, after)
    if as_json:
        screen.emit(done)
    else:
        _show(done)


def _show(done: Compared) -> None:
    comparison = done.comparison
    rows = [(c.parameter, f"{100 * c.relative_change:+.2f} %", f"{c.sigmas:.1f}") for c in comparison.changes]
    screen.out.print(f"[bold]{comparison.verdict.value}[/]\n  {comparison.reason}")
    screen.out.print(screen.table("", ("parameter", "change", "standard errors"), rows, right=(1, 2)))
    for sentence in done.common.sentences:
        screen.out.print(f"  [dim]•[/] {screen.text(sentence)}")
