"""The closing stretch of a multitone test: the same tones, small, on a DC bias above their peak."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

from commissioner.identify.excite.bias import CUT_ABOVE, BiasGuard, plan_bias
from commissioner.identify.excite.flux_guard import FluxAdvice
from commissioner.identify.excite.tones import Excitation, ExcitationLimits
from commissioner.procedure.energised.multitone import UnderTest
from commissioner.procedure.energised.session import SinceCommand, along_axis, next_block, tone_period_s
from commissioner.procedure.findings import BiasChosen, GuardActed
from commissioner.procedure.plan import Job
from commissioner.procedure.steps import Findings
from commissioner.safety.commands import Command, SetBias, SetScale, Tell

SECONDS = 1.3
"""Time on the bias, for rotor time constants up to 0.5 s; before it the tones come down."""

COME_DOWN_S = 0.1
"""After the bias was asked for: by then the tones have surely come down."""


def under_bias(
    job: Job, findings: Findings, step: str, axis_deg: float, excitation: Excitation, test: UnderTest, seconds: float
) -> Generator[Command, Any, None]:
    """Tones down, bias on for `seconds`, the flux watched through the current; bias off. Left out where no bias fits, which
    is told."""
    machine = findings.at_worst(findings.estimate) if findings.estimate is not None else None
    limits = ExcitationLimits(test.limit_wb, findings.test_current_a(job), job.test_voltage_v)
    levels = findings.staircases[-1].levels
    plan = None
    if machine is not None and findings.is_measured:
        plan = plan_bias(machine, excitation, limits, levels, tone_period_s(findings))
    if machine is None or plan is None:
        yield Tell(BiasChosen(axis_deg, 0.0, 0.0, 0.0, 0.0, 0.0))
        return
    yield Tell(
        BiasChosen(
            axis_deg, seconds, plan.voltage_v, plan.current_a, plan.scale, plan.peak_flux_wb / test.limit_wb
        )
    )  # fmt: skip
    guard = BiasGuard(
        machine, test.limit_wb, job.link_latency_s, excitation, plan.scale, plan.voltage_v, tone_period_s(findings),
        findings.inverter, axis_deg, test.rotor_flux_wb,
    )  # fmt: skip
    yield SetScale(plan.scale)
    since, has_bias = SinceCommand(), False
    while since.seconds < seconds or not has_bias:
        if since.seconds >= 1.0 / job.scale_ramp_per_s and not has_bias:
            # the tones have come down: both together would pass the current limit
            since, has_bias = SinceCommand(), True
            yield SetBias(plan.voltage_v)
        block = yield from next_block(findings, step, axis_deg)
        since.take(block)
        has_come_down = has_bias and since.seconds > COME_DOWN_S + job.link_latency_s
        test.require_asked(block, plan.scale if has_come_down else None, plan.voltage_v if has_bias else 0.0)
        ends_s = (block.first_index + block.count) * block.sample_period_s
        reached_wb, predicted_wb = guard.advance(along_axis(block) - test.offset_a, ends_s, block.lost_before)
        reading = test.take_biased(block, reached_wb, predicted_wb)
        if test.is_time_to_tell():
            yield Tell(test.update(reading))
        if reading.fraction > CUT_ABOVE:
            findings.guard_acted = True
            yield Tell(
                GuardActed(axis_deg, test.time_s, FluxAdvice.BACK_OFF.name, reading.fraction, 0.0, 0.0)
            )  # fmt: skip
            break
    yield SetBias(0.0)
