"""One commissioning run from URL to run folder: open, check, carry the course out, archive, report, close."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from commissioner.errors import CommissionerError, UsageError
from commissioner.link.drive.facts import Action, Intent
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile, reference
from commissioner.link.wire.url import parse_url, without_secrets
from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.course import Findings, Job, course
from commissioner.procedure.energised.excite import warm_up
from commissioner.procedure.findings import LeftUnfinished, RunEnded, WarmingUp
from commissioner.procedure.plan import ProcedurePlan
from commissioner.records import DriveIdentity
from commissioner.registers.profile import DriveProfile
from commissioner.report.run.contract import RunDocument
from commissioner.run.archive.documents import archive_lost
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.report import keep_result
from commissioner.run.ending import as_error, ended_by, note
from commissioner.run.holding.drive_lock import ACT, DriveLock
from commissioner.run.holding.mastery import Mastery
from commissioner.run.holding.unfinished import left_unfinished
from commissioner.run.job import bounds, make_job, names_of, open_drive, watch_limits
from commissioner.run.runner import Course, Present, Runner, kind_of
from commissioner.run.stopping.operator_stop import Abandoned, OperatorStop
from commissioner.run.stopping.stop_file import stopped_by_file


@dataclass(frozen=True)
class Order:
    """What was asked for."""

    url: str
    profile: DriveProfile
    nameplate: Nameplate
    plan: ProcedurePlan
    write_back: bool
    key: bytes | None = None
    """Seals the run's folder."""

    def open_folder(self, runs: Path, lock: DriveLock, **more: object) -> RunFolder:
        """A new run folder, with the order in it; the address without what is secret. The lock is this run's from here on."""
        folder = RunFolder.create(runs, Path(self.profile.file).stem, self.key)
        lock.name_run(folder.path.name)
        request = {
            "url": without_secrets(self.url), "profile": reference(self.profile), "nameplate": self.nameplate,
            "plan": self.plan, "write_back": self.write_back,
        }  # fmt: skip
        folder.save("request.json", request | more)
        return folder

    def tell_unfinished(self, folder: RunFolder, identity: DriveIdentity, present: Present) -> LeftUnfinished | None:
        """What an earlier run left in the middle of this drive, journalled and told before anything changes it."""
        left = left_unfinished(folder.path.parent, without_secrets(self.url), identity)
        if left is not None:
            tell(folder, present, left)
        return left


@dataclass(frozen=True)
class Origin:
    """Who asked for a run: under which names of drive and motor (`facts`, kept with the request), what is told the folder as soon
    as there is one, and by what others end the run (None: the terminal's signals alone).
    """

    facts: Mapping[str, Any] = field(default_factory=dict)
    begun: Callable[[Path], None] = lambda _folder: None
    stop: OperatorStop | None = None


@dataclass(frozen=True)
class Commissioned:
    """How a run ended and where it is."""

    ended: RunEnded
    folder: Path
    result: RunDocument
    is_being_diagnosed: bool = False
    """By a process of its own, whose result joins the archive when it is ready."""


def commission(
    url: str,
    profile_name: str,
    nameplate: Nameplate,
    plan: ProcedurePlan,
    *,
    write_back: bool,
    runs: Path,
    present: Present,
    key: bytes | None = None,
    origin: Origin | None = None,
) -> Commissioned:
    """The whole job. Configuration errors are raised, and DriveInUse where another run has the drive; from the first request on, every end is a run with a folder.

    `key`: seals the folder (`archive.seal`).
    """
    profile = load_profile(profile_name)
    require_capabilities(profile, write_back=write_back)
    order = Order(url, profile, nameplate, plan, write_back, key)
    findings = Findings()
    origin = origin or Origin()
    asked = origin.stop or OperatorStop()
    with DriveLock.take(parse_url(url), profile, ACT) as lock:
        folder = order.open_folder(runs, lock, **({"origin": origin.facts} if origin.facts else {}))
        with closing(folder), asked, stopped_by_file(folder.path, asked):
            origin.begun(folder.path)
            tell(folder, present, WarmingUp())
            with suppress(Abandoned), asked.computing():
                warm_up(nameplate)
            ended = carry_out(order, folder, findings, present, course, "job", asked, lock)
            lock.release()  # the drive is let go: what follows is the archive's
            result = close_run(order, folder, findings, ended)
    return Commissioned(ended, folder.path, result)


def tell(folder: RunFolder, present: Present, state: WarmingUp | LeftUnfinished) -> None:
    """What is told while nothing is energised: to the journal, which others follow, and to the screen."""
    note(folder, kind_of(state), state)
    with suppress(Exception):
        present(state)


def require_capabilities(profile: DriveProfile, *, write_back: bool) -> None:
    """UsageError where a run needs what the drive's file does not offer."""
    for capability in ("excite", "stream", *(["write_back"] if write_back else [])):
        profile.require(capability)


def carry_out(
    order: Order,
    folder: RunFolder,
    findings: Findings,
    present: Present,
    steps: Callable[[Job, Findings], Course],
    kind: str,
    stop: OperatorStop,
    lock: DriveLock,
) -> RunEnded:
    """The steps over the order's link, each refusal and failure as the end of a run. The job is journalled as `kind`;
    a `stop` asked for before it began ends the run, too. A UsageError before the first request is raised, too."""
    profile = order.profile
    try:
        with open_drive(order.url, profile, order.plan) as port:
            inverter = Inverter(port, profile, lambda intent: _announce(folder, intent))
            job = make_job(profile, order.nameplate, order.plan, port, write_back=order.write_back)
            folder.journal(kind, job, durable=True)
            with Mastery(inverter, lock) as mastery:
                identity = inverter.identify()
                mastery.take(identity)
                findings.left_unfinished = order.tell_unfinished(folder, identity, present)
                runner = Runner(inverter, folder, bounds(job), watch_limits(job), present, stop)
                ended = runner.perform(steps(job, findings))
            with suppress(OSError):
                folder.journal("link", port.stats.as_dict())
            return ended
    except (CommissionerError, OSError) as failure:
        error = failure if isinstance(failure, CommissionerError) else as_error(failure, folder)
        ended = ended_by(error, folder, 0.0)
        note(folder, "run_ended", ended)
        if isinstance(error, UsageError):
            raise
        return ended


def _announce(folder: RunFolder, intent: Intent) -> None:
    """Every intent is with the operating system before it is carried out, so that a kill loses none. What starts or
    changes something lasting is on the disk, too; steering a running test is not: a slow disk must not starve the
    watchdog."""
    folder.journal("about_to", intent, durable=intent.action is not Action.STEER)


def close_run(order: Order, folder: RunFolder, findings: Findings, ended: RunEnded) -> RunDocument:
    """What came of the run, kept and covered."""
    try:
        result = keep_result(folder, order.nameplate, names_of(order.profile), findings, ended)
        folder.cover()
        return result
    except OSError as failure:
        raise archive_lost(
            folder.path, failure, f"; the run itself ended as {ended.outcome}: {ended.reason}"
        ) from failure
