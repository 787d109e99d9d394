"""Into a drive without energising it: what a run found there before, what it accepted, what recordings say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from commissioner.link.drive.facts import WriteReport
from commissioner.link.files.drive_file import archived_profile
from commissioner.operations.events import Began, Observe, nobody
from commissioner.registers.profile import Item
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.documents import read_saved
from commissioner.run.archive.report import mark_restored, mark_written
from commissioner.run.archive.summary import RunSummary
from commissioner.run.restore import Restored
from commissioner.run.restore import restore as write_snapshot
from commissioner.run.write_accepted import Plan, check_token, plan_restore, plan_write_back, write_accepted
from commissioner.settings import load_procedure

if TYPE_CHECKING:
    from commissioner.operations.recordings.identify import Identified
    from commissioner.run.commission import Commissioned


@dataclass(frozen=True)
class RunRequest:
    """A run of the archive, and the drive to write to; `drive` None: the run's own."""

    runs: Path
    run: str
    drive: str | None = None

    def find(self) -> RunSummary:
        """UsageError: none or several."""
        return find_run(self.runs, self.run)


@dataclass(frozen=True)
class WriteRequest:
    """The drive that the motor of recordings hangs on."""

    drive: str
    profile: str
    runs: Path
    procedure: Path | None = None


@dataclass(frozen=True)
class Written:
    """What was read back; `report` counts the writes of the drive's memory."""

    run: str
    report: WriteReport


def planned_restore(request: RunRequest) -> Plan:
    """What `restore` would change. Reads the drive, changes nothing."""
    return plan_restore(request.find(), request.drive)


def restore(
    request: RunRequest, token: str | None = None, observe: Observe = nobody, key: bytes | None = None
) -> Restored:
    """The set that the run found, written back, verified and stored. Aborted where `token` is of another table.
    `key`: of a sealed folder."""
    summary = request.find()
    if token is not None:
        check_token(plan_restore(summary, request.drive), token)
    observe(Began("proving the run"))
    done = write_snapshot(summary, request.drive, key=key, observe=observe)
    mark_restored(summary, key)
    return done


def planned_write(request: RunRequest) -> Plan:
    """What `write_run` would change. Reads the drive, changes nothing."""
    return plan_write_back(request.find(), request.drive)


def write_run(request: RunRequest, token: str, key: bytes | None = None, observe: Observe = nobody) -> Written:
    """The accepted result of a run into its drive. Aborted where `token` is of another table. `key`: of a sealed folder."""
    summary = request.find()
    written = Written(summary.run, write_accepted(summary, request.drive, token, key, observe))
    mark_written(summary, key)
    return written


def items_of(request: RunRequest) -> Mapping[str, Item]:
    """The drive's items, by the drive file as the run had it: number, unit and convention of what is written. DataRefused: none is kept."""
    return archived_profile(str(read_saved(Path(request.find().folder), "request.json", "profile")["profile"])).items


def write_recorded(request: WriteRequest, identified: Identified, observe: Observe = nobody) -> Commissioned:
    """The verdict on a motor identified from recordings; an accepted one is written, as a run that `restore` takes."""
    from commissioner.run.write_recorded import write_recorded as carry_out

    return carry_out(
        request.drive,
        request.profile,
        identified.nameplate,
        load_procedure(request.procedure),
        identified.found,
        identified.files,
        runs=request.runs,
        present=observe,
    )
