"""What the terminals alone say of a steady stretch: torque from the air-gap power, speed from the plate's slip."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from commissioner.monitor.intake.findings import Audited, Fundamental
from commissioner.monitor.intake.sensors import SKEW_STD_S
from commissioner.monitor.signals.quiet import wander
from commissioner.motor.nameplate import Nameplate
from commissioner.motor.running import from_nameplate, stator_impedance

RESISTANCE_STD, SLIP_STD, IRON_STD = 0.4, 0.25, 0.02
"""Relative: of the plate's stator resistance, of slip over torque (tolerance of IEC 60034-1 and temperature), and of the
apparent power for iron loss (which light load does not lower) and sensors."""
NEGATIVE_LEAST = 0.7
"""Of the plate's impedance at negative sequence, the motor's at least."""
LEVEL_S, LEVEL_PERIODS = 0.1, 3.0
"""Over which the power has a level: seconds, and supply periods where these are longer (an unbalance pulses with twice the supply)."""


@dataclass(frozen=True)
class Terminals:
    """Mean torque and speed, each with its standard deviation."""

    torque_nm: float
    torque_std_nm: float
    speed_rad_per_s: float
    speed_std_rad_per_s: float


def power_wander_w(audited: Audited) -> float:
    """rms of the power's level within the stretch around its mean: a load that drifts or swings; zero where nothing is known."""
    seen, power = audited.fundamental, 1.5 * np.real(audited.voltage_v * np.conj(audited.current_a))
    if seen is None or not seen.frequency_hz > 0.0:
        return 0.0
    level_s = max(LEVEL_S, LEVEL_PERIODS / seen.frequency_hz)
    return wander(power, max(round(level_s / audited.sample_period_s), 1))


def late_w(seen: Fundamental, late_s: float) -> float:
    """What currents that are `late_s` behind their voltages make of the reactive power."""
    return abs(seen.reactive_var) * 2.0 * math.pi * seen.frequency_hz * late_s


def lost_in_loop_w(seen: Fundamental, plate: Nameplate) -> float:
    """What a shorted loop may take of the power, none of which is torque: it draws as much current of positive sequence as of negative, and no
    more of that than the voltages' own unbalance does not drive."""
    impedance = stator_impedance(from_nameplate(plate), 2.0 * math.pi * seen.frequency_hz, 2.0 - plate.rated_slip)
    driven = abs(seen.voltage_negative_v) / (NEGATIVE_LEAST * abs(impedance))
    return 1.5 * abs(seen.voltage_v) * max(abs(seen.current_negative_a) - driven, 0.0)


def from_terminals(
    seen: Fundamental | None, plate: Nameplate, wander_w: float = 0.0, skew_std_s: float = SKEW_STD_S
) -> Terminals | None:
    """T = (P - 3 R_s I^2) / (omega / p), and the slip that this torque has by the plate; None where no machine draws so. `wander_w`:
    rms of the power's movement within the stretch, which no mean tells; `skew_std_s`: standard deviation of the currents' delay against the voltages,
    which takes reactive power for active."""
    if seen is None:
        return None
    apparent = math.hypot(seen.power_w, seen.reactive_var)
    if not 0.02 * apparent < abs(seen.power_w) < 0.99 * apparent or seen.reactive_var < 0.0 or seen.frequency_hz <= 0.0:
        return None
    copper = 1.5 * from_nameplate(plate).stator_resistance_ohm * abs(seen.current_a) ** 2
    synchronous = 2.0 * math.pi * seen.frequency_hz / plate.pole_pairs
    torque = (seen.power_w - copper) / synchronous
    volts = math.sqrt(1.5) * abs(seen.voltage_v)
    rated_apparent = math.sqrt(3.0) * plate.rated_voltage_v * plate.rated_current_a
    of_iron = IRON_STD * max(apparent, rated_apparent * (volts / plate.rated_voltage_v) ** 2)
    late = late_w(seen, skew_std_s)
    torque_std = math.hypot(RESISTANCE_STD * copper, of_iron, lost_in_loop_w(seen, plate), wander_w, late) / synchronous
    rated_nm = plate.rated_power_w / (plate.rated_speed_rpm * math.pi / 30.0)
    flux, rated_flux = volts / seen.frequency_hz, plate.rated_voltage_v / plate.rated_frequency_hz
    drop = plate.rated_slip * 2.0 * math.pi * plate.rated_frequency_hz / plate.pole_pairs * torque / rated_nm
    drop *= (rated_flux / flux) ** 2
    return Terminals(
        torque, torque_std, synchronous - drop, math.hypot(SLIP_STD * drop, drop * torque_std / max(abs(torque), 1e-9))
    )
