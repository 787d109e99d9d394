"""Each pre-energise check fails for its own reason and says what to do."""

import math
from dataclasses import replace

import pytest

from commissioner.motor.nameplate import Nameplate
from commissioner.procedure.checks import SMALLEST_DRIVE, DriveLimits, check_failed, judge_drive
from commissioner.procedure.link_plan import LinkPlan, StreamPace, plan_link
from commissioner.records import DriveIdentity, DriveStatus

PLATE = Nameplate(2200.0, 400.0, 50.0, 5.0, 1436.0, 0.8, 2, "star")
IDENTITY = DriveIdentity("SIM", 1, "1.0.0", 1, 7.0, 2e-4, 5000.0)
LIMITS = DriveLimits(480.0, 640.0, 85.0, 120.0)
INTERLOCKS = {
    "sto_released": True,
    "remote_control": True,
    "shaft_at_rest": True,
    "supply_ok": True,
    "no_other_master": True,
}
STATUS = DriveStatus(
    state="switch_on_disabled",
    is_energised=False,
    fault_code=0,
    fault_text="none",
    trip_value=0.0,
    trip_limit=0.0,
    interlocks=INTERLOCKS,
    dc_link_v=540.0,
    heatsink_degc=40.0,
    winding_degc=math.nan,
    shaft_speed_rad_per_s=0.0,
    current_magnitude_a=0.0,
    heartbeat_echo=0,
    session=0,
)


def _failed(statuses=(STATUS, STATUS), identity=IDENTITY, plate=None, test_current=6.4):
    results = judge_drive(identity, statuses, plate or {}, PLATE, LIMITS, test_current)
    assert all(result.remedy for result in results)
    return [result.name for result in results if not result.has_passed]


def test_a_healthy_drive_passes_every_check():
    assert _failed() == []


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"fault_code": 3, "fault_text": "earth fault"}, "no fault"),
        ({"is_energised": True}, "output off"),
        ({"interlocks": INTERLOCKS | {"sto_released": False}}, "safe torque off is released"),
        ({"interlocks": INTERLOCKS | {"remote_control": False}}, "control is remote and ours"),
        ({"interlocks": INTERLOCKS | {"no_other_master": False}}, "no other master holds the drive"),
        ({"shaft_speed_rad_per_s": -0.6}, "shaft at rest over the dwell time"),
        ({"shaft_speed_rad_per_s": math.nan}, "shaft at rest over the dwell time"),
        ({"heatsink_degc": 86.0}, "heatsink temperature, degC"),
        ({"winding_degc": 121.0}, "winding temperature, degC"),
    ],
)
def test_one_wrong_reading_fails_one_check(changes, name):
    assert _failed((STATUS, replace(STATUS, **changes))) == [name]


def test_a_shaft_that_moved_during_the_dwell_fails_even_if_it_rests_now():
    assert _failed((replace(STATUS, shaft_speed_rad_per_s=3.0), STATUS)) == ["shaft at rest over the dwell time"]
    assert _failed((STATUS, replace(STATUS, shaft_speed_rad_per_s=math.nan))) == ["shaft at rest over the dwell time"]


def test_a_link_that_is_still_charging_is_not_steady():
    assert _failed((replace(STATUS, dc_link_v=500.0), STATUS)) == ["DC link steady"]
    assert _failed((replace(STATUS, dc_link_v=470.0), replace(STATUS, dc_link_v=470.0))) == ["DC link in range"]


def test_the_voltage_that_left_its_range_is_the_one_that_is_told_in_its_unit():
    readings = (replace(STATUS, dc_link_v=470.0), replace(STATUS, dc_link_v=479.996), STATUS)
    results = judge_drive(IDENTITY, readings, {}, PLATE, LIMITS, 6.4)
    seen = {result.name: result.value for result in results}
    assert seen["DC link in range"] == 470.0
    error = check_failed(results)
    assert error is not None and (error.value, error.unit) == (470.0, "V")
    (just,) = [r for r in judge_drive(IDENTITY, readings[1:], {}, PLATE, LIMITS, 6.4) if r.name == "DC link in range"]
    assert (just.has_passed, just.value) == (False, 479.996)


def test_a_drive_too_small_for_the_test_current_fails():
    smallest_a = 7.0 * math.sqrt(2) / SMALLEST_DRIVE
    assert _failed(test_current=smallest_a - 0.01) == []
    assert _failed(test_current=smallest_a + 0.01) == ["drive rated for the test current"]


def test_a_drive_set_up_for_another_motor_fails_and_an_empty_plate_does_not():
    assert _failed(plate={"rated_current_a": 5.2, "rated_voltage_v": 0.0}) == []
    assert _failed(plate={"rated_current_a": 8.0}) == ["rated_current_a in the drive"]


@pytest.mark.parametrize(("round_trip_s", "passes"), [(0.0046, True), (0.0047, False), (0.03, False), (0.1, False)])
def test_a_link_that_cannot_carry_the_samples_is_refused_with_the_figure_that_would_do(round_trip_s, passes):
    """29 samples of 0.2 ms a window, four fifths of that for it; 125 registers of it take 22 bits each on a serial line."""
    identity = replace(IDENTITY, control_period_s=2e-4)
    results = judge_drive(identity, (STATUS, STATUS), {}, PLATE, LIMITS, 6.4, StreamPace(round_trip_s, 29, 125))
    (pace,) = [result for result in results if result.name == "the link keeps up with the samples"]
    assert pace.has_passed is passes
    assert ("4.64 ms" if round_trip_s == 0.0047 else "5.8 ms") in pace.limit
    assert f"{(125 * 22 + 430) / 5.8e-3:.0f} Bd" in pace.remedy


@pytest.mark.parametrize(
    ("round_trip_s", "channels", "averaged"),
    [(0.0046, 4, 1), (0.0055, 3, 1), (0.0061, 3, 1), (0.0123, 3, 2), (0.0287, 3, 5), (0.043, 3, 7)],
)
def test_a_slow_link_is_planned_for_with_the_least_reduction_that_it_carries(round_trip_s, channels, averaged):
    """39 samples of three channels fill a window; four fifths of the link's time are for windows."""
    plan = plan_link(StreamPace(round_trip_s, 29, 125, 117, 100), 2e-4)
    assert (len(plan.channels), plan.averaged) == (channels, averaged)
    assert round_trip_s <= 39 * averaged * 2e-4


def test_a_link_that_carries_no_plan_is_refused_and_an_unmeasured_one_is_not():
    assert plan_link(StreamPace(0.2, 29, 125, 117, 100), 2e-4) is None
    assert plan_link(StreamPace(0.03, 29, 125, 117, 2), 2e-4) is None
    assert plan_link(None, 2e-4) == LinkPlan()


def test_a_link_of_150_ms_a_request_is_refused_by_its_name_before_anything_is_energised():
    """It carries the samples, and a staircase over it outlasts what the drive allows a test."""
    carried = StreamPace(0.11, 29, 125, 117, 100, 20000, 0.11, 0.11)
    assert plan_link(carried, 2e-4).captured
    slow = replace(carried, round_trip_s=0.15, slowest_s=0.15, request_s=0.15)
    assert plan_link(slow, 2e-4) is None
    results = judge_drive(replace(IDENTITY, control_period_s=2e-4), (STATUS, STATUS), {}, PLATE, LIMITS, 6.4, slow)
    (seen,) = [result for result in results if result.name == "the link keeps up with the samples"]
    assert not seen.has_passed
    assert "150 ms for the shortest request" in seen.value and "120 ms for a short request" in seen.limit


def test_a_late_answer_is_told_and_refused_where_the_drive_does_not_keep_what_it_holds_up():
    def seen(slowest_s):
        pace = StreamPace(0.0045, 29, 125, 117, 100, 500, slowest_s)
        results = judge_drive(replace(IDENTITY, control_period_s=2e-4), (STATUS, STATUS), {}, PLATE, LIMITS, 6.4, pace)
        return next(result for result in results if result.name == "the link keeps up with the samples")

    assert seen(0.006).has_passed and "worst" not in seen(0.006).value
    assert seen(0.08).has_passed and "80 ms at worst" in seen(0.08).value
    assert not seen(0.11).has_passed and "evenly" in seen(0.11).remedy
