"""The inverter's legs lose voltage that the commanded one does not show."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Form, Sizes, Values


def _sizes(v: Values, s: Scales) -> Sizes:
    return {"lost_per_leg_v": (v["dead_voltage"] * s.voltage_v, "V")}


CAUSE = Cause(
    name="dead_time",
    title="Dead time of the inverter",
    says="Each leg of the inverter loses {size} that the commanded voltage does not show",
    meaning="No fault of the motor. At low speed the torque ripples a little.",
    remedy="Switch dead-time compensation on if the drive has one.",
    physics="u -= V sum of i_k / sqrt(i_k^2 + k^2) n_k 2/3; offered where the voltages are an inverter's (a switching frequency is stated)",
    signature="lowest frequency of a ramp; 5th and 7th",
    source="Holtz, Quan, IEEE Trans. Ind. Appl. 38(4), 2002",
    forms=(Form("", ("dead_voltage",)),),
    sizes=_sizes,
    range=(0.0, 1e3),
    scenario=lambda v, s: {"size": _sizes(v, s)["lost_per_leg_v"][0]},
    needs=lambda record: record.is_commanded,
)
