"""A drive that was told to switch off and does not say that it has: no run ends well on that."""

import pytest

from commissioner.errors import DriveFault, ReplyTimeout
from commissioner.link.facts import DisarmReport
from commissioner.procedure.findings import RunEnded
from commissioner.run.archive import RunFolder
from commissioner.run.runner import Runner
from commissioner.safety import commands as ask


class Drive:
    """Stands for an inverter whose status goes on saying `operation enabled`, from its n-th switching off on."""

    def __init__(self, live_from):
        self.live_from, self.disarmed = live_from, 0

    def disarm(self):
        self.disarmed += 1
        is_dead = self.disarmed < self.live_from
        return DisarmReport(is_dead, "switch-on disabled" if is_dead else "operation enabled", (), not is_dead)

    def enable(self):
        return None


@pytest.fixture
def folder(tmp_path):
    folder = RunFolder.create(tmp_path, "live")
    yield folder
    folder.close()


def perform(folder, drive, course, *, was_energised=True):
    runner = Runner(drive, folder, bounds=None, watch=None, present=lambda record: None)
    if was_energised:
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


def test_a_drive_that_was_never_energised_is_not_called_live(folder):
    def course():
        yield ask.Wait(0.0)
        raise DriveFault("no such drive", step="identify", remedy="look")

    ended = perform(folder, Drive(live_from=1), course(), was_energised=False)
    assert ended.error["remedy"] == "look"
