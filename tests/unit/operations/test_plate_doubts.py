"""A plate that is possible but unusual: it is said once, in words, wherever a drive is checked, measured or tuned."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from commissioner.motor.nameplate import check, plate_doubts
from commissioner.operations import check as checking
from commissioner.procedure.checks import CheckResult
from commissioner.records import DriveIdentity
from commissioner.run.inspection import Inspection
from commissioner.service.page.texts import Texts
from commissioner.settings import load_motor
from tests.campaigns.tunings import bench

PLATE = load_motor("motor_2kw2")
KW_AS_HP = replace(PLATE, rated_power_w=0.7457 * PLATE.rated_power_w)
NEARLY_PEAK = replace(PLATE, rated_current_a=1.35 * PLATE.rated_current_a)
OF_60_HZ = replace(
    PLATE, rated_power_w=180.0, rated_current_a=0.6, power_factor=0.7, rated_speed_rpm=1370.0, rated_frequency_hz=60.0
)


@pytest.mark.parametrize(("plate", "count"), [(PLATE, 0), (KW_AS_HP, 1), (NEARLY_PEAK, 1), (OF_60_HZ, 1)])
def test_each_doubt_is_a_sentence_that_the_german_page_tells_whole(plate, count):
    said = plate_doubts(plate)
    assert check(plate) == () and len(said) == count
    for text in said:
        told = Texts("de").tell(text)
        assert not re.search(r"\b(the|where|have|motors|with)\b", told) and not re.search(r"\d\.\d", told)


def test_a_peak_current_that_is_refused_is_told_with_the_one_that_fits():
    """2.2 kW with 1.41 times its current: only star and delta were offered."""
    (problem,) = check(replace(PLATE, rated_current_a=2**0.5 * PLATE.rated_current_a))
    assert problem.expected.endswith("; 5 A would fit, too, a peak value taken for an rms one")
    assert "Scheitelwert" in Texts("de").tell(problem.expected) and "would" not in Texts("de").tell(problem.expected)


@pytest.mark.parametrize("passes", [True, False])
def test_a_check_remarks_it_whether_it_passes_or_not(monkeypatch, passes):
    """It stood in the reason of a check that passed; where one failed, which another plate makes likely, nothing was said."""
    row = CheckResult("no fault", passes, "none", "none", "remove the cause")
    drive = DriveIdentity("SIM", 1, "1.0", 1, 7.0, 2e-4, 5000.0)
    seen = Inspection(drive, {}, {}, {}, (row,))
    monkeypatch.setattr(checking, "inspect_drive", lambda *_: seen)
    monkeypatch.setattr(checking, "load_motor", lambda _: KW_AS_HP)
    done = checking.check(checking.CheckRequest("tcp://127.0.0.1", "simulated", "x"))
    assert (done.outcome == "passed") is passes
    assert done.remarks == plate_doubts(KW_AS_HP) and "plate means" not in done.reason


@pytest.mark.parametrize("stops_at", [None, 3.0])
def test_a_tuning_remarks_it_first_however_it_ends(tmp_path: Path, monkeypatch, stops_at):
    """The page shows the first remarks of a tuning."""
    monkeypatch.setattr(bench, "load_motor", lambda _: KW_AS_HP)
    tried = bench.try_tune("schneider_atv340", tmp_path, repeat=1, stops_at=stops_at)
    remarks = tried.done.result["remarks"]
    assert remarks[0] == plate_doubts(KW_AS_HP)[0] and remarks.count(remarks[0]) == 1
