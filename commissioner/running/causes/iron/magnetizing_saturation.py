"""The main flux saturates: more magnetizing current than in proportion. Which flux (stator's, air gap's, rotor's) is a form, not a detail."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Confounder, Form, Sizes, Values


def _sizes(v: Values, _: Scales) -> Sizes:
    extra = sum(v[f"{side}_saturation_{k}"] for side in ("stator", "gap", "rotor") for k in (1, 2, 3))
    return {"extra_at_rated_flux": (extra, "")}


CAUSE = Cause(
    name="magnetizing_saturation",
    title="Saturation of the main flux",
    says="The iron saturates: at rated flux it takes {size} more magnetizing current than in proportion",
    meaning="Normal for a motor. A magnetizing inductance holds for the flux at which it was measured only.",
    remedy="Give the drive the magnetizing curve where it has a place for one.",
    physics="i_M = psi / L_M (1 + s1 y + s2 y^2 + s3 y^3), y = (psi / psi_rated)^2; psi of the stator, of the rotor, or of the air "
    "gap, which lies at a share k of L_sigma between them; k is fitted. L_M is that of little flux.",
    signature="first cycles after closing, where the flux swings to twice its rating; 150 Hz under unbalance, 350 Hz",
    source="Slemon 1989, DOI 10.1109/28.44251; power series after Qu et al. 2012, DOI 10.1109/TIA.2012.2190818",
    forms=(
        Form("stator flux", ("stator_saturation_1", "stator_saturation_2", "stator_saturation_3")),
        Form("air-gap flux", ("gap_saturation_1", "gap_saturation_2", "gap_saturation_3"), ("leakage_split",)),
        Form("rotor flux", ("rotor_saturation_1", "rotor_saturation_2", "rotor_saturation_3")),
    ),
    sizes=_sizes,
    range=(0.0, 5.0),
    confounders=(
        Confounder("rotor_skin_effect", "a start, or a second voltage at one load"),
        Confounder("leakage_saturation", "a start"),
    ),
    scenario=lambda v, s: {"size": _sizes(v, s)["extra_at_rated_flux"][0]},
)
