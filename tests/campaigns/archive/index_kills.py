"""Campaign: `python -m tests.campaigns.archive.index_kills [--kills 100] [--seed N]`: SIGKILL while the archive's index is written.

A child makes runs, ends them, names their motors, deletes some and rebuilds the index without pause; it is killed at a random
instant. After each kill every run that the child had noted in a ledger is there whole, the list is what the folders hold, and
what the index itself holds is what the folders hold.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import signal
import sqlite3
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from commissioner.run.archive.catalogue import read_runs
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.verify import DAMAGED, verify
from commissioner.run.index.index import find, refresh
from commissioner.run.index.rows import Wanted
from commissioner.run.index.store import NAME
from tests.support.archive.synthetic import make_archive

FIRST = 30
"""Runs that are there before the first kill."""


@dataclass
class Outcome:
    """What was killed and what it broke."""

    kills: int = 0
    runs: int = 0
    in_a_write: int = 0
    broken: list[str] = field(default_factory=list)


def victim(root: Path, ledger: Path, seed: int) -> None:
    """Never ends by itself."""
    chance = random.Random(seed)
    note = os.open(ledger, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    while True:
        folder = RunFolder.create(root, "victim")
        folder.journal(
            "run_ended", {"outcome": "aborted", "reason": f"number {seed}", "energised_s": 0.0}, durable=True
        )
        os.write(note, f"{folder.path.name}\n".encode())
        folder.close()
        if chance.random() < 0.3:
            refresh(root, rebuild=True)
        if chance.random() < 0.3:
            find(root, Wanted(limit=5))


def campaign(kills: int, seed: int) -> Outcome:
    chance, outcome = random.Random(seed), Outcome()
    context = multiprocessing.get_context("fork")
    with tempfile.TemporaryDirectory() as place:
        root, ledger = Path(place) / "runs", Path(place) / "ledger"
        make_archive(root, FIRST)
        refresh(root)
        for number in range(kills):
            child = context.Process(target=victim, args=(root, ledger, seed + number))
            child.start()
            time.sleep(0.05 + 0.4 * chance.random())
            assert child.pid is not None
            os.kill(child.pid, signal.SIGKILL)
            child.join()
            outcome.kills += 1
            outcome.in_a_write += (root / f"{NAME}-journal").exists()
            outcome.broken += [f"kill {number}: {what}" for what in _broken(root, ledger)]
        outcome.runs = len(read_runs(root, with_results=False))
    return outcome


def _broken(root: Path, ledger: Path) -> list[str]:
    said = []
    listed = [(row.run, row.outcome) for row in find(root, Wanted()).rows]
    folders = [(run.run, run.outcome) for run in read_runs(root, with_results=False)]
    if listed != folders:
        said.append(f"list and folders differ: {set(listed) ^ set(folders)}")
    with sqlite3.connect(root / NAME) as connection:
        held = {row[0] for row in connection.execute("SELECT run FROM runs")}
        if connection.execute("PRAGMA integrity_check").fetchone() != ("ok",):
            said.append("the index is damaged")
    if held != {run for run, _ in folders}:
        said.append("the index holds other runs than the folders")
    noted = ledger.read_text("utf-8").splitlines() if ledger.is_file() else []
    for run in noted:
        if dict(folders).get(run) != "aborted":
            said.append(f"{run} is lost")
    for run in noted[-3:]:
        if verify(root / run).state == DAMAGED:
            said.append(f"{run} is damaged")
    return said


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    done = campaign(options.kills, options.seed)
    print(
        f"{done.kills} kills, {done.in_a_write} of them inside a transaction; {done.runs} runs; {len(done.broken)} promises broken"
    )
    print("\n".join(done.broken))
    sys.exit(bool(done.broken))
