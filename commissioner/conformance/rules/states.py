"""Rules of command and state that need no voltage at the motor."""

from __future__ import annotations

from commissioner.conformance import drive as words
from commissioner.conformance.drive import Drive
from commissioner.conformance.records import Broken, Steps
from commissioner.conformance.registry import rules_of
from commissioner.registers.status import DriveState

RULES, rule = rules_of("The commissioning map: command and state")

DISABLED, READY, SWITCHED_ON = DriveState.SWITCH_ON_DISABLED, DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON
OFF_ITEMS = ("current_magnitude_a", "present_scale", "present_bias_v", "test_time_left_s")


@rule
def states_follow_the_commands(drive: Drive) -> Steps[None]:
    """Shut down, switch on, shut down again and disable voltage lead through ready and switched on and back."""
    steps = (
        (words.DISABLE_VOLTAGE, DISABLED, "disable voltage"),
        (words.SHUTDOWN, READY, "shut down"),
        (words.SWITCH_ON, SWITCHED_ON, "switch on"),
        (words.SHUTDOWN, READY, "shut down"),
        (words.DISABLE_VOLTAGE, DISABLED, "disable voltage"),
    )
    for word, wanted, name in steps:
        yield from drive.command(word)
        yield from drive.must_reach(wanted, name)


@rule
def switching_on_needs_a_shut_down_before(drive: Drive) -> Steps[None]:
    """From switch-on disabled the command to switch on leads nowhere."""
    yield from drive.command(words.DISABLE_VOLTAGE)
    yield from drive.must_reach(DISABLED, "disable voltage")
    yield from drive.command(words.SWITCH_ON)
    seen = yield from drive.reaches(SWITCHED_ON, polls=4)
    yield from drive.command(words.DISABLE_VOLTAGE)
    if seen is not DISABLED:
        raise Broken(f"'switch on' led from switch-on disabled to '{seen.value}'")


@rule
def quick_stop_disables(drive: Drive) -> Steps[None]:
    """Quick stop leads from ready to switch-on disabled."""
    yield from drive.command(words.SHUTDOWN)
    yield from drive.must_reach(READY, "shut down")
    yield from drive.command(words.QUICK_STOP)
    yield from drive.must_reach(DISABLED, "quick stop")


@rule
def at_rest_nothing_runs(drive: Drive) -> Steps[None]:
    """While the output is off, current, scale, bias and remaining time read zero and no fault stands."""
    yield from drive.command(words.DISABLE_VOLTAGE)
    yield from drive.must_reach(DISABLED, "disable voltage")
    for name in OFF_ITEMS:
        value = yield from drive.number(name)
        if value != 0.0:
            raise Broken(f"{name} is {value:g} while the output is off")
    code = yield from drive.number("fault_code")
    if code:
        raise Broken(f"fault_code is {code:g} in switch-on disabled")
