"""The current sensors' gains differ; a gain that all share is an impedance scale and stays unseen.

Of two sensors the third current is minus their sum: it carries what one reads wrong, which turns the current's vector as well."""

from __future__ import annotations

from collections.abc import Callable

from commissioner.estimation.numbers import Scales
from commissioner.estimation.record import Record
from commissioner.running.causes.cause import PHASES, Cause, Confounder, Form, Sizes, Values, of_one_gain, one_of_three


def _parts(v: Values) -> tuple[float, float, float]:
    a, b = v["current_gain_v"], v["current_gain_w"]
    return (-a - b, a, b)


PAIRS = {"u": ("v", "w"), "v": ("w", "u"), "w": ("u", "v")}
"""The two that are measured where this phase is computed."""


def _has_three(record: Record) -> bool:
    """Sensors, or what may have been three before it was written without its sum."""
    return record.has_zero or len(record.computed) == len(PHASES)


def _may_lack(phase: str) -> Callable[[Record], bool]:
    return lambda record: phase in record.computed


def _computed(v: Values) -> str | None:
    """The phase without a sensor; None where there are three."""
    return next((p for p in PHASES if v[f"current_pair_{p}"] != 0.0), None)


def _sizes(v: Values, _: Scales) -> Sizes:
    if without := _computed(v):
        first, second = PAIRS[without]
        return {f"{first}_against_{second}": (v[f"current_pair_{without}"], "")}
    k, apart = one_of_three(_parts(v))
    return {f"{PHASES[k]}_against_the_others": (apart, "")}


def _leaves_open(v: Values) -> str:
    """The mean of two gains, or of three, whose sum is taken as zero."""
    if without := _computed(v):
        return of_one_gain(abs(v[f"current_pair_{without}"]) / 2.0)
    return of_one_gain(abs(one_of_three(_parts(v))[1]) / 3.0)


def _scenario(v: Values, _: Scales) -> dict[str, float]:
    if without := _computed(v):
        return {"size": v[f"current_pair_{without}"], "phase": PHASES.index(PAIRS[without][0])}
    k, apart = one_of_three(_parts(v))
    return {"size": apart, "phase": k}


CAUSE = Cause(
    name="sensor_gain_mismatch",
    title="Unlike gains of the current sensors",
    says="One current sensor reads {size} differently from the others",
    meaning="The measurement's error, not the motor's. It looks like an unbalance of the currents.",
    remedy="Correct the scale of that channel, or exchange two sensors and record again.",
    physics="i_k (1 + g_k), sum of g_k = 0; of two sensors the third is minus their sum",
    signature="zero sequence at the supply's frequency where three currents are measured; in proportion to current",
    source="definition",
    forms=(
        Form("", ("current_gain_v", "current_gain_w"), needs=_has_three),
        *(Form(f"{p}_computed", (f"current_pair_{p}",), needs=_may_lack(p)) for p in PHASES),
    ),
    sizes=_sizes,
    range=(-0.6, 0.6),
    confounders=(Confounder("voltage_gain_mismatch", "the third current sensor, or a start and load steps"),),
    scenario=_scenario,
    is_of_measurement=True,
    leaves_open=_leaves_open,
)
