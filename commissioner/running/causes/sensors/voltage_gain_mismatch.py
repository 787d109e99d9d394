"""The voltage sensors' gains differ; a gain that all share is an impedance scale and stays unseen."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import PHASES, Cause, Form, Sizes, Values, in_phases, of_one_gain, one_of_three


def _apart(v: Values) -> tuple[int, float]:
    k, g = one_of_three(in_phases(v["voltage_gain_re"], v["voltage_gain_im"]))
    return k, -g  # the machine gets what is taken off the reading


def _sizes(v: Values, _: Scales) -> Sizes:
    k, g = _apart(v)
    return {f"{PHASES[k]}_against_the_others": (g, "")}


CAUSE = Cause(
    name="voltage_gain_mismatch",
    title="Unlike gains of the voltage sensors",
    says="One voltage sensor reads {size} differently from the two others",
    meaning="The measurement's error, not the motor's. It looks like an unbalance of the mains.",
    remedy="Correct the scale of that channel, or exchange two probes and record again.",
    physics="u + g conj(u), g turns twice with the phase that differs",
    signature="-50, -250, 350 Hz in proportion to the voltage; nothing in the zero sequence",
    source="definition",
    forms=(Form("", ("voltage_gain_re", "voltage_gain_im")),),
    sizes=_sizes,
    range=(-0.6, 0.6),
    negative_sequence="adds",
    scenario=lambda v, s: {"size": _apart(v)[1], "phase": _apart(v)[0]},
    is_of_measurement=True,
    leaves_open=lambda v: of_one_gain(abs(_apart(v)[1]) / 3.0),
)
