"""How fast a large archive is: `python -m tests.benchmarks.bench_archive [--runs 10000]` prints figures.

Targets, cold process: list and `show last` below 0.3 s each, rebuild below 5 s, index below 20 MB; an empty list 0.4 CPU-s, 60 MB.
Wall time of a busy host says little: CPU seconds stand beside it.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from commissioner.operations.history.runs import Archive, Wanted, write_runs
from commissioner.run.index.store import NAME
from tests.benchmarks.pairs import Pair
from tests.support.archive.synthetic import make_archive


def cold(*arguments: str) -> tuple[float, float, float]:
    """(wall s, CPU s, MB) of one call in a process of its own; the best of three."""
    taken = []
    for _ in range(3):
        began = time.perf_counter()
        process = subprocess.Popen([sys.executable, "-m", "commissioner", *arguments], stdout=subprocess.DEVNULL)
        _, code, used = os.wait4(process.pid, 0)
        assert code == 0, arguments
        taken.append((time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024))
    return min(taken, key=lambda one: one[1])


def pairs(closing: ExitStack, count: int = 10_000) -> list[Pair]:
    """The newest fifty of an archive, each in a process of its own: our list checks every folder against the index; DuckDB reads the table."""
    root = Path(closing.enter_context(tempfile.TemporaryDirectory())) / "runs"
    make_archive(root, count)
    table = root.parent / "runs.parquet"
    write_runs(Archive(root), Wanted(), table)
    query = f"SELECT run, outcome, motor_tag, drive, person FROM '{table}' ORDER BY run DESC LIMIT 50"
    duck = ("-c", f"import duckdb; print(duckdb.sql({query!r}).fetchall())")
    ours = ("-m", "commissioner", "runs", "list", "--runs", str(root))
    return [
        Pair(
            f"list of {count} runs, cold process",
            "DuckDB on the table",
            lambda: _child(*ours),
            lambda: _child(*duck),
            "s a list",
        )
    ]


def _child(*arguments: str) -> float:
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.DEVNULL)
    _, code, used = os.wait4(process.pid, 0)
    assert code == 0, arguments
    return used.ru_utime + used.ru_stime


def figures(count: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "runs"
        calls: dict[str, tuple[str, ...]] = {"--help": ("--help",)}
        calls["list, empty"] = ("runs", "list", "--runs", str(root))
        _say(calls)
        make_archive(root, count)
        at = ("--runs", str(root))
        _say(
            {
                "index --rebuild": ("runs", "index", "--rebuild", *at),
                "list": ("runs", "list", *at),
                "list --json, all": ("runs", "list", "--json", *at),
                "find pump-017 jörg": ("runs", "find", "pump-017", "jörg", *at),
                "show last": ("runs", "show", "last", *at),
            }
        )
        print(f"index of {count} runs: {(root / NAME).stat().st_size / 1e6:.1f} MB")


def _say(calls: dict[str, tuple[str, ...]]) -> None:
    for name, call in calls.items():
        wall, cpu, megabytes = cold(*call)
        print(f"{name:<20} {wall:6.2f} s wall {cpu:6.2f} s CPU {megabytes:6.0f} MB", flush=True)


@pytest.mark.benchmark
def test_an_archive_of_two_thousand_runs() -> None:
    figures(2000)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--runs", type=int, default=10_000)
    figures(parser.parse_args().runs)
