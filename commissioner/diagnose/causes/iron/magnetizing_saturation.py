"""Saturation of the main flux path."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from commissioner.diagnose.causes.cause import Cause, Confounder, Entry, Form, Words
from commissioner.diagnose.causes.in_points import InPoints
from commissioner.diagnose.causes.iron.side import split
from commissioner.diagnose.causes.setting import Array, Numbers, Setting, Sizes, listed, spline_value
from commissioner.diagnose.intake.points import Points
from commissioner.diagnose.kernels.kinds import IRON_CURVE
from commissioner.diagnose.plant.model import Model, Term

FOOT_SHARE = 0.5
"""Of the flux reached, at which a foot that ends within three intervals of the dictionary has ended."""


def in_table(x: Array, points: Points, scale: Mapping[str, float]) -> dict[str, float]:
    lowest = float(np.min(points.phase_voltage_v / points.omega)) / scale["flux_wb"]
    extra = (1.0 + x[0]) / (1.0 + x[0] * lowest ** x[1]) - 1.0
    return {"extra_current_at_highest_flux": float(extra), "exponent": float(x[1])}


class MagnetizingSaturation(Cause):
    """Extra magnetizing current G(|psi|) psi, G(0) = 0, a cubic spline over the flux reached, rising beyond half of
    it (below, the permeability of steel may still grow: Rayleigh's foot).
    `split` moves the saturating flux between rotor (-0.5) and stator (+0.5) side of the leakage.
    """

    name = "magnetizing_saturation"
    place = 5
    title = "Saturation of the main flux path"
    family = "odd"
    sign = 1
    form = Form.SHAPED
    is_common = True
    bends_l_m = True
    where = frozenset({"at_flux_wb"})
    signature = "odd lines of the lowest tone, growing very fast with level; even lines with DC bias"
    source = "i_M = psi/L_M (1 + b |psi/psi_n|^S): Qu, Ranta, Hinkkanen, Luomi, IEEE Trans. Ind. Appl. 48(3), 2012"
    confounders = (Confounder("dc_link_sag"),)
    split_by = "repeat the lowest tone at half and at full flux"
    decides = "Repeat the test of the lowest frequency at half the level."
    words = Words(
        "The motor's main iron saturates: {size} more magnetizing current at the highest flux of the test",
        "Every motor does this near rated flux. One L_M is right at one flux only.",
        "Enter the L_M at rated flux that `commissioner identify` gives, and its curve where the drive has a table for it.",
        is_normal=True,
    )
    advice = "Normal. Give the drive its saturation curve if it takes one."
    in_points = InPoints(
        "magnetizing", (0.3, 5.0), (0.0, 1.0), (50.0, 14.0), lambda x, flux, _speed: 1.0 + x[0] * flux ** x[1], in_table
    )

    def terms(self, setting: Setting) -> tuple[Term, ...]:
        count = setting.layout.iron_vectors.shape[0]
        step = setting.facts.rated_current_peak_a / max(setting.iron_flux_wb, 1e-9) * 0.01
        # on twice the knots what falls at k falls from 2 k - 1 to 2 k + 2: a curve must not lose its foot there
        foot = FOOT_SHARE * (count - 1) - 2.0
        curve = tuple(
            Term(self.name, f"curve_{k}", "A/Wb", IRON_CURVE, k, step, 0.0 if k > foot else -np.inf)
            for k in range(count)
        )
        return (*curve, split(self.name))

    def sizes(self, setting: Setting, values: Numbers) -> Sizes:
        """Extra current against the iron at its most permeable (that of sheet at small flux is lower) where it is largest: at the
        largest flux, of iron that is only hard to magnetize at first below it.
        """
        layout = setting.layout
        weights = listed(values, "curve", layout.iron_vectors.shape[0])
        grid = np.linspace(0.0, setting.iron_flux_wb, 60)
        curve = np.array([spline_value(layout.iron_vectors, weights, layout.iron_top_wb, float(flux)) for flux in grid])
        extra = (curve - curve.min()) * grid
        most = int(np.argmax(extra))
        return {"extra_current_a": (float(extra[most]), "A"), "at_flux_wb": (float(grid[most]), "Wb")}

    def to_scenario(self, sizes: Numbers, values: Numbers, setting: Setting, model: Model) -> Entry:
        """Power law through the curve at the flux reached and at 0.8 of it."""
        layout, flux = setting.layout, sizes["at_flux_wb"]
        weights = listed(values, "curve", layout.iron_vectors.shape[0])
        high, low = (spline_value(layout.iron_vectors, weights, layout.iron_top_wb, a * flux) for a in (1.0, 0.8))
        order = float(np.clip(np.log(max(high, 1e-12) / max(low, 1e-12)) / np.log(1.25), 1.0, 20.0))
        rated = setting.facts.rated_flux_wb or flux
        inductance = model.nominal[2] + model.nominal[3]
        return {"size": high * inductance * (rated / flux) ** order, "order": order, "shape": "power"}


CAUSE = MagnetizingSaturation()
