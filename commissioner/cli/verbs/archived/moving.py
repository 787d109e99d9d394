"""`commissioner runs push` and `pull`: run folders to a share and from it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.errors import DataRefused
from commissioner.operations.history import share


def move(folder: Path, other: str, names: Sequence[str], *, to_it: bool, as_json: bool) -> None:
    """Exit 3 where a run was left behind for a reason that a person has to look at."""
    with screen.busy("copying and proving"):
        done = share.push(folder, other, names) if to_it else share.pull(folder, other, names)
    bad = [one for one in done if not one.is_good]
    if as_json:
        screen.emit({"runs": done, "left": len(bad)})
    else:
        for one in done:
            if one.what not in (share.THERE, share.NEWER):
                why = f": {screen.text(one.why)}" if one.why else f", {1e-6 * one.bytes:.1f} MB"
                screen.out.print(f"{screen.text(one.run)}  {one.what}{why}")
        same = sum(one.what in (share.THERE, share.NEWER) for one in done)
        screen.out.print(f"{len(done) - same - len(bad)} runs copied, {same} were there, {len(bad)} left")
    if bad:
        raise SystemExit(DataRefused.exit_code)
