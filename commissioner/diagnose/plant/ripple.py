"""What a filtered sensor shows of the switching's ripple.

A current that is sampled where the carrier turns has its mean over the pulses there. Behind a filter it has not: the pulses lie
T/4 back, the slope since then is that of the zero vector, and a lag far shorter than that hardly shows. Exact for
centre-aligned pulses of a sinusoidal modulator (D. G. Holmes, T. A. Lipo, Pulse Width Modulation for Power Converters, 2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import njit
from commissioner.diagnose.intake.record import Facts
from commissioner.diagnose.plant.low_pass import SHAPE_STEP, STEP, unforced

Array = NDArray[np.float64]
FIRST_STEP = 0.01
"""Of a sample, for the derivative by a lag where there is none yet."""
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


@njit(nogil=True)
def _behind(legs_v, link_v, carriers, lag, shape, out):
    n, length = legs_v.shape[1], 1.0 / carriers
    whole, rise, fall = np.zeros(4), np.zeros(4), np.zeros(4)
    unforced(length, lag, shape, whole)
    for leg in range(3):
        value = slope = 0.0
        for k in range(1, n):
            duty = min(max(0.5 + legs_v[leg, k - 1] / link_v, 0.0), 1.0)
            unforced(0.5 * length * (1.0 + duty), lag, shape, rise)
            unforced(0.5 * length * (1.0 - duty), lag, shape, fall)
            # a ramp's answer is t - lag + lag u0 - u1. The pulse's three ramps and the mean's add up to none at the period's end:
            # only what dies out is left
            added = lag * (rise[0] - fall[0]) - (rise[1] - fall[1]) - duty * (lag * (whole[0] - 1.0) - whole[1])
            added_slope = lag * (rise[2] - fall[2]) - (rise[3] - fall[3]) - duty * (lag * whole[2] - whole[3] + 1.0)
            for _ in range(carriers):
                value, slope = (
                    whole[0] * value + whole[1] * slope + added,
                    whole[2] * value + whole[3] * slope + added_slope,
                )
            out[leg, k] = link_v * value
