"""The JSON of a run folder: documents read with care, and what is raised where they are not whole."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from commissioner.encoding import JsonObject, read_json
from commissioner.errors import CommissionerError, DataRefused
from commissioner.motor.quantities import FIVE, FOUR

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


def origin_of(request: Mapping[str, Any]) -> JsonObject:
    """Who asked for the run, its drive and motor by the service's lists; empty of a run from the command line, or where it is none."""
    return origin if isinstance(origin := request.get("origin"), dict) else {}


def identified(document: Mapping[str, Any], *, with_errors: bool = True) -> JsonObject | None:
    """The parameters of a result that has all four, each finite and above zero with a finite error; None of any other, also where somebody
    changed the file. Without `with_errors` an error may be missing, as of a version that told none."""
    parameters = document.get("parameters")
    if not isinstance(parameters, dict):
        return None
    told = [parameters.get(of.field) for of in FIVE if of in FOUR or of.field in parameters]
    return parameters if all(is_quantity(one, has_error=with_errors) for one in told) else None


def is_quantity(found: object, *, has_error: bool = True) -> bool:
    """A finite value above zero with a finite standard error; without `has_error` that may be missing."""
    if not isinstance(found, dict):
        return False
    value, std = (number(found.get(key)) for key in ("value", "std"))
    is_known = std is not None and std >= 0.0
    return value is not None and value > 0.0 and (is_known or (not has_error and found.get("std") is None))


def number(value: object) -> float | None:
    """None where it is no finite number."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not math.isfinite(value):
        return None
    return float(value)


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
    """The disk took no more of a run, or the run's folder is gone."""
    remedy = (
        "bring the folder that was removed, moved or unmounted back, or give another one with --runs, then start again"
        if isinstance(failure, FileNotFoundError)
        else "make room or give another folder with --runs, then start again"
    )
    return CommissionerError(
        f"the run's archive cannot be written: {failure.strerror or failure}{so_far}", step="archive",
        value=str(folder), limit="a disk with room that this user may write", remedy=remedy,
    )  # fmt: skip


def open_no_link(path: str, flags: int) -> int:
    """An `opener` that never writes through a symbolic link, nor waits for whoever would read a pipe in the file's place."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0), 0o666)
