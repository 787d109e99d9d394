"""Current sensors that read something at no current."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import PHASES, Cause, Confounder, Form, Sizes, Values


def _sizes(v: Values, s: Scales) -> Sizes:
    values = {p: v[f"current_offset_{p}"] * s.current_a for p in PHASES}
    order = sorted(PHASES, key=lambda p: -abs(values[p]))
    return {f"offset_{p}_a": (values[p], "A") for p in order}


def _scenario(v: Values, _: Scales) -> dict[str, float]:
    worst = max(range(3), key=lambda k: abs(v[f"current_offset_{PHASES[k]}"]))
    return {"size": v[f"current_offset_{PHASES[worst]}"], "phase": worst}


CAUSE = Cause(
    name="sensor_offset",
    title="Offset of the current sensors",
    says="A current sensor reads {size} at no current",
    meaning="The measurement's error, not the motor's.",
    remedy="Zero the sensors with the contactor open, or take the mean of an open stretch off.",
    physics="i_k + o_k",
    signature="0 Hz; of one sensor a third in the zero sequence",
    source="definition",
    forms=(Form("", ("current_offset_u", "current_offset_v", "current_offset_w")),),
    sizes=_sizes,
    range=(-1e6, 1e6),
    confounders=(Confounder("voltage_offset", "a stretch with the contactor open, or a third current sensor"),),
    scenario=_scenario,
    is_of_measurement=True,
)
