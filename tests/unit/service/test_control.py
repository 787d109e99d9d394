"""Who clicks first has the drive, from the click on; a STOP reaches a run whose process is not there yet; control passes only to
somebody who is there."""

import asyncio
import sys
from types import SimpleNamespace

import pytest

from commissioner.service.configuration import DriveTable, ServiceFile, Settings
from commissioner.service.parts import make_parts
from commissioner.service.problems import Refusal
from commissioner.service.routes.write import act
from commissioner.service.runs import child, desk
from commissioner.service.runs.control import Control, Pages, Party
from tests.support.archive.synthetic import make_run


class SlowChild:
    """A process that takes a moment to come, then says that it was stopped before it began."""

    made = 0

    def __init__(self):
        self.said = []

    @classmethod
    async def start(cls, _arguments, _log):
        cls.made += 1
        await asyncio.sleep(0.02)
        return cls()

    async def begin(self, _origin):
        await asyncio.sleep(0.02)
        raise Refusal(409, f"stopped by {self.said}", step="", value="", limit="", remedy="")

    def stop(self, *words):
        self.said.append(words)

    def kill(self):
        pass


@pytest.fixture
def parts(tmp_path, monkeypatch):
    monkeypatch.setattr(desk, "Child", SlowChild)
    SlowChild.made = 0
    return make_parts(Settings(tmp_path / "runs", tmp_path / "data"))


def begin(parts, people, stop=None):
    """What each is told who starts a run on one drive at once."""

    async def at_once():
        drive, motor = parts.library.drives()[0], parts.library.motors()[0]
        tasks = [asyncio.create_task(parts.desk.start(drive, motor, ["run"], Party("", person))) for person in people]
        await asyncio.sleep(0)
        if stop:
            await parts.desk.stop_all(*stop)
        return [str(one.problem.title) for one in await asyncio.gather(*tasks, return_exceptions=True)]

    return asyncio.run(at_once())


def test_of_two_who_start_at_once_one_is_told_who_was_first(parts):
    _first, second = begin(parts, ("anna", "anna"))
    assert SlowChild.made == 1
    assert second.endswith("is in use: anna")


@pytest.mark.parametrize("what", ["write-back", "restore"])
def test_who_does_not_operate_a_drive_writes_nothing_into_it(tmp_path, what):
    hall = DriveTable(id="hall3", name="Pump 7", url="tcp://127.0.0.1:9", profile="simulated")
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data", file=ServiceFile(drives=[hall])))
    run = "20240105-081500-simulated-000abc"
    make_run(tmp_path / "runs", run, origin={"drive": "hall3"})
    parts.desk.pages.opened("at the page")
    parts.desk.control("hall3").take(Party("at the page", "otto"))
    with pytest.raises(Refusal) as refused:
        asyncio.run(act(parts, run, what, "token", SimpleNamespace(party=Party("another", "olga"))))
    assert (refused.value.problem.status, refused.value.problem.title) == (409, "otto operates this drive")


def test_a_button_pressed_twice_writes_once_and_how_far_it_is_can_be_asked(tmp_path, monkeypatch):
    parts = make_parts(Settings(tmp_path / "runs", tmp_path / "data"))
    make_run(tmp_path / "runs", run := "20240105-081500-simulated-000abc")
    otto = SimpleNamespace(party=Party("", "otto"), person="otto", address="")
    begun, told = [], []

    async def slow(*_, may_kill):
        assert not may_kill
        begun.append(dict(parts.writing))
        await asyncio.sleep(0.02)
        return {"report": {"written": []}}

    async def twice():
        first = asyncio.create_task(act(parts, run, "write-back", "token", otto))
        while not begun:
            await asyncio.sleep(0.001)
        with pytest.raises(Refusal) as refused:
            await act(parts, run, "restore", "token", otto)
        told.append(refused.value.problem)
        await first

    monkeypatch.setattr("commissioner.service.routes.write.succeed", slow)
    asyncio.run(twice())
    assert [list(going) for going in begun] == [[run]] and parts.writing == {}
    assert (told[0].status, told[0].title) == (409, "the drive of this run is being written already")


def test_a_stop_reaches_a_run_whose_process_is_not_there_yet(parts):
    assert begin(parts, ("anna",), stop=("bert", "wait")) == ["stopped by [('bert', 'wait')]"]


@pytest.mark.parametrize(("kind", "status"), [("DriveInUse", 409), ("DiskRefused", 507), ("LinkUnreachable", 502)])
def test_a_drive_in_use_or_a_full_disk_is_no_broken_drive(tmp_path, kind, status):
    refusal = child._refusal(5, {"error": {"kind": kind, "what": "no run"}}, tmp_path / "log")
    assert refusal.problem.status == status


@pytest.mark.parametrize("may_kill", [True, False])
def test_what_writes_into_a_drive_goes_on_where_the_service_is_shut_down(tmp_path, monkeypatch, may_kill):
    """Shut down while it wrote, the service killed it after 8 s, whatever half of the values the drive had by then."""
    done = tmp_path / "done"
    script = f"import time, pathlib; time.sleep(0.15); pathlib.Path({str(done)!r}).touch()"
    monkeypatch.setattr(child, "program", lambda *_: [sys.executable, "-c", script])

    begun: list[asyncio.subprocess.Process] = []
    begin = asyncio.create_subprocess_exec

    async def noted(*arguments, **options):
        begun.append(await begin(*arguments, **options))
        return begun[-1]

    monkeypatch.setattr(asyncio, "create_subprocess_exec", noted)

    async def shut_down():
        asking = asyncio.create_task(child.succeed(["write-back"], tmp_path / "log", may_kill=may_kill))
        while not begun:
            await asyncio.sleep(0.01)
        asking.cancel()
        await asyncio.gather(asking, return_exceptions=True)
        await begun[0].communicate()

    asyncio.run(shut_down())
    assert done.exists() is not may_kill


ANNA, BERT, SCRIPT = Party("a", "anna"), Party("b", "bert"), Party("", "script")


@pytest.fixture
def clock():
    return [100.0]


@pytest.fixture
def pages(clock):
    made = Pages(lambda: clock[0])
    made.opened("a")
    made.opened("b")
    return made


@pytest.fixture
def control(pages, clock):
    made = Control(pages, 15.0, lambda: clock[0])
    made.take(ANNA)
    made.ask(BERT)
    return made


def test_who_asked_and_closed_the_page_takes_control_from_nobody(control, pages, clock):
    """Control without a page would end the run that anna looks after."""
    pages.closed("b")
    clock[0] += 16.0
    assert control.is_held_by(ANNA) and control.asking is None


def test_a_reload_while_asking_takes_nothing_away(control, pages, clock):
    pages.closed("b")
    clock[0] += 1.0
    assert control.asking == BERT
    pages.opened("b")
    clock[0] += 15.0
    assert control.is_held_by(BERT)


def test_control_passes_to_no_page_in_the_midst_of_a_reload(control, pages, clock):
    clock[0] += 14.5
    pages.closed("b")
    clock[0] += 1.0
    assert control.is_held_by(ANNA)
    pages.opened("b")
    assert control.is_held_by(BERT)


def test_a_script_has_no_page_to_lose(pages, clock):
    control = Control(pages, 15.0, lambda: clock[0])
    control.take(ANNA)
    control.ask(SCRIPT)
    clock[0] += 16.0
    assert control.is_held_by(SCRIPT)
