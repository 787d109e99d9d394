"""`commissioner restore`, `write`, `replay` and `runs diagnose`: what an archived run is good for afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.errors import DataRefused
from commissioner.link.drive.facts import Action, Intent
from commissioner.operations import archive, closing, write
from commissioner.operations.events import Observe
from commissioner.records import WrittenParameter, drive_words, plain_name
from commissioner.run.archive.replay import Decided
from commissioner.run.archive.seal import read_key
from commissioner.run.ending import WritingBegan
from commissioner.run.holding.priority import lower_priority
from commissioner.run.write_accepted import Plan, as_document
from commissioner.text import counted


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
    request = write.RunRequest(runs, run, drive)
    if plan:
        _show_plan(write.planned_restore(request), as_json=as_json)
        return
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        _show_plan(write.planned_restore(request), as_json=False)
        screen.confirm("Write?", otherwise="nothing was written")
    with screen.busy("proving the run") as say:
        done = write.restore(request, token, _telling(say), read_key(seal) if seal is not None else None)
    if as_json:
        screen.emit({"outcome": "restored", "reason": f"snapshot written, {screen.kept(done.is_stored)}"} | vars(done))
        return
    _show_written(request, done.written)
    screen.out.print(
        f"[green]the values before the run are restored, {screen.kept(done.is_stored)}[/]"
        if done.written
        else "the drive held the snapshot's values already"
    )
    if done.fault:
        screen.out.print(f"[yellow]the drive reports a fault: {screen.text(done.fault)}[/]")
    if done.wear_fraction is not None and done.store_count is not None:
        screen.out.print(screen.wear(done.store_count, done.wear_fraction))


def write_run(
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
    """An accepted result into the drive, after the table was shown and agreed to."""
    request = write.RunRequest(runs, run, drive)
    shown = write.planned_write(request)
    if plan:
        _show_plan(shown, as_json=as_json)
        return
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        _show_plan(shown, as_json=False)
        screen.confirm("Write?", otherwise="nothing was written")
    with screen.busy("proving the result") as say:
        done = write.write_run(
            request,
            shown.token if token is None else token,
            read_key(seal) if seal is not None else None,
            _telling(say),
        )
    report = done.report
    if as_json:
        reason = f"{counted(len(report.written), 'value')} written, {screen.kept(report.is_stored)}"
        screen.emit({"outcome": "written", "reason": reason} | vars(done))
        return
    _show_written(request, report.written)
    screen.out.print(f"[green]{len(report.written)} parameters written, {screen.kept(report.is_stored)}[/]")
    if report.wear_fraction is not None and report.store_count_after is not None:
        screen.out.print(screen.wear(report.store_count_after, report.wear_fraction))


_DOING = {
    Action.STAGE: "staging the values, nothing is in use yet", Action.COMMIT: "bringing them into use, reading back",
    Action.STORE: "storing them, reading back",
}  # fmt: skip


def _telling(say: Callable[[str], None]) -> Observe:
    """Each record of a proof or a write in words, as it comes."""

    def tell(record: object) -> None:
        if isinstance(record, Decided):
            say(f"proving: decision {record.number} of {record.of}, nothing is sent")
        elif isinstance(record, WritingBegan):
            say(f"comparing what {record.drive} holds")
        elif isinstance(record, Intent) and record.action in _DOING:
            say(_DOING[record.action])

    return tell


def _show_written(request: write.RunRequest, written: Sequence[WrittenParameter]) -> None:
    """What a drive holds now, as the table that was agreed to says it."""
    if not written:
        return
    items = write.items_of(request)
    rows = [
        (str(w.register), plain_name(w.name), *(f"{value:.6g}" for value in (w.before, w.after, w.read_back)), items[w.name].unit,
         plain_name(items[w.name].convention))
        for w in written
    ]  # fmt: skip
    header = ("register", "parameter", "before", "written", "read back", "unit", "convention")
    screen.out.print(screen.table("", header, rows, right=(2, 3, 4)))


def _show_plan(plan: Plan, *, as_json: bool) -> None:
    if as_json:
        screen.emit(as_document(plan))
        return
    rows = [
        (str(r.register), plain_name(r.name), f"{r.now:.6g}", f"{r.will_be:.6g}", r.unit, plain_name(r.convention))
        for r in plan.rows
    ]
    screen.out.print(f"[bold]{screen.text(drive_words(plan.drive_type, plan.serial_number))}[/]")
    header = ("register", "parameter", "now", "will be", "unit", "convention")
    screen.out.print(screen.table("", header, rows, right=(2, 3)))
    if plan.holds_for_stator_flux_wb is not None:
        screen.out.print(
            f"  [dim]•[/] L_M and T_R are written for {plan.holds_for_stator_flux_wb:.3f} Wb of stator flux; at which flux the drive's "
            "hold, it does not say, and saturation alone moves them",
            soft_wrap=True,
        )


def diagnose_run(runs: Path, run: str, seconds: float | None, *, seal: Path | None, as_json: bool) -> None:
    """The closing diagnosis of a run; every other program of this computer goes first."""
    lower_priority()
    allowed_s = closing.DIAGNOSIS_S if seconds is None else seconds
    with screen.busy("diagnosing the samples"):
        result = closing.diagnose_archived(runs, run, allowed_s, read_key(seal) if seal is not None else None)
    if as_json:
        screen.emit(result)
    else:
        screen.result(result)


def replay_run(runs: Path, run: str, *, as_json: bool, salvage: bool) -> None:
    """Decide the run again from its archive; exit 3 where the folder is not as the run left it, or a decision comes out
    otherwise."""
    with screen.busy("deciding again") as say:
        done, verified = archive.replay_run(runs, run, salvage=salvage, observe=_telling(say))
    if as_json:
        screen.emit(done)
        if not done.identical:
            raise SystemExit(DataRefused.exit_code)
        return
    if done.difference is not None:
        place, replayed, archived = done.difference.apart
        raise DataRefused(
            f"decision {done.difference.number} of {done.run} comes out otherwise{f' in {place}' if place else ''}", step="replay",
            value=replayed, limit=archived,
            remedy="the run was made by another version of commissioner, or its folder was changed",
        )  # fmt: skip
    until = "" if verified.is_whole else f" up to the first loss; {screen.text(verified.usable)}"
    screen.out.print(f"[green]{done.decisions} decisions, all identical[/]{until}")
