"""`commissioner runs verify`: is the archive as its runs left it?"""

from __future__ import annotations

from pathlib import Path

from commissioner.cli.screens import screen
from commissioner.errors import CommissionerError, DataRefused, UsageError
from commissioner.run.archive.catalogue import find_folder, run_folders
from commissioner.run.archive.seal import read_key
from commissioner.run.archive.verify import DAMAGED, Loss, Verified, verify

_COLOURS = {"intact": "green", "unverified": "yellow", "cut off": "yellow", DAMAGED: "red"}


def verify_runs(runs: Path, run: str | None, *, everything: bool, seal: Path | None, as_json: bool) -> None:
    """One run, or all of them; exit 3 where one has lost something or was changed."""
    if everything and run is not None:
        raise UsageError(
            "one run or --all, not both", step="command line", value=run, limit="RUN or --all",
            remedy=f"leave out {run!r} or --all",
        )  # fmt: skip
    key = read_key(seal) if seal is not None else None
    folders = run_folders(runs) if everything else [find_folder(runs, run or "last")]
    found = [verify_folder(folder, key) for folder in folders]
    damaged = sum(not one.is_whole for one in found)
    if as_json:
        documents = [vars(one) | {"is_whole": one.is_whole} for one in found]
        screen.emit({"runs": documents, "damaged": damaged} if everything else documents[0])
    else:
        for one in found:
            _print(one)
        if not found:
            screen.out.print(f"no runs in {screen.text(runs)}/")
    if damaged:
        raise SystemExit(DataRefused.exit_code)


def verify_folder(folder: Path, key: bytes | None) -> Verified:
    """As `verify`; a folder that cannot be read at all is damaged, too."""
    try:
        return verify(folder, key)
    except (CommissionerError, OSError) as error:
        what = error.what if isinstance(error, CommissionerError) else str(error)
        return Verified(
            folder.name, DAMAGED, (Loss(folder.name, None, what),), "nothing that can be read", 0, 0, 0, 0, "none"
        )


def _print(one: Verified) -> None:
    colour = _COLOURS.get(one.state, "red")
    screen.out.print(f"[bold]{screen.text(one.run)}[/]  [{colour}]{one.state}[/]  {screen.text(one.usable)}")
    for loss in one.losses:
        place = "" if loss.record is None else f", record {loss.record}"
        screen.out.print(f"  [red]{screen.text(loss.file)}{place}[/]: {screen.text(loss.what)}")
    if one.seal != "none":
        screen.out.print(f"  seal: {one.seal}")
    for remark in one.remarks:
        screen.out.print(f"  [dim]{screen.text(remark)}[/]")
