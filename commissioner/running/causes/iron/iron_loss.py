"""Hysteresis and eddy losses of the stator's iron: a conductance beside the magnetizing inductance."""

from __future__ import annotations

from commissioner.estimation.numbers import Scales
from commissioner.running.causes.cause import Cause, Confounder, Form, Sizes, Values


def _sizes(v: Values, s: Scales) -> Sizes:
    watts = 1.5 * v["iron_conductance"] * s.current_a * s.voltage_v
    return {"loss_at_rated_voltage_w": (watts, "W")}


CAUSE = Cause(
    name="iron_loss",
    title="Iron loss",
    says="The iron takes {size} at rated voltage",
    meaning="Normal: two or three hundredths of rated power. Torque from the air gap is wrong by that much if it is left out.",
    remedy="Nothing to repair. Much more than the maker states speaks of damaged sheets.",
    physics="i_fe = (d psi_s / dt) G; torque is made without it. Its sign is fixed: it takes power",
    signature="end of the run-up and no load; opposite to a speed that reads high",
    source="IEEE Std 112-2017 (separation of losses)",
    forms=(Form("", ("iron_conductance",)),),
    sizes=_sizes,
    range=(0.0, 1e7),
    is_sized_by_law=lambda record: not record.has_speed,  # what it takes is load then
    confounders=(
        Confounder(
            "speed_sensor_gain", "count an encoder's pulses over a known number of turns, or read the shaft's power"
        ),
        Confounder("sampling_delay", "a second load, or a start"),
    ),
    scenario=lambda v, s: {
        "size": _sizes(v, s)["loss_at_rated_voltage_w"][0] / (s.torque_nm * s.frequency_rad_per_s / s.pole_pairs)
    },
)
