"""Rules of what ends a test: commands, watchdog, limits; and of faults and their reset."""

from __future__ import annotations

from commissioner.conformance import drive as words
from commissioner.conformance.drive import Drive
from commissioner.conformance.records import Broken, Steps, Wait
from commissioner.conformance.registry import rules_of
from commissioner.conformance.signal import Signal
from commissioner.registers.status import DriveState

RULES, rule = rules_of("The commissioning map: supervision inside the drive", energises=True)

OVERCURRENT, WATCHDOG, TIME_LIMIT = 1, 6, 7
ENABLED, DISABLED, FAULT = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED, DriveState.FAULT
WATCHDOG_GRACE_S = 0.15
"""Beyond its time, for the drive's own tick, the link and a busy computer."""


def _watched(drive: Drive, **changes: float) -> Steps[None]:
    drive.needs_level()
    yield from drive.enable(Signal(bias_v=drive.level_v), drive.supervision(**changes))


def _blocked_by(drive: Drive, word: int, name: str, wanted: tuple[DriveState, ...]) -> Steps[None]:
    """Energise, give the command, and see the output off at the next look."""
    yield from _watched(drive)
    yield from drive.stream(60)
    yield from drive.command(word)
    seen = yield from drive.state()
    if seen not in wanted:
        raise Broken(f"after '{name}' the drive is '{seen.value}'")
    window = yield from drive.window(0)
    if window.flags & drive.layout.flags["running"]:
        raise Broken(f"after '{name}' the sample window still says running")


@rule
def disable_voltage_blocks_at_once(drive: Drive) -> Steps[None]:
    """The command disable voltage blocks an energised output at once."""
    yield from _blocked_by(drive, words.DISABLE_VOLTAGE, "disable voltage", (DISABLED,))


@rule
def quick_stop_blocks_at_once(drive: Drive) -> Steps[None]:
    """The command quick stop blocks an energised output at once."""
    yield from _blocked_by(drive, words.QUICK_STOP, "quick stop", (DISABLED,))


@rule
def shut_down_blocks_at_once(drive: Drive) -> Steps[None]:
    """The command shut down blocks an energised output at once."""
    yield from _blocked_by(drive, words.SHUTDOWN, "shut down", (DriveState.READY_TO_SWITCH_ON, DISABLED))


def _bite(drive: Drive, beat: int | None) -> Steps[float]:
    """Starve the watchdog, or feed it one and the same heartbeat; when the fault was seen (s after the last feeding)."""
    shortest, _ = drive.watchdog_range_ms
    yield from _watched(drive, watchdog_ms=shortest)
    yield from drive.beat()
    waited_s, step_s = 0.0, 0.02
    while waited_s < 1e-3 * shortest + WATCHDOG_GRACE_S:
        if beat is not None:
            yield from drive.put({"heartbeat": drive.heartbeat})
        yield Wait(step_s)
        waited_s += step_s
        if (yield from drive.state()) is FAULT:
            return waited_s
    return waited_s


@rule
def the_watchdog_bites(drive: Drive) -> Steps[None]:
    """Without heartbeats the drive blocks its output by itself within the watchdog's time, as a fault that says why."""
    shortest, _ = drive.watchdog_range_ms
    waited_s = yield from _bite(drive, None)
    yield from _must_have_tripped(drive, WATCHDOG, f"{waited_s:.2f} s without a heartbeat")
    value = yield from drive.number("trip_value")
    limit = yield from drive.number("trip_limit")
    if limit != shortest or not value >= shortest:
        raise Broken(f"the watchdog of {shortest} ms tripped with value {value:g} and limit {limit:g}")


@rule
def only_a_changed_heartbeat_feeds(drive: Drive) -> Steps[None]:
    """Writing the same heartbeat again does not feed the watchdog: a hung service that repeats itself is dead."""
    waited_s = yield from _bite(drive, 1)
    yield from _must_have_tripped(drive, WATCHDOG, f"{waited_s:.2f} s with one and the same heartbeat")


@rule
def a_fed_watchdog_does_not_bite(drive: Drive) -> Steps[None]:
    """With changing heartbeats the test outlasts the watchdog's time."""
    shortest, _ = drive.watchdog_range_ms
    yield from _watched(drive, watchdog_ms=shortest)
    for _ in range(round(2.2e-3 * shortest / 0.02)):
        yield from drive.beat()
        yield Wait(0.02)
    seen = yield from drive.state()
    if seen is not ENABLED:
        raise Broken(f"fed every 20 ms, a watchdog of {shortest} ms ended the test: '{seen.value}'")


@rule
def too_much_current_trips(drive: Drive) -> Steps[None]:
    """A current beyond the current limit, in whichever phase, blocks the output and says value and limit."""
    drive.needs_level()
    limit_a = 0.7 * drive.test_current_a
    for axis_deg in (0.0, 120.0, 240.0):
        signal = Signal(axis_deg=axis_deg, bias_v=drive.level_v)
        yield from drive.enable(signal, drive.supervision(current_limit_a=limit_a))
        yield from drive.stream(3000)
        yield from _must_have_tripped(
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
    yield from _must_have_tripped(drive, TIME_LIMIT, f"a test-time limit of {limit_s:g} s")
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


def _must_have_tripped(drive: Drive, cause: int, by: str) -> Steps[None]:
    """Fault state, code and cause, and a sample window that no longer runs."""
    seen = yield from drive.state()
    if seen is not FAULT:
        raise Broken(f"{by} left the drive '{seen.value}', wanted a fault")
    code, kept = (yield from drive.number("fault_code")), (yield from drive.number("trip_cause"))
    if (code, kept) != (cause, cause):
        raise Broken(f"{by}: fault_code {code:g}, trip_cause {kept:g}, wanted {cause}")
    window = yield from drive.window(0)
    if window.flags & drive.layout.flags["running"]:
        raise Broken(f"{by}: the output is blocked and the sample window says running")
