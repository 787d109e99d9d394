"""A test with tones over a link that does not carry its samples: the drive keeps them, they are downloaded afterwards.

Nobody sees a sample while the motor is energised, so nothing relies on one. The drive's own ceilings end the test by current,
voltage and time; its watchdog is fed and its status judged four times a second. The amplitude is chosen before and never raised:
for a motor of which nothing is known, so that the volt-seconds commanded cannot make more flux than the limit in any motor
(`Amplitude.safe`); for one that was measured, so that its flux stays below the limit with every value on its bad side.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

from commissioner.errors import Aborted, DriveFault
from commissioner.procedure.energised.ceilings import for_tones
from commissioner.procedure.energised.multitone import UnderTest
from commissioner.procedure.energised.session import OFFSET_S, load, next_block, tone_period_s
from commissioner.procedure.findings import AxisFinished, StepProgress
from commissioner.procedure.plan import Job
from commissioner.procedure.steps import Findings
from commissioner.records import DriveStatus
from commissioner.safety.commands import Command, Disarm, Enable, ReadStatus, SetScale, Supervise, Tell

PART_S = 1.0
"""Told as progress about as often."""
AT_LEAST = 0.5
"""Of a test's time: what the samples that the drive made of it must cover."""


def captured(
    job: Job,
    findings: Findings,
    step: str,
    axis_deg: float,
    tones: tuple[tuple[float, float, float], ...],
    under_test: UnderTest,
    seconds: float,
    *,
    is_look: bool,
) -> Generator[Command, Any, None]:
    """One session of `seconds`, then its samples into the findings."""
    ramp_s = 1.0 / job.scale_ramp_per_s
    yield for_tones(job, findings)
    yield load(job, findings, axis_deg, tones)
    yield Enable(step)
    findings.segment += 1
    yield from _pass(OFFSET_S, step, axis_deg)
    yield SetScale(under_test.blind_scale)
    passed_s = 0.0
    while passed_s < seconds:
        part_s = min(PART_S, seconds - passed_s)
        yield from _pass(part_s, step, axis_deg)
        passed_s += part_s
        said = f"{passed_s:4.1f} s at {under_test.blind_scale:.0%}, the drive keeps its samples"
        yield Tell(StepProgress(axis_deg, passed_s / seconds, said))
    yield SetScale(0.0)
    yield from _pass(ramp_s, step, axis_deg)
    yield Disarm("test done")
    lost = yield from _download(findings, step, axis_deg, OFFSET_S + seconds + ramp_s)
    why = "judged by the fit of its samples"
    yield Tell(AxisFinished(axis_deg, is_look, seconds, False, why, findings.peak_flux_fraction, lost))


def _pass(seconds: float, step: str, axis_deg: float) -> Generator[Command, Any, None]:
    status: DriveStatus = yield Supervise(seconds)
    if not status.is_energised:
        raise Aborted(
            "the drive ended the test by itself", step=f"{step}, axis {axis_deg:g} deg", value=status.state,
            limit="the whole test", remedy="check the drive's own time limit and its status",
        )  # fmt: skip


def _download(findings: Findings, step: str, axis_deg: float, seconds: float) -> Generator[Command, Any, int]:
    """All that the drive has kept of the session; how many samples it had lost. DriveFault: it made too few for its `seconds`."""
    status: DriveStatus = yield ReadStatus()
    made_s = status.samples_produced * tone_period_s(findings)
    if made_s < AT_LEAST * seconds:
        raise DriveFault(
            f"the drive made samples of {made_s:.2g} s in a test of {seconds:.2g} s", step=f"{step}, axis {axis_deg:g} deg",
            value=made_s, unit="s", limit=AT_LEAST * seconds,
            remedy="its time does not pass as ours does: check decimation and control period of the firmware; a simulated "
            "inverter behind a slow link must run in real time (--speed 1)",
        )  # fmt: skip
    got, lost = 0, 0
    while got < status.samples_produced:
        block = yield from next_block(findings, step, axis_deg)
        got = block.first_index + block.count
        lost += block.lost_before
        yield Tell(StepProgress(axis_deg, got / status.samples_produced, f"{got} samples downloaded"))
    return lost
