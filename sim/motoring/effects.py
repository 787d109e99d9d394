"""The hidden effects of a running motor: unit, range of hidden draws, and how each enters machine or sensors.

Sizes as practice has them; rotor and iron follow other laws than a fit would choose (sinh iron, 1/sqrt leakage, two bar
sections, tanh dead time, a shorted loop with its own time constant).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.motoring import kernel as at
from sim.motoring.machine import Effect, Scenario


@dataclass(frozen=True)
class Kind:
    """`smallest`, `largest`: of hidden draws. `in_phase`: it sits in one phase. `needs`: what a recording must have."""

    unit: str
    meaning: str
    smallest: float
    largest: float
    in_phase: bool = False
    is_signed: bool = False
    needs: str = ""


CATALOGUE: dict[str, Kind] = {
    "magnetizing_saturation": Kind("", "extra magnetizing current at rated flux, of the linear one", 0.15, 0.5),
    "leakage_saturation": Kind("", "leakage inductance lost at infinite current, of the linear one", 0.08, 0.3),
    "rotor_skin_effect": Kind("", "rotor resistance added at high slip frequency, of R_r", 0.3, 0.9),
    "iron_loss": Kind("", "iron loss at rated voltage, of rated power", 0.01, 0.04),
    "stator_heating": Kind("", "R_s gained a second at three times rated current", 0.02, 0.08),
    "rotor_heating": Kind("", "R_r gained a second at three times rated current", 0.02, 0.08),
    "sensor_gain_mismatch": Kind("", "gain of one current sensor over 1", 0.004, 0.02, in_phase=True, is_signed=True),
    "sensor_offset": Kind("A/A", "offset of one current sensor, of rated peak", 0.004, 0.02, in_phase=True, is_signed=True),
    "sampling_delay": Kind("s", "currents are this old against the voltages", 2e-5, 1e-4),
    "sensor_lag": Kind("s", "time constant of the current sensors' filter", 2e-5, 1e-4),
    "dead_time": Kind("V", "lost per leg; the recorded voltages are the commanded ones", 1.0, 6.0, needs="inverter"),
    "voltage_gain_mismatch": Kind("", "gain of one voltage sensor over 1", 0.003, 0.015, in_phase=True, is_signed=True),
    "line_resistance": Kind("", "resistance in one line behind the voltage tap, of R_s", 0.02, 0.12, in_phase=True),
    "speed_sensor_gain": Kind("", "measured over true speed, less 1", 0.001, 0.005, is_signed=True, needs="speed"),
    "speed_sensor_lag": Kind("s", "time constant of the measured speed", 1e-3, 5e-3, needs="speed"),
    "rotor_asymmetry": Kind("", "half the difference of the rotor's two resistances, of R_r", 0.007, 0.04),
    "stator_asymmetry": Kind("", "current of a shorted loop at rated voltage, of rated current", 0.02, 0.06, in_phase=True),
}  # fmt: skip
UNLISTED = ("slot_modulation", "gain_drift", "sensor_knee")
"""What no catalogue of a diagnosis names; drawn for the stratum `absent`."""
OF_SENSORS = (
    "sensor_gain_mismatch", "sensor_offset", "sampling_delay", "sensor_lag", "voltage_gain_mismatch", "speed_sensor_gain",
    "speed_sensor_lag", "gain_drift", "sensor_knee",
)  # fmt: skip


def machine_array(scenario: Scenario) -> np.ndarray:
    """The kernel's numbers: machine and effects. ValueError for an unknown effect."""
    machine, plate = scenario.machine, scenario.nameplate
    peak_v = math.sqrt(2.0 / 3.0) * plate["rated_voltage_v"]
    omega = 2.0 * math.pi * plate["rated_frequency_hz"]
    m = np.zeros(at.MACHINE_SIZE)
    m[at.R_S], m[at.R_R] = machine.stator_resistance_ohm, machine.rotor_resistance_ohm
    m[at.LEAK], m[at.L_S] = machine.leakage_inductance_h, machine.inductance_h
    m[at.INERTIA], m[at.PAIRS], m[at.SLOTS] = machine.inertia_kg_m2, machine.pole_pairs, machine.rotor_slots
    m[at.FLUX], m[at.CURRENT] = peak_v / omega, math.sqrt(2.0) * plate["rated_current_a"]
    m[at.SATURATION_STEEPNESS] = 3.0
    m[at.LEAKAGE_KNEE], m[at.LOOP_TAU] = 2.0 * m[at.CURRENT], 3e-4
    m[at.CORNER_1], m[at.CORNER_2] = 2.0 * math.pi * 14.0, 2.0 * math.pi * 55.0
    m[at.DEAD_KNEE] = 0.03 * m[at.CURRENT]
    for effect in scenario.effects:
        _enter(m, effect, scenario, peak_v)
    return m


def _enter(m: np.ndarray, effect: Effect, scenario: Scenario, peak_v: float) -> None:
    size, name = effect.size, effect.name
    if name in OF_SENSORS:
        return
    if name == "rotor_skin_effect":
        m[at.BAR_1], m[at.BAR_2] = 0.65 * size, 0.35 * size
    elif name == "iron_loss":
        m[at.IRON] = size * scenario.nameplate["rated_power_w"] / (1.5 * peak_v * peak_v)
    elif name == "stator_asymmetry":
        m[at.LOOP], m[at.LOOP_PHASE] = size * m[at.CURRENT] / peak_v, effect.phase
    elif name == "line_resistance":
        m[at.LINE], m[at.LINE_PHASE] = size * m[at.R_S], effect.phase
    else:
        places = {
            "magnetizing_saturation": at.SATURATION,
            "leakage_saturation": at.LEAKAGE_DROP,
            "stator_heating": at.HEAT_S,
            "rotor_heating": at.HEAT_R,
            "dead_time": at.DEAD,
            "rotor_asymmetry": at.BROKEN,
            "slot_modulation": at.SLOT,
        }
        if name not in places:
            raise ValueError(f"effect {name!r} is none of {', '.join((*CATALOGUE, *UNLISTED))}")
        m[places[name]] = size
        if "steepness" in effect.details:
            m[at.SATURATION_STEEPNESS] = effect.details["steepness"]
