"""`commissioner restore` and `commissioner replay`: what an archived run is good for afterwards."""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.errors import DataRefused
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.late_report import mark_restored
from commissioner.run.archive.replay import replay
from commissioner.run.archive.verify import refuse_damage, verify
from commissioner.run.restore import restore
from commissioner.run.write_accepted import (
    Plan,
    as_document,
    check_token,
    plan_restore,
    plan_write_back,
    write_accepted,
)


def restore_run(
    runs: Path,
    run: str,
    drive: str | None,
    *,
    yes: bool,
    as_json: bool,
    plan: bool = False,
    token: str | None = None,
    seal: Path | None = None,
) -> None:
    """Write the run's snapshot back, after asking. `plan`: only show what would change; `token`: only if that still holds."""
    summary = find_run(runs, run)
    if plan or token is not None:
        shown = plan_restore(summary, drive)
        if plan:
            _show_plan(shown, as_json=as_json)
            return
        check_token(shown, token or "")
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        screen.out.print(
            f"The parameters that [bold]{summary.run}[/] found in {summary.drive} will be written into the drive and "
            "stored. Make sure that it is the same drive."
        )
        screen.confirm("Write?", otherwise="nothing was written")
    with screen.busy("writing and reading back"):
        done = restore(summary, drive)
    mark_restored(summary)
    if as_json:
        screen.emit({"outcome": "restored", "reason": f"snapshot written, {screen.kept(done.is_stored)}"} | vars(done))
        return
    rows = [(w.name, f"{w.before:.5g}", f"{w.after:.5g}", f"{w.read_back:.5g}") for w in done.written]
    if rows:
        screen.out.print(screen.table("", ("parameter", "before", "written", "read back"), rows, right=(1, 2, 3)))
    screen.out.print(
        f"[green]snapshot restored, {screen.kept(done.is_stored)}[/]"
        if rows
        else "the drive held the snapshot's values already"
    )
    if done.wear_fraction is not None:
        screen.out.print(screen.wear(done.store_count, done.wear_fraction))


def write_run(
    runs: Path, run: str, drive: str | None, *, yes: bool, as_json: bool, plan: bool = False, token: str | None = None
) -> None:
    """An accepted result into the drive, after the table was shown and agreed to."""
    summary = find_run(runs, run)
    shown = plan_write_back(summary, drive)
    if plan:
        _show_plan(shown, as_json=as_json)
        return
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        _show_plan(shown, as_json=False)
        screen.confirm("Write?", otherwise="nothing was written")
    done = write_accepted(summary, drive, shown.token if token is None else token)
    if as_json:
        reason = f"{len(done.written)} values written, {screen.kept(done.is_stored)}"
        screen.emit({"outcome": "written", "reason": reason, "run": summary.run, "report": done})
        return
    screen.out.print(f"[green]{len(done.written)} parameters written, {screen.kept(done.is_stored)}[/]")
    if done.wear_fraction is not None:
        screen.out.print(screen.wear(done.store_count_after, done.wear_fraction))


def _show_plan(plan: Plan, *, as_json: bool) -> None:
    if as_json:
        screen.emit(as_document(plan))
        return
    rows = [(str(r.register), r.name, f"{r.now:.6g}", f"{r.will_be:.6g}", r.unit, r.convention) for r in plan.rows]
    screen.out.print(f"[bold]{plan.drive_type} #{plan.serial_number}[/]")
    header = ("register", "parameter", "now", "will be", "unit", "convention")
    screen.out.print(screen.table("", header, rows, right=(2, 3)))


def replay_run(runs: Path, run: str, *, as_json: bool, salvage: bool) -> None:
    """Decide the run again from its archive; exit 3 where the folder is not as the run left it, or a decision comes out
    otherwise."""
    summary = find_run(runs, run)
    folder = Path(summary.folder)
    verified = verify(folder)
    if not salvage:
        refuse_damage(folder, verified, "replay")
    with screen.busy("deciding again"):
        done = replay(folder, salvage=not verified.is_whole)
    if as_json:
        screen.emit({"run": summary.run, "decisions": done.decisions, "identical": done.is_identical,
                     "difference": done.difference, "state": verified.state, "losses": verified.losses})  # fmt: skip
        if not done.is_identical:
            raise SystemExit(DataRefused.exit_code)
        return
    if done.difference is not None:
        raise DataRefused(
            f"decision {done.difference.number} of {summary.run} comes out otherwise", step="replay",
            value=done.difference.replayed, limit=done.difference.archived,
            remedy="the run was made by another version of commissioner, or its folder was changed",
        )  # fmt: skip
    until = "" if verified.is_whole else f" up to the first loss; {screen.text(verified.usable)}"
    screen.out.print(f"[green]{done.decisions} decisions, all identical[/]{until}")
