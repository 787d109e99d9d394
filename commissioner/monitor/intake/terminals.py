"""What the terminals alone say of a short steady stretch: torque from the air-gap power, speed from the plate's slip."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from commissioner.monitor.intake.columns import complete
from commissioner.monitor.signals.supply import phase_voltages, space_vector
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate
from commissioner.records import RunningRecording

RESISTANCE_STD, SLIP_STD, IRON_STD = 0.4, 0.25, 0.02
"""Relative: of the plate's stator resistance, of slip over torque (tolerance of IEC 60034-1 and temperature), and of the
apparent power for iron loss (which light load does not lower) and sensors."""


@dataclass(frozen=True)
class Terminals:
    """Mean torque and speed, each with its standard deviation."""

    torque_nm: float
    torque_std_nm: float
    speed_rad_per_s: float
    speed_std_rad_per_s: float


def from_terminals(part: RunningRecording, plate: Nameplate, frequency_hz: float) -> Terminals | None:
    """T = (P - 3 R_s I^2) / (omega / p), and the slip that this torque has by the plate; None where no motor draws so."""
    completed, _ = complete(part)
    v = completed.voltages_v
    star = phase_voltages(*v) if part.voltages_are_line_to_line else v
    current, voltage = space_vector(*completed.currents_a), space_vector(*star)
    if current.size < 16 or not np.all(np.isfinite(current)) or not np.all(np.isfinite(voltage)):
        return None
    current, voltage = current - current.mean(), voltage - voltage.mean()
    power = 1.5 * float(np.mean((voltage * np.conj(current)).real))
    apparent = 1.5 * float(np.sqrt(np.mean(np.abs(voltage) ** 2) * np.mean(np.abs(current) ** 2)))
    if not 0.02 * apparent < power < 0.99 * apparent or frequency_hz <= 0.0:
        return None
    copper = 1.5 * from_nameplate(plate).stator_resistance_ohm * float(np.mean(np.abs(current) ** 2))
    synchronous = 2.0 * math.pi * frequency_hz / plate.pole_pairs
    torque = (power - copper) / synchronous
    volts = float(np.sqrt(1.5 * np.mean(np.abs(voltage) ** 2)))
    rated_apparent = math.sqrt(3.0) * plate.rated_voltage_v * plate.rated_current_a
    of_iron = IRON_STD * max(apparent, rated_apparent * (volts / plate.rated_voltage_v) ** 2)
    torque_std = math.hypot(RESISTANCE_STD * copper, of_iron) / synchronous
    rated_nm = plate.rated_power_w / (plate.rated_speed_rpm * math.pi / 30.0)
    flux = float(np.sqrt(np.mean(np.abs(voltage) ** 2) / 2.0)) / frequency_hz
    rated_flux = plate.rated_voltage_v / math.sqrt(3.0) / plate.rated_frequency_hz
    drop = plate.rated_slip * 2.0 * math.pi * plate.rated_frequency_hz / plate.pole_pairs * torque / rated_nm
    drop *= (rated_flux / flux) ** 2
    return Terminals(
        torque, torque_std, synchronous - drop, math.hypot(SLIP_STD * drop, drop * torque_std / max(torque, 1e-9))
    )
