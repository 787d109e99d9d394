"""Each reason to stop, at its edge."""

import math
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

from commissioner.errors import Aborted, DriveFault
from commissioner.records import DriveStatus, SampleBlock
from commissioner.safety.watch import StopReason, WatchLimits, judge_block, judge_status, stop_if

LIMITS = WatchLimits(
    current_a=5.0,
    flux_fraction=1.0,
    axis_time_s=20.0,
    lost_samples_s=0.01,
    age_s=0.5,
    dc_link_v=(480.0, 640.0),
    heatsink_degc=85.0,
    winding_degc=120.0,
)
STATUS = DriveStatus(
    state="operation_enabled",
    is_energised=True,
    fault_code=0,
    fault_text="none",
    trip_value=0.0,
    trip_limit=0.0,
    interlocks={},
    dc_link_v=540.0,
    heatsink_degc=40.0,
    winding_degc=math.nan,
    shaft_speed_rad_per_s=0.0,
    current_magnitude_a=1.0,
    heartbeat_echo=0,
    session=1,
)


def _block(u=(0.0, 1.0), v=(0.0, -0.5), w=(0.0, -0.5), **changes):
    block = SampleBlock(
        session=1,
        first_index=0,
        sample_period_s=2e-4,
        axis_deg=0.0,
        voltage_axis_v=np.zeros(2),
        current_u_a=np.array(u),
        current_v_a=np.array(v),
        current_w_a=None if w is None else np.array(w),
        dc_link_v=540.0,
    )
    return replace(block, **changes)


def test_a_quiet_block_is_no_reason_to_stop():
    assert judge_block(_block(), 1.0, 0.5, LIMITS) is None


@pytest.mark.parametrize("phase", ["u", "v", "w"])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_over_current_in_any_phase_and_either_sign_stops(phase, sign):
    over = judge_block(_block(**{phase: (0.0, sign * 5.01)}), 1.0, 0.5, LIMITS)
    assert over is not None
    assert over.what == "the current passed its limit"
    assert (over.value, over.limit, over.is_fault) == (pytest.approx(5.01), 5.0, False)
    assert judge_block(_block(**{phase: (0.0, sign * 5.0)}), 1.0, 0.5, LIMITS) is None


def test_the_third_phase_is_judged_even_without_a_sensor():
    stop = judge_block(_block(u=(3.0, 3.0), v=(3.0, 3.0), w=None), 1.0, 0.5, LIMITS)
    assert stop is not None
    assert stop.value == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("changes", "seconds", "flux", "says", "is_fault"),
    [
        ({"current_u_a": np.array([0.0, math.nan])}, 1.0, 0.5, "the current passed its limit", False),
        ({}, 1.0, 1.0001, "the flux came too close to its rated value", False),
        ({}, 1.0, math.nan, "the flux came too close to its rated value", False),
        ({"clipped": True}, 1.0, 0.5, "a current sensor reached the end of its range", True),
        ({}, 20.001, 0.5, "the axis was energised too long", False),
        ({"lost_before": 51}, 1.0, 0.5, "the stream lost samples", True),
        ({"age_s": 0.5001}, 1.0, 0.5, "the samples came too late", True),
        ({"age_s": math.nan}, 1.0, 0.5, "the samples came too late", True),
        ({"dc_link_v": 479.9}, 1.0, 0.5, "the DC link left its range", True),
        ({"dc_link_v": 640.1}, 1.0, 0.5, "the DC link left its range", True),
        ({"dc_link_v": math.nan}, 1.0, 0.5, "the DC link left its range", True),
    ],
)
def test_each_reason_is_named_with_its_remedy(changes, seconds, flux, says, is_fault):
    stop = judge_block(_block(**changes), seconds, flux, LIMITS)
    assert stop is not None
    assert (stop.what, stop.is_fault) == (says, is_fault)
    assert stop.remedy


@pytest.mark.parametrize(
    ("changes", "seconds", "flux"),
    [
        ({}, 20.0, 0.5),
        ({}, 1.0, 1.0),
        ({"lost_before": 50}, 1.0, 0.5),
        ({"age_s": 0.5}, 1.0, 0.5),
        ({"dc_link_v": 480.0}, 1.0, 0.5),
        ({"dc_link_v": 640.0}, 1.0, 0.5),
    ],
)
def test_the_limit_itself_is_still_allowed(changes, seconds, flux):
    assert judge_block(_block(**changes), seconds, flux, LIMITS) is None


@pytest.mark.parametrize(
    ("changes", "says", "is_fault"),
    [
        ({"fault_code": 1, "fault_text": "over-current"}, "the drive tripped: over-current", True),
        ({"heatsink_degc": 85.1}, "the heatsink is too hot", False),
        ({"winding_degc": 120.1}, "the winding is too hot", False),
        ({"dc_link_v": 479.0}, "the DC link left its range", True),
    ],
)
def test_each_status_reason_is_named(changes, says, is_fault):
    stop = judge_status(replace(STATUS, **changes), LIMITS)
    assert stop is not None
    assert (stop.what, stop.is_fault) == (says, is_fault)
    assert stop.remedy


@pytest.mark.parametrize(("unit", "names"), [("A", True), ("V", False), ("", False)])
def test_what_tripped_on_its_current_may_be_wired_otherwise(unit, names):
    stop = judge_status(replace(STATUS, fault_code=1, fault_text="it", trip_unit=unit), LIMITS)
    assert ("wired in delta for star" in stop.remedy) is names and "reset the fault at the drive" in stop.remedy


def test_a_healthy_status_is_no_reason_to_stop():
    assert judge_status(STATUS, LIMITS) is None
    assert judge_status(replace(STATUS, heatsink_degc=85.0, winding_degc=120.0), LIMITS) is None


@pytest.mark.parametrize("record", [LIMITS, StopReason("what", 1.0, 0.0, "remedy")])
def test_nobody_can_change_a_limit_or_a_reason(record):
    with pytest.raises(FrozenInstanceError):
        setattr(record, next(iter(record.__dataclass_fields__)), 99.0)


@pytest.mark.parametrize(("is_fault", "kind"), [(True, DriveFault), (False, Aborted)])
def test_a_reason_ends_the_run_as_what_it_is(is_fault, kind):
    reason = StopReason("the winding is too hot", 130.0, 120.0, "let the motor cool down", is_fault)
    with pytest.raises(kind) as ended:
        stop_if(reason, "a test")
    told = ended.value.as_dict()
    assert (ended.value.what, told["step"], told["value"], told["limit"]) == (reason.what, "a test", 130.0, 120.0)
    assert told["remedy"] == reason.remedy
    with pytest.raises(kind) as ended:
        stop_if(reason)
    assert ended.value.as_dict()["step"] == "watch"


def test_no_reason_ends_nothing():
    stop_if(None)


def test_a_number_that_stopped_the_test_has_its_unit_in_the_error():
    hot = replace(STATUS, heatsink_degc=91.0)
    tripped = replace(STATUS, fault_code=1, trip_value=15.2, trip_limit=14.0, trip_unit="A")
    for status, kind, unit in ((hot, Aborted, "°C"), (tripped, DriveFault, "A")):
        with pytest.raises(kind) as caught:
            stop_if(judge_status(status, LIMITS))
        assert caught.value.as_dict()["unit"] == unit
