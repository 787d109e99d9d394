"""Make the golden run again: `python -m tests.replay.golden`, after a change that is meant to change decisions."""

from __future__ import annotations

import gzip
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

from commissioner.run.commission import commission
from commissioner.settings import load_motor, load_procedure
from tests.support.sim_process import SimProcess

GOLDEN = Path(__file__).parent.parent / "data" / "golden_run"
SEED = "20"


def short_run(url: str, runs: Path) -> Path:
    """One axis, two seconds of multitone, no report wanted; the run's folder."""
    plan = load_procedure(None, (0.0,))
    plan = replace(
        plan,
        repeat_first=False,
        excitation=replace(plan.excitation, seconds=2.0),
        supervision=replace(plan.supervision, standstill_dwell_s=0.05),
    )
    done = commission(
        url, "simulated", load_motor("motor_2kw2"), plan, write_back=True, runs=runs, present=lambda record: None
    )
    if done.ended.outcome != "commissioned":
        raise SystemExit(f"the run ended as {done.ended.outcome}: {done.ended.reason}")
    return done.folder


def pack(run: Path, target: Path) -> None:
    """What `replay` needs: the journal as it is, the samples compressed."""
    target.mkdir(parents=True, exist_ok=True)
    shutil.copy(run / "journal.jsonl", target / "journal.jsonl")
    (target / "blocks.bin.gz").write_bytes(gzip.compress((run / "blocks.bin").read_bytes(), 9, mtime=0))


def unpack(source: Path, target: Path) -> Path:
    """The golden run as a run folder below `target`."""
    folder = target / "golden"
    folder.mkdir()
    shutil.copy(source / "journal.jsonl", folder / "journal.jsonl")
    (folder / "blocks.bin").write_bytes(gzip.decompress((source / "blocks.bin.gz").read_bytes()))
    return folder


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder, SimProcess("--tcp", "0", "--seed", SEED) as sim:
        pack(short_run(sim.url, Path(folder)), GOLDEN)
