"""A drive that was told to switch off and does not say that it has: no run ends well on that."""

import gc
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

from commissioner.errors import Aborted, DriveFault, ReplyTimeout
from commissioner.link.drive.facts import DisarmReport, WriteReport
from commissioner.link.wire.port import LinkStats
from commissioner.motor.nameplate import prior
from commissioner.procedure.findings import RunEnded
from commissioner.records import SampleBlock
from commissioner.run.archive.folder import RunFolder
from commissioner.run.holding.priority import raised_priority
from commissioner.run.runner import Runner
from commissioner.run.stopping.operator_stop import OperatorStop
from commissioner.run.stream import Stream
from commissioner.safety import commands as ask
from commissioner.safety.limits import SafetyFacts
from commissioner.settings import load_motor

EVERY_SAMPLE = SimpleNamespace(stream=SimpleNamespace(averaged=1, sample_period_s=5e-4))


class Drive:
    """Stands for an inverter whose status goes on saying `operation enabled`, from its n-th switching off on."""

    sleep, now_s = staticmethod(time.sleep), staticmethod(time.monotonic)

    def __init__(self, live_from):
        self.live_from, self.disarmed = live_from, 0
        self.port = SimpleNamespace(stats=LinkStats())

    def disarm(self):
        self.disarmed += 1
        is_dead = self.disarmed < self.live_from
        return DisarmReport(is_dead, "switch-on disabled" if is_dead else "operation enabled", (), not is_dead)

    def enable(self):
        return EVERY_SAMPLE


@pytest.fixture
def folder(tmp_path):
    folder = RunFolder.create(tmp_path, "live")
    yield folder
    folder.close()


def perform(folder, drive, course, *, was_energised=True):
    runner = Runner(drive, folder, bounds=None, watch=None, present=lambda record: None)
    if was_energised:
        runner._progress.has_touched = True
        runner._enable()
    return runner.perform(course)


def test_a_run_is_not_commissioned_where_its_last_switching_off_was_not_confirmed(folder):
    def course():
        yield ask.Wait(0.0)
        return RunEnded("commissioned", "done", 0.0)

    ended = perform(folder, Drive(live_from=1), course())
    assert ended.outcome == "faulted"
    assert ended.error["step"] == "de-energise" and ended.error["value"] == "operation enabled"
    assert "isolate" in ended.error["remedy"]


def test_nothing_follows_a_test_whose_end_was_not_confirmed(folder):
    went_on = []

    def course():
        yield ask.Disarm("test done")
        went_on.append(True)
        return RunEnded("commissioned", "done", 0.0)

    ended = perform(folder, drive := Drive(live_from=1), course())
    assert not went_on and drive.disarmed == 2
    assert ended.outcome == "faulted" and "isolate" in ended.error["remedy"]


def test_a_run_that_failed_for_another_reason_says_both(folder):
    def course():
        yield ask.Wait(0.0)
        raise ReplyTimeout("no answer", step="read status", remedy="check the cable")

    ended = perform(folder, Drive(live_from=1), course())
    assert ended.reason == "no answer"
    assert "isolate" in ended.error["remedy"] and "check the cable" in ended.error["remedy"]


def test_a_stopped_run_is_a_fault_while_its_drive_is_live(folder):
    def course():
        yield ask.Wait(0.0)
        raise Aborted("stopped by the operator", step="run", remedy="start again when ready")

    ended = perform(folder, Drive(live_from=1), course())
    assert ended.outcome == "faulted" and "stopped by the operator" in ended.reason
    assert "isolate" in ended.error["remedy"] and "start again" in ended.error["remedy"]


def test_a_drive_that_was_never_energised_is_not_called_live(folder):
    def course():
        yield ask.Wait(0.0)
        raise DriveFault("no such drive", step="identify", remedy="look")

    ended = perform(folder, drive := Drive(live_from=1), course(), was_energised=False)
    assert ended.error["remedy"] == "look"
    assert drive.disarmed == 0  # it may be another master's, and at work


def test_a_defect_in_switching_off_leaves_a_run_with_an_end(folder):
    class Broken(Drive):
        def disarm(self):
            raise OSError("the port has gone")

    def course():
        yield ask.Wait(0.0)
        return RunEnded("commissioned", "done", 0.0)

    ended = perform(folder, Broken(live_from=1), course())
    assert ended.outcome == "faulted" and "the port has gone" in ended.error["value"]


@pytest.mark.parametrize("gone", [BrokenPipeError("closed"), SystemExit(1)])
def test_a_screen_that_has_gone_does_not_end_a_run(folder, gone):
    def present(record):
        raise gone

    def course():
        yield ask.Tell(RunEnded("a record", "", 0.0))
        return RunEnded("commissioned", "done", 0.0)

    runner = Runner(Drive(live_from=9), folder, bounds=None, watch=None, present=present)
    assert runner.perform(course()).outcome == "commissioned"


def test_a_stop_during_the_write_back_lets_it_end_as_written(folder):
    stop = OperatorStop()

    class Writing(Drive):
        def write_circuit(self, *_):
            stop.ask("", "SIGTERM")
            return WriteReport((), True, 0, 1, None)

    plate = load_motor("motor_2kw2")
    box = prior(plate)

    def course():
        yield ask.WriteParameters(box.typical, plate)
        return RunEnded("commissioned", "done", 0.0)

    bounds = SimpleNamespace(parameters=box)
    runner = Runner(Writing(live_from=9), folder, bounds, watch=None, present=lambda record: None, stop=stop)
    runner._snapshot = object()
    runner._progress.facts = SafetyFacts(checks_passed=True, snapshot_taken=True, writing_allowed=True)
    ended = runner.perform(course())
    assert ended.outcome == "commissioned", ended


def test_a_stream_without_samples_ends_within_the_watchdogs_time(folder):
    class Silent(Drive):
        def fetch(self, cursor, most):
            return SimpleNamespace(cursor=cursor, block=None, has_ended=False)

    stream = Stream(Silent(live_from=9), EVERY_SAMPLE, time.monotonic(), sensors=None, watch=None)
    began = time.monotonic()
    with pytest.raises(DriveFault, match="no samples"):
        stream.next_block(0.05)
    assert time.monotonic() - began < 1.0


class Full(Drive):
    """In a time of its own: every window is full, takes `took_s` to come and brings 8 ms of samples that the drive made long ago."""

    def __init__(self, took_s, behind_s=0.0):
        super().__init__(live_from=9)
        self.took_s, self.time_s = took_s, behind_s

    def now_s(self):
        return self.time_s

    def sleep(self, seconds):
        self.time_s += seconds

    def fetch(self, cursor, most):
        self.time_s += self.took_s
        count = min(16, int(self.time_s / 5e-4) - cursor.next_index)
        block = SampleBlock(7, cursor.next_index, 5e-4, 0.0, *[np.zeros(count)] * 3, None, 560.0) if count else None
        moved = SimpleNamespace(stream=cursor.stream, next_index=cursor.next_index + count)
        return SimpleNamespace(cursor=moved, block=block, has_ended=False)

    def read_status(self):
        self.time_s += self.took_s
        return SimpleNamespace(is_energised=True, samples_produced=0)


def streamed(drive, monkeypatch):
    monkeypatch.setattr("commissioner.run.stream.judge_status", lambda status, watch: None)
    stream = SimpleNamespace(averaged=1, sample_period_s=5e-4, samples_per_window=16)
    sensors = SimpleNamespace(claim=lambda status: None)
    return Stream(drive, SimpleNamespace(stream=stream, next_index=0), 0.0, sensors, watch=None)


def test_a_link_that_has_become_slower_than_its_samples_is_seen_before_eight_more_windows_have_come(monkeypatch):
    drive = Full(took_s=0.12)
    stream = streamed(drive, monkeypatch)
    while (age_s := stream.next_block(0.5).age_s) <= 0.5:
        pass
    assert age_s < 0.5 + 4 * 0.12  # at the most three windows and a status after the one that was still young enough


@pytest.mark.parametrize(("took_s", "least", "most"), [(1e-4, 6, 9), (1e-3, 6, 10), (6e-3, 11, 13)])
def test_a_fast_link_is_asked_for_samples_that_are_worth_asking_and_never_for_more_than_a_window(
    monkeypatch, took_s, least, most
):
    drive = Full(took_s)
    stream = streamed(drive, monkeypatch)
    counts = [stream.next_block(0.5).count for _ in range(100)][2:]
    assert all(least <= count <= most for count in counts)  # of 16: each ends with the newest sample there was
    assert stream._clock.first is not None


@pytest.mark.parametrize("took_s", [0.001, 0.002, 0.004, 0.0075, 0.012])
def test_a_host_that_was_behind_catches_up_in_one_go(monkeypatch, took_s):
    block = streamed(Full(took_s, behind_s=0.15), monkeypatch).next_block(0.5)
    assert block.count == 8 * 16


@pytest.mark.parametrize(("gap_s", "is_named"), [(0.4, True), (0.1, False)])
def test_a_fault_in_a_session_whose_host_was_late_says_so_with_its_longest_gap(folder, gap_s, is_named):
    def course():
        raise DriveFault("the drive tripped: watchdog expired", step="watch", remedy="start again")
        yield

    drive = Drive(live_from=9)
    runner = Runner(drive, folder, bounds=None, watch=None, present=lambda record: None)
    runner._progress.has_touched = True
    runner._progress.facts = SafetyFacts(energised=True, watchdog_s=0.5)
    drive.port.stats.longest_gap_s = gap_s
    ended = runner.perform(course())
    assert ended.outcome == "faulted"
    assert ("this host was late: it did nothing for 0.4 s" in ended.reason) is is_named
    assert ("less busy" in ended.error["remedy"]) is is_named


def test_a_gap_between_two_sessions_is_no_lateness(folder):
    def course():
        yield ask.Wait(0.0)
        raise DriveFault("the drive does not follow", step="enable", remedy="start again")

    drive = Drive(live_from=9)
    drive.port.stats.longest_gap_s = 3.0
    runner = Runner(drive, folder, bounds=None, watch=None, present=lambda record: None)
    runner._progress.facts = SafetyFacts(energised=False, watchdog_s=0.5)
    assert "late" not in runner.perform(course()).reason


@pytest.mark.skipif(sys.platform == "win32", reason="nice values are POSIX's")
@pytest.mark.parametrize("refuses", [False, True])
def test_priority_is_asked_for_and_given_back(monkeypatch, refuses):
    asked = []

    def set_it(which, who, value):
        asked.append(value)
        if refuses:
            raise PermissionError

    monkeypatch.setattr("os.getpriority", lambda which, who: 5)
    monkeypatch.setattr("os.setpriority", set_it)
    with raised_priority():
        assert asked == [-5]
    assert asked == [-5, 5]


def test_the_collector_does_not_look_through_what_was_there_while_a_drive_waits(folder):
    """A full collection of a process that had compiled took 0.3 s, all threads standing: nearly the drive's watchdog."""
    was_there = [[number] for number in range(1000)]
    looked_at = []

    def course():
        came_before_enabling = [[number] for number in range(1000)]
        yield ask.Wait(0.0)
        runner._enable()
        looked_at.append(gc.get_objects())
        del came_before_enabling
        return RunEnded("commissioned", "done", 0.0)

    runner = Runner(Drive(live_from=9), folder, bounds=None, watch=None, present=lambda record: None)
    runner.perform(course())
    seen = {id(thing) for thing in looked_at[0]}
    assert not seen & {id(thing) for thing in was_there}
    assert len(seen) < 1000
    assert gc.get_freeze_count() == 0
