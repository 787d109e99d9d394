"""`commissioner runs verify`: is the archive as its runs left it?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from typing_extensions import TypedDict

from commissioner.cli.screens import screen
from commissioner.errors import DataRefused, UsageError
from commissioner.operations import archive
from commissioner.run.archive.seal import read_key
from commissioner.run.archive.verify import DAMAGED, Verified

_COLOURS = {"intact": "green", "unverified": "yellow", "cut off": "yellow", DAMAGED: "red"}


class VerifiedRuns(TypedDict):
    """Of `--all`; `damaged`: how many are not as their runs left them."""

    runs: Sequence[Verified]
    damaged: int


def verify_runs(runs: Path, run: str | None, *, everything: bool, seal: Path | None, as_json: bool) -> None:
    """One run, or all of them; exit 3 where one has lost something or was changed."""
    if everything and run is not None:
        raise UsageError(
            "one run or --all, not both", step="command line", value=run, limit="RUN or --all",
            remedy=f"leave out {run!r} or --all",
        )  # fmt: skip
    key = read_key(seal) if seal is not None else None
    found = archive.verify_runs(runs, None if everything else run or "last", key)
    damaged = sum(not one.is_whole for one in found)
    if as_json:
        screen.emit(VerifiedRuns(runs=found, damaged=damaged) if everything else found[0])
    else:
        for one in found:
            _print(one)
        for remark in dict.fromkeys(remark for one in found for remark in one.remarks):
            screen.out.print(f"  [dim]{screen.text(remark)}[/]")
        if not found:
            screen.out.print(f"no runs in {screen.text(runs)}/")
    if damaged:
        raise SystemExit(DataRefused.exit_code)


def _print(one: Verified) -> None:
    colour = _COLOURS.get(one.state, "red")
    screen.out.print(f"[bold]{screen.text(one.run)}[/]  [{colour}]{one.state}[/]  {screen.text(one.usable)}")
    for loss in one.losses:
        place = "" if loss.record is None else f", record {loss.record}"
        screen.out.print(f"  [red]{screen.text(loss.file)}{place}[/]: {screen.text(loss.what)}")
    if one.seal != "none":
        screen.out.print(f"  seal: {one.seal}")
