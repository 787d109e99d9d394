"""The stator warms within the recording."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Confounder, Form, Sizes, Values


def _sizes(v: Values, _: Scales) -> Sizes:
    return {"gain_per_s_at_3x_rated": (v["stator_heat"], "1/s")}


CAUSE = Cause(
    name="stator_heating",
    title="Heating of the stator",
    says="The stator's resistance grows by {size} a second at three times rated current",
    meaning="Normal in long or repeated starts. Above a few hundredths a second the cooling or the load of the start is wrong.",
    remedy="Let the motor cool between starts.",
    physics="R_s (1 + h q), dq/dt = |i_s|^2 / (3 I_rated)^2: adiabatic; copper at 5 A/mm^2 gives 0.006 a second",
    signature="start and what follows it; 50 and -50 Hz, growing",
    source="adiabatic heating of copper",
    forms=(Form("", ("stator_heat",)),),
    sizes=_sizes,
    range=(0.0, 0.3),
    confounders=(Confounder("rotor_heating", "load steps"),),
    scenario=lambda v, s: {"size": v["stator_heat"]},
)
