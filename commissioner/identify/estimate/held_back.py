"""Was less applied than was asked for, where current or voltage were largest? Told by what a fit leaves unexplained.

A drive that limits its current, or its voltage, and does not say so takes volts away at the peaks alone. The fit spreads that over
its parameters, a resistance that is too large above all, and what is left stands at the peaks: of the sign that opposes them,
however fast the current moves there. Iron, leakage and delays leave what follows the flux or the slope, and passes through zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.identify.batch.segments import BatchFit, Segment
from commissioner.motor.circuit import InverseGamma
from commissioner.records import Signal, peak

PEAKS = 0.9
"""Of the largest, from where on it is a peak: of tests with tones a few hundred samples of some 60 000."""
FEWEST = 12
"""Peaks, from where on their scatter is known."""
SIGMAS = 8.0
"""Of the mean over the peaks: sound tests showed up to 2, a drive that took a tenth off the largest current 10 and more."""
LEAST_SHARE = 0.01
"""Of the largest voltage of the test: what is missing below it moves no value by what its acceptance allows."""
FARTHEST = 8
"""Rows from one measured current to the next, of the means that a slow link carries: longer ones know no peaks, and say nothing."""


@dataclass(frozen=True)
class HeldBack:
    """`what` was held back, current or voltage, from about `at` (A or V); `missing_v`: mean of the volts that the peaks lack."""

    what: str
    at: float
    unit: str
    missing_v: float

    @property
    def sentence(self) -> str:
        """What was seen, without its axis."""
        return (
            f"less voltage arrived at the motor than the samples say wherever the {self.what} came near {self.at:.3g} {self.unit}: "
            f"{self.missing_v:.2g} V are missing there"
        )


def held_back(segments: Sequence[Segment], batch: BatchFit, machine: InverseGamma) -> HeldBack | None:
    """The clearer of current and voltage, None where neither lacks anything at its peaks, or where means are too long to show peaks."""
    seen = [_missing(s, r, machine, batch.sample_period_s) for s, r in zip(segments, batch.residuals, strict=True)]
    missing_v, current_a, voltage_v = (np.concatenate(each) for each in zip(*seen, strict=True))
    if not missing_v.size:
        return None
    least_v = LEAST_SHARE * peak(voltage_v)
    found = [
        (sigmas, HeldBack(what, PEAKS * peak(of), unit, volts))
        for what, unit, of in (("current", "A", current_a), ("voltage", "V", voltage_v))
        for volts, sigmas in [_at_peaks(missing_v, of)]
        if sigmas > SIGMAS and volts > least_v
    ]
    return max(found, key=lambda each: each[0])[1] if found else None


def _missing(
    segment: Segment, residual_a: Signal, machine: InverseGamma, period_s: float
) -> tuple[Signal, Signal, Signal]:
    """Between neighbouring measured currents, `(n,)` each: the volts that would make up for what the residual gained, signed; the current
    that the fit expected, and the voltage that the samples say."""
    rows = np.flatnonzero(segment.weight > 0.0) if segment.weight is not None else np.arange(segment.current_a.size)
    apart = np.diff(rows)
    near = apart <= FARTHEST
    r_s, r_r, leakage_h, _ = machine.as_tuple()
    rise, middle = np.diff(residual_a), 0.5 * (residual_a[1:] + residual_a[:-1])
    gained_v = leakage_h * rise / (apart * period_s) + (r_s + r_r) * middle
    expected = segment.current_a[rows] - residual_a
    summed = np.concatenate([[0.0], np.cumsum(segment.voltage_v)])
    mean_v = (summed[rows[1:]] - summed[rows[:-1]]) / apart
    return -gained_v[near], 0.5 * (expected[1:] + expected[:-1])[near], mean_v[near]


def _at_peaks(missing_v: Signal, of: Signal) -> tuple[float, float]:
    """Mean of what is missing against the sign of the peaks, and its size in standard errors."""
    at = np.abs(of) >= PEAKS * peak(of)
    lacking = np.sign(of[at]) * missing_v[at]
    if lacking.size < FEWEST:
        return 0.0, 0.0
    volts, std_v = float(np.mean(lacking)), float(np.std(lacking)) / math.sqrt(lacking.size)
    return volts, volts / max(std_v, 1e-12)
