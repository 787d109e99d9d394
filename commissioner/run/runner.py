"""Carries a procedure out on a real drive. This file holds the only `finally` that de-energises.

Each command passes `safety.limits` before the wire; each block and status passes `safety.watch` after it. The inverter
journals, on the disk, what energises or writes before it goes out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from typing import Any

from commissioner.errors import Aborted, CommissionerError, DriveFault, WriteBackFailed
from commissioner.link.drive.inverter import Inverter
from commissioner.procedure.findings import ChecksJudged, EstimateUpdated, ParametersWritten, RunEnded, VerdictReached
from commissioner.records import DriveStatus, ParameterSnapshot, SampleBlock, WrittenParameter
from commissioner.run.acting import set_up
from commissioner.run.archive.folder import RunFolder
from commissioner.run.ending import (
    as_error,
    ended_by,
    let_go,
    note,
    still_live,
    taken_as_live,
    with_host,
    with_link,
    with_master,
    with_shares,
    write_lost,
)
from commissioner.run.holding.collector import set_aside, short_collections
from commissioner.run.holding.priority import raised_priority
from commissioner.run.stopping.operator_stop import Abandoned, OperatorStop, StopAsked
from commissioner.run.stream import Stream
from commissioner.safety import commands as ask
from commissioner.safety.limits import Bounds, SafetyFacts, after, permit
from commissioner.safety.sensors import SensorWatch
from commissioner.safety.watch import WatchLimits, judge_block, judge_status, stop_if

STATUS_EVERY_S = 0.25
"""Motor time between two readings of the drive's status while energised."""
TOUCHING = (ask.ArmWatchdog, ask.SetDriveLimits, ask.LoadExcitation, ask.Enable)
"""Before the first of these the drive is somebody else's: it is only looked at, and not switched off either."""

JUDGED_REPLIES = (ask.Identify, ask.ReadNameplate, ask.ReadStatus, ask.Supervise, ask.TakeSnapshot, ask.WriteParameters)
"""What a course decides upon besides the samples: kept, so that `replay` can decide again."""

Course = Generator[ask.Command, Any, RunEnded]
Present = Callable[[object], None]


@dataclass
class _Progress:
    """What the runner keeps while it goes."""

    facts: SafetyFacts = field(default_factory=SafetyFacts)
    has_touched: bool = False
    has_written: bool = False
    segment: int = -1
    session_s: float = 0.0
    flux_fraction: float = 0.0
    next_status_s: float = 0.0
    granted: StopAsked | None = None


class Runner:
    """Carries one course out, once: `perform` returns how the run ended, whatever happens on the way. After that the gate
    lets nothing through."""

    def __init__(
        self,
        inverter: Inverter,
        folder: RunFolder,
        bounds: Bounds,
        watch: WatchLimits,
        present: Present,
        stop: OperatorStop | None = None,
    ) -> None:
        self._inverter = inverter
        self._folder = folder
        self._bounds = bounds
        self._watch = watch
        self._present = present
        self._progress = _Progress()
        self._stop = stop or OperatorStop()
        self._stream: Stream | None = None
        self._snapshot: ParameterSnapshot | None = None

    @property
    def energised_s(self) -> float:
        """Motor time under voltage so far."""
        return self._progress.facts.energised_s + self._progress.session_s

    def perform(self, course: Course) -> RunEnded:
        """Run the course to its end. Faults, guards and the operator end it as a value; the drive is disarmed."""
        error: CommissionerError | None = None
        ended: RunEnded | None = None
        with self._stop, raised_priority(), short_collections():
            try:
                ended = self._drive(course)
            except CommissionerError as failure:
                error = self._explained(failure)
            except Exception as surprise:  # must not leave a motor energised or a run without an end
                error = as_error(surprise, self._folder)
            finally:
                self._progress.facts = replace(self._progress.facts, run_ended=True)
                live = self._disarm(error.what if error is not None else "the run has ended")
                if self._progress.granted is not None:  # zero volts came first
                    note(self._folder, kind_of(self._progress.granted), self._progress.granted)
        if live is not None:
            ended, error = None, still_live(live, error)
        elif error is not None and self._progress.segment >= 0 and self._progress.granted is None:
            error = with_master(error, self._inverter)
        if ended is None:
            assert error is not None
            ended = ended_by(error, self._folder, self.energised_s)
        note(self._folder, "run_ended", ended)
        self._show(ended)
        return ended

    def _drive(self, course: Course) -> RunEnded:
        reply: object = None
        while True:
            if self._stop.wish is not None and not self._progress.has_written:  # what is written ends as written
                raise self._granted(self._stop.wish)
            try:
                with nullcontext() if self._progress.has_written else self._stop.computing():
                    command = course.send(reply)
            except Abandoned:
                assert self._stop.wish is not None
                raise self._granted(self._stop.wish) from None
            except StopIteration as stop:
                ended = stop.value
                assert isinstance(ended, RunEnded)
                return replace(ended, energised_s=self.energised_s)
            reply = self._carry_out(command)

    def _granted(self, wish: StopAsked) -> Aborted:
        self._progress.granted = wish
        return Aborted(wish.what, step="run", value=str(wish), limit="no stop", remedy=wish.remedy)

    def _carry_out(self, command: ask.Command) -> object:
        refusal = permit(command, self._progress.facts, self._bounds)
        if refusal is not None:
            raise Aborted(
                f"not sent: {refusal.what}",
                step=type(command).__name__,
                value=refusal.value,
                limit=refusal.limit,
                remedy=refusal.remedy,
            )
        self._progress.has_touched |= isinstance(command, TOUCHING)
        reply = self._send(command)
        if isinstance(command, JUDGED_REPLIES):
            self._folder.journal("reply", {"command": type(command).__name__, "reply": reply})
        self._progress.facts = after(command, self._progress.facts)
        return reply

    def _send(self, command: ask.Command) -> object:
        """What the drive answers; None for a command that only acts."""
        inverter = self._inverter
        match command:
            case ask.Fetch():
                return self._fetch()
            case ask.Identify():
                return inverter.identify()
            case ask.ReadNameplate():
                return inverter.read_nameplate()
            case ask.ReadStatus():
                return inverter.read_status()
            case ask.Supervise(seconds=seconds):
                return self._supervise(seconds)
            case ask.TakeSnapshot():
                return self._take_snapshot()
            case ask.WriteParameters():
                return self._write(command)
        self._act(command)
        return None

    def _act(self, command: ask.Command) -> None:
        match command:
            case ask.Tell(record=record):
                self._tell(record)
            case ask.Wait(seconds=seconds):
                self._inverter.sleep(seconds)
            case ask.Enable():
                self._enable()
            case ask.Disarm(reason=reason):
                live = self._disarm(reason)
                if live is not None:
                    raise live
                if self._stream is not None:
                    self._stream.is_over = True
                stop_if(judge_status(self._inverter.read_status(), self._watch))
            case _:
                set_up(self._inverter, command)

    def _take_snapshot(self) -> ParameterSnapshot:
        self._snapshot = self._inverter.snapshot()
        self._folder.save("snapshot.json", self._snapshot)
        return self._snapshot

    def _write(self, command: ask.WriteParameters) -> tuple[WrittenParameter, ...]:
        assert self._snapshot is not None
        self._folder.save("snapshot.json", self._snapshot)  # the way back, also where somebody removed it
        try:
            report = self._inverter.write_circuit(command.circuit, command.nameplate, self._snapshot)
        except WriteBackFailed as failed:
            if failed.was_restored:
                self._folder.journal("snapshot_restored", failed.as_dict(), durable=True)
            raise
        except OSError as failure:
            raise write_lost(failure, self._folder) from failure
        self._progress.has_written = True
        self._folder.journal("parameters_written", report, durable=True)
        facts = (report.store_count_after, report.wear_fraction, report.is_stored)
        self._show(ParametersWritten(report.written, *facts))
        return report.written

    def _enable(self) -> None:
        progress = self._progress
        progress.segment += 1
        progress.session_s = progress.next_status_s = progress.flux_fraction = 0.0
        limits = progress.facts.drive_limits
        set_aside()
        began_s = self._inverter.now_s()
        cursor = self._inverter.enable()
        self._inverter.port.stats.longest_gap_s = 0.0
        sensors = SensorWatch(limits.current_a if limits else math.inf)
        self._stream = Stream(self._inverter, cursor, began_s, sensors, self._watch)

    def _explained(self, error: CommissionerError) -> CommissionerError:
        facts = self._progress.facts
        if not facts.energised:
            return error
        stats = self._inverter.port.stats
        error = with_host(error, stats.longest_gap_s, facts.watchdog_s)
        error = with_link(error, stats.latency_s(1.0), facts.watchdog_s)
        return with_shares(error, *stats.shares_s(facts.watchdog_s or 0.0))

    def _fetch(self) -> SampleBlock | None:
        """The next block, archived and judged; None once the drive has ended the session."""
        longest_s = self._progress.facts.watchdog_s
        assert self._stream is not None and longest_s is not None
        block = self._stream.next_block(longest_s)
        if block is None:
            return None
        progress = self._progress
        self._folder.append(block, progress.segment)
        if not progress.facts.energised:  # kept in the drive, and downloaded now
            stop_if(self._stream.sensors.judge(block))
            return block
        progress.session_s += (block.count + block.lost_before) * block.sample_period_s
        stop_if(judge_block(block, progress.session_s, progress.flux_fraction, self._watch))
        stop_if(self._stream.sensors.judge(block))
        if progress.session_s >= progress.next_status_s:
            progress.next_status_s = progress.session_s + STATUS_EVERY_S
            self._stream.ask_status()
        return block

    def _supervise(self, seconds: float) -> DriveStatus:
        """Until so much time has passed: heartbeats, and the drive's status as often as while samples come."""
        assert self._stream is not None
        inverter, progress = self._inverter, self._progress
        began_s = inverter.now_s()
        every_s = min(STATUS_EVERY_S, 0.3 * (progress.facts.watchdog_s or 0.0))
        while True:
            asked_s = inverter.now_s()
            status = self._stream.supervise()
            left_s = began_s + seconds - inverter.now_s()
            if left_s <= 0.0 or not status.is_energised:
                break
            inverter.beat()
            inverter.sleep(max(0.0, min(every_s - (inverter.now_s() - asked_s), left_s)))
        inverter.beat()
        progress.session_s += inverter.now_s() - began_s
        return status

    def _tell(self, record: object) -> None:
        if isinstance(record, EstimateUpdated):
            self._progress.flux_fraction = record.agreed_flux_fraction
        if isinstance(record, ChecksJudged):
            passed = all(result.has_passed for result in record.results)
            self._progress.facts = replace(self._progress.facts, checks_passed=passed)
        if isinstance(record, VerdictReached):
            self._progress.facts = replace(self._progress.facts, writing_allowed=record.decision == "write back")
        self._folder.journal(kind_of(record), record)
        self._show(record)

    def _show(self, record: object) -> None:
        """To the screen. A screen that has gone, or that has a defect, must not end a run."""
        try:
            self._present(record)
        except (Exception, SystemExit) as gone:
            self._present = lambda _record: None
            note(self._folder, "presenter_lost", {"kind": type(gone).__name__, "what": str(gone)})

    def _disarm(self, reason: str) -> DriveFault | None:
        """The one place that de-energises. It tries every path and says what it verified.

        A fault where the drive was told to energise before and does not confirm that its output is off.
        """
        if not self._progress.has_touched:
            return None
        verified = let_go(self._inverter)
        progress = self._progress
        progress.facts = replace(progress.facts, energised=False, loaded=None, energised_s=self.energised_s)
        progress.session_s = 0.0
        note(self._folder, "disarmed", {"because": reason, "verified": verified})
        if verified.is_confirmed or progress.segment < 0:
            return None
        return taken_as_live(verified.state)


def kind_of(record: object) -> str:
    """`EstimateUpdated` -> `estimate_updated`"""
    name = type(record).__name__
    return "".join("_" + c.lower() if c.isupper() else c for c in name).lstrip("_")
