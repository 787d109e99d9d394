"""May this command be sent? The last gate before the wire; every command passes here, whoever asked.

`permit` is a pure function of the command, of what is known to be true of the drive (`SafetyFacts`, built only from the
drive's own answers by `after`) and of the run's bounds. It returns None or the reason for the refusal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

from commissioner.motor.nameplate import ParameterBox
from commissioner.safety.commands import (
    ArmWatchdog,
    Command,
    Disarm,
    Enable,
    LoadExcitation,
    SetBias,
    SetDriveLimits,
    SetScale,
    Supervise,
    TakeSnapshot,
    Wait,
    WriteParameters,
)


@dataclass(frozen=True)
class Bounds:
    """What no command of this run may exceed. Peak values; voltages along the axis."""

    max_watchdog_s: float
    drive_current_a: float
    test_voltage_v: float
    axis_time_s: float
    total_time_s: float
    parameters: ParameterBox


@dataclass(frozen=True)
class SafetyFacts:
    """What the drive has confirmed so far in this run."""

    watchdog_s: float | None = None
    drive_limits: SetDriveLimits | None = None
    loaded: LoadExcitation | None = None
    checks_passed: bool = False
    snapshot_taken: bool = False
    writing_allowed: bool = False
    energised: bool = False
    energised_s: float = 0.0
    """Under voltage, up to the end of the last session."""
    run_ended: bool = False


MORE_TIME = "raise limits.total_time_s, or measure fewer axes"


@dataclass(frozen=True)
class Refusal:
    """Why a command does not go out."""

    what: str
    value: object
    limit: object
    remedy: str = field(default="this is a defect of the procedure: report the run folder")


def permit(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    """None where the command may be sent."""
    if isinstance(command, Disarm):
        return None
    if facts.run_ended:
        return Refusal("the run has ended", type(command).__name__, "no command after the end but Disarm")
    judge = _JUDGES.get(type(command))
    return judge(command, facts, bounds) if judge is not None else None


def after(command: Command, facts: SafetyFacts) -> SafetyFacts:
    """The facts once the drive has carried out `command` and the link has verified it."""
    if isinstance(command, ArmWatchdog):
        return replace(facts, watchdog_s=command.timeout_s)
    if isinstance(command, SetDriveLimits):
        return replace(facts, drive_limits=command)
    if isinstance(command, LoadExcitation):
        return replace(facts, loaded=command)
    if isinstance(command, TakeSnapshot):
        return replace(facts, snapshot_taken=True)
    if isinstance(command, Enable):
        return replace(facts, energised=True)
    if isinstance(command, Disarm):
        return replace(facts, energised=False, loaded=None)
    return facts


def _judge_wait(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, Wait)
    if facts.energised:
        return Refusal("waiting would starve the watchdog", command.seconds, "no wait while energised")
    return _within("wait", command.seconds, 0.0, 60.0)


def _judge_supervise(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, Supervise)
    if not facts.energised:
        return Refusal("nothing is energised", command.seconds, "supervise an energised motor")
    return _within("time without samples", command.seconds, 0.0, bounds.axis_time_s)


def _judge_watchdog(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, ArmWatchdog)
    if facts.energised:
        return Refusal("the watchdog is not touched while energised", command.timeout_s, "de-energised")
    ceiling = bounds.max_watchdog_s if facts.watchdog_s is None else min(facts.watchdog_s, bounds.max_watchdog_s)
    return _within("watchdog time-out", command.timeout_s, 0.1, ceiling)


def _judge_drive_limits(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, SetDriveLimits)
    if facts.energised:
        return Refusal("the drive's limits are not touched while energised", command.current_a, "de-energised")
    return (
        _within("current limit in the drive", command.current_a, 0.0, bounds.drive_current_a)
        or _within("voltage limit in the drive", command.voltage_v, 0.0, bounds.test_voltage_v)
        or _within("time limit in the drive", command.time_s, 0.0, bounds.axis_time_s)
    )


def _judge_excitation(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, LoadExcitation)
    if facts.energised:
        return Refusal("the excitation is not exchanged while energised", command.axis_deg, "de-energised")
    peak = sum(abs(amplitude_v) for amplitude_v, _, _ in command.tones)
    return (
        _within("sum of tone amplitudes", peak, 0.0, bounds.test_voltage_v)
        or _within("duration", command.duration_s, 0.0, bounds.axis_time_s)
        or _within("axis", command.axis_deg, -360.0, 360.0)
        or _within("bias ramp", command.bias_ramp_v_per_s, 0.0, math.inf)
        or _within("scale ramp", command.scale_ramp_per_s, 0.0, math.inf)
    )


def _judge_enable(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    if facts.energised:
        return Refusal("the drive is already energised", "Enable", "de-energised")
    if not facts.checks_passed:
        return Refusal("the pre-energise checks have not passed", "Enable", "all checks passed")
    if facts.watchdog_s is None or facts.watchdog_s > bounds.max_watchdog_s:
        return Refusal("no watchdog is armed", facts.watchdog_s, f"at most {bounds.max_watchdog_s} s")
    if facts.drive_limits is None:
        return Refusal("the drive's own limits are not set", None, "current, voltage and time limit read back")
    if facts.loaded is None:
        return Refusal("no excitation is loaded", None, "an excitation loaded since the last disarm")
    seconds = facts.energised_s + facts.loaded.duration_s
    refusal = _within("energised time of the run", seconds, 0.0, bounds.total_time_s)
    return refusal and replace(refusal, remedy=MORE_TIME)


def _judge_scale(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, SetScale)
    if not facts.energised:
        return Refusal("amplitude is set only while a test runs", command.scale, "energised")
    return _within("amplitude scale", command.scale, 0.0, 1.0)


def _judge_bias(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, SetBias)
    if not facts.energised:
        return Refusal("bias is set only while a test runs", command.bias_v, "energised")
    return _within("bias", abs(command.bias_v), 0.0, bounds.test_voltage_v)


def _judge_write(command: Command, facts: SafetyFacts, bounds: Bounds) -> Refusal | None:
    assert isinstance(command, WriteParameters)
    if facts.energised:
        return Refusal("parameters are not written while energised", "WriteParameters", "de-energised")
    if not facts.snapshot_taken:
        return Refusal("no snapshot of the drive's parameters exists", "WriteParameters", "snapshot archived")
    if not facts.writing_allowed:
        return Refusal("the verdict does not allow writing", "WriteParameters", "verdict: write back")
    circuit, box = command.circuit, bounds.parameters
    limits = zip(fields(circuit), circuit.as_tuple(), box.lower.as_tuple(), box.upper.as_tuple(), strict=True)
    refusals = (_within(number.name, value, low, high) for number, value, low, high in limits)
    return next(filter(None, refusals), None)


def _within(name: str, value: float, low: float, high: float) -> Refusal | None:
    """None where low <= value <= high; NaN and infinity never are."""
    if math.isfinite(value) and low <= value <= high:
        return None
    return Refusal(f"{name} is outside its limits", value, f"{low:g} ... {high:g}")


_JUDGES = {
    Wait: _judge_wait,
    ArmWatchdog: _judge_watchdog,
    SetDriveLimits: _judge_drive_limits,
    LoadExcitation: _judge_excitation,
    Enable: _judge_enable,
    Supervise: _judge_supervise,
    SetScale: _judge_scale,
    SetBias: _judge_bias,
    WriteParameters: _judge_write,
}
