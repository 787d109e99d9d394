"""A run of well under a second: the product's own steps and guard, short tests, and a verdict given from outside.

The excitation comes from the design once and is then made too strong by `strength`; the voltage that the staircase is said
to have needed for a current, from which the DC bias is chosen, by its square: the guards have work.
"""

from __future__ import annotations

import functools
from collections.abc import Generator
from dataclasses import dataclass, replace
from typing import Any

from commissioner.identify.excite import tones as excitation
from commissioner.identify.excite.tones import DesignedExcitation, ExcitationLimits
from commissioner.identify.inverter.staircase import IDEAL_INVERTER, DcLevel, Staircase, fit_staircase
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import Nameplate, prior, rated_flux
from commissioner.procedure.energised.excite import _test
from commissioner.procedure.findings import RunEnded, StateEntered, VerdictReached
from commissioner.procedure.plan import Acceptance, ExcitationPlan, Job, Limits, ProcedurePlan, Supervision
from commissioner.procedure.states import Event, State
from commissioner.procedure.steps import Findings, check, connect
from commissioner.safety import commands as ask
from commissioner.settings import load_motor

WATCHDOG_S, REPLY_TIMEOUT_S = 0.25, 0.06
NEW_SI = (3.7, 2.2, 0.021, 0.23)
NEW_ON_THE_WIRE = (3.7, 2.2, 21.0, 230.0)
OLD_ON_THE_WIRE = (3.2, 1.8, 26.0, 200.0)
DECISIONS = ("write back", "keep", "reject")
BIAS_S = 0.3

PLAN = ProcedurePlan(
    axes_deg=(0.0, 60.0),
    repeat_first=False,
    supervision=Supervision(WATCHDOG_S, 0.5, 0.01, REPLY_TIMEOUT_S),
    limits=Limits(current_fraction=0.9, trip_fraction=1.4, flux_fraction=0.9, axis_time_s=1.2, total_time_s=4.0),
    excitation=ExcitationPlan(seconds=0.3, staircase_seconds=1.0, first_scale=0.4, scale_ramp_per_s=10.0),
    acceptance=Acceptance(1.0, 2.0, 3.0, 3.0, 6.0),
)


@dataclass(frozen=True)
class Script:
    """`decision` of the verdict; whether the tests end on a DC bias; `rogue`: what a defective procedure does, before its
    `rogue_at`-th command."""

    decision: str = "write back"
    tests: int = 1
    strength: float = 1.0
    rogue: str = ""
    rogue_at: int = 0
    is_biased: bool = False


@functools.cache
def plate() -> Nameplate:
    return load_motor("motor_2kw2")


ROGUES: dict[str, ask.Command | Exception] = {
    "waits": ask.Wait(5.0),
    "slow watchdog": ask.ArmWatchdog(1.9),
    "loose limits": ask.SetDriveLimits(100.0, 300.0, 60.0),
    "too much scale": ask.SetScale(1.7),
    "too much bias": ask.SetBias(500.0),
    "not a number": ask.SetBias(float("nan")),
    "too many volts": ask.LoadExcitation(0.0, ((300.0, 2.0, 0.0),), 100.0, 10.0, 0.5),
    "enables again": ask.Enable("rogue"),
    "writes unasked": ask.WriteParameters(InverseGamma(*NEW_SI), plate()),
    "defect": ZeroDivisionError("a defect of the procedure"),
}
"""What no procedure should ever do; whether it is refused depends on the moment."""


@functools.cache
def _designed() -> DesignedExcitation:
    known = replace(prior(plate()).typical, stator_resistance_ohm=NEW_SI[0])
    limits = ExcitationLimits(PLAN.limits.flux_fraction * rated_flux(plate(), NEW_SI[0]).stator_peak_wb, 6.0, 90.0)
    return excitation.design(known, limits, 2e-4, IDEAL_INVERTER, 1.0)


def _stronger(chosen: DesignedExcitation, factor: float) -> DesignedExcitation:
    tones = tuple(replace(tone, amplitude_v=factor * tone.amplitude_v) for tone in chosen.excitation.tones)
    return replace(chosen, excitation=replace(chosen.excitation, tones=tones))


def _levels(axis_deg: float, strength: float) -> Staircase:
    """What a staircase tells of a drive without losses, its voltages too high."""
    return fit_staircase([DcLevel(strength**2 * NEW_SI[0] * i, i, 1e-3) for i in (1.0, 2.0, 4.0, -2.0)], axis_deg)


def short_course(script: Script, job: Job, findings: Findings) -> Generator[ask.Command, Any, RunEnded]:
    """The commands of a short run; a rogue script puts one in that does not belong."""
    steps, reply, number = _steps(script, job, findings), None, 0
    while True:
        try:
            command = steps.send(reply)
        except StopIteration as stop:
            return stop.value  # type: ignore[no-any-return]
        if script.rogue and number == script.rogue_at:
            rogue = ROGUES[script.rogue]
            if isinstance(rogue, Exception):
                raise rogue
            yield rogue
        number += 1
        reply = yield command


def _steps(script: Script, job: Job, findings: Findings) -> Generator[ask.Command, Any, RunEnded]:
    yield _entered(State.CONNECTING, Event.START)
    yield from connect(job, findings)
    yield _entered(State.CHECKING, Event.IDENTIFIED)
    yield from check(job, findings)
    known = replace(prior(job.nameplate).typical, stator_resistance_ohm=NEW_SI[0])
    chosen, seconds = _stronger(_designed(), script.strength), PLAN.excitation.seconds
    for axis_deg in PLAN.axes_deg[: script.tests]:
        findings.estimate, findings.is_measured = known, True
        findings.staircases.append(_levels(axis_deg, script.strength))
        yield _entered(State.EXCITING, Event.RESISTANCE_KNOWN)
        bias_s = BIAS_S if script.is_biased else 0.0
        yield from _test(job, findings, axis_deg, chosen, seconds, seconds, is_look=True, bias_s=bias_s)
        findings.tests_done += 1
    yield _entered(State.JUDGING, Event.AXES_DONE)
    yield ask.Tell(VerdictReached(script.decision, "the script says so", None, None, ""))
    if script.decision == "reject":
        return RunEnded(State.REJECTED.value, "the script says so", 0.0)
    if script.decision == "write back":
        yield _entered(State.WRITING, Event.WRITE_BACK)
        yield ask.WriteParameters(InverseGamma(*NEW_SI), job.nameplate)
    return RunEnded(State.COMMISSIONED.value, "the script says so", 0.0)


def _entered(state: State, because: Event) -> ask.Tell:
    return ask.Tell(StateEntered(state.value, because.value))
