"""What the archive holds, told from the folders alone, also for runs that were killed or that somebody damaged."""

from __future__ import annotations

import itertools
import os
from dataclasses import replace
from pathlib import Path

from commissioner.errors import CommissionerError, UsageError
from commissioner.run.archive.summary import RunSummary, read_summary, sound_result, summarise, unreadable

DIGITS = tuple("0123456789")


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
    return (
        sorted((p for p in root.iterdir() if _is_run(p)), key=lambda p: age(p.name), reverse=True)
        if root.is_dir()
        else []
    )


def age(name: str) -> tuple[bool, str]:
    """By which runs are ordered: an id begins with its time; a folder that somebody called otherwise is never the newest."""
    return name[:1] in DIGITS, name


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
    names = sorted(os.listdir(root), key=age, reverse=True) if root.is_dir() else []  # noqa: PTH208  names, not 10 000 paths
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
