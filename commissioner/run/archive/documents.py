"""The JSON of a run folder: documents read with care, and what is raised where they are not whole."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from commissioner.encoding import JsonObject, read_json
from commissioner.errors import CommissionerError, DataRefused

if TYPE_CHECKING:
    from pydantic import TypeAdapter

    from commissioner.report.run.contract import RunDocument


@dataclass(frozen=True)
class Loss:
    """One thing that is lost or was changed: in which file, at which record of the journal if it is one, what."""

    file: str
    record: int | None
    what: str


def read_document(text: str) -> JsonObject:
    """The JSON object in `text`; empty where it holds none, or one that is none of ours."""
    try:
        document = read_json(text)
    except ValueError:
        return {}
    return document if isinstance(document, dict) else {}


def read_saved(folder: Path, name: str, *needed: str) -> JsonObject:
    """The JSON document `name` of a run. DataRefused: missing, damaged, or without one of the `needed` keys."""
    path = folder / name
    document = read_document(path.read_text("utf-8", errors="replace")) if path.is_file() else {}
    missing = [key for key in needed if key not in document]
    if missing or not document:
        raise damaged(
            folder, name, f"no {missing[0]}" if document else "not readable" if path.is_file() else "no such file"
        )
    return document


def read_result(folder: Path) -> JsonObject | None:
    """What the run's `result.json` says; None where it has none. DataRefused: damaged, or a value of another kind than promised;
    what is not there, or null, may be an older version's."""
    if not (folder / "result.json").is_file():
        return None
    from pydantic import ValidationError  # late: a list of runs reads no result

    document = read_saved(folder, "result.json")
    try:
        _promised().validate_python(document, strict=True)
    except ValidationError as error:
        wrong = [at for at in error.errors(include_url=False) if at["type"] != "missing" and at["input"] is not None]
        if wrong:
            where = ".".join(map(str, wrong[0]["loc"]))
            seen = f"{where}: {wrong[0]['msg']}, not {wrong[0]['input']!r:.80}"
            raise damaged(folder, "result.json", seen) from error
    return document


@cache
def _promised() -> TypeAdapter[RunDocument]:
    from pydantic import TypeAdapter

    from commissioner.report.run.contract import RunDocument

    return TypeAdapter(RunDocument)


def damaged(folder: Path, name: str, seen: str) -> DataRefused:
    """What is raised where an archived file is not as a run leaves it."""
    return DataRefused(
        f"{folder.name}: {name} is damaged or missing", step="read the archive", value=seen,
        limit="the file as the run left it", remedy="use the run folder as the run left it, or another run",
    )  # fmt: skip


def archive_lost(folder: Path, failure: OSError, so_far: str = "") -> CommissionerError:
    """The disk took no more of a run."""
    return CommissionerError(
        f"the run's archive cannot be written: {failure.strerror or failure}{so_far}", step="archive",
        value=str(folder), limit="a disk with room that this user may write",
        remedy="make room or give another folder with --runs, then start again",
    )  # fmt: skip


def open_no_link(path: str, flags: int) -> int:
    """An `opener` that never writes through a symbolic link, nor waits for whoever would read a pipe in the file's place."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o666)
