"""What six sensors may get wrong together, and what that does to every result: gains and the delay between current and voltage.

Neither shows in the data: a gain of all currents is a larger motor, a delay another load angle. So they are a systematic part of
every standard deviation (`systematic`). What does show is how unlike the sensors are among themselves: the currents of a motor without a neutral sum to zero, so do
line-to-line voltages; the sum that is measured is sensor error, and tells its size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from commissioner.monitor.signals.supply import SupplyAngle, fundamental_phasor
from commissioner.records import Signal

GAIN_STD = 0.005
SKEW_STD_S = 100e-6
"""Where nothing is known: class 0.5 for each group of sensors, and one degree between them (converters one after another,
isolation amplifiers, transformers of class 1)."""
LEAST_ASYMMETRY = 0.001
LARGEST_ASYMMETRY = 0.03
"""Beyond it the sum of phase voltages is the mains' own zero sequence."""
STAYS_UNLIKE = 0.3
"""Of what the sum showed: the part that delays between channels have in it."""


@dataclass(frozen=True)
class Trust:
    """Standard deviations common to a group of sensors, and the share of the mean that their differences turn into a negative
    sequence.
    """

    gain_std: float = GAIN_STD
    skew_std_s: float = SKEW_STD_S
    asymmetry: float = LEAST_ASYMMETRY


@dataclass(frozen=True)
class Evened:
    """A group's channels with the gains that make their sum zero; `difference` `(3,)` is what each gain had beyond the mean, and
    `unlike` the share of the mean that is left as a negative sequence.
    """

    signals: tuple[Signal, ...]
    difference: Signal
    unlike: float


def evened(group: Sequence[Signal], sums_to_zero: bool, supply: SupplyAngle, period_s: float) -> Evened:
    """Three channels whose sum should be zero (line currents, line-to-line voltages) with the smallest differences of gain that
    explain the sum's fundamental; as they are where the sum says nothing: one was made up, or a star point may move.

    Real gains make zero and negative sequence alike in size, so with the sum the negative sequence that they make goes as well;
    what delays between the channels make of it stays.
    """
    total = np.sum(group, axis=0)
    unknown = Evened(tuple(group), np.zeros(3), GAIN_STD)
    if np.ptp(total) < 1e-9 * np.ptp(group[0]):
        return unknown
    angle = supply.angle_rad(np.arange(group[0].size) * period_s)
    own = np.array([fundamental_phasor(signal - signal.mean(), angle) for signal in group])
    share = float(abs(own.sum()) / max(np.abs(own).sum(), 1e-12))
    if not sums_to_zero or share > LARGEST_ASYMMETRY:
        return replace(unknown, unlike=share)
    gain = np.ones(3)
    for _ in range(4):
        even = own / gain
        gain *= 1 + np.linalg.pinv(np.array([even.real, even.imag])) @ np.array([even.sum().real, even.sum().imag])
    gain /= gain.mean()
    signals = tuple(signal / g for signal, g in zip(group, gain, strict=True))
    return Evened(signals, gain - 1, STAYS_UNLIKE * share)


def trust_of(currents: Evened, voltages: Evened, supply: SupplyAngle, skew_std_s: float = SKEW_STD_S) -> Trust:
    """From how unlike the sensors of the two groups are, and what is taken where nothing is known (`skew_std_s`: of the delay)."""
    unlike = float(min(np.sqrt(LEAST_ASYMMETRY**2 + currents.unlike**2 + voltages.unlike**2), LARGEST_ASYMMETRY))
    seen = float(np.sqrt((np.var(currents.difference) + np.var(voltages.difference)) / 3))
    return Trust(
        float(np.hypot(GAIN_STD, np.hypot(unlike, seen))),
        float(np.hypot(skew_std_s, unlike / supply.carrier_rad_per_s)),
        unlike,
    )
