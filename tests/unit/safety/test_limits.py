"""The last gate before the wire: each rule, at its edge, from both sides."""

import math
from dataclasses import FrozenInstanceError, fields, replace

import pytest

from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import ParameterBox
from commissioner.safety.commands import (
    ArmWatchdog,
    Disarm,
    Enable,
    Fetch,
    Identify,
    LoadExcitation,
    ReadStatus,
    SetBias,
    SetDriveLimits,
    SetScale,
    Supervise,
    TakeSnapshot,
    Tell,
    Wait,
    WriteParameters,
)
from commissioner.safety.limits import Bounds, Refusal, SafetyFacts, after, permit
from commissioner.settings import load_motor

LOWER, UPPER = InverseGamma(1.0, 0.5, 0.001, 0.1), InverseGamma(10.0, 8.0, 0.1, 1.0)
BOUNDS = Bounds(
    max_watchdog_s=1.0,
    drive_current_a=10.0,
    test_voltage_v=50.0,
    axis_time_s=20.0,
    total_time_s=100.0,
    parameters=ParameterBox(LOWER, LOWER, UPPER),
)
EXCITATION = LoadExcitation(60.0, ((20.0, 1.0, 0.0), (-20.0, 5.0, 0.0)), 100.0, 1.0, 15.0)
LIMITS = SetDriveLimits(10.0, 50.0, 20.0)
READY = SafetyFacts(watchdog_s=0.5, drive_limits=LIMITS, loaded=EXCITATION, checks_passed=True, snapshot_taken=True)
RUNNING = replace(READY, energised=True)
GOOD = InverseGamma(3.7, 2.2, 0.02, 0.23)
PLATE = load_motor("motor_2kw2")


def test_enable_is_permitted_only_when_everything_is_in_place():
    assert permit(Enable("test"), READY, BOUNDS) is None


@pytest.mark.parametrize(
    ("missing", "says"),
    [
        ({"watchdog_s": None}, "no watchdog is armed"),
        ({"watchdog_s": 1.001}, "no watchdog is armed"),
        ({"drive_limits": None}, "the drive's own limits are not set"),
        ({"loaded": None}, "no excitation is loaded"),
        ({"checks_passed": False}, "the pre-energise checks have not passed"),
        ({"energised": True}, "the drive is already energised"),
        ({"run_ended": True}, "the run has ended"),
        ({"energised_s": 85.001}, "energised time of the run is outside its limits"),
    ],
)
def test_enable_is_refused_when_one_thing_is_missing(missing, says):
    refusal = permit(Enable("test"), replace(READY, **missing), BOUNDS)
    assert refusal is not None
    assert refusal.what == says
    assert refusal.remedy


def test_a_run_whose_time_is_up_is_told_what_to_raise():
    """The limit is the procedure file's: no defect of ours."""
    refusal = permit(Enable("test"), replace(READY, energised_s=85.001), BOUNDS)
    assert refusal is not None
    assert "limits.total_time_s" in refusal.remedy


def test_the_run_may_use_its_energised_time_to_the_last_second():
    assert permit(Enable("test"), replace(READY, energised_s=85.0), BOUNDS) is None
    assert permit(Enable("test"), replace(READY, watchdog_s=1.0), BOUNDS) is None


@pytest.mark.parametrize("facts", [SafetyFacts(), READY, RUNNING, replace(RUNNING, run_ended=True)])
def test_disarm_is_always_permitted(facts):
    assert permit(Disarm("whatever"), facts, BOUNDS) is None


@pytest.mark.parametrize(
    "command", [Identify(), ReadStatus(), Fetch(), TakeSnapshot(), Tell("x"), Enable("x"), Wait(0.1)]
)
def test_nothing_but_disarm_follows_the_end(command):
    refusal = permit(command, replace(READY, run_ended=True), BOUNDS)
    assert refusal is not None
    assert (refusal.what, refusal.value) == ("the run has ended", type(command).__name__)


@pytest.mark.parametrize("command", [Identify(), ReadStatus(), Fetch(), TakeSnapshot(), Tell("x")])
def test_reading_is_permitted_in_any_state(command):
    assert permit(command, RUNNING, BOUNDS) is None
    assert permit(command, SafetyFacts(), BOUNDS) is None


@pytest.mark.parametrize(
    ("armed", "wanted", "is_permitted"),
    [
        (None, 1.0, True),
        (None, 1.001, False),
        (None, 0.1, True),
        (None, 0.099, False),
        (0.5, 0.5, True),
        (0.5, 0.501, False),
        (0.5, 0.4, True),
        (2.0, 1.0, True),
        (2.0, 1.5, False),
        (None, math.nan, False),
    ],
)
def test_the_watchdog_is_tightened_never_relaxed(armed, wanted, is_permitted):
    facts = replace(READY, watchdog_s=armed)
    assert (permit(ArmWatchdog(wanted), facts, BOUNDS) is None) is is_permitted


@pytest.mark.parametrize("command", [ArmWatchdog(0.5), LIMITS, EXCITATION, Wait(0.1), WriteParameters(GOOD, PLATE)])
def test_what_belongs_to_standstill_is_refused_while_energised(command):
    facts = replace(RUNNING, writing_allowed=True)
    assert permit(command, facts, BOUNDS) is not None
    assert permit(command, replace(facts, energised=False), BOUNDS) is None


@pytest.mark.parametrize(
    ("command", "is_permitted"),
    [
        (SetDriveLimits(10.0, 50.0, 20.0), True),
        (SetDriveLimits(10.01, 50.0, 20.0), False),
        (SetDriveLimits(10.0, 50.01, 20.0), False),
        (SetDriveLimits(10.0, 50.0, 20.01), False),
        (SetDriveLimits(0.0, 0.0, 0.0), True),
        (SetDriveLimits(-0.1, 50.0, 20.0), False),
        (SetDriveLimits(math.inf, 50.0, 20.0), False),
        (Wait(60.0), True),
        (Wait(60.1), False),
        (Wait(-0.1), False),
        (Wait(0.0), True),
        (replace(EXCITATION, tones=((30.0, 1.0, 0.0), (20.0, 5.0, 0.0))), True),
        (replace(EXCITATION, tones=((30.0, 1.0, 0.0), (-20.1, 5.0, 0.0))), False),
        (replace(EXCITATION, duration_s=20.0), True),
        (replace(EXCITATION, duration_s=20.1), False),
        (replace(EXCITATION, duration_s=0.5), True),
        (replace(EXCITATION, tones=()), True),
        (replace(EXCITATION, bias_ramp_v_per_s=math.inf), False),
        (replace(EXCITATION, duration_s=-1.0), False),
        (replace(EXCITATION, axis_deg=360.0), True),
        (replace(EXCITATION, axis_deg=-360.0), True),
        (replace(EXCITATION, axis_deg=361.0), False),
        (replace(EXCITATION, axis_deg=-361.0), False),
        (replace(EXCITATION, bias_ramp_v_per_s=-1.0), False),
        (replace(EXCITATION, scale_ramp_per_s=-1.0), False),
        (replace(EXCITATION, bias_ramp_v_per_s=0.0), True),
        (replace(EXCITATION, scale_ramp_per_s=0.0), True),
        (replace(EXCITATION, scale_ramp_per_s=math.nan), False),
    ],
)
def test_bounds_hold_at_their_edges(command, is_permitted):
    assert (permit(command, READY, BOUNDS) is None) is is_permitted


@pytest.mark.parametrize(
    ("command", "is_permitted"),
    [
        (SetScale(0.0), True),
        (SetScale(1.0), True),
        (SetScale(1.001), False),
        (SetScale(-0.001), False),
        (SetScale(math.nan), False),
        (SetBias(50.0), True),
        (SetBias(0.0), True),
        (SetBias(-50.0), True),
        (SetBias(50.01), False),
        (SetBias(-50.01), False),
        (SetBias(math.nan), False),
    ],
)
def test_amplitude_and_bias_are_bounded_and_need_a_running_test(command, is_permitted):
    assert (permit(command, RUNNING, BOUNDS) is None) is is_permitted
    refusal = permit(command, READY, BOUNDS)
    assert refusal is not None
    assert refusal.limit == "energised"


@pytest.mark.parametrize(
    ("facts", "says"),
    [
        ({"writing_allowed": False}, "the verdict does not allow writing"),
        ({"snapshot_taken": False}, "no snapshot of the drive's parameters exists"),
        ({"energised": True}, "parameters are not written while energised"),
    ],
)
def test_writing_needs_a_verdict_a_snapshot_and_a_dead_motor(facts, says):
    allowed = replace(READY, writing_allowed=True)
    assert permit(WriteParameters(GOOD, PLATE), allowed, BOUNDS) is None
    refusal = permit(WriteParameters(GOOD, PLATE), replace(allowed, **facts), BOUNDS)
    assert refusal is not None
    assert refusal.what == says


@pytest.mark.parametrize("field", [field.name for field in fields(InverseGamma)])
@pytest.mark.parametrize("beyond", ["below", "above", "nan", "inf"])
def test_no_value_outside_the_box_is_written(field, beyond):
    low, high = getattr(LOWER, field), getattr(UPPER, field)
    value = {"below": 0.999 * low, "above": 1.001 * high, "nan": math.nan, "inf": math.inf}[beyond]
    wrong = WriteParameters(replace(GOOD, **{field: value}), PLATE)
    refusal = permit(wrong, replace(READY, writing_allowed=True), BOUNDS)
    assert refusal is not None
    assert refusal.what == f"{field} is outside its limits"


@pytest.mark.parametrize("edge", [LOWER, UPPER])
def test_values_on_the_edge_of_the_box_are_written(edge):
    assert permit(WriteParameters(edge, PLATE), replace(READY, writing_allowed=True), BOUNDS) is None


def test_facts_follow_what_the_drive_answered():
    facts = SafetyFacts()
    assert after(ArmWatchdog(0.5), facts).watchdog_s == 0.5
    assert after(LIMITS, facts).drive_limits is LIMITS
    assert after(EXCITATION, facts).loaded is EXCITATION
    assert after(TakeSnapshot(), facts).snapshot_taken
    assert after(Enable("x"), facts).energised
    assert after(Identify(), facts) == facts
    off = after(Disarm("x"), RUNNING)
    assert not off.energised
    assert off.loaded is None
    assert off.watchdog_s == RUNNING.watchdog_s


def test_each_enable_needs_its_own_excitation():
    facts = after(Disarm("done"), RUNNING)
    assert permit(Enable("again"), facts, BOUNDS) is not None


def test_a_test_of_less_than_no_time_is_refused():
    assert permit(Enable("short"), replace(READY, loaded=replace(EXCITATION, duration_s=-0.5)), BOUNDS) is not None
    assert permit(replace(EXCITATION, duration_s=-0.5), READY, BOUNDS) is not None


@pytest.mark.parametrize("field", ["current_a", "voltage_v", "time_s"])
def test_a_limit_below_zero_is_not_set_in_the_drive(field):
    assert permit(replace(LIMITS, **{field: -0.5}), replace(READY, energised=False), BOUNDS) is not None


def test_a_short_first_test_is_permitted():
    assert permit(Enable("short"), replace(READY, loaded=replace(EXCITATION, duration_s=0.5)), BOUNDS) is None


def test_a_run_begins_with_nothing_known_and_nothing_allowed():
    assert SafetyFacts() == SafetyFacts(
        watchdog_s=None, drive_limits=None, loaded=None, checks_passed=False, snapshot_taken=False,
        writing_allowed=False, energised=False, energised_s=0.0, run_ended=False,
    )  # fmt: skip


@pytest.mark.parametrize("command", [Identify(), Fetch(), SetScale(0.5), SetBias(1.0), Tell("x"), Wait(0.0)])
def test_a_command_that_proves_nothing_changes_no_fact(command):
    assert after(command, RUNNING) == RUNNING


@pytest.mark.parametrize("record", [BOUNDS, READY, Refusal("what", 1, 0)])
def test_nobody_can_change_bounds_facts_or_a_refusal(record):
    with pytest.raises(FrozenInstanceError):
        setattr(record, next(iter(record.__dataclass_fields__)), 99.0)


@pytest.mark.parametrize(
    ("seconds", "facts", "says"),
    [
        (0.0, RUNNING, None),
        (20.0, RUNNING, None),
        (20.001, RUNNING, "time without samples is outside its limits"),
        (-0.001, RUNNING, "time without samples is outside its limits"),
        (1.0, READY, "nothing is energised"),
    ],
)
def test_only_an_energised_motor_is_supervised_without_samples_and_no_longer_than_a_test(seconds, facts, says):
    refusal = permit(Supervise(seconds), facts, BOUNDS)
    assert (None if refusal is None else refusal.what) == says
