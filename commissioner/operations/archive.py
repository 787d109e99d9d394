"""What is made of archived runs: report, export, verify, replay."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from commissioner.errors import CommissionerError, DataRefused
from commissioner.operations.events import Observe, nobody
from commissioner.procedure.assembly import assemble, columns
from commissioner.run.archive.blocks import read_blocks
from commissioner.run.archive.catalogue import find_folder, find_run, must_be_archive, run_folders
from commissioner.run.archive.documents import Loss, damaged, read_saved
from commissioner.run.archive.journal import read_journal
from commissioner.run.archive.replay import Difference, replay
from commissioner.run.archive.summary import lacks_result
from commissioner.run.archive.verify import DAMAGED, Verified, losses_at_sight, refuse_damage, verify
from commissioner.run.index.index import unlike
from commissioner.run.index.store import NAME as INDEX


@dataclass(frozen=True)
class Reported:
    """Where the page of a run is, and what of its folder is not as the run left it."""

    run: str
    report: str
    losses: tuple[Loss, ...]


@dataclass(frozen=True)
class Exported:
    """Where the samples of a run were written, how many, and what of them was lost before."""

    run: str
    recording: str
    samples: int
    losses: tuple[Loss, ...]


@dataclass(frozen=True)
class ReplayedRun:
    """How many decisions were compared, and the first that differs."""

    run: str
    decisions: int
    identical: bool
    difference: Difference | None
    state: str
    losses: tuple[Loss, ...]


def report_run(runs: Path, run: str) -> Reported:
    """The path of the run's report, made from its archive where the run could not make it."""
    from commissioner.run.archive.report import make_report

    summary = find_run(runs, run)
    report = Path(summary.folder) / "report.html"
    if not report.is_file() or lacks_result(report.parent, read_journal(report.parent / "journal.jsonl")):
        make_report(summary)
    return Reported(summary.run, str(report), losses_at_sight(report.parent))


def export_run(runs: Path, run: str, out: Path, *, salvage: bool = False) -> Exported:
    """The run's whole samples as a recording in the contract's format. DataRefused: it has none, or they are damaged."""
    from commissioner.recordings.table import check_ending, write_table

    summary = find_run(runs, run)
    check_ending(out)
    source = Path(summary.folder)
    verified = verify(source)
    if not salvage:
        refuse_damage(source, verified, "export", "blocks.bin", "request.json", "journal.jsonl")
    nameplate = read_saved(source, "request.json", "nameplate")["nameplate"]
    if not isinstance(nameplate, dict):
        raise damaged(source, "request.json", f"nameplate {nameplate!r}")
    plate = {key: value for key, value in nameplate.items() if value is not None}
    recording = assemble(read_blocks(source / "blocks.bin"), plate, summary.run)
    if recording is None:
        raise DataRefused(
            f"{summary.run} holds no samples", step="export", value=0, limit="at least one block",
            remedy="nothing was sampled: the motor was never energised, or the drive tuned itself",
        )  # fmt: skip
    write_table(out, columns(recording), plate | {"sample_period_s": recording.sample_period_s, "run": summary.run})
    return Exported(summary.run, str(out), int(recording.time_s.size), tuple(verified.losses))


def verify_runs(runs: Path, run: str | None, key: bytes | None = None) -> tuple[Verified, ...]:
    """One run, or all of them where `run` is None, and what the index says of them. UsageError: there is no such archive."""
    must_be_archive(runs)
    folders = run_folders(runs) if run is None else [find_folder(runs, run)]
    differ: Mapping[str, str] = {}
    with suppress(sqlite3.Error):  # an index that cannot be had is done without
        differ = unlike(runs, {folder.name for folder in folders})
    return tuple(_beside_index(verify_folder(folder, key), differ) for folder in folders)


def _beside_index(seen: Verified, differ: Mapping[str, str]) -> Verified:
    """The folder is the truth; a list that believes a changed index tells something else."""
    if seen.run not in differ:
        return seen
    what = f"its {differ[seen.run]} of this run is not the folder's: `commissioner runs index --rebuild`"
    return replace(seen, losses=(*seen.losses, Loss(INDEX, None, what)), is_whole=False)


def verify_folder(folder: Path, key: bytes | None) -> Verified:
    """As `verify`; a folder that cannot be read at all is damaged, too."""
    try:
        return verify(folder, key)
    except (CommissionerError, OSError) as error:
        what = error.what if isinstance(error, CommissionerError) else str(error)
        return Verified(
            folder.name, DAMAGED, (Loss(folder.name, None, what),), "nothing that can be read",
            records=0, blocks=0, samples=0, lost_samples=0, seal="none", remarks=(), is_whole=False,
        )  # fmt: skip


def replay_run(
    runs: Path, run: str, *, salvage: bool = False, observe: Observe = nobody
) -> tuple[ReplayedRun, Verified]:
    """Decides the run again from its archive. DataRefused: the folder is not as the run left it, unless `salvage`."""
    summary = find_run(runs, run)
    folder = Path(summary.folder)
    verified = verify(folder)
    if not salvage:
        refuse_damage(folder, verified, "replay")
    done = replay(folder, salvage=not verified.is_whole, observe=observe)
    replayed = ReplayedRun(
        summary.run, done.decisions, done.is_identical, done.difference, verified.state, tuple(verified.losses)
    )
    return replayed, verified
