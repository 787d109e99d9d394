"""A speed that is read late: a filter or a counting interval."""

from __future__ import annotations

from commissioner.running.causes.cause import Cause, Form

CAUSE = Cause(
    name="speed_sensor_lag",
    title="Lag of the speed sensor",
    says="The speed is read {size} late",
    meaning="The measurement's error, not the motor's.",
    remedy="Take the lag off the speed's time stamps, or shorten its filter.",
    physics="w = w_read + tau dw_read/dt",
    signature="run-up and load steps",
    source="definition",
    forms=(Form("", ("speed_lag",)),),
    sizes=lambda v, s: {"lag_ms": (1e3 * v["speed_lag"], "ms")},
    range=(-50.0, 50.0),
    scenario=lambda v, s: {"size": v["speed_lag"]},
    needs=lambda record: record.has_speed,
    is_of_measurement=True,
)
