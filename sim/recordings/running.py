"""Recordings of the running motor as a measuring chain would store them, with their answer key."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sim.physics.loads import PeriodicLoad, build
from sim.physics.running import Machine, Played, Supply, play

SCENARIOS = Path(__file__).parents[1] / "scenarios"
CURRENTS = ("current_u_a", "current_v_a", "current_w_a")
PHASES = ("voltage_u_v", "voltage_v_v", "voltage_w_v")
LINES = ("voltage_uv_v", "voltage_vw_v", "voltage_wu_v")
POINTS_PER_TURN = 360
NAMEPLATE = (
    "rated_power_w",
    "rated_voltage_v",
    "rated_frequency_hz",
    "rated_current_a",
    "rated_speed_rpm",
    "power_factor",
    "pole_pairs",
    "connection",
)


def load_scenario(name: str) -> dict:
    """The scenario `name` of this package, or the TOML file of that path; `extends` names the one it builds on."""
    path = Path(name) if name.endswith(".toml") else SCENARIOS / f"{name}.toml"
    scenario = tomllib.loads(path.read_text(encoding="utf-8"))
    base = scenario.pop("extends", None)
    return _merged(load_scenario(base), scenario) if base else scenario


def _merged(below: dict, above: dict) -> dict:
    out = dict(below)
    for key, value in above.items():
        out[key] = _merged(out[key], value) if isinstance(value, dict) and isinstance(out.get(key), dict) else value
    return out


def record(scenario: dict, seed: int) -> tuple[dict[str, NDArray[np.float64]], dict, dict]:
    """(columns, metadata, answer key) of one recording; same scenario and seed, same numbers."""
    played, machine, loads, supply = run(scenario, seed)
    rng = np.random.default_rng([seed, 2])
    columns = _sensed(played, scenario.get("sensing", {}), scenario, rng)
    recording = scenario.get("recording", {})
    metadata: dict = {key: scenario["nameplate"][key] for key in NAMEPLATE if key in scenario["nameplate"]}
    metadata |= {"inertia_kg_m2": machine.inertia_kg_m2, "sample_period_s": 1.0 / float(recording.get("rate_hz", 8000))}
    if recording.get("tell_slots"):
        metadata["rotor_slots"] = machine.rotor_slots
    return columns, metadata, _answer_key(played, machine, loads, supply, scenario, seed)


def run(scenario: dict, seed: int) -> tuple[Played, Machine, list[PeriodicLoad], Supply]:
    """What truly happens in the scenario, before any sensor."""
    rng = np.random.default_rng([seed, 1])
    machine = _machine(scenario["machine"], rng)
    loads = [build(entry, rng) for entry in scenario.get("loads", [])]
    recording = scenario.get("recording", {})
    duration, rate = float(recording.get("duration_s", 30.0)), float(recording.get("rate_hz", 8000))
    supply = _supply(scenario["supply"], duration, rng)
    steady = scenario.get("steady_load", {})
    coefficients = (
        float(steady.get("constant_nm", 0.0)),
        float(steady.get("per_speed_nms", 0.0)),
        float(steady.get("per_speed_squared_nms2", 0.0)),
    )
    return play(machine, supply, loads, coefficients, duration, 1 / rate), machine, loads, supply


def _machine(entry: dict, rng: np.random.Generator) -> Machine:
    """The scenario's machine; `scatter` draws every resistance and inductance log-uniformly around it."""
    entry = dict(entry)
    scatter = float(entry.pop("scatter", 0.0))
    for key in ("stator_resistance_ohm", "rotor_resistance_ohm", "stator_leakage_h", "magnetizing_inductance_h"):
        factor = np.exp(rng.uniform(-scatter, scatter))
        entry[key] *= factor
        if key == "stator_leakage_h":
            entry["rotor_leakage_h"] *= factor
    return Machine(**entry)


def _supply(entry: dict, duration_s: float, rng: np.random.Generator) -> Supply:
    """Mains (or a steady inverter) whose frequency wanders by `drift_hz` in all: half a ramp, half a slow wave."""
    drift = float(entry.get("drift_hz", 0.0))
    share = rng.uniform(0.3, 0.7)
    sign = rng.choice([-1.0, 1.0])
    return Supply(
        amplitude_v=float(entry["voltage_v"]) * np.sqrt(2.0 / 3.0),
        frequency_hz=float(entry["frequency_hz"]) + rng.uniform(-0.5, 0.5) * float(entry.get("frequency_spread_hz", 0)),
        unbalance=float(entry.get("unbalance", 0.0)),
        unbalance_angle_rad=rng.uniform(0, 2 * np.pi),
        fifth=float(entry.get("fifth", 0.0)),
        seventh=float(entry.get("seventh", 0.0)),
        drift_ramp_hz_per_s=sign * drift * share / duration_s,
        drift_wave_hz=0.5 * drift * (1 - share),
        drift_wave_rad_per_s=2 * np.pi * rng.uniform(0.8, 2.0) / max(duration_s, 20.0),
        drift_wave_angle_rad=rng.uniform(0, 2 * np.pi),
        sag=float(entry.get("sag", 0.0)),
        sag_rad_per_s=2 * np.pi * rng.uniform(0.05, 0.2),
    )


def _sensed(played: Played, sensing: dict, scenario: dict, rng: np.random.Generator) -> dict[str, NDArray[np.float64]]:
    """The six channels with noise, offset, gain, lag, quantisation, limits and mistakes in the wiring."""
    time = played.time_s.copy()
    line_to_line = bool(sensing.get("line_to_line", False))
    u, v, w = played.voltage_abc_v
    voltages = [u - v, v - w, w - u] if line_to_line else [u, v, w]
    names = CURRENTS + (LINES if line_to_line else PHASES)
    channels = [*played.current_abc_a, *voltages]
    plate = scenario["nameplate"]
    current_scale = float(plate["rated_current_a"]) * np.sqrt(2)
    voltage_scale = float(plate["rated_voltage_v"]) * np.sqrt(2.0 if line_to_line else 2.0 / 3.0)
    sensed = []
    for k, channel in enumerate(channels):
        scale = current_scale if k < 3 else voltage_scale
        sensed.append(_channel(channel, scale, sensing, k, played, rng))
    order = sensing.get("channel_order", list(range(6)))
    flips = sensing.get("channel_signs", [1] * 6)
    columns = {"time_s": time} | {name: flips[k] * sensed[order[k]] for k, name in enumerate(names)}
    if sensing.get("reference_speed", False):
        columns["speed_rad_per_s"] = played.speed_rad_per_s
    return _damaged(columns, sensing, rng)


def _channel(
    x: NDArray[np.float64], scale: float, sensing: dict, k: int, played: Played, rng: np.random.Generator
) -> NDArray[np.float64]:
    kind = "current" if k < 3 else "voltage"
    gain = 1 + float(sensing.get("gain_error", 0.0)) * rng.standard_normal()
    offset = scale * float(sensing.get("offset", 0.0)) * rng.standard_normal()
    jitter = float(sensing.get("clock_jitter_s", 0.0))
    if jitter:
        slope = np.gradient(x, played.time_s)
        x = x + slope * jitter * np.random.default_rng(7).standard_normal(x.size)
    y = gain * x + offset + scale * float(sensing.get("noise", 0.0)) * rng.standard_normal(x.size)
    ripple = float(sensing.get("pwm_ripple", 0.0)) if kind == "voltage" else 0.0
    if ripple:
        y = y + scale * ripple * rng.standard_normal(x.size)
    full = scale * float(sensing.get(f"{kind}_range", 3.0))
    bits = int(sensing.get("bits", 0))
    if bits:
        step = 2 * full / 2**bits
        y = np.round(y / step) * step
    return np.clip(y, -full, full)


def _damaged(
    columns: dict[str, NDArray[np.float64]], sensing: dict, rng: np.random.Generator
) -> dict[str, NDArray[np.float64]]:
    """Rows lost in a burst (`gap_s` at the middle) or one by one (`lost_fraction`); time stamps that wander."""
    time = columns["time_s"]
    keep = np.ones(time.size, dtype=bool)
    gap = float(sensing.get("gap_s", 0.0))
    if gap:
        keep &= np.abs(time - time.mean()) > gap / 2
    lost = float(sensing.get("lost_fraction", 0.0))
    if lost:
        keep &= rng.uniform(size=time.size) >= lost
    wander = float(sensing.get("stamp_jitter_s", 0.0))
    if wander:
        columns = columns | {"time_s": time + wander * rng.standard_normal(time.size)}
    return columns if keep.all() else {name: values[keep] for name, values in columns.items()}


def _answer_key(
    played: Played, machine: Machine, loads: list[PeriodicLoad], supply: Supply, scenario: dict, seed: int
) -> dict:
    """Plain numbers and lists: what `--truth` prints."""
    turns = (played.angle_rad[-1] - played.angle_rad[0]) / (2 * np.pi)
    elapsed = played.time_s[-1] - played.time_s[0]
    shaft_hz = turns / elapsed
    return {
        "kind": "running",
        "seed": seed,
        "mean_speed_rad_per_s": float(2 * np.pi * shaft_hz),
        "mean_torque_nm": float(played.electromagnetic_torque_nm.mean()),
        "supply_frequency_hz": float(supply.frequency_hz),
        "machine": {
            "stator_resistance_ohm": machine.stator_resistance_ohm,
            "rotor_resistance_ohm": machine.rotor_resistance_ohm,
            "stator_leakage_h": machine.stator_leakage_h,
            "rotor_leakage_h": machine.rotor_leakage_h,
            "magnetizing_inductance_h": machine.magnetizing_inductance_h,
            "inertia_kg_m2": machine.inertia_kg_m2,
            "rotor_slots": machine.rotor_slots,
        },
        "loads": [
            {
                "name": load.name,
                "frequency_hz": float(load.turns_per_shaft_turn * shaft_hz + load.turns_per_s),
                "locked_to_shaft": load.turns_per_s == 0.0,
            }
            for load in loads
        ],
        "over_shaft_angle": _over_angle(played),
        "channel_order": scenario.get("sensing", {}).get("channel_order", list(range(6))),
    }


def _over_angle(played: Played) -> dict[str, list[float]]:
    """Means of speed and torques in bins of the shaft angle (what repeats with the shaft, and nothing else)."""
    angle = np.mod(played.angle_rad, 2 * np.pi)
    place = np.minimum((angle / (2 * np.pi) * POINTS_PER_TURN).astype(np.int64), POINTS_PER_TURN - 1)
    count = np.maximum(np.bincount(place, minlength=POINTS_PER_TURN), 1)
    return {"shaft_angle_rad": ((np.arange(POINTS_PER_TURN) + 0.5) * 2 * np.pi / POINTS_PER_TURN).tolist()} | {
        name: (np.bincount(place, values, minlength=POINTS_PER_TURN) / count).tolist()
        for name, values in (
            ("speed_rad_per_s", played.speed_rad_per_s),
            ("electromagnetic_torque_nm", played.electromagnetic_torque_nm),
            ("load_torque_nm", played.load_torque_nm),
        )
    }
