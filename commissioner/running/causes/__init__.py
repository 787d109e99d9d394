"""The catalogue of a running motor: every file of its rooms ends with CAUSE. Their order here is that of trying and of ties."""

from __future__ import annotations

from commissioner.running.causes.cause import Cause
from commissioner.running.causes.iron import iron_loss, leakage_saturation, magnetizing_saturation
from commissioner.running.causes.rotor import rotor_asymmetry, rotor_heating, rotor_skin_effect
from commissioner.running.causes.sensors import (
    sampling_delay,
    sensor_gain_mismatch,
    sensor_lag,
    sensor_offset,
    speed_sensor_gain,
    speed_sensor_lag,
    voltage_gain_mismatch,
    voltage_offset,
)
from commissioner.running.causes.stator import dead_time, line_resistance, stator_asymmetry, stator_heating

CATALOGUE: dict[str, Cause] = {
    room.CAUSE.name: room.CAUSE
    for room in (
        magnetizing_saturation, leakage_saturation, iron_loss, rotor_skin_effect, rotor_heating, rotor_asymmetry, stator_heating,
        stator_asymmetry, line_resistance, dead_time, sensor_gain_mismatch, sensor_offset, sampling_delay, sensor_lag,
        voltage_gain_mismatch, voltage_offset, speed_sensor_gain, speed_sensor_lag,
    )
}  # fmt: skip


def confounders_of(name: str) -> dict[str, str]:
    """Who may look the same, with what tells them apart; stated in one file, known both ways."""
    own = {c.name: c.told_apart_by for c in CATALOGUE[name].confounders}
    return own | {o.name: c.told_apart_by for o in CATALOGUE.values() for c in o.confounders if c.name == name}


def always_tied(name: str) -> tuple[str, ...]:
    """Who is the same at the terminals, whatever is recorded."""
    own = [c.name for c in CATALOGUE[name].confounders if c.is_always_tied]
    own += [o.name for o in CATALOGUE.values() for c in o.confounders if c.name == name and c.is_always_tied]
    return tuple(dict.fromkeys(own))
