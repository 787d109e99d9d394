"""From the fine truth to the recorded columns: delay, lag, gains, offsets, noise, an encoder with ripple."""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import lfilter

from sim.motoring.machine import Played, Scenario

Columns = dict[str, np.ndarray]
PHASES = np.exp(2j * np.pi / 3.0 * np.arange(3))


def sensed(scenario: Scenario, played: Played, rng: np.random.Generator) -> Columns:
    """The contract's columns of a running recording."""
    effects = {e.name: e for e in scenario.effects}
    h = float(played.time_s[1] - played.time_s[0])
    every = slice(None, None, played.substeps)
    sensors = scenario.sensors
    peak = math.sqrt(2.0) * scenario.nameplate["rated_current_a"]
    current = played.current
    if "sensor_lag" in effects:
        keep = math.exp(-h / effects["sensor_lag"].size)
        current = lfilter([0.5 * (1 - keep), 0.5 * (1 - keep)], [1.0, -keep], current)
    if "sampling_delay" in effects:
        late = played.time_s - effects["sampling_delay"].size
        current = np.interp(late, played.time_s, current.real) + 1j * np.interp(late, played.time_s, current.imag)
    time = played.time_s[every]
    phases = np.real(np.conj(PHASES)[:, None] * current[every])
    for name, change in (
        ("sensor_gain_mismatch", lambda x, d: x * (1 + d)),
        ("sensor_offset", lambda x, d: x + d * peak),
    ):
        if name in effects:
            e = effects[name]
            phases[int(e.phase)] = change(phases[int(e.phase)], e.size)
    if "gain_drift" in effects:
        phases[0] *= 1.0 + effects["gain_drift"].size * np.sin(2 * np.pi * time / time[-1] * 3.0)
    if "sensor_knee" in effects:
        size = effects["sensor_knee"].size
        phases[1] = np.where(phases[1] > 0, phases[1] * (1 + size), phases[1] * (1 - size))
    phases += sensors.current_noise_a * rng.standard_normal(phases.shape)
    volts = np.real(np.conj(PHASES)[:, None] * played.voltage[every])
    names = ["voltage_u_v", "voltage_v_v", "voltage_w_v"]
    if sensors.line_to_line:
        volts = volts - np.roll(volts, -1, axis=0)
        names = ["voltage_uv_v", "voltage_vw_v", "voltage_wu_v"]
    if "voltage_gain_mismatch" in effects:
        e = effects["voltage_gain_mismatch"]
        volts[int(e.phase)] *= 1 + e.size
    volts = volts + sensors.voltage_noise_v * rng.standard_normal(volts.shape)
    columns: Columns = {"time_s": time}
    columns |= {f"current_{p}_a": phases[k] for k, p in enumerate("uvw") if sensors.has_w or p != "w"}
    columns |= {name: volts[k] for k, name in enumerate(names)}
    if sensors.has_speed:
        columns["speed_rad_per_s"] = _speed(scenario, played, h, rng)
    return columns


def _speed(scenario: Scenario, played: Played, h: float, rng: np.random.Generator) -> np.ndarray:
    effects = {e.name: e for e in scenario.effects}
    speed = played.speed_rad_per_s
    if "speed_sensor_lag" in effects:
        keep = math.exp(-h / effects["speed_sensor_lag"].size)
        first = np.array([keep * speed[0] - 0.5 * (1 - keep) * speed[0] + 0.5 * (1 - keep) * speed[0]])
        first = np.array([(1.0 - 0.5 * (1 - keep)) * speed[0]])  # at rest in the first value
        speed, _ = lfilter([0.5 * (1 - keep), 0.5 * (1 - keep)], [1.0, -keep], speed, zi=first)
    if "speed_sensor_gain" in effects:
        speed = speed * (1 + effects["speed_sensor_gain"].size)
    every = slice(None, None, played.substeps)
    sensors = scenario.sensors
    nominal = 2.0 * math.pi * scenario.supply.frequency_hz / scenario.machine.pole_pairs
    ripple = sensors.speed_ripple_rad_per_s * np.cos(played.angle_rad[every] + 0.4) * (speed[every] / nominal)
    return speed[every] + ripple + sensors.speed_noise_rad_per_s * rng.standard_normal(speed[every].size)
