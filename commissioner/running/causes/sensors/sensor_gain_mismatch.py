"""The current sensors' gains differ; a gain that all share is an impedance scale and stays unseen."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import PHASES, Cause, Confounder, Form, Sizes, Values, one_of_three


def _parts(v: Values) -> tuple[float, float, float]:
    a, b = v["current_gain_v"], v["current_gain_w"]
    return (-a - b, a, b)


def _sizes(v: Values, _: Scales) -> Sizes:
    k, apart = one_of_three(_parts(v))
    return {f"{PHASES[k]}_against_the_others": (apart, "")}


def _scenario(v: Values, _: Scales) -> dict[str, float]:
    k, apart = one_of_three(_parts(v))
    return {"size": apart, "phase": k}


CAUSE = Cause(
    name="sensor_gain_mismatch",
    title="Unlike gains of the current sensors",
    says="One current sensor reads {size} differently from the two others",
    meaning="The measurement's error, not the motor's. It looks like an unbalance of the currents.",
    remedy="Correct the scale of that channel, or exchange two sensors and record again.",
    physics="i_k (1 + g_k), sum of g_k = 0",
    signature="zero sequence at the supply's frequency where three currents are measured; in proportion to current",
    source="definition",
    forms=(Form("", ("current_gain_v", "current_gain_w")),),
    sizes=_sizes,
    range=(-0.6, 0.6),
    confounders=(Confounder("voltage_gain_mismatch", "the third current sensor, or a start and load steps"),),
    scenario=_scenario,
    is_of_measurement=True,
)
