"""Leakage path that saturates with current."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.in_points import InPoints
from commissioner.diagnose.causes.setting import Array, Numbers, Setting, Sizes, listed, spline_value
from commissioner.diagnose.intake.points import Points
from commissioner.diagnose.kernels.kinds import LEAK_SPLIT, LEAKAGE_CURVE
from commissioner.diagnose.plant.model import Model, Term

LEAST_SPREAD = 1.3
"""Of the largest over the smallest current of a table, from which on it shows how the leakage falls."""


def in_table(x: Array, points: Points, scale: Mapping[str, float]) -> dict[str, float]:
    low, high = (float(end) / scale["current_a"] for end in np.quantile(points.current_line_a, (0.0, 1.0)))
    return {"inductance_drop_over_range": float(1.0 - (1.0 + x[0] * low) / (1.0 + x[0] * high))}


def has_several_currents(points: Points) -> bool:
    return float(points.current_line_a.max() / points.current_line_a.min()) >= LEAST_SPREAD


class LeakageSaturation(Cause):
    """Extra inverse leakage S(|phi|) >= 0 [1/H], a rising cubic spline with S(0) = 0 over the leakage flux reached.

    `split` moves it between the leakage of the stator current (-0.5) and of the rotor current (+0.5).
    """

    name = "leakage_saturation"
    place = 8
    title = "Leakage path that saturates with current"
    family = "odd"
    sign = 1
    form = Form.SHAPED
    is_common = True
    where = frozenset({"at_current_a"})
    signature = "odd intermodulation around the highest tones, growing with the cube of the current"
    source = "T. A. Lipo, A. Consoli, IEEE Trans. Ind. Appl. IA-20(1), 1984; T. Tuovinen et al., IEEE ECCE 2011"
    confounders = (Confounder("dc_link_sag"),)
    split_by = "DC staircase with a small high tone on top"
    decides = "Repeat one test at half the level, and one with a DC current added."
    words = Words(
        "The leakage inductance falls by {size} up to the largest current",
        "Usual with closed or narrow slots. One leakage inductance is right at one current only.",
        "Use the drive's table for it where there is one; if the current control rings at large current, lower its gain.",
        is_normal=True,
    )
    advice = "Normal in small motors with closed slots."
    in_points = InPoints(
        "leakage", (0.1,), (-0.5,), (5.0,), lambda x, amps, _speed: np.maximum(1.0 + x[0] * amps, 0.1), in_table,
        has_several_currents,
    )  # fmt: skip

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        count = setting.layout.leak_vectors.shape[0]
        step = 0.01 * setting.facts.current_peak_a / setting.layout.leak_top_wb
        curve = tuple(Term(self.name, f"curve_{k}", "1/H", LEAKAGE_CURVE, k, step, 0.0, np.inf) for k in range(count))
        return (*curve, Term(self.name, "split", "1", LEAK_SPLIT, 0, 0.1, -0.7, 0.7))

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """Drop of the inductance (flux over current) from no current to the largest that the leakage path carries.

        The path's own inductance is L_sigma with the stator current's leakage, (1 + L_sigma/L_M) L_sigma with the rotor's.
        """
        layout, flux = setting.layout, setting.leakage_flux_wb
        own_h = setting.nominal[2] * (1.0 + (0.5 + values.get("split", 0.0)) * layout.leak_ratio)
        weights = listed(values, "curve", layout.leak_vectors.shape[0])
        growth = own_h * spline_value(layout.leak_vectors, weights, layout.leak_top_wb, flux)
        return {"inductance_drop": (growth / (1.0 + growth), "1"), "at_current_a": (flux / own_h * (1.0 + growth), "A")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """The simulator states the drop at twice the rated current: first order in the square of the current."""
        reach = min(2.0 * setting.facts.rated_current_peak_a / sizes["at_current_a"], 3.0)
        gain = reach**2 * sizes["inductance_drop"] / max(1.0 - sizes["inductance_drop"], 0.1)
        return {"size": gain / (1.0 + gain), "shape": "root"}


CAUSE = LeakageSaturation()
