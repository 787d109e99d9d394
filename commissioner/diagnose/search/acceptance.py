"""What an accepted cause may leave behind, so that a later one must gain more than that to be named beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from commissioner.diagnose.catalogue import CATALOGUE, Setting
from commissioner.diagnose.catalogue.mains_lines import is_made_by_tones
from commissioner.diagnose.catalogue.sensing import RESTARTS, RUNS_ON
from commissioner.diagnose.fit.gauss_newton import Fit
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.plant.prediction import modulation
from commissioner.diagnose.plant.sampling import clock_courses

MATERIAL_SHARE = 1e-4
"""A cause must move the current by this share of its rms (-80 dB), else it is listed as below materiality."""
GUARD = 2e-5
"""A later cause must gain this share of what the strongest accepted nonlinearity gains, else it may be its shape."""
CLASS_GUARD = 1e-2
"""Beside an accepted cause of rigid form that it is mistaken for, a later cause must gain this share of its gain."""
SAME_ORDER = frozenset({"rotor_skin_effect", "iron_loss"})
PAIR_GUARDS = {
    SAME_ORDER: 0.1,
    frozenset({"inductance_anisotropy", "resistance_anisotropy"}): 2e-3,
    frozenset({"shaft_motion", "remanence"}): 0.02,
    frozenset({"sensor_offset", "remanence"}): 1e-4,
    frozenset({"sensor_offset", "sensor_drift"}): 3e-3,
    frozenset({"shaft_motion", "sensor_drift"}): 3e-3,
    frozenset({"iron_loss", "sensor_lag"}): 5e-4,
    frozenset({"iron_loss", "sampling_delay"}): 5e-4,
}
"""Pairs of which the weaker is only named beside the other where it is no trifle: networks that terminals hardly tell apart;
flux left from the segment before, which a shaft that turns in the pause carries elsewhere. (A flux decays and an offset stays. Offset and drift differ plainly, and so does a
shaft, which moves current across the axis; a conductance's current steps with the voltage, which a delay or a lag does to no current; and how
far a leakage's anisotropy tilts the cage's resistance is a number of its own.)"""
LINEAR = ("sampling_delay", "sensor_lag", "iron_loss", "rotor_skin_effect", "cable_capacitance")
"""Causes that only turn and scale the excited lines: any two of them can look like a third."""
TONE_TO_TONE = 0.05
"""As CLASS_GUARD, for a ripple whose side lines fall from one tone to another, beside linear causes."""
RIGID_GUARD = 1e-3
"""As GUARD, beside an accepted cause whose form has few numbers."""
LINES_OF_THEIR_OWN = frozenset({"dc", "non-periodic"})
"""Families that act where the tones and their multiples are not."""
ALIKE_ON_ALL_AXES = frozenset({"linear", "axis"})
"""What a linear cause leaves is the same on every axis: nothing that an anisotropy or gains would take."""
EXACT_GUARD = 2e-3
"""As CLASS_GUARD, beside an accepted cause of exact form."""
APART = 0.1
"""Factor on a guard where what the one may leave and what the other makes lie at other frequencies, or axes; or where the one leaves what is
in proportion to the command, and the other is a curve."""
EXACT = frozenset(
    {
        "sensor_offset",
        "sensor_gain_mismatch",
        "sampling_delay",
        "mains_pickup",
        "dc_link_ripple",
        "remanence",
    }
)
"""Causes whose form is not a matter of opinion: they leave nothing behind."""
SHAPED = frozenset({"dead_time", "device_drop", "magnetizing_saturation", "leakage_saturation"})
"""Causes whose curve is free: what they leave is small. No two hysteresis models agree, so it is not among them."""
LEAST_BESIDE = 800.0
"""Lost samples must gain at least so much beside accepted causes."""
LEAST_INCONSTANT = 0.15
"""Of what an even drift's delay has that no constant one makes (0.05 to 0.25 of its power): lags and conductances that pass for a clock

have 0.04 to 0.09 of it in whole recordings, clocks 0.9 and more.
"""
CLOCK_RATES = RESTARTS + RUNS_ON
SHOWN_BY_A_PART = 0.3
"""Of its gain per sample: a cause of which the first part of the segments shows less is late, or met seldom."""
LATEST_KNEE, LATEST_KNEE_OF_RATED, LATEST_KNEE_AT_SMALL_CURRENT = 0.2, 0.15, 0.6
"""Of the largest current, by which a leg has lost half of its voltage; or, up to that part of the largest, of the rated peak."""
LEAST_SEEN, CLEARLY = 0.3, 6.0
"""Of a sag or a ripple, what a recorded link must show of it, and how many standard errors of white noise it may miss."""
MOST_SAG = 0.5
"""Of the link, at rated power: no source gives that power while it loses more. (A charging resistor that was left in loses it at small powers:
a recorded link shows that.)"""
LEAST_SLOPE_LOST = 0.25
"""A channel that loses less of its slope than this at the largest current is not straight, yet not at its end."""


def guard(losses: Mapping[str, float], name: str, *, ripple_meets_tones: bool = False) -> float:
    """What the forms of the accepted causes (with what chi2 loses without them) may leave behind for a later one to take.

    A ripple whose side lines fall from tone to tone changes impedances as linear causes do.
    """
    share = TONE_TO_TONE if name == "dc_link_ripple" and ripple_meets_tones else 0.0
    left = [_share_left(accepted, name) * loss for accepted, loss in losses.items()]
    return max([*left, *(share * losses[n] for n in LINEAR if n in losses)], default=0.0)


def guard_of_lost_samples(fitted: Fit) -> float:
    """What lost samples must gain beside accepted causes, as any cause beside one that it is mistaken for."""
    return max(LEAST_BESIDE, CLASS_GUARD * max(losses_of(fitted, effects_of(fitted.model)).values(), default=0.0))


def _share_left(accepted: str, name: str) -> float:
    mine, other = CATALOGUE[accepted], CATALOGUE[name]
    if accepted in SHAPED:
        return APART * GUARD if other.family == "non-periodic" else GUARD
    if accepted in other.confounders or name in mine.confounders:
        plain = EXACT_GUARD if accepted in EXACT and accepted not in LINEAR else CLASS_GUARD
        return PAIR_GUARDS.get(frozenset({accepted, name}), plain)
    if accepted in EXACT:
        return 0.0
    families = {mine.family, other.family}
    is_curve_beside_linear = mine.family == "linear" and name in SHAPED
    is_apart = len(families) == 2 and (
        families & LINES_OF_THEIR_OWN or families == ALIKE_ON_ALL_AXES or is_curve_beside_linear
    )
    return APART * RIGID_GUARD if is_apart else RIGID_GUARD


def meets_tones(record: Record, setting: Setting) -> bool:
    """Whether two excited tones lie the ripple's frequency (or twice it) apart."""
    ripples = [m * f for name, f in setting.lines_hz.items() if name.startswith("ripple") for m in (1.0, 2.0)]
    return is_made_by_tones(record, *ripples)


def is_plausible(model: Model, name: str, setting: Setting) -> bool:
    """The sign physics demands; a leg error that is at half its height before a fifth of the largest current, or where the switching's

    ripple ends in a test at small currents; and a clock whose delay grows: one that jumps to a value in each segment and stays there
    is a delay in disguise.
    """
    if name == "clock_drift" and _is_a_delay(model.of(name), setting.record):
        return False
    if is_ruled_out(model, name, setting.record):
        return False
    sizes = CATALOGUE[name].sizes(setting, model.of(name))
    sign = CATALOGUE[name].sign
    has_own_sign = any(t.lower < 0.0 for t in CATALOGUE[name].exchanged_in(model.of(name)))
    if sign and sizes and not has_own_sign and next(iter(sizes.values()))[0] * sign <= 0:
        return False
    if (
        "sag_at_rated_power" in sizes
        and sizes["sag_at_rated_power"][0] > MOST_SAG
        and not _link_shows(model, name, setting.record)
    ):
        return False
    if "slope_lost" in sizes and sizes["slope_lost"][0] < LEAST_SLOPE_LOST:
        return False
    peak, rated_peak = setting.facts.current_peak_a, setting.facts.rated_current_peak_a
    latest = max(LATEST_KNEE * peak, min(LATEST_KNEE_OF_RATED * rated_peak, LATEST_KNEE_AT_SMALL_CURRENT * peak))
    return "half_current_a" not in sizes or sizes["half_current_a"][0] < latest


def is_ruled_out(model: Model, name: str, record: Record) -> bool:
    """Whether what was measured says surely that it is not this cause: a link that was recorded, and stands still."""
    return any(t.kind == kinds.VOLTAGE_MOD for t in model.terms if t.effect == name) and _link_stands_still(
        model, name, record
    )


def _link_stands_still(model: Model, name: str, record: Record) -> bool:
    """Whether the DC link was recorded and surely moves by less than LEAST_SEEN of what this cause says."""
    share, standard_error = _shown_by_the_link(model, name, record)
    return share + CLEARLY * standard_error < LEAST_SEEN


def _link_shows(model: Model, name: str, record: Record) -> bool:
    """Whether the DC link was recorded and surely moves by more than LEAST_SEEN of what this cause says."""
    share, standard_error = _shown_by_the_link(model, name, record)
    return share - CLEARLY * standard_error > LEAST_SEEN


def _shown_by_the_link(model: Model, name: str, record: Record) -> tuple[float, float]:
    """Share of what this cause says of the DC link that the recorded one shows, and its standard error; anything where it was not recorded."""
    both = power = swung = 0.0
    count = 0
    for segment, channels in zip(record.segments, record.channels, strict=True):
        if segment.link_swing is None:
            return LEAST_SEEN, np.inf
        course = modulation(model.only((name,)), segment, channels)[0]
        said, seen = course - course.mean(), segment.link_swing - segment.link_swing.mean()
        both, power, swung = both + float(said @ seen), power + float(said @ said), swung + float(seen @ seen)
        count += segment.count
    if power == 0.0:
        return LEAST_SEEN, np.inf
    share = both / power
    return share, float(np.sqrt(max(swung - share * both, 0.0) / count / power))


def _is_a_delay(rates: Mapping[str, float], record: Record) -> bool:
    """Whether a clock only makes currents late alike (or early, as a conductance does), beside what a drift would show."""
    return 1.0 - constancy(rates, record) < LEAST_INCONSTANT * (1.0 - constancy({"drift": 1.0}, record))


def constancy(rates: Mapping[str, float], record: Record) -> float:
    """Share of what a clock's delay does that a constant one would do as well, each instant weighed by how fast the command moves."""
    mean = square = weight = 0.0
    for segment in record.segments:
        delay = np.array([rates.get(n, 0.0) for n in CLOCK_RATES]) @ clock_courses(segment)
        moves = np.gradient(segment.voltage_axis_v) ** 2
        mean, square, weight = (
            total + float(x) for total, x in ((mean, moves @ delay), (square, moves @ delay**2), (weight, moves.sum()))
        )
    return float(mean**2 / (square * weight)) if square * weight > 0.0 else 0.0


def losses_of(fitted: Fit, names: Sequence[str]) -> dict[str, float]:
    """Delta chi2 of each effect, the others free (linear, at the fit)."""
    return {name: loss_without(fitted, name) for name in names}


def loss_without(current: Fit, name: str) -> float:
    """How much chi2 rises to first order when the effect's numbers go to zero and the others re-adjust."""
    mine, information = current.information_of(name)
    value = current.model.theta[mine]
    return max(float(value @ information @ value), 0.0)


def shows(part: Fit, share: float, name: str, gain: float) -> bool:
    """Whether an effect that gains so much on the whole is seen as well on a part that is this share of it."""
    return loss_without(part, name) > SHOWN_BY_A_PART * share * gain


def effects_of(model: Model) -> tuple[str, ...]:
    """The effects that the model has numbers of."""
    return tuple(dict.fromkeys(t.effect for t in model.terms if t.effect))
