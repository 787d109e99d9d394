"""How a run ends: the drive let go and looked at, what broke as an error with a remedy, the error as an end."""

from __future__ import annotations

import errno
import os
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from commissioner.errors import (
    OF_DISK,
    Aborted,
    CommissionerError,
    DriveError,
    DriveFault,
    ForeignMaster,
    UsageError,
    WriteBackFailed,
)
from commissioner.link.drive.facts import DisarmReport, Intent
from commissioner.link.drive.inverter import Inverter
from commissioner.procedure.findings import RunEnded
from commissioner.records import DriveIdentity
from commissioner.run.archive.documents import archive_lost
from commissioner.run.archive.folder import RunFolder
from commissioner.safety.watch import TOO_LATE

LATE_SHARE = 0.5
"""Of the watchdog's time: in a run on a host at rest no gap is a tenth of it."""
WRITING_BEGAN = "writing_began"
"""Kind of the record that stands before everything a write-back or restore of an archived run journals."""
SLOW_SHARE = 0.25
"""Of the watchdog's time: an answer that takes as long is slower than any that the watchdog was armed for."""


def let_go(inverter: Inverter) -> DisarmReport:
    """De-energise by every path; what was verified. Whatever breaks meanwhile: a run must have an end."""
    try:
        return inverter.disarm()
    except Exception as surprise:
        return DisarmReport(False, f"unknown: {type(surprise).__name__}: {surprise}", (), False)


def taken_as_live(state: str) -> DriveFault:
    """A drive that was energised and does not confirm that its output is off."""
    return DriveFault(
        "the drive does not confirm that its output is off", step="de-energise", value=state,
        limit="a status that says so", remedy="take the motor as live: isolate the drive's supply, then look at its status",
    )  # fmt: skip


def still_live(live: DriveFault, error: CommissionerError | None) -> CommissionerError:
    """What ended the run, as the fault that it is while the drive does not confirm that its output is off."""
    if error is None or error.what == live.what:
        return live
    if error.outcome != live.outcome:
        live.what = f"{error.what}; {live.what}"
        live.remedy = f"{live.remedy}; {error.remedy}"
        return live
    error.remedy = f"{live.remedy}; {error.remedy}"
    return error


def as_error(surprise: Exception, folder: RunFolder) -> CommissionerError:
    """A disk that takes no more, something else that the operating system refused, or a defect of ours; of these two the
    traceback goes to the journal."""
    if isinstance(surprise, OSError) and _is_of_disk(surprise, folder.path):
        return archive_lost(folder.path, surprise)
    note(folder, "defect", "".join(traceback.format_exception(surprise)))
    if isinstance(surprise, OSError):
        where = str(surprise.filename) if surprise.filename is not None else type(surprise).__name__
        return CommissionerError(
            f"the operating system refused {where}: {surprise.strerror or surprise}", step="run",
            value=errno.errorcode.get(surprise.errno or 0, where), limit="a call that succeeds",
            remedy="check that file, device or connection, its permissions and what this host has left (open files, memory)",
        )  # fmt: skip
    return CommissionerError(
        f"a defect in commissioner: {type(surprise).__name__}: {surprise}", step="run",
        value=type(surprise).__name__, limit="no such error", remedy="please report it with the run folder",
    )  # fmt: skip


def _is_of_disk(failure: OSError, folder: Path) -> bool:
    """Whether it is the run folder that failed: by the file's name, else by what only a disk says."""
    if failure.filename is not None:
        return Path(os.fsdecode(failure.filename)).absolute().is_relative_to(folder.absolute())
    return failure.errno in OF_DISK


def with_master(error: CommissionerError, inverter: Inverter) -> CommissionerError:
    """What stopped the run, as the other master whose writes the drive shows once its output is off: a guard sees the voltage or the
    flux of such a write before the next status would have told of it."""
    if not isinstance(error, Aborted):
        return error
    try:
        inverter.read_status()
    except ForeignMaster as other:
        other.what += f"; before that was seen: {error.what}"
        return other
    except Exception:  # whatever breaks: the run ends by what stopped it
        return error
    return error


def with_host(error: CommissionerError, gap_s: float, watchdog_s: float | None) -> CommissionerError:
    """What broke while energised, and that this host was late: `gap_s` between an answer and its own next request is a good
    part of what the drive's watchdog grants."""
    if isinstance(error, DriveError) and watchdog_s is not None and gap_s >= LATE_SHARE * watchdog_s:
        error.what += f"; this host was late: it did nothing for {gap_s:.2g} s"
        error.remedy = (
            f"keep this host from sleeping and end other programs on it, or use one that is less busy; {error.remedy}"
        )
    return error


def with_link(error: CommissionerError, answer_s: float, watchdog_s: float | None) -> CommissionerError:
    """What broke while energised, and that the link was slow: its slowest answer took a good part of what the drive's watchdog grants."""
    if isinstance(error, DriveFault) and watchdog_s is not None and answer_s >= SLOW_SHARE * watchdog_s:
        error.what += f"; the link was slow: an answer took {answer_s:.2g} s"
        error.remedy = (
            f"use a link that answers sooner and evenly: a cable in place of radio, VPN or gateway; {error.remedy}"
        )
    return error


def with_shares(error: CommissionerError, host_s: float, link_s: float) -> CommissionerError:
    """Samples that came too late though no gap and no answer stands out: where the time went, as many small delays add up."""
    if error.what == TOO_LATE and host_s + link_s > 0.0:
        error.what += f"; of the last {host_s + link_s:.2g} s this host took {host_s:.2g} s, and the link {link_s:.2g} s to answer"
    return error


@dataclass(frozen=True)
class WritingBegan:
    """`what` begins: the run is proved, and its `drive` answers."""

    what: str
    drive: str


class Announced:
    """The journal of a write-back or restore of an archived run: each intent is on the disk before the drive hears of it, and whoever
    observes after that."""

    def __init__(self, folder: RunFolder, observe: Callable[[object], None] | None = None) -> None:
        self.folder, self.has_any = folder, False
        self._tell = observe or (lambda _record: None)

    def __call__(self, intent: Intent) -> None:
        self.folder.journal("about_to", intent, durable=True)
        self.has_any = True
        self._tell(intent)

    def begin(self, what: str, identity: DriveIdentity) -> None:
        """The first record."""
        began = WritingBegan(what, identity.words)
        try:
            self.folder.journal(WRITING_BEGAN, began, durable=True)
        except OSError as failure:
            raise self.lost(failure) from failure
        self._tell(began)

    def lost(self, failure: OSError) -> CommissionerError:
        """The disk took no more: in the middle of it, or before anything was sent."""
        if self.has_any:
            return write_lost(failure, self.folder)
        return archive_lost(self.folder.path, failure, "; nothing was written into the drive")


def write_lost(failure: OSError, folder: RunFolder) -> WriteBackFailed:
    """The disk took no more in the middle of a write-back or a restore."""
    lost = archive_lost(folder.path, failure, "; the drive holds its old or its new parameters")
    remedy = (
        "bring the run's folder back, then `commissioner restore` this run"
        if isinstance(failure, FileNotFoundError)
        else "make room, then `commissioner restore` this run"
    )
    return WriteBackFailed(lost.what, step=lost.step, value=lost.value, limit=lost.limit, unit=lost.unit, remedy=remedy)


def note(folder: RunFolder, kind: str, record: object) -> None:
    """Journal how the run ends. A disk that is full cannot keep it from ending."""
    with suppress(OSError):
        folder.journal(kind, record, durable=True)


def ended_by(error: CommissionerError, folder: RunFolder, energised_s: float | None) -> RunEnded:
    """The end that an error makes of a run, journalled; a call that cannot be right aborts one that has begun."""
    note(folder, "error", error.as_dict())
    outcome = "aborted" if isinstance(error, UsageError) else error.outcome
    return RunEnded(outcome, error.what, energised_s, error.as_dict())
