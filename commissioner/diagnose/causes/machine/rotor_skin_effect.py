"""Current displacement in the rotor bars."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Words
from commissioner.diagnose.causes.in_points import InPoints
from commissioner.diagnose.causes.setting import Array, Numbers, Setting, Sizes, listed
from commissioner.diagnose.intake.points import Points
from commissioner.diagnose.kernels.kinds import BRANCH
from commissioner.diagnose.plant.model import Model, Term


def in_table(x: Array, points: Points, scale: Mapping[str, float]) -> dict[str, float]:
    highest = float(points.frequency_hz.max()) / scale["frequency_hz"]
    return {"resistance_rise_over_range": float(x[0]) * (highest**2 - 1.0)}


def has_several_frequencies(points: Points) -> bool:
    return np.unique(points.frequency_hz).size > 1


class RotorSkinEffect(Cause):
    """Rotor branches g_k / (1 + s T_k) beside 1/R_R, g_k >= 0 [S], corners from 12.5 to 800 Hz, two thirds of an octave apart, and closer
    where one acts. No branch carries more than a hundred times the motor's own conductance: a bar's resistance rises tenfold at most.
    """

    name = "rotor_skin_effect"
    place = 9
    title = "Current displacement in the rotor bars"
    family = "linear"
    sign = 1
    is_common = True
    spare = frozenset({BRANCH})
    signature = (
        "rotor resistance rises and leakage falls between 50 and 600 Hz; excited lines only, proportional to level"
    )
    source = "ladder network of a bar: A. Levy, H. Auinger, cited in Babb & Williams, Trans. AIEE 70, 1951"
    confounders = (Confounder("cable_capacitance"), Confounder("magnetic_hysteresis"))
    split_by = "tones on both sides of the corner, 20 Hz to 1 kHz"
    decides = "Add tones between 20 Hz and 1 kHz."
    words = Words(
        "The rotor's resistance rises by {size} with frequency (skin effect in the bars)",
        "Every cage does this, large ones most. At running slip the low-frequency value counts.",
        "Do not enter a rotor resistance from a locked-rotor test at mains frequency: it is too high.",
        is_normal=True,
    )
    advice = "Normal in larger motors."
    in_points = InPoints(
        "resistance", (0.1,), (-0.5,), (5.0,), lambda x, _amps, speed: np.maximum(1.0 + x[0] * (speed**2 - 1.0), 1e-3),
        in_table, has_several_frequencies,
    )  # fmt: skip

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        # the box ends at 6 times the resistance seen at the tones (`nominal.bare_layout`)
        largest = 600.0 / setting.layout.nominal_box[1][1] if np.isfinite(setting.layout.nominal_box[1][1]) else np.inf
        return tuple(
            Term(self.name, f"branch_{k}", "S", BRANCH, k, 0.01, 0.0, largest, is_beside_rotor=True)
            for k, time in enumerate(setting.layout.branch_time_s)
            if time > 0.0
        )

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """R_R(f_N) / R_R(0) - 1 of the branches beside R_R."""
        rated = float(setting.facts.metadata.get("rated_frequency_hz", 50.0))
        branches = listed(values, "branch", setting.layout.branch_time_s.size)
        slow = 1.0 / setting.nominal[1] + branches.sum()
        fast = 1.0 / setting.nominal[1] + (branches / (1.0 + 2j * np.pi * rated * setting.layout.branch_time_s)).sum()
        return {"resistance_rise_at_rated_frequency": (float((1.0 / fast).real * slow - 1.0), "1")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """The rise at rated frequency, and the corner that carries most of it."""
        rated = float(setting.facts.metadata.get("rated_frequency_hz", 50.0))
        times = setting.layout.branch_time_s
        branches = listed(values, "branch", times.size)
        corner = 1.0 / (2.0 * np.pi * float(branches @ times) / max(float(branches.sum()), 1e-12))
        return {"size": sizes["resistance_rise_at_rated_frequency"], "corner": corner / rated}


CAUSE = RotorSkinEffect()
