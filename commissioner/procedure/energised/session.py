"""What both energised steps share: blocks kept as they come, the sensors' offset, the ramp down."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

import numpy as np

from commissioner.errors import Aborted
from commissioner.motor.nameplate import prior
from commissioner.motor.space_vector import axis_current_a
from commissioner.procedure.plan import Job
from commissioner.procedure.steps import Findings
from commissioner.records import SampleBlock, Signal
from commissioner.safety.commands import Command, Fetch, LoadExcitation, Wait

BIAS_RAMP_PER_S = 4.0
"""The drive's bias ramp in test voltages per second: a DC level is reached in a few hundredths of a second."""
OFFSET_S = 0.1
"""Enabled without voltage before each test: what the current sensors show then is their offset."""
LEFT = 0.1
"""Of its flux: what a test with tones may find in the rotor. Half a second after a staircase a motor with a rotor time constant of 0.45 s
still held 0.27 of the limit, which the guard did not know: 1.05 of the limit was reached."""
REST_STEP_S = 0.5


def tone_period_s(findings: Findings) -> float:
    """Of a sample of a test with tones."""
    assert findings.identity is not None
    return findings.identity.control_period_s * findings.link.of_tones


def load(
    job: Job, findings: Findings, axis_deg: float, tones: tuple[tuple[float, float, float], ...]
) -> LoadExcitation:
    """A session's signal; its samples are what the link can carry."""
    bias_ramp_v_per_s = BIAS_RAMP_PER_S * job.test_voltage_v
    link = findings.link
    averaged = link.of_tones if tones else link.averaged
    return LoadExcitation(
        axis_deg, tones, bias_ramp_v_per_s, job.scale_ramp_per_s, job.axis_time_s, link.channels, averaged
    )


def rest(job: Job, findings: Findings) -> Generator[Command, Any, None]:
    """De-energised, until the rotor has lost what the test before has left in it: exp(-t / T_R) of that flux is `LEFT`, the ramp to
    zero before and the zero volts after counted in. A fast motor needs none, nor one that was not energised before."""
    if not findings.blocks:
        return
    machine = findings.estimate or prior(job.nameplate).typical
    left_s = -math.log(LEFT) * machine.rotor_time_constant_s - 1.0 / BIAS_RAMP_PER_S - OFFSET_S
    while left_s > 0.0:
        yield Wait(min(left_s, REST_STEP_S))
        left_s -= REST_STEP_S


def next_block(findings: Findings, step: str, axis_deg: float) -> Generator[Command, Any, SampleBlock]:
    """The next block of the session, kept for the judgement. A drive that stops by itself ends the run."""
    block: SampleBlock | None = yield Fetch()
    if block is None:
        raise Aborted(
            "the drive ended the test by itself", step=f"{step}, axis {axis_deg:g} deg", value="session ended",
            limit="the whole test", remedy="check the drive's own time limit and its status",
        )  # fmt: skip
    findings.blocks.append((findings.segment, block))
    findings.axis_s += duration_s(block)
    return block


def measure_offset(findings: Findings, step: str, axis_deg: float) -> Generator[Command, Any, float]:
    """Mean current along the axis while the drive is enabled and commands nothing."""
    seen = np.zeros(0)
    while (seen.size + 1) * period_s(findings) < OFFSET_S:
        block = yield from next_block(findings, step, axis_deg)
        seen = np.append(seen, along_axis(block))
    return float(np.mean(seen))


def ramp_down(findings: Findings, step: str, axis_deg: float, seconds: float) -> Generator[Command, Any, None]:
    """Fetch until the drive's ramp has reached zero, so that the motor is left without a jerk."""
    since = SinceCommand()
    while since.seconds < seconds:
        since.take((yield from next_block(findings, step, axis_deg)))


@dataclass
class SinceCommand:
    """The motor time that has surely passed, at the end of the newest block, since the last command took effect.

    A command has taken effect when its answer is here, and so before the next block is; that block's last sample may be
    older than the command, by its age at the most. Late samples so let no command overtake what it was based on.
    """

    seconds: float = 0.0
    _has_begun: bool = False

    def take(self, block: SampleBlock) -> None:
        if self._has_begun:
            self.seconds += duration_s(block)
        else:
            self._has_begun, self.seconds = True, -block.age_s


def duration_s(block: SampleBlock) -> float:
    """Motor time the block stands for, what was lost before it included."""
    return (block.count + block.lost_before) * block.sample_period_s


def along_axis(block: SampleBlock) -> Signal:
    return axis_current_a(block.current_u_a, block.current_v_a, block.current_w_a, block.axis_deg)


def period_s(findings: Findings) -> float:
    """Of a sample, which is a mean over some control periods on a slow link."""
    assert findings.identity is not None
    return findings.identity.control_period_s * findings.link.averaged
