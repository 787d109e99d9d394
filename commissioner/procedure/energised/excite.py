"""The multitone tests: what to drive, a first look at an unknown motor, and one energised session after the other."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import asdict, replace
from typing import Any

from commissioner.errors import DataRefused
from commissioner.identify.analysis import Identification, identify
from commissioner.identify.excite import tones as excitation
from commissioner.identify.excite.flux_guard import FluxAdvice
from commissioner.identify.excite.tones import DesignedExcitation, ExcitationLimits
from commissioner.motor.circuit import SYMBOLS, InverseGamma
from commissioner.motor.nameplate import ParameterBox, believable
from commissioner.motor.plate_match import PlateMismatch, sure_mismatch
from commissioner.procedure.assembly import assemble
from commissioner.procedure.energised.captured import captured
from commissioner.procedure.energised.ceilings import aimed_current_a, for_tones
from commissioner.procedure.energised.closing_bias import SECONDS as BIAS_SECONDS
from commissioner.procedure.energised.closing_bias import under_bias
from commissioner.procedure.energised.multitone import UnderTest, plate_machine, warm_up
from commissioner.procedure.energised.session import (
    OFFSET_S,
    load,
    measure_offset,
    next_block,
    ramp_down,
    rest,
    tone_period_s,
)
from commissioner.procedure.findings import ExcitationChosen, FirstLook, GuardActed
from commissioner.procedure.plan import Job
from commissioner.procedure.states import Event
from commissioner.procedure.steps import Findings, Step, reject
from commissioner.procedure.verdict import Objection
from commissioner.safety.commands import Command, Disarm, Enable, SetScale, Tell

__all__ = ["excite", "warm_up"]

STEP = "multitone test"
LOOK_RESISTANCE_STD = 0.25
"""Of R_s at a look, relative, at the least: at a small current it is tied to what the inverter loses. A look at a quarter of the flux, of a
small motor on a large drive, said 1.46 times R_s, four of its standard errors."""
LOOK_STD = 0.15
"""A value of the first look counts where its relative standard error is below this."""
AXIS_SECONDS = 11.85
"""Energised on one axis, staircase and all, for rotor time constants up to 0.5 s: 12 s at most, and sessions end a block
late."""
SHORTEST = 0.6
"""Of its planned time: what a first test keeps where look and staircase have taken the rest of the axis' time; where not
even that is left beside a bias, the bias is left out."""
FIRST_LOOK = 0.3
"""Share of a test's time spent, the first time, on an excitation chosen from the plate alone."""


BLIND_LOOK = 1.0
"""The same where its samples are downloaded afterwards: its amplitude is what any motor can take, and is never raised."""


def excite(job: Job, findings: Findings) -> Step:
    """The multitone test of one axis; the first axis begins with a look chosen from the plate alone."""
    axis_deg = job.plan.tests_deg[findings.tests_done]
    seconds = job.plan.excitation.seconds * job.stretch
    is_first = findings.tests_done == 0
    if is_first:
        look_s = (BLIND_LOOK if findings.link.captured else FIRST_LOOK) * seconds
        looked = yield from _test(job, findings, axis_deg, _design(job, findings, look_s), look_s, look_s, is_look=True)
        if isinstance(looked, PlateMismatch):
            return (yield from reject(findings, (Objection(**asdict(looked)),)))
        yield from _look(job, findings)
        mismatch = _mismatch(job, findings)
        if mismatch is not None:
            return (yield from reject(findings, (Objection(**asdict(mismatch)),)))
    ramp_s = 1.0 / job.scale_ramp_per_s
    left_s = AXIS_SECONDS * job.stretch - findings.axis_s - OFFSET_S - ramp_s
    bias_s = BIAS_SECONDS * job.stretch
    if not findings.link.captured and left_s - (bias_s + ramp_s) >= SHORTEST * seconds:
        left_s -= bias_s + ramp_s
    else:
        bias_s = 0.0
    seconds = min(seconds, max(left_s, SHORTEST * seconds))
    longest_s = max(seconds, left_s)
    chosen = _design(job, findings, seconds)
    played_s = yield from _test(job, findings, axis_deg, chosen, seconds, longest_s, bias_s=bias_s)
    if isinstance(played_s, PlateMismatch):
        return (yield from reject(findings, (Objection(**asdict(played_s)),)))
    findings.excitations.append(chosen.cut_to(played_s))
    findings.tests_done += 1
    if findings.tests_done == len(job.plan.tests_deg):
        return Event.AXES_DONE
    if is_first:
        yield from _look(job, findings)
    return Event.AXIS_DONE


def _design(job: Job, findings: Findings, seconds: float) -> DesignedExcitation:
    """For the machine and the inverter as far as they are known."""
    machine = findings.estimate or plate_machine(job, findings)
    limits = ExcitationLimits(
        flux_wb=job.flux_limit_wb(findings.resistance_ohm(job)),
        current_a=aimed_current_a(job, findings),
        voltage_v=job.test_voltage_v,
    )
    return excitation.design(machine, limits, tone_period_s(findings), findings.inverter, seconds)


def _look(job: Job, findings: Findings) -> Generator[Command, Any, None]:
    """Batch fit of all that was recorded so far, the motor de-energised meanwhile.

    It separates resistance from the inverter's lost voltage, which design, observer and guard need from here on. Where
    the data say too little, the next test is designed from what was known before.
    """
    recording = assemble(findings.blocks, {}, "first look")
    assert recording is not None
    try:
        look = identify(recording, job.nameplate, "nls", is_final=False)
    except DataRefused:
        return
    findings.look = look
    findings.estimate = _believable(look, plate_machine(job, findings), believable(job.nameplate))
    findings.is_measured = findings.estimate == look.parameters
    error = look.inverter.plateau_v if look.inverter else 0.0
    yield Tell(FirstLook(look.parameters.as_tuple(), look.std, error, look.delay_s[0]))


def _mismatch(job: Job, findings: Findings) -> PlateMismatch | None:
    """Whether the motor that was measured is the plate's, as soon as all four of its values are."""
    look = findings.look
    if look is None or any(s > LOOK_STD * v for v, s in zip(look.parameters.as_tuple(), look.std, strict=True)):
        return None
    resistance_std_ohm = max(look.std[0], LOOK_RESISTANCE_STD * look.parameters.stator_resistance_ohm)
    return sure_mismatch(look.parameters, resistance_std_ohm, job.nameplate)


def _believable(look: Identification, otherwise: InverseGamma, box: ParameterBox) -> InverseGamma:
    """Each value of the look, or the plate's where the look is too uncertain or outside what the plate allows."""
    corners = zip(
        look.parameters.as_tuple(),
        look.std,
        otherwise.as_tuple(),
        box.lower.as_tuple(),
        box.upper.as_tuple(),
        strict=True,
    )
    return InverseGamma(*(v if s < LOOK_STD * v and low <= v <= high else plate for v, s, plate, low, high in corners))


def _test(
    job: Job,
    findings: Findings,
    axis_deg: float,
    chosen: DesignedExcitation,
    seconds: float,
    longest_s: float,
    *,
    is_look: bool = False,
    bias_s: float = 0.0,
) -> Generator[Command, Any, float | PlateMismatch]:
    """One energised multitone session: raise the amplitude as the guard permits, end when the time is up and settled.

    An estimate that has not settled after `seconds` gets more time, up to `longest_s`; then `bias_s` on a DC bias. Returns
    the seconds of tones that were played, or what speaks against this being the plate's motor, the output off.
    """
    tones = tuple((t.amplitude_v, t.frequency_hz, t.phase_rad) for t in chosen.excitation.tones)
    yield Tell(
        ExcitationChosen(
            axis_deg, is_look, tones, seconds, chosen.peak_flux_wb, chosen.peak_current_a,
            dict(zip(SYMBOLS, (100 * s for s in chosen.relative_std), strict=True)),
        )
    )  # fmt: skip
    under_test = UnderTest(job, findings, axis_deg, chosen, seconds)
    yield from rest(job, findings)
    if findings.link.captured:
        yield from captured(job, findings, STEP, axis_deg, tones, under_test, seconds, is_look=is_look)
        return seconds
    yield for_tones(job, findings)
    yield load(job, findings, axis_deg, tones)
    yield Enable(STEP)
    findings.segment += 1
    offset_a = yield from measure_offset(findings, STEP, axis_deg)
    under_test.begin(offset_a)
    yield SetScale(under_test.scale)
    while not under_test.is_done(longest_s):
        block = yield from next_block(findings, STEP, axis_deg)
        reading = under_test.take(block)
        overdrawn = under_test.overdrawn(reading)
        if overdrawn is not None:
            yield Disarm(overdrawn.what)
            return overdrawn
        wanted = under_test.answer(reading)
        if wanted is not None:
            if reading.advice is FluxAdvice.BACK_OFF:
                findings.guard_acted = True
                yield Tell(
                    GuardActed(
                        axis_deg, under_test.time_s, reading.advice.name, reading.fraction, reading.current_fraction,
                        wanted,
                    )
                )  # fmt: skip
            yield SetScale(wanted)
        if under_test.is_time_to_tell():
            yield Tell(under_test.update(reading))
    finished = under_test.finished(is_look=is_look)
    if bias_s > 0.0:
        yield from under_bias(job, findings, STEP, axis_deg, chosen.excitation, under_test, bias_s)
    yield SetScale(0.0)
    yield from ramp_down(findings, STEP, axis_deg, 1.0 / job.scale_ramp_per_s)
    yield Disarm("test done")
    yield Tell(replace(finished, energised_s=under_test.time_s, peak_flux_fraction=under_test.peak_fraction))
    return finished.energised_s
