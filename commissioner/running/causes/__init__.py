"""The catalogue of a running motor: every file of its rooms ends with CAUSE. Their order here is that of trying and of ties."""

from __future__ import annotations

from collections.abc import Callable

from commissioner.estimation.record import Record
from commissioner.running.causes.cause import Cause, Confounder, Values
from commissioner.running.causes.iron import iron_loss, leakage_saturation, magnetizing_saturation
from commissioner.running.causes.load import load_ripple
from commissioner.running.causes.rotor import rotor_asymmetry, rotor_heating, rotor_skin_effect
from commissioner.running.causes.sensors import (
    sample_period,
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
        voltage_gain_mismatch, voltage_offset, speed_sensor_gain, sample_period, speed_sensor_lag, load_ripple,
    )
}  # fmt: skip


def confounders_of(name: str) -> dict[str, str]:
    """Who may look the same, with what tells them apart; stated in one file, known both ways."""
    own = {c.name: c.told_apart_by for c in CATALOGUE[name].confounders}
    return own | {o.name: c.told_apart_by for o in CATALOGUE.values() for c in o.confounders if c.name == name}


def goes_by(name: str, record: Record, values: Values) -> tuple[str, ...]:
    """Whose the numbers of this cause may be in this recording, the likeliest first."""
    return CATALOGUE[name].goes_by(record, values) or (name,)


def always_tied(name: str) -> tuple[str, ...]:
    """Who is the same at the terminals, whatever is recorded."""
    return _alike(name, lambda c: c.is_always_tied)


def tied_in(name: str, record: Record) -> tuple[str, ...]:
    """Who is the same in this recording.

    Without a start a wrong voltage gain, shorted turns and a resistance in one line are a current of negative sequence alike; a fit that parts them by
    the little that harmonics and noise tell parts them by what its own laws lack. (Four of four turn faults of another simulator under one steady
    load and mains of 1.2 to 3 % unbalance, two of them without a speed, were a voltage gain, 0.99 sure.)
    """
    lacking = {"a start": not record.has_start, "a second load": record.has_one_load}
    return _alike(name, lambda c: c.is_always_tied or lacking.get(c.tied_without, False))


def _alike(name: str, is_tied: Callable[[Confounder], bool]) -> tuple[str, ...]:
    own = [c.name for c in CATALOGUE[name].confounders if is_tied(c)]
    own += [o.name for o in CATALOGUE.values() for c in o.confounders if c.name == name and is_tied(c)]
    return tuple(dict.fromkeys(own))
