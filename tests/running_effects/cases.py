"""A drawn case as the diagnosis gets it, and the key for whoever scores it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording
from sim.motoring import kernel as at
from sim.motoring.effects import machine_array
from sim.motoring.hidden import draw
from sim.motoring.machine import Scenario
from sim.motoring.recording import record

RATED = (
    "rated_power_w", "rated_voltage_v", "rated_frequency_hz", "rated_current_a", "rated_speed_rpm", "power_factor",
    "pole_pairs", "connection",
)  # fmt: skip
SAME_CLASS = {"sensor_lag": {"sampling_delay", "sensor_lag"}, "sampling_delay": {"sampling_delay", "sensor_lag"}}
SIZES = {"sensor_offset": None, "leakage_saturation": None}
"""Sizes that are defined otherwise in simulator and diagnosis and are not compared."""


@dataclass(frozen=True)
class Case:
    """One blind case; `only` forces the cause."""

    seed: int
    stratum: str
    course: str = "start"
    has_speed: bool = True
    only: str = ""

    def scenario(self) -> Scenario:
        return draw(self.seed, self.stratum, self.course, self.only, self.has_speed)


def elsewhere(scenario: Scenario) -> Scenario:
    """The same motor started or ramped up with other loads, closed at another angle, seen by sensors that have no noise."""
    first, *others = scenario.course.steps
    steps = ((first[0], 1.7 * first[1]), *((t, 0.4 * torque) for t, torque in others))
    return replace(
        scenario,
        course=replace(scenario.course, constant_nm=2.0 * scenario.course.constant_nm, steps=steps),
        supply=replace(scenario.supply, phase_rad=scenario.supply.phase_rad + 1.0),
        sensors=replace(
            scenario.sensors,
            current_noise_a=0.0,
            voltage_noise_v=0.0,
            speed_noise_rad_per_s=0.0,
            speed_ripple_rad_per_s=0.0,
            has_speed=True,
        ),
    )


def taken(scenario: Scenario, seed: int) -> tuple[RunningRecording, Nameplate, dict[str, Any]]:
    """Recording, plate, answer key."""
    columns, metadata, truth = record(scenario, seed)
    return as_recording(columns, metadata), as_plate(metadata), truth


def as_recording(columns: dict[str, np.ndarray], metadata: dict[str, Any]) -> RunningRecording:
    empty = np.full(columns["time_s"].size, np.nan)
    return RunningRecording(
        columns["time_s"],
        tuple(columns.get(f"current_{p}_a", empty) for p in "uvw"),
        tuple(columns[f"voltage_{p}_v"] for p in "uvw"),
        False,
        columns.get("speed_rad_per_s"),
        float(metadata["sample_period_s"]),
        metadata,
        "blind",
    )


def as_plate(metadata: dict[str, Any]) -> Nameplate:
    return Nameplate(**{k: metadata[k] for k in RATED})


def true_size(effect: dict[str, Any], scenario: Scenario) -> float | None:
    """The truth in the diagnosis' unit of the first size; None where the two define it differently."""
    name, size, plate = effect["name"], float(effect["size"]), scenario.nameplate
    if name in SIZES:
        return None
    if name == "iron_loss":
        return size * plate["rated_power_w"]
    if name in ("sampling_delay", "sensor_lag"):
        return 1e6 * size
    if name == "speed_sensor_lag":
        return 1e3 * size
    if name == "rotor_skin_effect":  # the key's is that of high frequencies, ours that of the rated one
        m, omega = machine_array(scenario), 2.0 * np.pi * plate["rated_frequency_hz"]
        bars = ((m[at.BAR_1], m[at.CORNER_1]), (m[at.BAR_2], m[at.CORNER_2]))
        return float(sum(added / (1.0 + (corner / omega) ** 2) for added, corner in bars))
    if name == "line_resistance":
        return size * scenario.machine.stator_resistance_ohm
    return size
