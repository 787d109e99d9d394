"""A time column that runs too fast or too slow. To a motor whose speed was measured it is a speed that reads too high or too low, and is fitted as one."""

from __future__ import annotations

from commissioner.running.causes.cause import Cause, Confounder

CAUSE = Cause(
    name="sample_period",
    title="Wrong sample period",
    says="The sample period is {size} longer than the true one",
    meaning="The time column's error, not the motor's: inductances, times and the inertia are wrong by as much.",
    remedy="Correct sample_period_s or the time column; a sampling rate that was rounded or assumed is a usual reason.",
    physics="all rates by 1 - g: the voltage turns slower beside a speed that was counted by a clock of its own",
    signature="as a gain of the speed; of mains their frequency is off by as much",
    source="definition",
    forms=(),
    sizes=lambda v, s: {"too_long": (v["speed_gain"], "")},
    range=(-0.2, 0.2),
    needs=lambda record: record.has_speed,
    is_of_measurement=True,
    confounders=(
        Confounder("speed_sensor_gain", "measure the supply's frequency, or the sampling rate by a second clock"),
    ),
)
