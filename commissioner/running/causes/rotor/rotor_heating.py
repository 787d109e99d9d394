"""The rotor warms within the recording: R_R grows with the heat that its current has made."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Confounder, Form, Sizes, Values


def _sizes(v: Values, _: Scales) -> Sizes:
    return {"gain_per_s_at_3x_rated": (v["rotor_heat"], "1/s")}


CAUSE = Cause(
    name="rotor_heating",
    title="Heating of the rotor",
    says="The rotor's resistance grows by {size} a second at three times rated current",
    meaning="Normal in a start; a slip compensation drifts by that much.",
    remedy="Let the motor cool between starts; use R_R at working temperature.",
    physics="R_R (1 + h q), dq/dt = |i_R|^2 / (3 I_rated)^2: adiabatic",
    signature="50 Hz with skirts, growing with the heat",
    source="adiabatic heating of copper and aluminium; Proca, Keyhani, IEEE Trans. Energy Conversion 17(1), 2002",
    forms=(Form("", ("rotor_heat",)),),
    sizes=_sizes,
    range=(0.0, 0.5),
    confounders=(Confounder("speed_sensor_gain", "load steps"), Confounder("rotor_asymmetry", "a loaded stretch")),
    scenario=lambda v, s: {"size": v["rotor_heat"]},
)
