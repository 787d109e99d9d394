"""What a filtered sensor shows of the switching's ripple.

A current that is sampled where the carrier turns has its mean over the pulses there. Behind a filter it has not: the pulses lie
T/4 back, the slope since then is that of the zero vector, and a lag far shorter than that hardly shows. Exact for
centre-aligned pulses of a sinusoidal modulator (D. G. Holmes, T. A. Lipo, Pulse Width Modulation for Power Converters, 2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from commissioner.diagnose.lag import unforced
from commissioner.diagnose.record import Facts

Array = NDArray[np.float64]
MOST_PULSES, FORGOTTEN = 64, 12.0
"""Pulses that a filter may still show, and after how many of its lags one is forgotten."""
STEP, FIRST_STEP, SHAPE_STEP = 1e-3, 0.01, 5e-3
"""Of the lag, relative, and of a sample where there is none yet; of the shape: for derivatives."""
LEAST_LINK = 2.0
"""Times the largest command: what a leg can give. Where the link is not known it is the plate's voltage, rectified."""


@dataclass(frozen=True)
class Pulses:
    """Commands of the legs (3, n) in V, of the link's voltage (V) and the number of carrier periods in a sample."""

    legs_v: Array
    link_v: float
    carriers: int
    period_s: float

    @staticmethod
    def of(facts: Facts, legs_v: Array) -> Pulses:
        plate_v = facts.metadata.get("rated_voltage_v")
        rectified_v = math.sqrt(2.0) * plate_v if isinstance(plate_v, float | int) else 0.0
        link_v = facts.dc_link_v or max(rectified_v, LEAST_LINK * float(np.abs(legs_v).max()), 1.0)
        return Pulses(np.ascontiguousarray(legs_v), link_v, _carriers_of(facts), facts.sample_period_s)

    def behind(self, lag: float, shape: float) -> Array:
        """(3, n) A H: ripple behind the filter of that lag (samples) and shape at the samples, times the leakage inductance."""
        out = np.zeros_like(self.legs_v)
        if lag > 0.0:
            _behind(self.legs_v, self.link_v, self.carriers, lag, shape, out)
            out -= out.mean(axis=0)
        return out * self.period_s

    def by_lag(self, lag: float, shape: float) -> Array:
        """Its derivative by the lag, per sample."""
        if lag <= 0.0:
            return np.asarray(self.behind(FIRST_STEP, shape) / FIRST_STEP)
        h = STEP * lag
        return np.asarray((self.behind(lag + h, shape) - self.behind(lag - h, shape)) / (2.0 * h))

    def by_shape(self, lag: float, shape: float) -> Array:
        low = max(shape - SHAPE_STEP, 0.0)
        return np.asarray((self.behind(lag, shape + SHAPE_STEP) - self.behind(lag, low)) / (shape + SHAPE_STEP - low))


def _carriers_of(facts: Facts) -> int:
    """Carrier periods in a sample, a whole number; one where the switching frequency is not known."""
    return max(round((facts.switching_frequency_hz or 0.0) * facts.sample_period_s), 1)


@njit(cache=True, nogil=True)
def _ramp(t, lag, shape, free):
    """Answer of the filter, `t` samples after its input began to rise by 1 per sample."""
    if t <= 0.0:
        return 0.0
    unforced(t, lag, shape, free)
    # the ramp behind the filter is t - lag, from a value of lag and a slope of -1 that die out; of first order it has no slope of its own
    return t - lag + lag * free[0] - free[1]


@njit(cache=True, nogil=True)
def _behind(legs_v, link_v, carriers, lag, shape, out):
    n, length = legs_v.shape[1], 1.0 / carriers
    free = np.zeros(4)
    pulses = min(math.ceil(FORGOTTEN * lag * carriers) + 1, MOST_PULSES)
    for leg in range(3):
        for k in range(n):
            total = 0.0
            for i in range(pulses):
                at = k - 1 - i // carriers
                if at < 0:
                    break
                duty = min(max(0.5 + legs_v[leg, at] / link_v, 0.0), 1.0)
                ago = (i + 1) * length
                rise, fall = ago - 0.5 * length * (1.0 - duty), ago - 0.5 * length * (1.0 + duty)
                total += _ramp(rise, lag, shape, free) - _ramp(fall, lag, shape, free)
                total -= duty * (_ramp(ago, lag, shape, free) - _ramp(ago - length, lag, shape, free))
            out[leg, k] = link_v * total
