"""What six sensors may get wrong together, and what that does to every result: gains and the delay between current and voltage.

Neither shows in the data: a gain of all currents is a larger motor, a delay another load angle. So they are a systematic part of
every standard deviation (`systematic`). What does show is how unlike the sensors are among themselves: the currents of a motor without a neutral sum to zero, so do
line-to-line voltages; the sum that is measured is sensor error, and tells its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from commissioner.monitor.supply import SupplyAngle, harmonic_phasor
from commissioner.records import Signal

GAIN_STD = 0.005
SKEW_STD_S = 100e-6
"""Where nothing is known: class 0.5 for each group of sensors, and one degree between them (converters one after another,
isolation amplifiers, transformers of class 1)."""
LEAST_ASYMMETRY = 0.001
LARGEST_ASYMMETRY = 0.03
"""Beyond it the sum of phase voltages is the mains' own zero sequence."""


@dataclass(frozen=True)
class Trust:
    """Standard deviations common to a group of sensors, and the share of the mean that their differences turn into a negative
    sequence.
    """

    gain_std: float = GAIN_STD
    skew_std_s: float = SKEW_STD_S
    asymmetry: float = LEAST_ASYMMETRY


def trust_of(currents: Sequence[Signal], voltages: Sequence[Signal], supply: SupplyAngle, period_s: float) -> Trust:
    """From the fundamental of the sums, over the channels' own; three channels of which one was made up sum to zero and say
    nothing.
    """
    time = np.arange(currents[0].size) * period_s
    angle = supply.angle_rad(time)
    shares = [LEAST_ASYMMETRY]
    for group in (currents, voltages):
        total = np.sum(group, axis=0)
        if np.ptp(total) < 1e-9 * np.ptp(group[0]):
            shares.append(GAIN_STD)
            continue
        phasors = [abs(harmonic_phasor(signal - signal.mean(), angle)) for signal in group]
        shares.append(abs(harmonic_phasor(total - total.mean(), angle)) / (3 * max(float(np.mean(phasors)), 1e-12)))
    unlike = float(min(np.sqrt(np.sum(np.square(shares))), LARGEST_ASYMMETRY))
    return Trust(
        float(np.hypot(GAIN_STD, unlike)), float(np.hypot(SKEW_STD_S, unlike / supply.carrier_rad_per_s)), unlike
    )
