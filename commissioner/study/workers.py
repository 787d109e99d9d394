"""Cases spread over processes of this computer, or over a Dask cluster. A worker that dies loses only what it was at."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from multiprocessing import get_context
from typing import Any
from urllib.parse import urlsplit

from commissioner.errors import CommissionerError, UsageError
from commissioner.study.rows import DEFECT, Row
from commissioner.study.specification import Case

AHEAD = 4
"""Cases handed out for each worker: memory stays what it is however many there are."""
MOST_BREAKS = 3
"""A case at which the workers die so often is the reason for it."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def carried_out(case: Case) -> Row:
    """The row of a case, whatever it is. Nothing is raised: a defect is a row that names it."""
    from commissioner.study.commissioning import commissioned
    from commissioner.study.looking import looked_at

    try:
        return commissioned(case) if case.kind == "commission" else looked_at(case)
    except CommissionerError as error:
        return {
            "case": case.number,
            "seed": case.seed,
            "motor": case.motor,
            "outcome": error.outcome,
            "reason": error.what,
        }
    except Exception as defect:
        reason = f"{type(defect).__name__}: {defect}"
        return {"case": case.number, "seed": case.seed, "motor": case.motor, "outcome": DEFECT, "reason": reason}


def here(cases: Sequence[Case], workers: int) -> Iterator[Row]:
    """Rows as they end, from `workers` processes of one thread each."""
    left = {case.number: case for case in cases}
    breaks: dict[int, int] = {}
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        while left:
            try:
                for row in _pool(list(left.values()), workers):
                    del left[row["case"]]
                    yield row
            except BrokenProcessPool:
                first = next(iter(left.values()))
                breaks[first.number] = breaks.get(first.number, 0) + 1
                if breaks[first.number] >= MOST_BREAKS:
                    del left[first.number]
                    yield {
                        "case": first.number, "seed": first.seed, "motor": first.motor, "outcome": DEFECT,
                        "reason": f"the worker died {MOST_BREAKS} times at it",
                    }  # fmt: skip
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _pool(cases: Sequence[Case], workers: int) -> Iterator[Row]:
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        waiting: set[Future[Row]] = set()
        rest = iter(cases)
        try:
            while True:
                for case in rest:
                    waiting.add(pool.submit(carried_out, case))
                    if len(waiting) >= AHEAD * workers:
                        break
                if not waiting:
                    return
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                for future in done:
                    yield future.result()
        finally:
            for future in waiting:
                future.cancel()


def _is_address(scheduler: str) -> bool:
    try:
        parts = urlsplit(scheduler)
        return parts.scheme in ("tcp", "tls") and bool(parts.hostname) and bool(parts.port)
    except ValueError:
        return False


def on_cluster(cases: Sequence[Case], scheduler: str) -> Iterator[Row]:
    """Rows as they end, from the workers of a Dask scheduler. UsageError: Dask is not installed, or nobody answers there."""
    if not _is_address(scheduler):  # a client of such a one is half made, and ends in a traceback of its own
        raise UsageError(
            f"{scheduler} is no scheduler's address", step="study", value=scheduler, limit="tcp://HOST:PORT or tls://HOST:PORT",
            remedy="give the address that `dask scheduler` prints, or leave --scheduler out",
        )  # fmt: skip
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise UsageError(
            "a cluster needs Dask", step="study", value=scheduler, limit="the package `distributed`",
            remedy="pip install \".[study]\" in the folder of this program",
        ) from error  # fmt: skip
    try:
        client = distributed.Client(scheduler, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise UsageError(
            f"no scheduler answers at {scheduler}", step="study", value=scheduler,
            limit="a running Dask scheduler of the same version", remedy="start one, or leave --scheduler out",
        ) from error  # fmt: skip
    with client:
        most = AHEAD * max(1, len(client.scheduler_info()["workers"]))
        rest = iter(cases)

        def submit(count: int) -> list[Any]:
            return [
                client.submit(carried_out, case, pure=False, retries=MOST_BREAKS)
                for _, case in zip(range(count), rest, strict=False)
            ]

        queue = distributed.as_completed(submit(most))
        for future in queue:
            yield future.result()
            queue.update(submit(1))
