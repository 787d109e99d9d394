"""Broken bars or end rings: the rotor has two unequal axes, which turn with it."""

from __future__ import annotations

import math

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Form, Sizes, Values


def _sizes(v: Values, _: Scales) -> Sizes:
    return {"relative_asymmetry": (math.hypot(v["cage_asymmetry_re"], v["cage_asymmetry_im"]), "")}


CAUSE = Cause(
    name="rotor_asymmetry",
    title="Asymmetry of the rotor (broken bar)",
    says="The rotor's resistance differs by {size} of its mean between two directions fixed in it: as broken bars make it",
    meaning="A fault of the motor: about two thirds of one over the number of bars for each broken bar beside another.",
    remedy="Watch it; from one broken bar on neighbouring bars carry more. Inspect the cage at the next stop.",
    physics="-R_R a exp(2 j theta) conj(i_R), theta the rotor's electrical angle, carried through the recording",
    signature="(1 - 2 s) f under load; in a start it sweeps from -f to f. A load that swings has both side bands and speed",
    source="Hamdani et al., Serbian J. Electrical Eng. 5(1), 2008; Kuptsov et al., PIER B 45, 2012, 269-290",
    forms=(Form("", ("cage_asymmetry_re", "cage_asymmetry_im")),),
    sizes=_sizes,
    range=(0.0, 0.6),
    scenario=lambda v, s: {"size": _sizes(v, s)["relative_asymmetry"][0]},
)
