"""Rules of what ends a test before anybody relies on it: commands and watchdog, tried with the output on and no voltage.

They come first of all that energise. Where a command or the watchdog does not block the output, nothing else is energised.
"""

from __future__ import annotations

from commissioner.conformance import drive as words
from commissioner.conformance.drive import Drive
from commissioner.conformance.records import Broken, Steps, Wait
from commissioner.conformance.registry import rules_of
from commissioner.conformance.signal import Signal
from commissioner.registers.status import DriveState

RULES, rule = rules_of("The commissioning map: supervision inside the drive", energises=True)

WATCHDOG = 6
ENABLED, DISABLED, FAULT = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED, DriveState.FAULT
WATCHDOG_GRACE_S = 0.15
"""Beyond its time, for the drive's own tick, the link and a busy computer."""
FED_TIMES = 3
"""Of the shortest watchdog time, where it must not bite: a busy computer or converter may pause longer than the shortest."""
VITAL = ("disable-voltage-blocks-at-once", "the-watchdog-bites")
"""Without these two the kit energises nothing more."""


def _watched(drive: Drive, **changes: float) -> Steps[None]:
    yield from drive.enable(Signal(), drive.supervision(**changes))


def _blocked_by(drive: Drive, word: int, name: str, wanted: tuple[DriveState, ...]) -> Steps[None]:
    """Energise, give the command, and see the output off at the next look."""
    yield from _watched(drive)
    yield from drive.stream(60)
    yield from drive.command(word)
    seen = yield from drive.state()
    if seen not in wanted:
        raise Broken(f"after '{name}' the drive is '{seen.value}'")


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
    yield from must_have_tripped(drive, WATCHDOG, f"{waited_s:.2f} s without a heartbeat")
    value = yield from drive.number("trip_value")
    limit = yield from drive.number("trip_limit")
    if limit != shortest or not value >= shortest:
        raise Broken(f"the watchdog of {shortest} ms tripped with value {value:g} and limit {limit:g}")


@rule
def only_a_changed_heartbeat_feeds(drive: Drive) -> Steps[None]:
    """Writing the same heartbeat again does not feed the watchdog: a hung service that repeats itself is dead."""
    waited_s = yield from _bite(drive, 1)
    yield from must_have_tripped(drive, WATCHDOG, f"{waited_s:.2f} s with one and the same heartbeat")


@rule
def a_fed_watchdog_does_not_bite(drive: Drive) -> Steps[None]:
    """With changing heartbeats the test outlasts the watchdog's time."""
    shortest, longest = drive.watchdog_range_ms
    time_ms = min(FED_TIMES * shortest, longest)
    yield from _watched(drive, watchdog_ms=time_ms)
    for _ in range(round(2.2e-3 * time_ms / 0.02)):
        yield from drive.beat()
        yield Wait(0.02)
    seen = yield from drive.state()
    if seen is not ENABLED:
        raise Broken(f"fed every 20 ms, a watchdog of {time_ms} ms ended the test: '{seen.value}'")


def must_have_tripped(drive: Drive, cause: int, by: str) -> Steps[None]:
    """Fault state, code and cause."""
    seen = yield from drive.state()
    if seen is not FAULT:
        raise Broken(f"{by} left the drive '{seen.value}', wanted a fault")
    code, kept = (yield from drive.number("fault_code")), (yield from drive.number("trip_cause"))
    if (code, kept) != (cause, cause):
        raise Broken(f"{by}: fault_code {code:g}, trip_cause {kept:g}, wanted {cause}")
