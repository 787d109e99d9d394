"""`commissioner runs push` and `pull`: run folders to a share or a service, and from a share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from typing_extensions import TypedDict

from commissioner.cli.screens import screen
from commissioner.cli.screens.password import read_password
from commissioner.errors import DataRefused
from commissioner.operations.history import send, share
from commissioner.text import counted


class MovedRuns(TypedDict):
    """What became of each run; `left`: how many a person has to look at."""

    runs: Sequence[share.Moved]
    left: int


def push(
    runs: Path,
    target: str,
    names: Sequence[str],
    *,
    account: str,
    password_file: Path | None,
    ca: Path | None,
    as_json: bool,
) -> None:
    """To a folder, or to a service at an http or https address."""
    if not target.lower().startswith(("http://", "https://")):
        _tell(lambda: share.push(runs, target, names), as_json=as_json)
        return
    who = send.Account(account, read_password(password_file, "push", is_new=False)) if account else None
    _tell(lambda: send.send(runs, target, names, account=who, ca=ca), as_json=as_json)


def pull(runs: Path, source: str, names: Sequence[str], *, as_json: bool) -> None:
    """From a folder."""
    _tell(lambda: share.pull(runs, source, names), as_json=as_json)


def _tell(move: Callable[[], tuple[share.Moved, ...]], *, as_json: bool) -> None:
    """Exit 3 where a run was left behind for a reason that a person has to look at."""
    with screen.busy("copying and proving"):
        done = move()
    bad = [one for one in done if not one.is_good]
    if as_json:
        screen.emit(MovedRuns(runs=done, left=len(bad)))
    else:
        for one in done:
            if one.what not in (share.THERE, share.NEWER):
                why = f": {screen.text(one.why)}" if one.why else f", {1e-6 * one.bytes:.1f} MB"
                screen.out.print(f"{screen.text(one.run)}  {one.what}{why}")
        same = sum(one.what in (share.THERE, share.NEWER) for one in done)
        screen.out.print(f"{counted(len(done) - same - len(bad), 'run')} copied, {same} were there, {len(bad)} left")
    if bad:
        raise SystemExit(DataRefused.exit_code)
