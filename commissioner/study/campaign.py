"""A study carried out: cases from its file, rows as they end, table and page at the end."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from commissioner.encoding import HIDDEN
from commissioner.recordings.whole import folder_to_write, write_text
from commissioner.settings import load
from commissioner.study.drawing import require_drawable
from commissioner.study.rows import Rows
from commissioner.study.sheet import page
from commissioner.study.simulators import simulator
from commissioner.study.specification import Specification, cases_of
from commissioner.study.summary import Summary, summarise
from commissioner.study.workers import here, on_cluster

PAGE = "study.html"


@dataclass(frozen=True)
class StudyRequest:
    """`workers`: processes of this computer; `scheduler`: a Dask cluster's address instead."""

    file: Path
    out: Path
    workers: int | None = None
    scheduler: str | None = None
    resume: bool = False


@dataclass(frozen=True)
class CaseEnded:
    """Progress: one more row."""

    done: int
    cases: int
    outcome: str


@dataclass(frozen=True)
class Studied:
    """`per_minute`: of the cases that ended in this call, by the wall clock, start-up included."""

    cases: int
    outcomes: dict[str, int]
    per_minute: float
    table: str
    report: str
    summary: Summary = field(metadata=HIDDEN)


def carry_out(request: StudyRequest, observe: Callable[[CaseEnded], None] = lambda _ended: None) -> Studied:
    """ConfigurationError: the file; UsageError: the folder, or no simulator. A worker's death is made good; Ctrl-C leaves rows
    that `resume` goes on from."""
    began = time.monotonic()
    study = load(request.file, Specification)
    motors = simulator().motors() if study.kind == "commission" else ()
    cases = cases_of(study, request.file, motors)
    require_drawable(cases, request.file)
    rows = Rows(folder_to_write(request.out), study.model_dump(), resume=request.resume)
    missing = [case for case in cases if case.number not in rows.ended]
    workers = request.workers or max(1, os.cpu_count() or 1)
    source = (
        on_cluster(missing, request.scheduler)
        if request.scheduler
        else here(missing, min(workers, max(1, len(missing))))
    )
    try:
        for done, row in enumerate(source, start=len(rows.ended) + 1):
            rows.add(row)
            observe(CaseEnded(done, len(cases), str(row["outcome"])))
    finally:
        table = rows.close()
    ordered = [rows.ended[number] for number in sorted(rows.ended)]
    seen, report = summarise(ordered), request.out / PAGE
    write_text(report, page(ordered, seen, f"Study {request.file.name}"))
    minutes = max(time.monotonic() - began, 1e-9) / 60.0
    return Studied(seen.cases, dict(seen.outcomes), len(missing) / minutes, str(table), str(report), seen)
