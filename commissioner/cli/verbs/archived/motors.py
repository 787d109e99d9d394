"""`commissioner runs motors` and `trend`: which motor a run was made on, and how a motor does over the years."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from typing_extensions import TypedDict

from commissioner.cli.screens import screen
from commissioner.errors import UsageError
from commissioner.history.motor import Trend, in_percent
from commissioner.motor.quantities import quantity_of
from commissioner.operations.history.motors import Likeness, Motor, judge_motor, list_motors, name_motor
from commissioner.operations.history.runs import Archive
from commissioner.operations.history.trend import MotorTrend, trend, trend_of_indicators
from commissioner.records import in_words


class KnownMotors(TypedDict):
    """The last used first."""

    motors: Sequence[Motor]


class LikelyMotors(TypedDict):
    """Those that a run may have been made on, the most alike first."""

    motors: Sequence[Likeness]


def motors(archive: Archive, run: str | None, *, tag: str, serial: str, confirm: bool, as_json: bool) -> None:
    """All motors; or those that a run may have been made on; or that it was made on this one."""
    if run is None:
        if tag or serial:
            raise UsageError(
                "of which run is this the motor?", step="command line", value=tag or serial, limit="RUN and --tag",
                remedy="`commissioner runs motors RUN --tag TAG`",
            )  # fmt: skip
        _list(archive, as_json=as_json)
    elif tag or serial:
        _name(archive, run, tag, serial, confirm=confirm, as_json=as_json)
    else:
        _judge(archive, run, as_json=as_json)


def show_trend(archive: Archive, motor: str | None, baseline: Path | None, out: Path | None, *, as_json: bool) -> None:
    """Of a motor's parameters, or of the indicators in a baseline of `monitor`."""
    if (motor is None) == (baseline is None):
        raise UsageError(
            "a trend is of a motor or of a baseline", step="command line", value="neither" if motor is None else "both", limit="one of them",
            remedy="give MOTOR, or --baseline FILE",
        )  # fmt: skip
    with screen.busy("comparing over the years"):
        done = trend_of_indicators(baseline, out) if baseline is not None else trend(archive, motor or "", out)
    if as_json:
        screen.emit(done)
    else:
        _show(done)


def _list(archive: Archive, *, as_json: bool) -> None:
    found = list_motors(archive)
    if as_json:
        screen.emit(KnownMotors(motors=found))
        return
    has_serials = any(one.serial for one in found)
    rows = [
        (screen.text(one.motor or "nobody said"), *([screen.text(one.serial)] if has_serials else []), screen.text(one.plate),
         screen.text(one.drive), str(one.runs), one.last_utc[:10], screen.outcome_cell(one.last_standing))
        for one in found
    ]  # fmt: skip
    header = ("motor", *(["serial number"] if has_serials else []), "plate", "drive", "runs", "last", "outcome")
    screen.out.print(screen.table("", header, rows, right=(header.index("runs"),), widths=screen.outcome_width(header)))


def _judge(archive: Archive, run: str, *, as_json: bool) -> None:
    found = judge_motor(archive, run)
    if as_json:
        screen.emit(LikelyMotors(motors=found))
        return
    screen.out.print(screen.table("", ("motor", "beside", "by its parameters", ""), [_row(one) for one in found]))
    screen.out.print("[dim]`commissioner runs motors RUN --tag TAG` says which one it was[/]")


def _row(one: Likeness) -> tuple[str, str, str, str]:
    verdict = one.comparison.verdict.value.partition(":")[0]
    return screen.text(one.motor), screen.text(one.against), verdict, screen.text(one.comparison.reason)


def _name(archive: Archive, run: str, tag: str, serial: str, *, confirm: bool, as_json: bool) -> None:
    done = name_motor(archive, run, tag=tag, serial=serial, confirm=confirm)
    if as_json:
        screen.emit(done)
        return
    screen.out.print(
        f"{screen.text(done.run)} was made on {screen.text(tag or serial)}, says {screen.text(done.person)}"
    )
    if done.likeness is not None:
        screen.out.print(f"  beside {screen.text(done.likeness.against)}: {done.likeness.comparison.verdict.value}")


def _level(one: Trend) -> tuple[str, str, str]:
    """Name, number of points and level, in words and in the unit that every other table has."""
    quantity = quantity_of(one.name)
    name, factor, unit = (
        (in_words(one.name)[0], 1.0, one.unit) if quantity is None else (quantity.name, quantity.factor, quantity.unit)
    )
    return name, str(len(one.points)), screen.quantity(factor * one.level, factor * one.level_std, unit).rstrip()


def _show(done: MotorTrend) -> None:
    screen.out.print(f"[bold]{screen.text(done.motor)}[/]")
    rows = [
        (*_level(one), "" if one.slope_per_year is None else in_percent(one.slope_per_year, one.slope_std or 0.0),
         str(len(one.steps)), "[red]alarm[/]" if one.is_alarm else "")
        for one in done.found.trends
    ]  # fmt: skip
    screen.out.print(
        screen.table("", ("", "points", "level now, ± 95 %", "a year", "steps", ""), rows, right=(1, 2, 3, 4))
    )
    for sentence in (*done.found.sentences, *done.found.common.sentences):
        screen.out.print(f"  [dim]•[/] {screen.text(sentence)}")
    for sentence in done.left_out:
        screen.out.print(f"  [dim]left out: {screen.text(sentence)}[/]")
    if done.picture:
        screen.out.print(f"[dim]picture   {screen.text(done.picture)}[/]", soft_wrap=True)
