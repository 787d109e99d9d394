"""A speed signal whose scale is wrong: a tachogenerator, an analogue output. An encoder that counts pulses cannot have it."""

from __future__ import annotations

from commissioner.estimation.record import Record
from commissioner.motor.channels.clock import of_speed_gain
from commissioner.running.causes.cause import Cause, Confounder, Form, Values

OWN, CLOCK = "speed_sensor_gain", "sample_period"


def _goes_by(record: Record, v: Values) -> tuple[str, ...]:
    """Of mains their frequency tells it from a wrong sample period."""
    whose = of_speed_gain(record.mains_hz, v["speed_gain"])
    return {"sensor": (OWN,), "period": (CLOCK,), "either": (OWN, CLOCK)}[whose]


CAUSE = Cause(
    name=OWN,
    title="Gain of the speed sensor",
    says="The speed is read {size} too high",
    meaning="The measurement's error, not the motor's: the slip is wrong by much more than that.",
    remedy="Correct the scale of the speed; ask what the sensor is: counted pulses cannot read a speed too high.",
    physics="w = w_read (1 - g)",
    signature="no load most; the opposite of iron loss",
    source="definition",
    forms=(Form("", ("speed_gain",)),),
    sizes=lambda v, s: {"gain": (v["speed_gain"], "")},
    range=(-0.2, 0.2),
    scenario=lambda v, s: {"size": v["speed_gain"]},
    needs=lambda record: record.has_speed,
    is_of_measurement=True,
    goes_by=_goes_by,
    confounders=(Confounder("rotor_skin_effect", "a start, or two loads", tied_without="a second load"),),
)
