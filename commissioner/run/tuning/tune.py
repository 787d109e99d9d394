"""One `tune` from URL to run folder: checks, snapshot, repeats with pauses, verdict, then the best set or the snapshot."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from commissioner.encoding import plain
from commissioner.errors import (
    Aborted,
    CheckFailed,
    CommissionerError,
    DataRefused,
    DriveFault,
    LinkError,
    UsageError,
    WriteBackFailed,
)
from commissioner.link.drive.facts import Intent
from commissioner.link.drive.inverter import Inverter
from commissioner.link.drive.ordinary.tuning import REST, Operator, Tuned
from commissioner.link.drive.write_back import check_can_be_given_back
from commissioner.link.wire.port import Port
from commissioner.link.wire.url import parse_url
from commissioner.motor.nameplate import Nameplate, plate_doubts
from commissioner.procedure.checks import check_failed, judge_idle
from commissioner.procedure.findings import DriveIdentified, RunEnded
from commissioner.procedure.plan import ProcedurePlan
from commissioner.procedure.steps import Findings
from commissioner.procedure.tuned import TunedRow, TuneVerdict, judge_tunings
from commissioner.records import ParameterSnapshot
from commissioner.registers.convention import as_in_drive
from commissioner.registers.profile import DriveProfile
from commissioner.registers.tuning import Tuning
from commissioner.report.run.summary import summarise
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.report import write_report
from commissioner.run.commission import Commissioned, Order, Origin
from commissioner.run.ending import as_error, ended_by, note, write_lost
from commissioner.run.holding.drive_lock import ACT, DriveLock
from commissioner.run.holding.mastery import Mastery
from commissioner.run.job import names_of, open_drive
from commissioner.run.proof import check_plausible
from commissioner.run.stopping.operator_stop import OperatorStop, StopAsked
from commissioner.run.stopping.stop_file import stopped_by_file
from commissioner.run.tuning.earlier import earlier_values

OpenPort = Callable[[], Any]
PAUSE_POLL_S = 0.5
TELL_S = 2.0
"""Between two records of a tuning that goes on: a journal that is silent for long is taken for one whose process has gone."""
LAST_LEFT = "what its last tuning left, if it found anything: this file knows no way to write"
POWER_UP_S = 120.0
"""So long a drive may take to answer again after it was switched off and on."""


@dataclass(frozen=True)
class TuneOrder:
    """What was asked for. `hardwired_stop`: a person has confirmed one; `pause_s` None: the drive file's."""

    order: Order
    repeat: int
    pause_s: float | None
    hardwired_stop: bool
    power_cycle: bool

    @property
    def tuning(self) -> Tuning:
        return require_tuning(self.order.profile)


@dataclass
class TuneFindings:
    """What one tune has learnt so far."""

    common: Findings = field(default_factory=Findings)
    repeats: list[Tuned] = field(default_factory=list)
    verdict: TuneVerdict | None = None
    in_the_drive: str = "as before"
    remarks: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Clock:
    """Time as a tune takes it; tests bring their own."""

    sleep: Callable[[float], None] = time.sleep
    now: Callable[[], float] = time.monotonic


def require_tuning(profile: DriveProfile) -> Tuning:
    """UsageError where the drive's file has no [tune]: with what to look up."""
    if profile.tuning is None:
        raise UsageError(
            f"{profile.name} cannot tune through this tool", step="check capabilities", value="tune", limit="a table [tune]",
            remedy=profile.unknown.get("tune", "tune at the drive's keypad"),
        )  # fmt: skip
    return profile.tuning


def tune(
    wanted: TuneOrder,
    runs: Path,
    operator: Operator,
    present: Callable[[object], None],
    *,
    open_port: Callable[[], Any] | None = None,
    clock: Clock | None = None,
    origin: Origin | None = None,
) -> Commissioned:
    """Every end from the first request on is a run with a folder, which `restore` takes. `open_port`: a context of a port."""
    origin = origin or Origin()
    order = wanted.order
    tuning = wanted.tuning
    _check_supervised(order.profile, tuning, hardwired_stop=wanted.hardwired_stop)
    found = TuneFindings()
    opened = open_port or (lambda: open_drive(order.url, order.profile, order.plan))
    with DriveLock.take(parse_url(order.url), order.profile, ACT) as lock:
        facts: dict[str, Any] = {
            "tune": {"repeat": wanted.repeat, "pause_s": wanted.pause_s, "hardwired_stop": wanted.hardwired_stop}
        }
        folder = order.open_folder(runs, lock, **facts, **({"origin": origin.facts} if origin.facts else {}))
        asked, time_taken = origin.stop or OperatorStop(), clock or Clock()
        with closing(folder), stopped_by_file(folder.path, asked):
            origin.begun(folder.path)
            attended = _Attended(operator, asked, folder, time_taken.now)
            run = _Run(wanted, folder, found, attended, present, time_taken, earlier_values(runs, order.nameplate))
            ended = run.carry_out(opened, lock)
            result = _save(order, folder, found, ended)
    return Commissioned(ended, folder.path, result)


def _check_supervised(profile: DriveProfile, tuning: Tuning, *, hardwired_stop: bool) -> None:
    """CheckFailed: nobody would stop a remote tuning if the link died."""
    if tuning.form == "assisted" or hardwired_stop:
        return
    if profile.watchdog is None:
        raise CheckFailed(
            "nothing would stop the tuning if the link died: this drive's watchdog is not known", step="check supervision",
            value=profile.unknown.get("watchdog", "none in the drive file"), limit="a watchdog, or a hard-wired stop in reach",
            remedy="with a tested hard-wired stop in your hand add --hardwired-stop",
        )  # fmt: skip


@dataclass(frozen=True)
class KeptSet:
    """What was left in the drive, as read back; `is_stored`: as far as its file can store."""

    values: Mapping[str, float]
    is_stored: bool


class _Attended:
    """The person at the drive, and whoever stops the run from elsewhere on this computer; meanwhile the journal says that it goes on."""

    def __init__(self, operator: Operator, stop: OperatorStop, folder: RunFolder, now: Callable[[], float]) -> None:
        self._operator, self._stop, self._folder, self._now = operator, stop, folder, now
        self._told_s = now()
        self._wish: StopAsked | None = None
        self._questions = 0

    def does(self, text: str) -> bool:
        """Asked where the tune was started; whoever follows the journal reads it, too."""
        self._questions += 1
        self._folder.journal("asked_at_drive", {"number": self._questions, "text": text}, durable=True)
        is_done = self._operator.does(text)
        self._folder.journal("answered_at_drive", {"number": self._questions, "done": is_done}, durable=True)
        return is_done

    def wants_stop(self) -> str:
        if self._now() - self._told_s >= TELL_S:
            self._told_s = self._now()
            self._folder.journal("tuning_goes_on", {})
        if self._wish is None and self._stop.wish is not None:
            self._wish = self._stop.wish
            self._folder.journal("stop_asked", self._wish, durable=True)
        return self._operator.wants_stop() or self._stop.asked


class _Run:
    def __init__(
        self,
        wanted: TuneOrder,
        folder: RunFolder,
        found: TuneFindings,
        operator: Operator,
        present: Callable[[object], None],
        clock: Clock,
        earlier: Any,
    ) -> None:
        self._wanted, self._folder, self._found, self._operator = wanted, folder, found, operator
        self._present, self._clock, self._earlier = present, clock, earlier
        self._kept: KeptSet | None = None
        self._energised_s: float | None = 0.0
        self._profile, self._plate = wanted.order.profile, wanted.order.nameplate

    def carry_out(self, opened: OpenPort, lock: DriveLock) -> RunEnded:
        """Never raises a CommissionerError; a tuned drive is left with the best set or the snapshot, or the end says not."""
        try:
            with opened() as port:
                inverter = self._inverter(port)
                with Mastery(inverter, lock) as mastery:
                    mastery.take(self._identify(inverter))
                    self._all(inverter)
            if self._wanted.power_cycle and self._kept is not None:
                self._prove_power_cycle(opened, self._kept)
        except (CommissionerError, OSError) as failure:
            error = failure if isinstance(failure, CommissionerError) else as_error(failure, self._folder)
            ended = ended_by(error, self._folder, self._energised_s)
        else:
            verdict = self._found.verdict
            assert verdict is not None
            ended = RunEnded("rejected" if verdict.objections else "commissioned", verdict.reason, self._energised_s)
        note(self._folder, "run_ended", ended)
        return ended

    @property
    def _can_write(self) -> bool:
        return self._profile.parameters is not None and "restore" in self._profile.capabilities

    def _inverter(self, port: Port) -> Inverter:
        return Inverter(port, self._profile, self._announce, sleep=self._clock.sleep, clock=self._clock.now)

    def _announce(self, intent: Intent) -> None:
        self._folder.journal("about_to", intent, durable=True)

    def _identify(self, inverter: Inverter) -> Any:
        identity = inverter.identify()
        self._found.common.identity = identity
        told = DriveIdentified(**{f.name: getattr(identity, f.name) for f in dataclasses.fields(DriveIdentified)})
        self._folder.journal("drive_identified", told, durable=True)
        self._found.common.left_unfinished = self._wanted.order.tell_unfinished(self._folder, identity, self._present)
        return identity

    def _all(self, inverter: Inverter) -> None:
        snapshot = self._check(inverter)
        try:
            self._repeat(inverter)
            self._judge(snapshot)
            is_kept = self._leave(inverter)
        except BaseException as failure:
            lost = self._bring_back(inverter, snapshot)
            if lost is None or not isinstance(failure, CommissionerError | OSError):
                raise
            error = failure if isinstance(failure, CommissionerError) else as_error(failure, self._folder)
            raise _not_given_back(lost, error) from failure
        if not is_kept and (lost := self._bring_back(inverter, snapshot)) is not None:
            raise lost

    def _check(self, inverter: Inverter) -> ParameterSnapshot:
        """Idle, without a fault, set up for this motor; and what it holds, archived before anything changes it."""
        common = self._found.common
        status = inverter.read_status() if "status_word" in self._profile.items else None
        common.checks = judge_idle(status, inverter.read_nameplate(), self._plate)
        if failed := check_failed(common.checks):
            raise failed
        _check_watchdog(inverter, self._wanted)
        common.snapshot = inverter.snapshot()
        self._folder.save("snapshot.json", common.snapshot)
        if self._can_write:
            check_can_be_given_back(common.snapshot)
            self._note_what_restore_refuses(common.snapshot)
        self._folder.journal("tuning_began", {"form": self._wanted.tuning.form}, durable=True)
        return common.snapshot

    def _note_what_restore_refuses(self, snapshot: ParameterSnapshot) -> None:
        """A drive that was never set up holds what no motor has: it gets it back within this tune, and never from an archive."""
        try:
            check_plausible(self._folder.path, self._profile, snapshot)
        except DataRefused as refused:
            self._found.remarks.append(
                f"before this tuning the drive held {refused.value}, which no motor of this plate has: `restore` will refuse it; {refused.remedy}"
            )

    def _repeat(self, inverter: Inverter) -> None:
        tuner = inverter.tuner(self._wanted.tuning, self._operator)
        for number in range(1, self._wanted.repeat + 1):
            if number > 1:
                self._pause(inverter)
            self._tell(TuningBegan(number, self._wanted.repeat))
            self._energised_s = None
            try:
                done = tuner.once()
            except CommissionerError as failure:
                self._note_rest(failure)
                raise
            self._found.repeats.append(done)
            self._folder.journal("tuned_once", done, durable=True)
            self._tell(TunedOnce(number, self._wanted.repeat, done))

    def _note_rest(self, failure: CommissionerError) -> None:
        """The last steps have run: where the file has one that looks, and it did not fail, the drive was seen at rest."""
        looks = any(step.do in ("expect", "await") for step in self._wanted.tuning.finally_)
        if looks and failure.step != REST:
            note(self._folder, "tuning_ended", {"why": failure.what})

    def _pause(self, inverter: Inverter) -> None:
        """The motor cools; the drive is looked at meanwhile, so that its watchdog is fed and a trip is seen."""
        asked = self._wanted.pause_s
        left = self._wanted.tuning.pause_s if asked is None else asked
        while left > 0:
            step = min(PAUSE_POLL_S, left)
            self._clock.sleep(step)
            left -= step
            inverter.read_status()
            if why := self._operator.wants_stop():
                raise Aborted(
                    f"stopped: {why}", step="tune: pause", value=why, limit="no stop", remedy="start again when ready"
                )

    def _judge(self, snapshot: ParameterSnapshot) -> None:
        repeats = [done.values for done in self._found.repeats]
        before = {**snapshot.in_use, **{n: v for n, v in snapshot.plate.items() if n in repeats[0]}}
        first = {name: before.get(name, repeats[0][name]) for name in repeats[0]}
        self._found.verdict = judge_tunings(
            self._profile, repeats, first, as_in_drive(self._plate, snapshot.plate), self._earlier
        )
        self._folder.journal("tunings_judged", self._found.verdict, durable=True)
        self._tell(self._found.verdict)

    def _leave(self, inverter: Inverter) -> bool:
        """The best set, where it was asked for and nothing objects. False: what was there before is to come back."""
        verdict = self._found.verdict
        assert verdict is not None
        if verdict.objections or not self._wanted.order.write_back:
            return False
        if not self._can_write:
            self._found.in_the_drive = LAST_LEFT
            return True
        present = inverter.snapshot()
        report = inverter.keep_tuned(verdict.best, present)
        held = inverter.snapshot().in_use
        self._kept = KeptSet({name: held[name] for name in verdict.best}, report.is_stored)
        self._found.common.written = report.written
        self._folder.journal("parameters_written", report, durable=True)
        kept = "stored" if report.is_stored else "not stored: save at the drive or it is lost at power-off"
        self._found.in_the_drive = f"new: the tuning nearest to the medians, read back, {kept}"
        return True

    def _bring_back(self, inverter: Inverter, snapshot: ParameterSnapshot) -> WriteBackFailed | None:
        """The snapshot. What kept the drive from taking it, which ends the run: nobody knows then what it holds."""
        if not self._can_write:
            self._found.in_the_drive = LAST_LEFT
            return None
        steps = (*self._wanted.tuning.steps, *self._wanted.tuning.finally_)
        written = {step.item for step in steps if step.do == "write" and step.item in snapshot.in_use}
        try:
            report = inverter.restore(snapshot, again=written)
        except (CommissionerError, OSError) as failure:
            lost = write_lost(failure, self._folder) if isinstance(failure, OSError) else _as_lost(failure)
            self._found.in_the_drive = f"unknown: {lost.what}"
            self._found.remarks.append(f"the values found before could not be restored: {lost.what}; run `restore`")
            note(self._folder, "restore_failed", lost.as_dict())
            return lost
        self._found.in_the_drive = "as before, read back"
        note(self._folder, "snapshot_restored", report)  # the drive holds it, whether the disk takes the record or not
        if report.fault:
            self._found.remarks.append(f"the drive reports a fault: {report.fault}")
        return None

    def _prove_power_cycle(self, opened: OpenPort, kept: KeptSet) -> None:
        """Off and on again; then the drive must hold what was kept."""
        if not kept.is_stored and not self._operator.does("Save the parameters at the drive's keypad. Done?"):
            self._found.remarks.append("not stored: save at the drive, or the values are lost at power-off")
            return
        written = kept.values
        if not self._operator.does("Switch the drive off, wait until its display is dark, switch it on again. Done?"):
            self._found.remarks.append("not proved by switching off and on")
            return
        held = self._read_again(opened)
        lost = [name for name, value in written.items() if held[name] != value]
        if lost:
            raise DriveFault(
                f"{lost[0]} did not outlast a power-off", step="prove by switching off and on", value=held[lost[0]],
                limit=written[lost[0]], remedy="store at the drive's keypad, or `restore` this run",
            )  # fmt: skip
        self._found.remarks.append("proved: the values outlasted a power-off")
        self._folder.journal("power_cycle_proved", held, durable=True)

    def _read_again(self, opened: OpenPort) -> dict[str, float]:
        end = self._clock.now() + POWER_UP_S
        while True:
            try:
                with opened() as port:
                    return dict(self._inverter(port).snapshot().in_use)
            except LinkError:
                if self._clock.now() > end:
                    raise
                self._clock.sleep(1.0)

    def _tell(self, record: object) -> None:
        self._present(record)


def _as_lost(failure: CommissionerError) -> WriteBackFailed:
    """Whatever kept a drive from taking its old values back, a refusal before anything was written included."""
    if isinstance(failure, WriteBackFailed):
        return failure
    return WriteBackFailed(
        f"the snapshot could not be restored: {failure.what}", step="restore", value=failure.value, limit=failure.limit, unit=failure.unit,
        remedy=f"{failure.remedy}; then run restore",
    )  # fmt: skip


def _not_given_back(lost: WriteBackFailed, error: CommissionerError) -> WriteBackFailed:
    """What ended a tune, as the fault that it is while the drive does not hold what it held before. A motor that is to be taken as live
    comes first."""
    remedies = dict.fromkeys((error.remedy, lost.remedy) if error.outcome == "faulted" else (lost.remedy, error.remedy))
    return WriteBackFailed(
        "; ".join(dict.fromkeys((error.what, lost.what))), step=error.step, value=error.value, limit=error.limit, unit=error.unit,
        remedy="; ".join(remedies),
    )  # fmt: skip


@dataclass(frozen=True)
class TuningBegan:
    """Number `number` of `of` begins."""

    number: int
    of: int


@dataclass(frozen=True)
class TunedOnce:
    """Number `number` of `of` has ended as it should."""

    number: int
    of: int
    tuned: Tuned


def _check_watchdog(inverter: Inverter, wanted: TuneOrder) -> None:
    """CheckFailed where the drive's own supervision of the link is off or slower than it may be."""
    watchdog = inverter.profile.watchdog
    if wanted.tuning.form == "assisted" or watchdog is None or wanted.hardwired_stop:
        return
    seen_ms = inverter.read_watchdog_ms()
    if not watchdog.min_ms <= seen_ms <= watchdog.max_ms or seen_ms <= 0:
        raise CheckFailed(
            "the drive's watchdog is off or out of its range", step="check supervision", value=f"{seen_ms:g} ms",
            limit=f"{watchdog.min_ms:g} ... {watchdog.max_ms:g} ms",
            remedy="set it at the drive, or with a tested hard-wired stop in your hand add --hardwired-stop",
        )  # fmt: skip


class TuneDocument(TypedDict):
    """What the drive found by itself, by the drive's own names: `repeats` with their `seconds`, `rows` over all of them, `best` the
    repeat nearest to the medians. `form`: remote or assisted; `proved_on`: models and firmware on which the drive file's way of tuning really ran."""

    form: str
    proved_on: tuple[str, ...]
    repeats: list[Mapping[str, float]]
    seconds: list[float]
    rows: Sequence[TunedRow]
    best: Mapping[str, float] | None
    in_the_drive: str


def _save(order: Order, folder: RunFolder, found: TuneFindings, ended: RunEnded) -> Any:
    """Result and report, as of any run; `tune` beside them."""
    document: dict[str, Any] = dict(summarise(found.common, ended, folder.path.name, *names_of(order.profile)))
    tuning = require_tuning(order.profile)
    document["tune"] = TuneDocument(
        form=tuning.form,
        proved_on=tuning.proved_on,
        repeats=[done.values for done in found.repeats],
        seconds=[done.seconds for done in found.repeats],
        rows=found.verdict.rows if found.verdict else (),
        best=found.verdict.best if found.verdict else None,
        in_the_drive=found.in_the_drive,
    )
    document["objections"] = found.verdict.objections if found.verdict else ()
    document["remarks"] = [
        *plate_doubts(order.nameplate),
        f"tuning: {tuning.proof}",
        *found.remarks,
        *found.common.of_the_archive,
    ]
    result = plain(document)
    write_report(folder, result, found.common)
    folder.cover()
    return result


def order_of(url: str, profile: DriveProfile, plate: Nameplate, plan: ProcedurePlan, *, write_back: bool) -> Order:
    """UsageError where the drive file can neither tune nor, if asked, take values."""
    require_tuning(profile)
    return Order(url, profile, plate, plan, write_back)
