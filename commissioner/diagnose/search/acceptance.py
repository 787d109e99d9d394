"""What an accepted cause may leave behind, so that a later one must gain more than that to be named beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from commissioner.diagnose.causes import CATALOGUE, LINEAR, LINES, UNRELATED, Form, Setting, between
from commissioner.diagnose.causes.mains_lines import is_made_by_tones
from commissioner.diagnose.fit.gauss_newton import Fit
from commissioner.diagnose.intake.record import Record
from commissioner.diagnose.plant.model import Model
from commissioner.diagnose.rules import RULES, Rules

LINES_OF_THEIR_OWN = frozenset({"dc", "non-periodic"})
"""Families that act where the tones and their multiples are not."""
ALIKE_ON_ALL_AXES = frozenset({"linear", "axis"})
"""What a linear cause leaves is the same on every axis: nothing that an anisotropy or gains would take."""


def guards(
    losses: Mapping[str, float], name: str, *, ripple_meets_tones: bool = False, rules: Rules = RULES
) -> tuple[float, str]:
    """What the forms of the accepted causes (with what chi2 loses without them) may leave behind for a later one to take, and whose it is.

    A ripple whose side lines fall from tone to tone changes impedances as linear causes do.
    """
    share = rules.tone_to_tone_guard if CATALOGUE[name].meets_tones and ripple_meets_tones else 0.0
    left = {accepted: _share_left(accepted, name, rules) * loss for accepted, loss in losses.items()}
    for linear in (n for n in LINEAR if n in losses):
        left[linear] = max(left[linear], share * losses[linear])
    by = max(left, key=lambda n: left[n], default="")
    return left.get(by, 0.0), by and f"what {by} may leave"


def guard(losses: Mapping[str, float], name: str, *, ripple_meets_tones: bool = False, rules: Rules = RULES) -> float:
    return guards(losses, name, ripple_meets_tones=ripple_meets_tones, rules=rules)[0]


def guard_of_lost_samples(fitted: Fit, rules: Rules = RULES) -> float:
    """What lost samples must gain beside accepted causes, as any cause beside one that it is mistaken for."""
    strongest = max(losses_of(fitted, effects_of(fitted.model)).values(), default=0.0)
    return max(rules.lost_samples_chi2, rules.confounder_guard * strongest)


def _share_left(accepted: str, name: str, rules: Rules) -> float:
    mine, other = CATALOGUE[accepted], CATALOGUE[name]
    if mine.form is Form.SHAPED:
        return rules.apart * rules.shaped_guard if other.family == "non-periodic" else rules.shaped_guard
    if (pair := between(accepted, name)) is not UNRELATED:
        is_exact = mine.form is Form.EXACT and mine.family != "linear"
        plain = rules.exact_guard if is_exact else rules.confounder_guard
        return plain if pair.least_share is None else pair.least_share
    if mine.form is Form.EXACT:
        return 0.0
    families = {mine.family, other.family}
    is_curve_beside_linear = mine.family == "linear" and other.form is Form.SHAPED
    is_apart = len(families) == 2 and (
        families & LINES_OF_THEIR_OWN or families == ALIKE_ON_ALL_AXES or is_curve_beside_linear
    )
    return rules.apart * rules.rigid_guard if is_apart else rules.rigid_guard


def meets_tones(record: Record, setting: Setting) -> bool:
    """Whether two excited tones lie the ripple's frequency (or twice it) apart."""
    kinds = tuple(kind for kind, name in LINES.items() if CATALOGUE[name].meets_tones)
    ripples = [m * f for name, f in setting.lines_hz.items() if name.startswith(kinds) for m in (1.0, 2.0)]
    return is_made_by_tones(record, *ripples)


def is_plausible(model: Model, name: str, setting: Setting) -> bool:
    """Whether the cause, as it is in the model, is what such a cause can be."""
    return CATALOGUE[name].is_plausible(model, setting)


def losses_of(fitted: Fit, names: Sequence[str]) -> dict[str, float]:
    """Delta chi2 of each effect, the others free (linear, at the fit)."""
    return {name: loss_without(fitted, name) for name in names}


def loss_without(current: Fit, name: str) -> float:
    """How much chi2 rises to first order when the effect's numbers go to zero and the others re-adjust."""
    mine, information = current.information_of(name)
    value = current.model.theta[mine]
    return max(float(value @ information @ value), 0.0)


def shows(part: Fit, share: float, name: str, gain: float, rules: Rules = RULES) -> bool:
    """Whether an effect that gains so much on the whole is seen as well on a part that is this share of it."""
    return loss_without(part, name) > rules.shown_by_a_part * share * gain


def effects_of(model: Model) -> tuple[str, ...]:
    """The effects that the model has numbers of."""
    return tuple(dict.fromkeys(t.effect for t in model.terms if t.effect))
