"""The currents are older than the voltages beside them. At these rates a filter's lag does the same."""

from __future__ import annotations

from commissioner.running.causes.cause import Cause, Confounder, Form

CAUSE = Cause(
    name="sampling_delay",
    title="Currents that come late",
    says="The currents are {size} older than the voltages recorded with them",
    meaning="The measurement's error, not the motor's. It turns active into reactive power and shifts R_s most.",
    remedy="Correct the time stamps of the currents by that, or use one converter for all channels.",
    physics="i(t - tau), cubic between samples",
    signature="in proportion to the current's slope: start, and the harmonics",
    source="definition",
    forms=(Form("", ("delay",)),),
    sizes=lambda v, s: {"delay_us": (1e6 * v["delay"], "us")},
    range=(-2000.0, 2000.0),
    confounders=(
        Confounder("sensor_lag", "a step of known current into the sensor on the bench", is_always_tied=True),
    ),
    scenario=lambda v, s: {"size": v["delay"]},
    is_of_measurement=True,
)
