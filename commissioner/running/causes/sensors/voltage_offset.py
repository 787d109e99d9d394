"""Voltage sensors that read something at no voltage: the simulated current gets a direct part."""

from __future__ import annotations

import math

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Form, Sizes, Values


def _sizes(v: Values, s: Scales) -> Sizes:
    return {"offset_v": (s.voltage_v * math.hypot(v["voltage_offset_re"], v["voltage_offset_im"]), "V")}


CAUSE = Cause(
    name="voltage_offset",
    title="Offset of the voltage sensors",
    says="The voltage sensors read {size} at no voltage",
    meaning="The measurement's error, not the motor's; a few millivolts make a direct current in the simulation.",
    remedy="Zero the sensors with the contactor open.",
    physics="u + o, the same at every sample; the flux carries it into a direct current",
    signature="0 Hz, no zero sequence",
    source="definition",
    forms=(Form("", ("voltage_offset_re", "voltage_offset_im")),),
    sizes=_sizes,
    range=(0.0, 1e6),
    is_of_measurement=True,
)
