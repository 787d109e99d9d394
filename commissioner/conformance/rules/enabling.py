"""Rules of enabling: what must hold before the output goes on. The first one finds the voltage the others use."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from commissioner.conformance import drive as words
from commissioner.conformance.drive import Drive
from commissioner.conformance.records import Broken, Steps
from commissioner.conformance.registry import rules_of
from commissioner.conformance.signal import Real, Signal
from commissioner.registers.codec import Value
from commissioner.registers.status import DriveState

RULES, rule = rules_of("The commissioning map: supervision inside the drive", energises=True)

LOOK_V_PER_S = 40.0
LARGEST_LINK_FRACTION = 0.15
"""No bias beyond this part of the DC link is tried."""
MOST_WINDOWS = 20000
SETTLE_S = 0.4
"""The current still rises behind a ramped voltage: some rotor time constants of a small motor."""
ENABLED = DriveState.OPERATION_ENABLED


@rule
def a_bias_drives_a_current(drive: Drive) -> Steps[None]:
    """A slowly rising direct voltage along the axis drives a direct current: the level of every later test."""
    link_v = yield from drive.number("dc_link_v")
    highest_v = LARGEST_LINK_FRACTION * link_v
    signal = Signal(bias_v=highest_v, bias_ramp_v_per_s=LOOK_V_PER_S, duration_s=2 * highest_v / LOOK_V_PER_S)
    supervision = replace(drive.supervision(), voltage_limit_v=1.5 * highest_v)
    yield from drive.enable(signal, supervision)
    scales, index, found_v = (yield from drive.scales()), 0, 0.0
    for _ in range(MOST_WINDOWS):
        window = yield from drive.window(index)
        index = window.first + window.count
        if window.flags & drive.layout.flags["ended"]:
            break
        if len(window.data) and _peak(window.data[-1:], scales["current_scale_a"]) >= drive.test_current_a:
            found_v = float(window.data[-1, 0]) * scales["voltage_scale_v"]
            break
    yield from drive.stop()
    if not 0.0 < found_v <= highest_v:
        raise Broken(f"no {drive.test_current_a:.2g} A at up to {highest_v:.0f} V along the axis, at {found_v:.3g} V")
    samples = round(SETTLE_S / scales["control_period_s"])
    settled = yield from drive.recorded(Signal(bias_v=found_v), samples, supervision)
    steady_a = float(np.median(np.abs(settled[-100:, 1:]).max(axis=1))) * scales["current_scale_a"]
    drive.level_v, drive.test_current_a = found_v, max(drive.test_current_a, steady_a)


def _peak(data: Real, scale_a: float) -> float:
    """Largest phase current (A) of the samples."""
    return float(np.abs(data[:, 1:]).max(initial=0.0)) * scale_a


def _must_stay_off(drive: Drive, changes: Mapping[str, Value], without: str) -> Steps[None]:
    """Set everything up, take one thing away, and walk: the output must stay off."""
    drive.needs_level()
    yield from drive.set_up(Signal(bias_v=drive.level_v), drive.supervision())
    yield from drive.put(changes)
    before = yield from drive.number("session_id")
    yield from drive.walk_to_enabled()
    seen = yield from drive.reaches(ENABLED, polls=2)
    yield from drive.command(words.DISABLE_VOLTAGE)
    after = yield from drive.number("session_id")
    if seen.may_be_energised or seen is DriveState.FAULT or after != before:
        raise Broken(f"the drive enables without {without}: '{seen.value}', session {before:g}, then {after:g}")


@rule
def no_enable_without_watchdog(drive: Drive) -> Steps[None]:
    """With the watchdog at 0 the drive does not enable."""
    yield from _must_stay_off(drive, {"watchdog_ms": 0}, "a watchdog")


@rule
def no_enable_without_current_limit(drive: Drive) -> Steps[None]:
    """With the current limit at 0 the drive does not enable."""
    yield from _must_stay_off(drive, {"current_limit_a": 0.0}, "a current limit")


@rule
def no_enable_without_time_limit(drive: Drive) -> Steps[None]:
    """With the test-time limit at 0 the drive does not enable."""
    yield from _must_stay_off(drive, {"test_time_limit_s": 0.0}, "a test-time limit")


@rule
def no_enable_without_voltage_limit(drive: Drive) -> Steps[None]:
    """With the voltage limit at 0 the drive does not enable."""
    yield from _must_stay_off(drive, {"voltage_limit_v": 0.0}, "a voltage limit")


@rule
def no_enable_without_duration(drive: Drive) -> Steps[None]:
    """With a duration of 0 the drive does not enable."""
    yield from _must_stay_off(drive, {"duration_s": 0.0}, "a duration")


@rule
def no_enable_without_the_mode(drive: Drive) -> Steps[None]:
    """Without the single-axis mode chosen the drive does not enable."""
    yield from _must_stay_off(drive, {"mode": 0}, "the single-axis mode")


@rule
def no_enable_from_switch_on_disabled(drive: Drive) -> Steps[None]:
    """The enable command alone, from switch-on disabled, leads nowhere."""
    drive.needs_level()
    yield from drive.set_up(Signal(bias_v=drive.level_v), drive.supervision())
    yield from drive.command(words.DISABLE_VOLTAGE)
    yield from drive.must_reach(DriveState.SWITCH_ON_DISABLED, "disable voltage")
    yield from drive.command(words.ENABLE)
    seen = yield from drive.reaches(ENABLED, polls=2)
    yield from drive.command(words.DISABLE_VOLTAGE)
    if seen.may_be_energised:
        raise Broken(f"'enable' led from switch-on disabled to '{seen.value}'")


@rule
def settings_that_need_a_stop_are_refused_while_energised(drive: Drive) -> Steps[None]:
    """While energised, every item that needs a stop refuses a write with exception 6, and the test goes on unchanged."""
    from commissioner.conformance import pdu

    drive.needs_level()
    yield from drive.enable(Signal(bias_v=drive.level_v))
    for item in drive.profile.items.values():
        if not item.needs_stop or "w" not in item.access:
            continue
        yield from drive.beat()
        held = yield from drive.words(item.name)
        each = item.words // item.length
        yield from pdu.refusal(
            pdu.write_pdu(item.address, held[:each]), (pdu.BUSY,), f"write {item.name} while energised"
        )
    seen = yield from drive.state()
    yield from drive.stop()
    if seen is not ENABLED:
        raise Broken(f"a refused write ended the test: '{seen.value}'")


@rule
def every_session_has_its_own_number(drive: Drive) -> Steps[None]:
    """Each enable opens a session with a new number, its samples counted from zero."""
    drive.needs_level()
    seen = [(yield from drive.number("session_id"))]
    produced = []
    for samples in (3000, 40):
        yield from drive.enable(Signal(bias_v=drive.level_v))
        produced.append((yield from drive.number("samples_produced")))
        yield from drive.stream(samples)
        seen.append((yield from drive.number("session_id")))
        yield from drive.stop()
    if len(set(seen)) != len(seen):
        raise Broken(f"session numbers before, first and second enable: {', '.join(f'{n:g}' for n in seen)}")
    if produced[1] >= 3000:
        raise Broken(
            f"{produced[1]:g} samples are there right after an enable: the count of the session before runs on"
        )
