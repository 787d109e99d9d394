"""`tune` on emulated vendors: each way a tuning can go ends in the right outcome, by the drive's own answer key.

The whole campaign: python -m tests.campaigns.tunings.cases --seeds 4
"""

import errno
import struct
from dataclasses import replace
from pathlib import Path

import pytest

from commissioner.errors import CheckFailed, IdentityMismatch, ReplyTimeout, WriteBackFailed
from commissioner.link.drive.facts import Action
from commissioner.link.drive.inverter import Inverter
from commissioner.link.files.drive_file import load_profile
from commissioner.run.archive.catalogue import find_run
from commissioner.run.archive.folder import RunFolder
from commissioner.run.tuning.tune import TuneOrder, order_of, tune
from commissioner.settings import load_motor, load_procedure
from sim.vendors.drive import Habits, VendorDrive
from sim.vendors.face import read_face
from tests.campaigns.tunings import bench
from tests.campaigns.tunings.cases import applies, campaign, cases, judge, names
from tests.support.service.described import judge as described


@pytest.mark.parametrize("case", cases(), ids=lambda case: case.name.replace(" ", "-"))
def test_a_tuning_ends_in_the_right_outcome_on_every_family(case, tmp_path):
    wrong = {}
    for name in names():
        if applies(case, name):
            tried = bench.try_tune(name, tmp_path / Path(name).stem, habits=case.habits, seed=1, **case.more)
            wrong[name] = judge(case, name, tried)
    assert {name: why for name, why in wrong.items() if why} == {}
    assert wrong


def test_what_a_tune_changed_is_restored_from_its_run_afterwards(tmp_path):
    """Check, snapshot, three tunings, write, power cycle, read back; then `restore`, on every family that can be written."""
    for name in names():
        if "restore" not in load_profile(name).capabilities:
            continue
        tried = bench.try_tune(name, tmp_path / Path(name).stem)
        assert tried.done.ended.outcome == "commissioned", name
        assert "proved: the values outlasted a power-off" in tried.done.result["remarks"]
        assert tried.truth["held"] != tried.before
        described("tune", {**tried.done.result, "folder": str(tried.done.folder)})
        bench.take_back(tmp_path / Path(name).stem, tried.drive, tried.person.clock)
        assert tried.drive.truth()["held"] == tried.before, name


REMOTE = [name for name in names() if load_profile(name).tuning.form == "remote"]


def losing(monkeypatch, times, is_lost):
    """A link that takes along, before the drive sees them, the first `times` requests of which `is_lost` is true."""
    lost = []

    class LosingPort(bench.VendorPort):
        def _ask_once(self, pdu):
            if len(lost) < times and is_lost(pdu):
                lost.append(pdu)
                self._clock.sleep(self.reply_timeout_s)
                raise ReplyTimeout("no answer", step="request", value="silence", limit="an answer", remedy="the cable")
            return super()._ask_once(pdu)

    monkeypatch.setattr(bench, "VendorPort", LosingPort)
    return lost


def written_by(name, steps):
    """The requests that these steps of the drive's file write."""
    item = load_profile(name).item
    return {struct.pack(">BHH", 6, item(s.item).address, s.value) for s in steps if s.do == "write"}


@pytest.mark.parametrize("times", [1, 2])
@pytest.mark.parametrize("name", REMOTE)
def test_a_stop_that_the_link_takes_along_is_asked_for_again(name, times, tmp_path, monkeypatch):
    """A reset of the connection in that one request left the output on, with a link that worked again."""
    stops = written_by(name, load_profile(name).tuning.finally_)
    lost = losing(monkeypatch, times, stops.__contains__)
    tried = bench.try_tune(name, tmp_path, repeat=1, power_cycle=False)
    assert len(lost) == times
    assert tried.done.ended.outcome == "commissioned"
    assert not tried.truth["is_energised"]


@pytest.mark.parametrize("name", REMOTE)
def test_a_start_that_the_link_takes_along_is_the_links_fault_and_not_repeated(name, tmp_path, monkeypatch):
    starts = written_by(name, [step for step in load_profile(name).tuning.steps if step.once])
    losing(monkeypatch, 1, starts.__contains__)
    tried = bench.try_tune(name, tmp_path, repeat=1, power_cycle=False)
    assert tried.done.ended.outcome == "faulted"
    assert "did not answer the command to tune" in tried.done.ended.reason
    assert tried.truth["tunings"] == []
    assert tried.truth["held"] == tried.before


LONGER_THAN_ANY_SETTLES_S = 20.0
WRITABLE = [name for name in names() if {"restore"} <= set(load_profile(name).capabilities)]
HABITS = [Habits(late_s=LONGER_THAN_ANY_SETTLES_S), *(Habits(refuses_from=n) for n in (1, 2, 3, 6))]


@pytest.mark.parametrize("write_back", [True, False])
@pytest.mark.parametrize("turn", range(len(HABITS)))
def test_a_tune_whose_drive_does_not_show_or_take_what_is_written_never_says_what_is_not_so(turn, write_back, tmp_path):
    """Every second family by turns: all of them without these habits stand above."""
    habits = HABITS[turn]
    for name in WRITABLE[(turn + write_back) % 2 :: 2]:
        folder = tmp_path / Path(name).stem
        tried = bench.try_tune(name, folder, habits=habits, write_back=write_back, power_cycle=False)
        drive, ended = tried.drive, tried.done.ended
        tried.person.clock.sleep(LONGER_THAN_ANY_SETTLES_S)
        said = tried.done.result["tune"]["in_the_drive"]
        if said.startswith("as before"):
            assert drive.truth()["held"] == tried.before, name
        if said.startswith("unknown"):
            assert ended.outcome == "faulted" and "restore" in ended.error["remedy"], name
        if ended.outcome == "commissioned":
            assert said.startswith("new" if write_back else "as before"), name
        summary = find_run(folder, "last")
        assert summary.is_unknown == said.startswith("unknown"), name
        drive.habits = Habits()
        bench.take_back(folder, drive, tried.person.clock)
        assert drive.truth()["held"] == tried.before, name


@pytest.mark.parametrize("name", [name for name in WRITABLE if "write_back" in load_profile(name).capabilities])
def test_a_write_back_is_taken_back_from_a_drive_that_shows_it_late(name):
    """Reading alone said that nothing was to be taken back: the old values stood there still, and a second later the new ones."""
    clock = bench.JumpingClock()
    drive = VendorDrive(read_face(name), clock.now, habits=Habits(late_s=LONGER_THAN_ANY_SETTLES_S))
    before = drive.truth()["held"]
    inverter = Inverter(
        bench.VendorPort(drive, clock), load_profile(name), lambda _: None, sleep=clock.sleep, clock=clock.now
    )
    snapshot = inverter.snapshot()
    with pytest.raises(WriteBackFailed, match="verified") as failed:
        inverter.write_parameters({"stator_resistance": 0.9 * snapshot.in_use["stator_resistance"]}, snapshot)
    assert failed.value.was_restored
    assert "shows it late" in failed.value.remedy and "settle_s" in failed.value.remedy
    clock.sleep(LONGER_THAN_ANY_SETTLES_S)
    assert drive.truth()["held"] == before


@pytest.mark.parametrize(("late_s", "outcome"), [(0.3, "commissioned"), (0.8, "rejected")])
def test_a_kind_of_tuning_that_shows_late_is_waited_for_as_a_write_back_is_and_never_assumed(late_s, outcome, tmp_path):
    """The file grants 0.5 s; the digit beside the kind asked for turns the shaft."""
    tried = bench.try_tune(
        "schneider_atv340", tmp_path, habits=Habits(late_s=late_s), repeat=1, pause_s=0.0, write_back=False
    )
    assert tried.done.ended.outcome == outcome and tried.truth["held"]["tune_kind"] == tried.before["tune_kind"]
    assert len(tried.drive.tunings) == (outcome == "commissioned")
    assert outcome == "commissioned" or "did not take 2 as tune kind" in tried.done.ended.reason


def test_a_disk_that_fills_up_while_a_tune_brings_the_old_values_back_is_not_told_as_done(tmp_path, monkeypatch):
    journal = RunFolder.journal

    def filling(folder, kind, record, *, durable=False):
        if kind == "about_to" and record.action is Action.COMMIT:
            raise OSError(errno.ENOSPC, "No space left on device")
        journal(folder, kind, record, durable=durable)

    monkeypatch.setattr(RunFolder, "journal", filling)
    tried = bench.try_tune("yaskawa_a1000", tmp_path, write_back=False)
    assert tried.truth["held"] != tried.before
    assert tried.done.result["tune"]["in_the_drive"].startswith("unknown: the run's archive cannot be written")
    assert tried.done.ended.outcome == "faulted" and "restore" in tried.done.ended.error["remedy"]


@pytest.mark.parametrize("how", ["good", "fails"])
def test_a_tune_is_not_taken_back_from_a_drive_that_holds_what_it_neither_found_nor_left(how, tmp_path):
    """No register tells two drives of a type apart, their values do; after a tuning that failed nobody knows what it left."""
    tried = bench.try_tune("schneider_atv340", tmp_path, habits=Habits(tunings=(how,)))
    other = tried.drive
    cell = other.face.cells["stator_resistance"]
    other.words[cell.address] += 7
    if how == "fails":
        bench.take_back(tmp_path, other, tried.person.clock)
        assert other.truth()["held"] == tried.before
        return
    with pytest.raises(IdentityMismatch, match="neither found nor wrote") as refused:
        bench.take_back(tmp_path, other, tried.person.clock)
    assert "another drive of its type" in refused.value.remedy
    assert other.truth()["held"]["stator_resistance"] == tried.truth["held"]["stator_resistance"] + 7


def test_a_remote_tune_without_a_known_watchdog_wants_a_hard_wired_stop(tmp_path):
    profile = load_profile("schneider_atv340")
    order = order_of("tcp://127.0.0.1:9", profile, load_motor("motor_2kw2"), load_procedure(None), write_back=False)
    with pytest.raises(CheckFailed, match="nothing would stop the tuning"):
        tune(TuneOrder(order, 3, 0.0, hardwired_stop=False, power_cycle=False), tmp_path, None, lambda _: None)
    assert list(tmp_path.iterdir()) == []


def test_a_drive_whose_watchdog_is_not_fed_while_it_tunes_would_trip_and_one_that_is_does_not(tmp_path):
    tried = bench.try_tune("schneider_atv340", tmp_path, habits=Habits(watchdog_s=1.0, tuning_s=20.0))
    assert tried.done.ended.outcome == "commissioned"
    assert [t["end"] for t in tried.truth["tunings"]] == ["done"] * 3


def test_a_result_in_line_to_line_ohm_is_compared_with_the_plate_per_phase(tmp_path):
    tried = bench.try_tune("yaskawa_a1000", tmp_path)
    row = next(r for r in tried.done.result["tune"]["rows"] if r["name"] == "stator_resistance")
    assert row["ours"] == pytest.approx(row["median"] / 2)
    assert row["conversion"] == "line to line: divided by 2"
    assert row["plate_low"] < row["ours"] < row["plate_high"]
    again = bench.try_tune("yaskawa_a1000", tmp_path, seed=2)
    earlier = next(r for r in again.done.result["tune"]["rows"] if r["name"] == "stator_resistance")["earlier"]
    assert [e["run"] for e in earlier] == [tried.done.folder.name]


def test_every_result_says_that_no_physical_drive_has_proved_it(tmp_path):
    tried = bench.try_tune("danfoss_fc302", tmp_path)
    assert "tuning: proved on no physical drive yet" in tried.done.result["remarks"]
    assert tried.done.result["tune"]["proved_on"] == []


def test_a_drive_under_local_control_is_not_tuned(tmp_path):
    tried = bench.try_tune("danfoss_fc302", tmp_path, habits=replace(Habits(), is_local=True))
    assert tried.done.ended.outcome == "rejected" and tried.truth["tunings"] == []


@pytest.mark.campaign
def test_at_least_two_hundred_cases_end_as_they_must():
    rows = list(campaign(range(2, 4)))
    assert len(rows) >= 200
    assert [row for row in rows if row[4]] == []
