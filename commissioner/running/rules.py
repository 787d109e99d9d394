"""The decisions of the search, each with its value and what it decides."""

from __future__ import annotations

from dataclasses import dataclass

from commissioner.estimation.hidden import LEAST_GAIN


@dataclass(frozen=True)
class Rules:
    """Chi-squares are those of whitened residuals, divided by what is left a sample where that is above 1."""

    least_gain: float = LEAST_GAIN
    """A cause gains at least so much: six standard deviations. 30 nulls had no score above 25."""
    each_further_number: float = 10.0
    """And so much more for every further number of its form."""
    least_share: float = 0.01
    """Of what all accepted causes gained; less is what their laws, simpler than nature's, leave."""
    certain_left: float = 0.03
    all_of_it: float = 0.9
    """Unless so much of the noise's power is left, and that share of it goes: a law's remainder is explained by no other cause. (A strong
    double cage hid a saturated main flux: 1.06 -> 1.00 a sample, 0.2 % of what the cage gained, and L_M 4 % low.)"""
    hold_out_loss: float = 9.0
    """Chi-square by which the held-out part may get worse (and a hundredth of the gain)."""
    tie: float = 10.0
    """Chi-square below which two names fit alike."""
    tie_share: float = 0.004
    """Of the cause's gain: a closer rival is a tie although noise alone would part them (models are not that exact)."""
    own_unbalance: float = 0.25
    """Of the current that the mains' own unbalance drives, without a start: what is below may be the motor's impedance at negative sequence, which a
    second cage makes another than that at slip. (A healthy one under 2 % of unbalance: a voltage gain of 0.89 +- 0.01 %, 0.14 of that current.)"""
    least_cosine: float = 0.85
    """Canonical correlation from which a rival is tried in a cause's place."""
    nothing_left: float = 1.05
    """Chi-square a sample below which no further candidate of a round is refitted: none could gain more."""
    tried: int = 5
    """Candidates refitted in each round."""
    most_causes: int = 6
    material_sigma: float = 0.03
    """Strength over noise below which a cause is not named."""
    material_steady_sigma: float = 0.2
    """The same where nothing but one load was recorded, however it ripples: all that is without a shape of its own there stands near the voltage's noise.
    Of 20 such cases five false names were weaker, and of the true ones only those below what counts for recall."""

    material_unheld_sigma: float = 0.1
    """The same where the speed is that of a fitted load: nothing is held out, and what the load's law lacks (a ripple that drove the
    shaft at rest, without its second order, left 0.0305 of the noise; more than two a turn are lacking still) passes for saturation. A third of what counts for recall."""

    least_told: float = 9.0
    """Square of a cause's size over its standard deviation, the voltage's noise counted, below which it is no name. (A healthy motor behind a filtered
    inverter, whose carrier is that noise: a delay of -17 +- 480 us, 0.99 sure; one at a load that ripples, 0.4 % of noise: a voltage gain of
    0.028 +- 0.014 %. Two deviations are passed by one healthy motor of two where fifteen causes are tried.)"""
    promising: float = 0.6
    """Of the least gain: what a candidate gains linearly before it is refitted."""
    promising_material: float = 0.1
    """And of the gain that is material: no bend of a law makes ten of one. (Without a speed, two refits of what gained 27 of 750 took half the time.)"""

    kept_promise: float = 0.5
    """Of a candidate's linear gain, where that is more than all others have gained: a refit that gains less has lost its way."""


RULES = Rules()
