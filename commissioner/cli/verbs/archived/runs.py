"""`commissioner runs`: the archive."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.cli.screens import screen
from commissioner.errors import DataRefused, UsageError
from commissioner.run.archive.blocks import read_blocks
from commissioner.run.archive.catalogue import OLD_OR_NEW, RunSummary, find_run, read_runs
from commissioner.run.archive.documents import damaged, read_saved
from commissioner.run.archive.verify import refuse_damage, verify

if TYPE_CHECKING:
    from commissioner.identify.estimate.axes import Combined


def list_runs(folder: Path, *, as_json: bool) -> None:
    """All runs, newest first."""
    found = read_runs(folder, with_results=as_json)
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
    summary = find_run(folder, name)
    if as_json:
        screen.emit({"run": summary.run, "summary": summary, "result": summary.result})
        return
    _print(summary, summary.result)


def _print(summary: RunSummary, result: dict[str, Any] | None) -> None:
    screen.out.print(f"[bold]{summary.run}[/]  {screen.outcome_mark(summary.standing)}  {summary.reason}")
    screen.out.print(f"  drive       {summary.drive}\n  energised   {summary.energised_s:.1f} s")
    screen.out.print(f"  parameters  {summary.written}\n  folder      {summary.folder}")
    if result is not None:
        screen.result(result, summary.standing)


def report_run(folder: Path, name: str, *, as_json: bool) -> None:
    """The path of the run's report, made from its archive where the run could not make it."""
    from commissioner.run.archive.late_report import make_report

    summary = find_run(folder, name)
    report = Path(summary.folder) / "report.html"
    if not report.is_file():
        with screen.busy("making the report"):
            make_report(summary)
    if as_json:
        screen.emit({"run": summary.run, "report": str(report)})
    else:
        screen.out.print(str(report), soft_wrap=True)


def export_run(folder: Path, name: str, out: Path, *, as_json: bool, salvage: bool = False) -> None:
    """The run's whole samples as a recording in the contract's format."""
    from commissioner.procedure.assembly import assemble, columns
    from commissioner.recordings.table import check_ending, write_table

    summary = find_run(folder, name)
    check_ending(out)
    source = Path(summary.folder)
    verified = verify(source)
    if not salvage:
        refuse_damage(source, verified, "export", "blocks.bin", "request.json")
    nameplate = read_saved(source, "request.json", "nameplate")["nameplate"]
    if not isinstance(nameplate, dict):
        raise damaged(source, "request.json", f"nameplate {nameplate!r}")
    plate = {key: value for key, value in nameplate.items() if value is not None}
    recording = assemble(read_blocks(source / "blocks.bin"), plate, summary.run)
    if recording is None:
        raise DataRefused(
            f"{summary.run} holds no samples", step="export", value=0, limit="at least one block",
            remedy="the motor was never energised in it",
        )  # fmt: skip
    write_table(out, columns(recording), plate | {"sample_period_s": recording.sample_period_s, "run": summary.run})
    if as_json:
        screen.emit({"run": summary.run, "recording": str(out), "samples": int(recording.time_s.size),
                     "losses": verified.losses})  # fmt: skip
    else:
        screen.out.print(f"{recording.time_s.size} samples in {out}", soft_wrap=True)


def compare_runs(folder: Path, before: str, after: str, *, as_json: bool) -> None:
    """Same motor, changed, or another one."""
    from commissioner.identify.estimate.axes import compare

    first, second = find_run(folder, before), find_run(folder, after)
    if first.run == second.run:
        raise UsageError(
            "a run cannot be compared with itself", step="compare", value=first.run, limit="two runs",
            remedy=f"`commissioner runs list --runs {folder}` shows the ids",
        )  # fmt: skip
    comparison = compare(_combined(first), _combined(second))
    if as_json:
        screen.emit({"before": first.run, "after": second.run, "comparison": comparison})
        return
    rows = [(c.parameter, f"{100 * c.relative_change:+.2f} %", f"{c.sigmas:.1f}") for c in comparison.changes]
    screen.out.print(f"[bold]{comparison.verdict.value}[/]\n  {comparison.reason}")
    screen.out.print(screen.table("", ("parameter", "change", "standard errors"), rows, right=(1, 2)))


def _combined(run: RunSummary) -> Combined:
    """A run's combined result as its document holds it."""
    import numpy as np

    from commissioner.identify.estimate.axes import Combined
    from commissioner.motor.circuit import InverseGamma
    from commissioner.procedure.verdict import PARAMETERS

    parameters = (run.result or {}).get("parameters")
    if not isinstance(parameters, dict) or not all(_is_quantity(parameters.get(name)) for name in PARAMETERS):
        raise DataRefused(
            f"{run.run} identified nothing", step="compare", value=run.outcome, limit="a run with parameters",
            remedy="compare runs that ended as commissioned or rejected",
        )  # fmt: skip
    values = [parameters[name]["value"] for name in PARAMETERS]
    std = np.array([parameters[name]["std"] for name in PARAMETERS])
    return Combined(InverseGamma(*values), np.diag(std**2), (0.0, 0.0, 0.0, 0.0), (), ())


def _is_quantity(value: Any) -> bool:
    return isinstance(value, dict) and all(isinstance(value.get(key), int | float) for key in ("value", "std"))
