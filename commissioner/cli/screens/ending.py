"""How a run ended, on the terminal or as the one JSON document, and the exit code of it."""

from __future__ import annotations

from commissioner.cli.screens import screen
from commissioner.paths import RUNS
from commissioner.run.commission import Commissioned

EXIT_CODES = {"commissioned": 0, "rejected": 3, "aborted": 4, "faulted": 5}


def show_and_exit(done: Commissioned, *, as_json: bool) -> None:
    """The result, and the exit code of its outcome."""
    if as_json:
        screen.emit({**done.result, "folder": str(done.folder)})
    else:
        screen.result(done.result)
        for what, name in (("report", "report.html"), ("samples", "recording.parquet")):
            if (done.folder / name).is_file():
                screen.out.print(f"[dim]{what:<9} {screen.text(done.folder / name)}[/]", soft_wrap=True)
        if done.is_being_diagnosed:
            archive = done.folder.parent
            where = "" if archive == RUNS else f' --runs "{archive}"'
            screen.out.print(
                "[dim]diagnosis of the samples: a process of its own makes it, in minutes; then "
                f"`commissioner runs show {done.folder.name}{where}` and the report have it[/]",
                soft_wrap=True,
            )
    if code := EXIT_CODES[done.ended.outcome]:
        raise SystemExit(code)
