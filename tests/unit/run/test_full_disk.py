"""A disk that takes no more: the drive is let go, the run ends with the reason, and nothing is left open."""

import dataclasses
import errno
import os
import shutil
import time
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest

from commissioner.errors import WriteBackFailed
from commissioner.link.drive.facts import DisarmReport
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.link.wire.url import parse_url
from commissioner.motor.nameplate import prior
from commissioner.procedure.findings import RunEnded
from commissioner.run import commission
from commissioner.run.archive.folder import RunFolder
from commissioner.run.ending import as_error
from commissioner.run.holding.drive_lock import DriveLock
from commissioner.run.runner import Runner
from commissioner.run.stopping.operator_stop import OperatorStop
from commissioner.safety import commands as ask
from commissioner.safety.limits import SafetyFacts
from commissioner.settings import load_motor, load_procedure
from tests.support.scripted_port import ScriptedDrive


class FullFolder(RunFolder):
    """A run folder on a disk that fills up at one kind of record."""

    full_at = ""
    is_full = False

    def journal(self, kind, record, *, durable=False):
        self.is_full = self.is_full or kind == self.full_at
        if self.is_full:
            raise OSError(errno.ENOSPC, "No space left on device")
        super().journal(kind, record, durable=durable)


class Drive:
    """Stands for the inverter; counts what it is told."""

    sleep, now_s = staticmethod(time.sleep), staticmethod(time.monotonic)

    def __init__(self):
        self.disarmed = 0

    def disarm(self):
        self.disarmed += 1
        return DisarmReport(True, "switch-on disabled", (), False)

    def write_circuit(self, *_):
        raise OSError(errno.ENOSPC, "No space left on device")


@pytest.fixture
def folder(tmp_path):
    folder = FullFolder.create(tmp_path, "full")
    yield folder
    folder.close()


def perform(drive, folder, course):
    runner = Runner(drive, folder, bounds=None, watch=None, present=lambda record: None)
    runner._progress.has_touched = True
    return runner.perform(course)


@pytest.mark.parametrize("full_at", ["record", "disarmed", "run_ended"])
def test_the_drive_is_let_go_and_the_run_ends_at_whatever_record_the_disk_fills_up(folder, full_at):
    folder.full_at, drive = full_at, Drive()

    class Record:
        """Journalled as `record`."""

    def course():
        yield ask.Tell(Record())
        return RunEnded("commissioned", "done", 0.0)

    ended = perform(drive, folder, course())
    assert drive.disarmed == 1
    if full_at == "record":
        assert (ended.outcome, ended.error["step"]) == ("faulted", "archive")
        assert "No space left" in ended.reason
        assert "--runs" in ended.error["remedy"]


@pytest.mark.parametrize(
    ("failure", "step", "said"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "archive", "No space left"),
        (ConnectionResetError(errno.ECONNRESET, "Connection reset by peer"), "run", "ConnectionResetError"),
        (
            PermissionError(errno.EACCES, "Permission denied", "/dev/ttyUSB0"),
            "run",
            "refused /dev/ttyUSB0: Permission denied",
        ),
        (OSError(errno.EMFILE, "Too many open files"), "run", "Too many open files"),
    ],
)
def test_what_the_operating_system_refused_is_named_by_what_failed(folder, failure, step, said):
    error = as_error(failure, folder)
    assert error.step == step and said in error.what
    assert ("archive" in error.what) is (step == "archive")


def test_a_file_of_the_run_folder_that_fails_is_the_archive(folder):
    assert (
        as_error(PermissionError(errno.EACCES, "Permission denied", str(folder.path / "blocks.bin")), folder).step
        == "archive"
    )


def test_a_defect_on_a_full_disk_still_lets_the_drive_go(folder):
    folder.full_at, drive = "defect", Drive()

    def course():
        yield ask.Wait(0.0)
        raise ZeroDivisionError("a defect")

    ended = perform(drive, folder, course())
    assert drive.disarmed == 1 and ended.outcome == "faulted" and "ZeroDivisionError" in ended.reason


@pytest.mark.parametrize("goes_by", [shutil.rmtree, lambda path: path.rename(path.with_name("elsewhere"))])
@pytest.mark.skipif(os.name == "nt", reason="Windows keeps a folder whose files are open")
def test_a_run_whose_folder_is_gone_energises_and_writes_nothing_more(tmp_path, goes_by):
    """The files that are open take what is written all the same; the snapshot that would bring the old parameters back is lost."""
    folder, drive = RunFolder.create(tmp_path, "gone"), ScriptedDrive()
    ended = write_after(lambda: goes_by(folder.path), folder, drive)
    assert ended.outcome == "faulted"
    assert ended.error["step"] == "archive" and "unmounted back" in ended.error["remedy"]
    assert drive.written("commit") == drive.written("staged_stator_resistance") == []


def test_a_snapshot_that_somebody_deleted_is_there_again_before_anything_is_written(folder):
    snapshot, drive = folder.path / "snapshot.json", ScriptedDrive()
    write_after(lambda: snapshot.unlink(missing_ok=True), folder, drive)
    assert drive.written("staged_stator_resistance")
    assert "stator_resistance" in snapshot.read_text("utf-8")


def write_after(happening, folder, drive):
    """How a run ends that writes after something happened to its folder."""
    inverter = Inverter(drive, load_profile("simulated"), partial(commission._announce, folder))
    plate = load_motor("motor_2kw2")
    box = prior(plate)
    bounds = SimpleNamespace(parameters=box)
    runner = Runner(inverter, folder, bounds, watch=None, present=lambda record: None)
    runner._progress.facts = SafetyFacts(checks_passed=True, snapshot_taken=True, writing_allowed=True)
    runner._snapshot = inverter.snapshot()

    def course():
        happening()
        yield ask.WriteParameters(box.typical, plate)
        return RunEnded("commissioned", "written", 0.0)

    ended = runner.perform(course())
    folder.close()
    return ended


def test_a_disk_that_fills_up_while_writing_back_says_what_the_drive_may_hold(folder):
    runner = Runner(Drive(), folder, bounds=None, watch=None, present=lambda record: None)
    runner._snapshot = {}
    with pytest.raises(WriteBackFailed, match="old or its new parameters") as caught:
        runner._write(ask.WriteParameters(None, None))
    assert "restore" in caught.value.remedy


@pytest.mark.parametrize("full_at", ["job", "error", "run_ended"])
def test_a_disk_that_fills_up_before_the_first_command_or_as_the_link_fails_ends_the_run_with_the_reason(
    folder, full_at, monkeypatch
):
    folder.full_at = full_at
    order = commission.Order(
        "tcp://127.0.0.1:1", load_profile("simulated"), load_motor("motor_2kw2"), load_procedure(), write_back=False
    )
    drive = ScriptedDrive()
    if full_at == "job":
        monkeypatch.setattr(commission, "open_drive", lambda *_: nullcontext(drive))
    with DriveLock.take(parse_url(order.url), order.profile, "run") as lock:
        ended = commission.carry_out(order, folder, None, lambda record: None, None, "job", OperatorStop(), lock)
    assert ended.outcome == "faulted"
    assert not [name for name, _ in drive.log if name == "write"]
    if full_at == "job":
        assert "No space left" in ended.reason and "--runs" in ended.error["remedy"]


def test_after_its_end_a_run_carries_out_nothing_more(folder):
    drive = Drive()

    def course():
        yield ask.Wait(0.0)
        return RunEnded("commissioned", "done", 0.0)

    runner = Runner(drive, folder, bounds=None, watch=None, present=lambda record: None)
    assert runner.perform(course()).outcome == "commissioned"
    again = runner.perform(course())
    assert again.outcome == "aborted" and "the run has ended" in again.reason


def test_a_saved_document_and_its_name_are_on_the_disk(folder, monkeypatch):
    synced = []
    sync = os.fsync

    def noted(descriptor):
        synced.append(Path(f"/proc/self/fd/{descriptor}").readlink())
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", noted)
    folder.save("snapshot.json", dataclasses.asdict(DisarmReport(True, "off", (), False)))
    assert synced == [folder.path / "snapshot.json.part", folder.path]


def test_a_document_that_the_disk_does_not_take_leaves_nothing(folder, monkeypatch):
    def full(_descriptor):
        raise OSError(errno.ENOSPC, "no space left")

    monkeypatch.setattr(os, "fsync", full)
    before = sorted(path.name for path in folder.path.iterdir())
    with pytest.raises(OSError, match="No space left"):
        folder.save("result.json", {"outcome": "commissioned"})
    assert sorted(path.name for path in folder.path.iterdir()) == before
