"""Deep bars or a second cage: the rotor's resistance rises with its slip frequency."""

from __future__ import annotations

import math

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Confounder, Form, Sizes, Values


def _sizes(v: Values, s: Scales) -> Sizes:
    """At standstill the slip has the rated frequency: of k there is what (w / w_b)^2 leaves."""
    share = 1.0 / (1.0 + (v["bar_corner"] / s.frequency_rad_per_s) ** 2)
    corner_hz = v["bar_corner"] / (2 * math.pi)
    return {"added_at_standstill": (v["bar_resistance"] * share, ""), "corner_hz": (corner_hz, "Hz")}


CAUSE = Cause(
    name="rotor_skin_effect",
    title="Skin effect in the rotor's bars",
    says="The rotor's resistance is up to {size} higher at starting slip than when the motor runs",
    meaning="Normal for deep bars and double cages. A drive needs the resistance of small slip.",
    remedy="Use R_R of the running motor for slip compensation, the locked one for starting calculations.",
    physics="R_R i_R + k R_R (i_R - c), dc/dt = w_b (i_R - c), both in rotor coordinates; k and w_b are fitted",
    signature="start; nothing at small slip",
    source="Maddi, Aouzellag, PIER M 59, 2017, 147-160",
    forms=(Form("", ("bar_resistance",), ("bar_corner",)),),
    sizes=_sizes,
    range=(0.0, 8.0),
    confounders=(
        Confounder("voltage_gain_mismatch", "a start"),
        Confounder("stator_asymmetry", "a start"),
        Confounder("iron_loss", "a start from the mains with the speed recorded"),
    ),
    negative_sequence="impedes",
    is_sized_by_law=lambda _: True,
    scenario=lambda v, _: {"size": v["bar_resistance"]},
)
