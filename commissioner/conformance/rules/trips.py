"""Rules of the limits that end a test, of faults and of their reset."""

from __future__ import annotations

from commissioner.conformance import drive as words
from commissioner.conformance.drive import Drive
from commissioner.conformance.records import Broken, Steps
from commissioner.conformance.registry import rules_of
from commissioner.conformance.rules.stopping import must_have_tripped
from commissioner.conformance.signal import Signal
from commissioner.registers.status import DriveState

RULES, rule = rules_of("The commissioning map: supervision inside the drive", energises=True)

OVERCURRENT, TIME_LIMIT = 1, 7
ENABLED, DISABLED, FAULT = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED, DriveState.FAULT


def _watched(drive: Drive, **changes: float) -> Steps[None]:
    drive.needs_level()
    yield from drive.enable(Signal(bias_v=drive.level_v), drive.supervision(**changes))


@rule
def too_much_current_trips(drive: Drive) -> Steps[None]:
    """A current beyond the current limit, in whichever phase, blocks the output and says value and limit."""
    drive.needs_level()
    limit_a = 0.7 * drive.test_current_a
    for axis_deg in (0.0, 120.0, 240.0):
        signal = Signal(axis_deg=axis_deg, bias_v=drive.level_v)
        yield from drive.enable(signal, drive.supervision(current_limit_a=limit_a))
        yield from drive.stream(3000)
        yield from must_have_tripped(
            drive, OVERCURRENT, f"1.4 times the current limit of {limit_a:.3g} A at {axis_deg:g} degrees"
        )
        value, limit = yield from drive.numbers("trip_value", "trip_limit")
        if not abs(limit - limit_a) < 1e-3 * limit_a or not limit_a < value < 2.0 * limit_a:
            raise Broken(f"tripped with value {value:g} and limit {limit:g}; the limit set was {limit_a:g}")
        yield from drive.make_safe()


@rule
def the_time_limit_trips(drive: Drive) -> Steps[None]:
    """When the test-time limit is reached the drive blocks its output, as a fault that says why."""
    limit_s = 0.2
    yield from _watched(drive, test_time_limit_s=limit_s)
    period_s = yield from drive.number("control_period_s")
    yield from drive.stream(round(1.0 / period_s))
    yield from must_have_tripped(drive, TIME_LIMIT, f"a test-time limit of {limit_s:g} s")
    lasted_s = (yield from drive.number("samples_produced")) * period_s
    if abs(lasted_s - limit_s) > 0.02:
        raise Broken(f"a test-time limit of {limit_s:g} s ended the test after {lasted_s:.3f} s")


def _tripped(drive: Drive) -> Steps[None]:
    """A fault on purpose: the shortest test-time limit."""
    yield from _watched(drive, test_time_limit_s=0.05)
    yield from drive.stream(5000)
    yield from drive.must_reach(FAULT, "the test-time limit")


@rule
def a_fault_needs_a_reset(drive: Drive) -> Steps[None]:
    """A fault stays, whatever the commands, until the reset bit rises; a reset bit that stays set resets no later fault."""
    yield from _tripped(drive)
    yield from drive.walk_to_enabled()
    seen = yield from drive.reaches(ENABLED, polls=2)
    if seen is not FAULT:
        raise Broken(f"a fault was left without a reset: '{seen.value}'")
    yield from drive.command(words.RESET_FAULT)
    yield from drive.must_reach(DISABLED, "a fault reset")
    code = yield from drive.number("fault_code")
    if code:
        raise Broken(f"fault_code is {code:g} after the reset")
    yield from _resets_no_later_fault(drive)


def _resets_no_later_fault(drive: Drive) -> Steps[None]:
    """The reset bit stays set through an enable and a new trip: nobody has asked for that fault to be forgotten."""
    yield from drive.set_up(Signal(bias_v=drive.level_v), drive.supervision(test_time_limit_s=0.05))
    yield from drive.walk_to_enabled(held=words.RESET_FAULT)
    yield from drive.stream(5000)
    yield from drive.must_reach(FAULT, "the test-time limit")
    yield from drive.command(words.RESET_FAULT)
    seen = yield from drive.reaches(DISABLED, polls=2)
    if seen is not FAULT:
        raise Broken(f"a reset bit that had stayed set reset a later fault: '{seen.value}'")


@rule
def the_trip_cause_outlives_the_reset(drive: Drive) -> Steps[None]:
    """What tripped stays readable after the reset, until the next enable."""
    yield from _tripped(drive)
    yield from drive.command(words.RESET_FAULT)
    yield from drive.must_reach(DISABLED, "a fault reset")
    after_reset = yield from drive.number("trip_cause")
    yield from _watched(drive)
    enabled = yield from drive.number("trip_cause")
    if after_reset != TIME_LIMIT or enabled:
        raise Broken(
            f"trip_cause is {after_reset:g} after the reset (wanted {TIME_LIMIT}) and {enabled:g} after the next enable"
        )
