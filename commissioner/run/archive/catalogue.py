"""What the archive holds, told from the folders alone, also for runs that were killed or that somebody damaged."""

from __future__ import annotations

import datetime as dt
import itertools
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from commissioner.errors import CommissionerError, UsageError
from commissioner.run.archive.summary import RunSummary, read_summary, sound_result, summarise, unreadable

AHEAD = dt.timedelta(minutes=10)
"""So much the clock of the computer that made a run may differ from ours."""
DATED_AHEAD = "its time has not come yet: it was made by a clock that was ahead"
"""Why a run says nothing of a motor over the years."""


def read_runs(root: Path, *, with_results: bool = True) -> list[RunSummary]:
    """Newest first; empty where there is no archive. A folder that cannot be read is a row that says so."""
    return [read_run(path, with_result=with_results) for path in run_folders(root)]


def read_run(folder: Path, *, with_result: bool = True) -> RunSummary:
    """One row, from its summary where that is of the journal as it is now, else from the journal."""
    try:
        found = read_summary(folder, (folder / "journal.jsonl").stat().st_size)
        if found is None:
            return summarise(folder)
        return replace(found, result=sound_result(folder)) if with_result else found
    except (CommissionerError, OSError, ValueError, TypeError, AttributeError, ArithmeticError) as error:
        return unreadable(folder, error)


def find_run(root: Path, name: str) -> RunSummary:
    """The one run whose id starts with `name`, or the newest for `last`."""
    return read_run(find_folder(root, name))


def run_folders(root: Path) -> list[Path]:
    """Every folder of a run, newest first, also one whose journal is gone; none where there is no archive."""
    age = by_age()
    return sorted(filter(_is_run, root.iterdir()), key=lambda p: age(p.name), reverse=True) if root.is_dir() else []


def names_until() -> str:
    """Runs of all times up to now are called less than this."""
    return (dt.datetime.now(dt.UTC) + AHEAD).strftime("%Y%m%d-%H%M%S~")


def by_age() -> Callable[[str], tuple[bool, str]]:
    """By which runs are ordered: an id begins with its time; a folder that somebody called otherwise is never the newest, nor is one
    whose time has not come, as a clock that was ahead has called it."""
    until = names_until()
    return lambda name: ("0" <= name < until, name)


def is_ahead(utc: str) -> bool:
    """Whether a record was written at a time that has not come yet: by a clock that was ahead, or ours has been put back."""
    return utc > (dt.datetime.now(dt.UTC) + AHEAD).isoformat()


def must_be_archive(root: Path) -> None:
    """UsageError where there is no folder."""
    if not root.is_dir():
        raise UsageError(
            f"{root} is no folder", step="archive", value=str(root), limit="the folder of an archive",
            remedy="give it with --runs",
        )  # fmt: skip


def find_folder(root: Path, name: str) -> Path:
    """As `find_run`, its folder; also by the path that a shell completes, `runs/ID/`. UsageError: none or several."""
    given, name = name, _id_of(root, name)
    names = sorted(os.listdir(root), key=by_age(), reverse=True) if root.is_dir() else []  # noqa: PTH208  names, not 10 000 paths
    if name == "last":
        matching = list(itertools.islice(filter(_has_journal, (root / one for one in names)), 1))
    else:
        matching = [root / one for one in names if one.startswith(name) and _is_run(root / one)]
    exact = [path for path in matching if path.name == name] or matching
    if name == "last" and not exact:
        raise UsageError(
            f"there is no run in {root}/", step="archive", value="no run", limit="at least one run",
            remedy="give the folder of an archive with --runs, or make a run: `commissioner demo`",
        )  # fmt: skip
    if len(exact) != 1:
        is_path = Path(name).name != name
        raise UsageError(
            f"{len(exact) or 'no'} runs match {given!r}",
            step="archive",
            value=", ".join(path.name for path in exact[:5]) or "none",
            limit="exactly one",
            remedy=f"`commissioner runs list --runs {root}` shows the ids"
            + (
                "; of a run that lies elsewhere, give the id alone, and with --runs the folder around it"
                if is_path
                else ""
            ),
        )
    return exact[0]


def _id_of(root: Path, name: str) -> str:
    """The folder's name alone, of a path into this archive; any other path is none of its runs, whatever lies there."""
    path = Path(name)
    return path.name if path.name != name and os.path.abspath(path.parent) == os.path.abspath(root) else name  # noqa: PTH100  touches no disk


def _has_journal(path: Path) -> bool:
    """A run that lists show: one whose journal is gone is found by its name alone."""
    return _has(path, "journal.jsonl")


def _is_run(path: Path) -> bool:
    return _has(path, "journal.jsonl", "request.json")


def _has(path: Path, *one_of: str) -> bool:
    try:
        return any((path / name).is_file() for name in one_of)
    except OSError:
        return False
