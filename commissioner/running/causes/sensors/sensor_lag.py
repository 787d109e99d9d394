"""A filter in the current sensors. Below its corner it is a delay and is fitted as one: the two are never told apart here."""

from __future__ import annotations

from commissioner.running.causes.cause import Cause

CAUSE = Cause(
    name="sensor_lag",
    title="Lag of the current sensors",
    says="The currents pass a filter of {size}",
    meaning="The measurement's error, not the motor's.",
    remedy="Put the same filter into the voltage channels, or correct the time stamps.",
    physics="tau di/dt = i_true - i; at 5 to 10 kHz a delay of tau, the gap in chi-square is 0 to 2 %",
    signature="as a delay",
    source="definition",
    forms=(),
    sizes=lambda v, s: {"time_constant_us": (1e6 * v["delay"], "us")},
    range=(0.0, 2000.0),
    scenario=lambda v, s: {"size": v["delay"]},
    is_of_measurement=True,
)
