"""Cases spread over processes of this computer, or over a Dask cluster. A worker that dies loses only what it was at."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from importlib import import_module
from itertools import islice
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from commissioner.errors import CommissionerError, UsageError
from commissioner.study.rows import DEFECT, Row
from commissioner.study.specification import Case
from commissioner.text import split_address

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
        return _ended(case, error.outcome, error.what)
    except Exception as defect:
        return _ended(case, DEFECT, f"{type(defect).__name__}: {defect}")


def _ended(case: Case, outcome: str, reason: str) -> Row:
    """The row of a case of which nothing else is known."""
    row: Row = {"case": case.number, "outcome": outcome, "reason": reason}
    if case.file:
        return row | {"file": Path(case.file).name}
    return row | {"seed": case.seed, "motor": case.motor}


def _died(case: Case) -> Row:
    return _ended(case, DEFECT, f"the worker died {MOST_BREAKS} times at it")


def here(cases: Sequence[Case], workers: int) -> Iterator[Row]:
    """Rows as they end, from `workers` processes of one thread each."""
    left = {case.number: case for case in cases}
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        while left:
            try:
                for row in _pool(list(left.values()), workers):
                    del left[row["case"]]
                    yield row
            except BrokenProcessPool:  # at one of those that were handed out: each alone says which
                for case in list(left.values())[: AHEAD * workers]:
                    yield _alone(left.pop(case.number))
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _alone(case: Case) -> Row:
    """In a worker that has no other case, so that its death is this one's."""
    for _ in range(MOST_BREAKS):
        try:
            (row,) = _pool([case], 1)
        except BrokenProcessPool:
            continue
        return row
    return _died(case)


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
    parts = split_address(scheduler)
    return parts.scheme in ("tcp", "tls") and bool(parts.hostname) and bool(parts.port)


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
        yield from _handed_out(cases, client, distributed)


def _handed_out(cases: Sequence[Case], client: Any, distributed: Any) -> Iterator[Row]:
    """A case whose worker died is tried again when no other runs: the scheduler blames what stood beside it, too."""
    rest, waiting, suspects = iter(cases), dict[str, Case](), list[Case]()
    queue = distributed.as_completed(loop=client.loop)

    def hand_out() -> None:
        """Workers may come later: they are counted anew."""
        most = AHEAD * max(1, sum(client.nthreads().values()))
        for case in islice(rest, max(0, most - len(waiting))):
            future = client.submit(carried_out, case, pure=False)
            waiting[future.key] = case
            queue.add(future)

    hand_out()
    for future in queue:
        case = waiting.pop(future.key)
        try:
            row = future.result()
        except distributed.KilledWorker:
            suspects.append(case)
        except Exception as error:
            raise _broken_cluster(case, future.status, error) from error
        else:
            yield row
        hand_out()
    for case in suspects:
        yield from [_died(case)] if len(cases) == 1 else _handed_out([case], client, distributed)


def _broken_cluster(case: Case, status: str, error: Exception) -> UsageError:
    is_gone = status == "cancelled"
    return UsageError(
        "the scheduler is gone" if is_gone else f"the cluster cannot carry out case {case.number}",
        step="study", value=f"{type(error).__name__}: {error}",
        limit="a scheduler that answers" if is_gone else "workers that have this version of the program",
        remedy=f"{'start it again' if is_gone else 'install it there'}, then give --resume",
    )  # fmt: skip
