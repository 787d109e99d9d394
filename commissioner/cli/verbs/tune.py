"""`commissioner tune`: an ordinary drive's own standstill autotune, after asking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import typer

from commissioner.cli.held import held_by_a_service
from commissioner.cli.screens import screen
from commissioner.cli.screens.ending import EXIT_CODES, show_and_exit
from commissioner.errors import UsageError
from commissioner.operations.tune import TunedOnce, TuneRequest, TuningBegan, check_request
from commissioner.operations.tune import tune as carry_out
from commissioner.procedure.findings import LeftUnfinished
from commissioner.records import plain_name
from commissioner.registers.profile import DriveProfile
from commissioner.registers.tuning import Tuning
from commissioner.run.stopping.dead_man import DeadMan
from commissioner.run.stopping.operator_stop import OperatorStop


class AtTheTerminal:
    """The person at the drive, asked on the terminal."""

    def __init__(self, stop: OperatorStop) -> None:
        self._stop = stop

    def does(self, text: str) -> bool:
        """True where the person says yes."""
        screen.out.print("[bold yellow]At the drive[/]")
        return typer.confirm(text)

    def wants_stop(self) -> str:
        return self._stop.asked


class AtThePage:
    """The person at the drive, asked on a service's page: the journal asks, the answer comes by the service's pipe."""

    def __init__(self, held: DeadMan, stop: OperatorStop) -> None:
        self._held, self._stop, self._asked = held, stop, 0

    def does(self, text: str) -> bool:
        """True where the person says yes. A stop meanwhile is a no; what is asked after one is answered all the same."""
        self._asked += 1
        before = self._stop.asked
        while not self._held.is_gone and self._stop.asked == before:
            if (is_done := self._held.answer(self._asked)) is not None:
                return is_done
        return False

    def wants_stop(self) -> str:
        return self._stop.asked


def hold_and_tune(request: TuneRequest) -> None:
    """A tune that a service holds, as `run --dead-man`."""
    check_request(request)
    with held_by_a_service() as (held, stop, origin):
        done = carry_out(request, AtThePage(held, stop), _quiet, origin)
    show_and_exit(done, as_json=True)


def tune(request: TuneRequest, *, yes: bool, as_json: bool, dead_man: bool = False) -> None:
    """Asks, tunes, judges; exits with the code of the outcome."""
    if dead_man:
        hold_and_tune(request)
        return
    profile = check_request(request)
    tuning = profile.tuning
    assert tuning is not None
    if as_json and (tuning.form == "assisted" or request.power_cycle):
        raise UsageError(
            "nobody can be asked with --json", step="confirm", value=f"{tuning.form} tuning", limit="a person at the drive",
            remedy="leave --json out: the person at the drive is told what to press",
        )  # fmt: skip
    screen.require_yes(yes, as_json=as_json)
    if not yes:
        _ask(request, profile, tuning)
    with OperatorStop() as stop:
        done = carry_out(request, AtTheTerminal(stop), _quiet if as_json else _show)
    if as_json:
        screen.emit({**done.result, "folder": str(done.folder)})
    else:
        _result(done.result)
        screen.out.print(f"[dim]report    {screen.text(done.folder / 'report.html')}[/]", soft_wrap=True)
    if code := EXIT_CODES[done.ended.outcome]:
        raise SystemExit(code)


def _ask(request: TuneRequest, profile: DriveProfile, tuning: Tuning) -> None:
    """What will happen, by whose doing, and what stays in the drive."""
    who = "this tool starts, watches and ends it" if tuning.form == "remote" else "a person starts it at the drive"
    screen.out.print(
        f"[bold]{screen.text(profile.name)}[/]: its own tuning at standstill, {tuning.form}: {who}; {screen.text(tuning.proof)}.\n"
        f"[bold yellow]The drive will energise the motor[/] {request.repeat} times: {screen.text(tuning.energises)}."
    )
    if request.write_back:
        screen.out.print("If nothing objects, the tuning nearest to the medians stays in the drive.")
    elif "restore" in profile.capabilities:
        screen.out.print("Afterwards the drive gets back the values it has now.")
    else:
        screen.out.print(
            "[yellow]This drive's file knows no way to write: what the last tuning finds stays in the drive.[/]"
        )
    screen.out.print("Go on only with guards on, people away and the emergency stop tested.")
    screen.confirm("Tune?", otherwise="nothing was energised or written")


def _quiet(_: object) -> None:
    """With --json nothing but the document goes to stdout."""


def _show(record: object) -> None:
    match record:
        case LeftUnfinished(sentence=sentence):
            screen.out.print(f"[yellow]{screen.text(sentence)}[/]")
        case TuningBegan(number=number, of=of):
            screen.out.print(f"tuning {number} of {of} ...")
        case TunedOnce(tuned=tuned):
            values = ", ".join(f"{name} {value:.6g}" for name, value in tuned.values.items())
            screen.out.print(f"  [green]✓[/] {tuned.seconds:.1f} s: {values}")


def _result(document: Mapping[str, Any]) -> None:
    screen.result(document)
    rows = (document.get("tune") or {}).get("rows") or ()
    if rows:
        header = ("result", "before", "median", "spread", "trend", "change")
        screen.out.print(screen.table("", header, [_row(row) for row in rows], right=(1, 2, 3, 4, 5)))
        for row in rows:
            screen.out.print(f"  [dim]•[/] {plain_name(row['name'])}: {screen.text(_said(row))}")
            for earlier in row["earlier"][:3]:
                screen.out.print(
                    f"  [dim]•[/] {plain_name(row['name'])}: {100 * (row['ours'] / earlier['value'] - 1):+.1f} % to run {earlier['run']}"
                )
    for remark in () if document.get("parameters") else document.get("remarks", ()):
        screen.out.print(f"  [dim]•[/] {screen.text(remark)}")
    screen.out.print(f"in the drive: {screen.text(document['tune']['in_the_drive'])}")


def _row(row: Mapping[str, Any]) -> Sequence[str]:
    return (
        plain_name(row["name"]),
        f"{row['before']:.6g}",
        f"{row['median']:.6g} {row['unit']}",
        f"{row['spread_percent']:.2g} %",
        f"{row['trend_percent']:+.2g} %",
        "" if row["change_percent"] is None else f"{row['change_percent']:+.1f} %",
    )


def _said(row: Mapping[str, Any]) -> str:
    """The median in the service's own terms, and what the plate allows."""
    if row["ours"] is None:
        return str(row["conversion"])
    allowed = f"{row['plate_low']:.3g} ... {row['plate_high']:.3g}"
    return f"{row['ours']:.5g} per phase, SI ({row['conversion']}); the plate allows {allowed}"
