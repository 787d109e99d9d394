"""What a killed write left in a drive is told by the next run on it, until somebody restores it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from commissioner.procedure.findings import LeftUnfinished
from commissioner.records import DriveIdentity
from commissioner.report.run.standing import Held
from commissioner.run.archive.folder import RunFolder
from commissioner.run.archive.journal import read_journal
from commissioner.run.holding.unfinished import Word, left_by, left_unfinished
from tests.campaigns.tunings.bench import try_tune
from tests.support.archive.killed import die
from tests.support.archive.synthetic import make_run

OURS = DriveIdentity(
    drive_type="SIM-INV-7A", serial_number=20250117, firmware_version="1", map_version=1,
    rated_drive_current_a=7.0, control_period_s=2e-4, switching_frequency_hz=5e3,
)  # fmt: skip
URL = "tcp://192.168.0.20:502"
OLD, NEWER = "20260101-000000-simulated-aaaaaa", "20260102-000000-simulated-bbbbbb"


def journalled(folder, *lines):
    run = RunFolder(folder)
    for kind, record in lines:
        run.journal(kind, record)
    die(run)


@pytest.fixture
def cut_off(tmp_path):
    path = make_run(tmp_path, OLD, closed=False)
    journalled(path, ("about_to", {"action": "commit"}))
    return path


def test_it_is_told_to_the_same_drive_alone(cut_off, tmp_path):
    assert left_unfinished(tmp_path, URL, OURS) == LeftUnfinished(OLD)
    assert left_unfinished(tmp_path, "tcp://elsewhere", OURS) == LeftUnfinished(OLD)  # its number tells
    assert left_unfinished(tmp_path, URL, replace(OURS, serial_number=1)) is None
    assert left_unfinished(tmp_path, URL, replace(OURS, drive_type="ATV340", serial_number=None)) is None
    assert left_unfinished(tmp_path / "none", URL, OURS) is None


def test_a_run_that_wrote_nothing_hides_it_not_and_one_that_wrote_ends_it(cut_off, tmp_path):
    newer = make_run(tmp_path, NEWER)
    assert left_unfinished(tmp_path, URL, OURS) == LeftUnfinished(OLD)
    journalled(newer, ("parameters_written", {"is_stored": True}))
    assert left_unfinished(tmp_path, URL, OURS) is None


def test_restored_it_is_over(cut_off, tmp_path):
    journalled(cut_off, ("snapshot_restored", {}))
    assert left_unfinished(tmp_path, URL, OURS) is None


AHEAD_UTC = "2099-01-01T00:00:00+00:00"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ([Word("a", Held.OLD_OR_NEW, "2026-01-02"), Word("b", Held.NEW, "2026-01-01")], "a"),
        ([Word("a", Held.OLD_OR_NEW, "2026-01-01"), Word("b", Held.NEW, "2026-01-02")], ""),
        ([Word("b", Held.OLD_OR_NEW, "2026-01-02"), Word("a", Held.RESTORED, "2026-01-03")], ""),  # an older run's set
        ([Word("a", Held.OLD_OR_NEW, "2026-01-02"), Word("b", Held.AS_BEFORE, "2026-01-03")], "a"),
        ([Word("a", Held.OLD_OR_NEW, "2026-01-02"), Word("b", Held.NEW, AHEAD_UTC)], "a"),
        ([Word("a", Held.OLD_OR_NEW, AHEAD_UTC), Word("b", Held.NEW, "2026-01-02")], "a"),
    ],
)
def test_whoever_wrote_last_settles_it_by_a_clock_that_can_be_right(words, told):
    assert left_by(words) == left_by(reversed(words)) == told


def test_the_next_tune_of_a_drive_without_a_number_says_so_in_journal_and_result(tmp_path):
    first = try_tune("schneider_atv340", tmp_path, repeat=1, power_cycle=False)
    journalled(first.done.folder, ("about_to", {"action": "commit"}))
    second = try_tune("schneider_atv340", tmp_path, repeat=1, power_cycle=False)
    assert LeftUnfinished(first.done.folder.name).sentence in second.done.result["remarks"]
    assert "left_unfinished" in [line["kind"] for line in read_journal(second.done.folder / "journal.jsonl")]
    third = try_tune("schneider_atv340", tmp_path, repeat=1, power_cycle=False)
    assert not any("was cut off" in remark for remark in third.done.result["remarks"])
