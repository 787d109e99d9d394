"""One session of direct current: voltage steered step by step, the flux watched through the current."""

from __future__ import annotations

import math
from collections.abc import Generator
from typing import Any

import numpy as np

from commissioner.errors import Aborted, DriveFault
from commissioner.identify.excite.current_flux import CurrentFlux
from commissioner.motor.circuit import InverseGamma
from commissioner.procedure.energised.session import (
    OFFSET_S,
    SinceCommand,
    along_axis,
    duration_s,
    load,
    measure_offset,
    next_block,
    period_s,
    ramp_down,
    rest,
)
from commissioner.procedure.plan import Job
from commissioner.procedure.steps import Findings
from commissioner.records import SampleBlock, Signal, peak
from commissioner.safety.commands import Command, Disarm, Enable, SetBias, SetDriveLimits

STEER_S, IN_EFFECT_S = 0.02, 0.015
"""Time between two voltages of the climb or of a push, where nothing is late; how long each is in effect at the least."""
LONGEST_STEER_S = 0.1
"""Over a slow link a voltage of the climb is for the time that the one before took; for no more than this."""
AGAINST = 0.5
"""Of the current aimed at: this much against the voltage is no noise but a sensor of the wrong sign."""


class DirectCurrent:
    """Begun by `begin`, ended by `end`. `inductance_h`: the most that the motor can have,
    while no machine is known whose flux follows from the current exactly."""

    def __init__(
        self,
        job: Job,
        findings: Findings,
        step: str,
        axis_deg: float,
        inductance_h: float,
        machine: InverseGamma | None,
    ) -> None:
        self.job, self.findings, self.axis_deg = job, findings, axis_deg
        self.seconds = self.offset_a = self.peak_fraction = 0.0
        self._step, self._inductance_h = step, inductance_h
        self._limit_wb = findings.flux_limit_wb = job.flux_limit_wb(findings.resistance_ohm(job))
        self._flux = CurrentFlux(machine, period_s(findings)) if machine else None

    def begin(self, limits: SetDriveLimits) -> Generator[Command, Any, None]:
        """Rested, the drive's own ceilings, then energised at zero volts: what the sensors show there is offset, where no flux is
        left that drives a current."""
        job = self.job
        yield from rest(job, self.findings)
        yield limits
        yield load(job, self.findings, self.axis_deg, ())
        yield Enable(self._step)
        self.findings.segment += 1
        self.offset_a = yield from measure_offset(self.findings, self._step, self.axis_deg)
        self.seconds += OFFSET_S

    def end(self, reason: str, seconds: float) -> Generator[Command, Any, None]:
        yield SetBias(0.0)
        yield from ramp_down(self.findings, self._step, self.axis_deg, seconds)
        yield Disarm(reason)

    def steer(self, voltage_v: float, aimed_a: float) -> Generator[Command, Any, tuple[float, float]]:
        """Ask for a voltage and wait until it has been in effect for `IN_EFFECT_S`: (time passed, current of its last part).

        DriveFault: the current flows against the voltage.
        """
        yield SetBias(voltage_v)
        since, passed_s, current = SinceCommand(), 0.0, np.zeros(0)
        while since.seconds < IN_EFFECT_S:
            block = yield from self.fetch()
            since.take(block)
            passed_s += duration_s(block)
            current = np.append(current, self.current(block))
        seen_a = float(np.mean(current[-max(1, round(IN_EFFECT_S / period_s(self.findings))) :]))
        if seen_a * math.copysign(1.0, voltage_v) < -AGAINST * aimed_a:
            raise DriveFault(
                "the current flows against the voltage: a current sensor has the wrong sign", step=self._where,
                value=seen_a, unit="A", limit=f"current of the sign of {voltage_v:.3g} V",
                remedy="check sign and order of the current sensors",
            )  # fmt: skip
        return passed_s, seen_a

    def climbing_s(self, last_step_s: float) -> float:
        """The time that the next voltage of a climb is for."""
        is_slow = self.findings.link.is_reduced
        return min(max(last_step_s, STEER_S), LONGEST_STEER_S) if is_slow else STEER_S

    def current(self, block: SampleBlock) -> Signal:
        return along_axis(block) - self.offset_a

    def fetch(self) -> Generator[Command, Any, SampleBlock]:
        """The next block, its flux noted. Aborted: the flux passed its limit."""
        block = yield from next_block(self.findings, self._step, self.axis_deg)
        self.seconds += duration_s(block)
        self._note_flux(block)
        return block

    @property
    def _where(self) -> str:
        return f"{self._step}, axis {self.axis_deg:g} deg"

    def _note_flux(self, block: SampleBlock) -> None:
        current = self.current(block)
        if self._flux is None:
            flux_wb = self._inductance_h * abs(float(np.mean(current)))
        else:
            flux_wb = peak(self._flux.advance(current, block.lost_before))
        self.peak_fraction = max(self.peak_fraction, flux_wb / self._limit_wb)
        self.findings.peak_flux_fraction = max(self.findings.peak_flux_fraction, self.peak_fraction)
        if flux_wb > self._limit_wb:
            raise Aborted(
                "the flux reached its limit", step=self._where, value=flux_wb, limit=self._limit_wb, unit="Wb",
                remedy="check rated voltage, frequency and connection of the plate; lower limits.flux_fraction",
            )  # fmt: skip
