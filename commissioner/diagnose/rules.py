"""The thresholds of search and verdict in one place, each with what it decides. Frozen: a diagnosis states its rules.

Numerical settings (grids, rounds, tolerances) stay where they act, the physics of one cause in its file.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

BLIND = "python -m tests.hidden_effects.protocol"


def rule(value: float, decides: str, *, without: str = "", source: str = BLIND) -> Any:
    """A threshold: what it decides, what was seen without it, and the paper or the command that sets it anew."""
    return field(default=value, metadata={"decides": decides, "without": without, "source": source})


@dataclass(frozen=True)
class Rules:
    """Shares are of a gain in chi-square unless said otherwise; sigmas are rms over the noise's rms."""

    # what a cause must gain
    floor_chi2: float = rule(40.0, "a cause gains this besides the price of its numbers", source="p near 1e-10")
    number_chi2: float = rule(10.0, "price of each of the first numbers", source="p near 1e-10")
    more_numbers_chi2: float = rule(3.0, "price of each further number", source="chi-square's mean and two deviations")
    full_price: int = rule(10, "how many numbers cost the full price")
    material_share: float = rule(
        1e-4, "a cause moves the current by this share of its rms (-80 dB), else it is listed as below materiality"
    )
    steps_share: float = rule(
        0.5,
        "share of the power of coarse converter steps that repeat with the signal that a cause gains",
        without="where currents creep or rest, most of it lies in slow changes from segment to segment, as a shaft's motion or a drift does",
    )
    # what accepted causes may leave behind
    shaped_guard: float = rule(2e-5, "share of its gain that a free curve may leave to a later cause")
    rigid_guard: float = rule(1e-3, "the same of a cause whose form has few numbers")
    confounder_guard: float = rule(
        1e-2, "the same to a cause that it is mistaken for, unless the pair's file says another share"
    )
    exact_guard: float = rule(2e-3, "the same to such a cause, of one of exact form")
    tone_to_tone_guard: float = rule(
        0.05, "the same of linear causes to a ripple whose side lines fall from one tone to another"
    )
    apart: float = rule(
        0.1, "factor on a guard where the one leaves other frequencies or axes than the other makes, or no curve"
    )
    lost_samples_chi2: float = rule(800.0, "lost samples gain this beside accepted causes")
    large_rest_sigma: float = rule(0.1, "a rest above this is large")
    entirely_share: float = rule(
        0.98,
        "a cause that takes so much of a large rest is no part of another's form",
        without="a shaft of 39, an iron loss of 4.9 and a drift of 5.1 lost their names to an anisotropy of 1.4",
    )
    least_share_of_rest: float = rule(
        0.15,
        "what the best candidate takes of a large rest, else the search ends; so of what a cause that was ruled out would take",
        without="six names in 124 s for one unknown cause",
    )
    noise_doubt: float = rule(2.0, "standard errors of the noise's power that are not surely left")
    # how far the search goes
    most_causes: int = rule(6, "causes accepted at most")
    refitted: int = rule(4, "candidates refitted in one step at most", source="time")
    most_implausible: int = rule(
        2, "refits that came out implausible until a candidate is refitted no more", source="time"
    )
    promised_share: float = rule(
        0.7, "of its threshold, below which a candidate's promise is not refitted", source="time"
    )
    hopeless_share: float = rule(0.4, "of its guard, below which a candidate's promise is not refitted", source="time")
    rival_promise: float = rule(
        2.5, "a candidate is refitted only if this multiple of its promise reaches the best gain so far", source="time"
    )
    most_looks: int = rule(
        3, "times that lines are looked for again: once they are, what was beside them is known better"
    )
    doubted_loss: float = rule(
        10.0,
        "of what it must gain: an accepted cause whose loss to first order is more is not fitted without",
        source="time",
    )
    wrong_valley_sigma: float = rule(
        1.0,
        "unexplained beside the first cause: what it made of the currents may have led the four parameters astray",
        without="dead times of 3.5 and of thirty times the noise left a valley without a magnetizing inductance",
    )
    regrouped: int = rule(4, "groups of linear causes refitted at most", source="time")
    hopeful: float = rule(1.3, "factor by which a group's refit may gain more than promised", source="time")
    nearly_share: float = rule(0.05, "of the gain: a group that lacks no more may get there with closer time constants")
    closer_loops_share: float = rule(0.5, "of the unexplained: loops of closer radii make so much of it")
    finer_curve_share: float = rule(
        2e-3,
        "of the unexplained: finer knots make so much of it; beside a cause that lacks, no curve need be right to the last digit",
    )
    faster_speed_share: float = rule(
        0.2, "of the unexplained: a faster speed makes so much of it, else another cause does"
    )
    shown_by_a_part: float = rule(
        0.3, "of its gain per sample: a cause of which a part shows less is late, or met seldom"
    )
    unknown_sigma: float = rule(0.1, "where so much is left no cause makes it, and refining gains nothing")
    unknown_share: float = rule(0.05, "the same, of the error there was to explain")
    hopeless_sigma: float = rule(0.3, "where a part's search ends with so much, the whole finds no more", source="time")
    mended_at_once: float = rule(0.5, "of the misfit: a round of mending that leaves more is the last")
    mended_share: float = rule(
        0.7, "of the misfit that the noise's uncertainty cannot make, so much goes with mended samples"
    )
    mended_least_share: float = rule(0.3, "of all of the misfit, so much goes with mended samples")
    # what is named
    least_confidence: float = rule(
        0.5, "below it a name is not given", source="definition: more likely wrong than right"
    )
    tie_chi2: float = rule(10.0, "a rival that loses less fits as well, and the test that parts them is asked for")
    nearly_all_share: float = rule(0.001, "of a cause's gain: a rival that loses less is as good where much is unknown")
    left_tie_share: float = rule(0.1, "of what no cause makes: the same")
    alternative_share: float = rule(
        0.9, "of its own gain or promise: a rival that promises less is not refitted", source="time"
    )
    mostly_explained_sigma: float = rule(0.1, "a rest above this is no trifle")
    explained_share: float = rule(0.95, "of the error power, that right names explain at least")
    unexplained_sigma: float = rule(0.3, "a rest above this is unexplained, whatever is named")
    unexplained_state_sigma: float = rule(
        0.03, "the same, of what goes with the state or comes and goes, where nothing is named"
    )
    worse_than_none: float = rule(
        -0.5, "of the error of left-out segments: weak causes that make it so much worse are none"
    )
    weak_sigma: float = rule(0.1, "what such weak causes make at most")
    much_left_sigma: float = rule(0.3, "a rest above this was not among what confidence learned from")
    dominant_share: float = rule(
        0.99,
        "of what is not another's: a cause that takes so much is there, whatever else is",
        without="real dead times, with ripple and a current that stops at zero, leave some thousandths of the power",
    )
    dominant_confidence: float = rule(0.9, "how sure such a cause is")
    rival_loss_share: float = rule(0.2, "unless a rival that takes its place loses less than this part of its gain")

    def price(self, numbers: int) -> float:
        """What `numbers` parameters must gain to be worth having."""
        full = min(numbers, self.full_price)
        return self.number_chi2 * full + self.more_numbers_chi2 * max(numbers - self.full_price, 0)

    def required_chi2(self, numbers: int) -> float:
        """What a cause of so many numbers must gain whatever the signal is."""
        return self.floor_chi2 + self.price(numbers)

    def table(self) -> list[tuple[str, float, str, str, str]]:
        """Every rule with its value, what it decides, what was seen without it and what sets it anew."""
        return [
            (f.name, getattr(self, f.name), *(f.metadata[k] for k in ("decides", "without", "source")))
            for f in fields(self)
        ]


RULES = Rules()
