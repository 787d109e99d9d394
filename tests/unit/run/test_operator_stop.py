"""The operator's wish while the computer computes: computing is given up, what was written ends as written."""

import signal
import threading
import time

import pytest

from commissioner.run.archive.folder import RunFolder
from commissioner.run.runner import Runner
from commissioner.run.stopping.operator_stop import SERVICE, Abandoned, OperatorStop
from commissioner.safety import commands as ask
from tests.unit.run.test_full_disk import Drive

LONG_S, AT_ONCE_S = 20.0, 5.0


def compute(seconds: float = LONG_S) -> None:
    """Work that no command interrupts."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        sum(range(1000))


def course_that_computes():
    yield ask.Wait(0.0)
    compute()


@pytest.fixture
def folder(tmp_path):
    folder = RunFolder.create(tmp_path, "stop")
    yield folder
    folder.close()


def perform(folder, course, stop, *, has_written=False):
    runner = Runner(Drive(), folder, None, None, lambda _record: None, stop)
    runner._progress.has_written = has_written
    return runner.perform(course)


@pytest.fixture(autouse=True)
def open_gate(monkeypatch):
    monkeypatch.setattr("commissioner.run.runner.permit", lambda *_: None)
    monkeypatch.setattr("commissioner.run.runner.after", lambda _command, facts: facts)


@pytest.mark.parametrize("by", ["another thread", "a signal"])
def test_a_run_that_computes_ends_at_once(folder, by):
    stop = OperatorStop()
    act = (
        (lambda: stop.ask("somebody", "enough"))
        if by == "another thread"
        else (lambda: signal.raise_signal(signal.SIGTERM))
    )
    timer = threading.Timer(0.3, act)
    timer.start()
    began = time.monotonic()
    ended = perform(folder, course_that_computes(), stop)
    timer.join()
    assert time.monotonic() - began < AT_ONCE_S
    by_whom = "operator" if by == "another thread" else "operating system"
    assert (ended.outcome, ended.reason) == ("aborted", f"stopped by the {by_whom}")
    assert '"stop_asked"' in (folder.path / "journal.jsonl").read_text("utf-8")


def test_what_is_written_ends_as_written(folder):
    """Behind a write-back the rest of the course is carried out, a wish or not."""
    stop, went_on = OperatorStop(), []

    def course():
        yield ask.Wait(0.0)
        compute(0.8)
        went_on.append(True)
        raise ValueError("end")

    timer = threading.Timer(0.2, stop.ask, ("somebody", "enough"))
    timer.start()
    perform(folder, course(), stop, has_written=True)
    timer.join()
    assert went_on


def test_a_wish_in_a_run_that_another_thread_carries_out_waits_for_the_next_command(folder):
    stop = OperatorStop()
    with stop.computing():
        stop.ask("somebody", "enough")
    assert stop.asked == "enough (somebody)"


def test_a_second_wish_interrupts_nothing(folder):
    stop = OperatorStop()
    with stop:
        stop.ask("", "first")
        with pytest.raises(Abandoned), stop.computing():
            signal.raise_signal(signal.SIGINT)
            compute(1.0)
        signal.raise_signal(signal.SIGINT)
    assert stop.asked == "first"


@pytest.mark.parametrize(
    ("person", "what"),
    [("anna", "stopped by the operator"), ("", "stopped by the operator"), (SERVICE, "stopped by the service")],
)
def test_a_run_says_whether_a_person_or_the_service_stopped_it(folder, person, what):
    stop = OperatorStop()
    stop.ask(person, "enough")
    ended = perform(folder, course_that_computes(), stop)
    assert (ended.outcome, ended.reason) == ("aborted", what)
    assert ended.error["remedy"].endswith("start again when ready")
