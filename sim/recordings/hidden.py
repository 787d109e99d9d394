"""Blind cases: a random motor, random causes with random sizes and shapes, and the excitation, all from one seed.

Strata: `null`, `one`, `two`, `three`, `four` causes; `wrong_form` (one or two causes in their least usual shape);
`absent` (a cause no catalogue names); `tie` (causes the data cannot tell apart). The answer key has names and sizes.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from sim.physics.effects import CATALOGUE, SINCE
from sim.physics.machine import Machine
from sim.physics.packing import pack
from sim.recordings.standstill import record
from sim.scenario import MACHINE_TABLE, Scenario, build, table_machine, table_rows

STRATA = ("null", "one", "two", "three", "four", "wrong_form", "absent", "tie")
FREQUENCIES_HZ = (0.5, 2.3, 9.7, 41.9, 113.3, 331.7)
CURRENT_SHARES = (0.55, 0.35, 0.25, 0.22, 0.12, 0.06)
"""Tone currents as fractions of the rated peak current."""
HARMLESS = ("quantization", "clipping", "lost_samples", "mains_pickup")
"""Names a data audit finds; drawn, but not into mixtures where they would drown the others."""
UNUSUAL = {
    "dead_time": "clamped",
    "device_drop": "logarithmic",
    "dc_link_sag": "soft",
    "dc_link_ripple": "sawtooth",
    "magnetizing_saturation": "steel",
    "magnetic_hysteresis": "widening",
    "leakage_saturation": "closed_slot",
    "rotor_skin_effect": "two_cells",
    "iron_loss": "eddy",
    "stator_heating": "shared",
    "rotor_heating": "slow",
    "sensor_drift": "warm_up",
    "sensor_nonlinearity": "kink",
    "shaft_motion": "pendulum",
    "inductance_anisotropy": "main",
    "resistance_anisotropy": "cage",
    "mains_pickup": "distorted",
    "sensor_lag": "second_order",
    "clock_drift": "wandering",
}


def draw(
    seed: int, stratum: str = "one", excitation: str = "rich", only: str = "", noise: str = "", seconds: float = 0.0
) -> Scenario:
    """A scenario with hidden causes. Same arguments, same case.

    `only` forces the single cause's name, `noise` its kind (`white`, `red`, `flicker`, `quantised`: white and a 12 bit
    converter), `seconds` the length of every segment. ValueError for an unknown stratum or excitation (`rich`; `poor`:
    one axis, two tones, one level).
    """
    if stratum not in STRATA or excitation not in ("rich", "poor"):
        raise ValueError(f"stratum {stratum!r} of {STRATA}, excitation {excitation!r} of ('rich', 'poor')")
    random = np.random.default_rng([seed, STRATA.index(stratum), 11])
    plate, machine = _motor(random)
    document: dict[str, Any] = {
        "name": f"hidden-{stratum}-{seed}",
        "nameplate": plate,
        "machine": machine,
        "power_stage": {"dead_time_s": 0.0, "threshold_v": 0.0, "slope_ohm": 0.0, "link_ripple": 0.0},
        "sensors": _sensors(plate, random),
        "heating": {"stator_per_min": 0.0, "rotor_per_min": 0.0},
        "noise": {"kind": _noise_kind(noise, random)},
        "effects": _causes(stratum, plate, random, only),
        "recording": {"segments": segments(plate, machine, excitation, random)},
    }
    if stratum == "absent":
        document["unlisted"] = _unlisted(plate, random)
    if noise == "quantised":
        document["sensors"]["bits"] = 12
    for segment in document["recording"]["segments"] if seconds else ():
        segment["duration_s"] = seconds
    return _possible(document)


def _noise_kind(asked: str, random: np.random.Generator) -> str:
    drawn = str(random.choice(["white", "white", "red", "flicker"]))
    return {"": drawn, "quantised": "white"}.get(asked, asked)


def _possible(document: dict[str, Any]) -> Scenario:
    """The scenario, a deep-bar effect halved until the motor's leakage can hold it."""
    while True:
        scenario = build(document, document["name"])
        try:
            pack(scenario.plant)
        except ValueError:
            document["effects"]["rotor_skin_effect"]["size"] *= 0.5
        else:
            return scenario


def case(seed: int, stratum: str = "one", excitation: str = "rich", only: str = "") -> tuple[Any, Any, Any]:
    """(columns, metadata, truth) of a drawn scenario; truth["effects"] lists the hidden causes."""
    columns, metadata, truth = record(draw(seed, stratum, excitation, only), seed)
    truth["stratum"] = stratum
    del metadata["scenario"]
    return columns, metadata, truth


def _motor(random: np.random.Generator) -> tuple[dict[str, Any], dict[str, Any]]:
    """A row of the machine table between 0.25 and 75 kW, every parameter shaken by up to 30 %."""
    rows = [r["id"] for r in table_rows() if 0.2 <= float(r["P_kW"]) <= 75.0 and 200 <= float(r["V_LL"]) <= 500]
    plate, machine = table_machine(str(random.choice(rows)), 0.0, str(MACHINE_TABLE))
    shaken = {k: v * float(np.exp(random.uniform(-0.26, 0.26))) for k, v in machine.items()}
    return plate, {**shaken, "saturation_at_rated_flux": 0.0}


def _sensors(plate: dict[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """An ideal chain but for noise, 50 to 66 dB below the rated peak current."""
    peak = math.sqrt(2.0) * plate["rated_current_a"]
    return {
        "noise_a": peak * 10.0 ** (-random.uniform(50.0, 66.0) / 20.0),
        "bits": 0,
        "full_scale_a": 3.0 * peak,
        "offset_a": [0.0, 0.0, 0.0],
        "gain": [1.0, 1.0, 1.0],
        "delay_s": 0.0,
        "lag_s": 0.0,
    }


def _causes(stratum: str, plate: dict[str, Any], random: np.random.Generator, only: str) -> dict[str, Any]:
    if only:
        return {only: _size(only, plate, random, unusual=stratum == "wrong_form")}
    if stratum in ("null", "absent"):
        return {}
    if stratum == "tie":
        return _tied(plate, random)
    count = {"one": 1, "two": 2, "three": 3, "four": 4, "wrong_form": int(random.integers(1, 3))}[stratum]
    pool = sorted(UNUSUAL if stratum == "wrong_form" else CATALOGUE.keys() - SINCE)
    if count > 1:
        pool = [name for name in pool if name not in HARMLESS]
    names = random.choice(pool, count, replace=False)
    return {str(n): _size(str(n), plate, random, unusual=stratum == "wrong_form") for n in names}


def _tied(plate: dict[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """A cause with a twin that looks the same from the terminals: a short delay or lag, a leg's loss of voltage."""
    name = str(random.choice(["sampling_delay", "sensor_lag", "dead_time", "device_drop"]))
    if name in ("sampling_delay", "sensor_lag"):
        return {name: {"size": float(random.uniform(4e-6, 2e-5))}}
    return {name: _size(name, plate, random, unusual=False)}


def _size(name: str, plate: dict[str, Any], random: np.random.Generator, *, unusual: bool) -> dict[str, Any]:
    """Log-uniform between the catalogue's ends, currents and voltages scaled to the motor; a random shape."""
    kind = CATALOGUE[name]
    size = math.exp(random.uniform(math.log(kind.smallest), math.log(kind.largest)))
    size *= _motor_scale(name, plate)
    if name == "lost_samples":
        size = float(round(size))
    shape = UNUSUAL[name] if unusual else str(random.choice(list(kind.shapes)))
    entry = {"size": float(size), "shape": shape}
    if name in ("remanence", "inductance_anisotropy", "resistance_anisotropy"):
        entry["angle_deg"] = float(random.uniform(0.0, 180.0))
    if name == "shaft_motion":
        entry["size"] *= float(random.choice([-1.0, 1.0]))
    return entry


def _motor_scale(name: str, plate: dict[str, Any]) -> float:
    """Sizes in the catalogue are for the 5 A, 400 V motor."""
    current, volt = plate["rated_current_a"] / 5.0, plate["rated_voltage_v"] / 400.0
    if CATALOGUE[name].unit in ("A", "A per minute", "S", "F"):
        return current if CATALOGUE[name].unit[0] == "A" else current / volt
    return 1.0


def _unlisted(plate: dict[str, Any], random: np.random.Generator) -> dict[str, float]:
    which = int(random.integers(0, 3))
    if which == 0:
        return {"voltage_curvature": float(random.uniform(0.02, 0.15))}
    if which == 1:
        peak = math.sqrt(2.0) * plate["rated_current_a"]
        return {"sensor_slew": float(peak * random.uniform(60.0, 200.0))}
    return {"echo": float(random.uniform(0.01, 0.06))}


def impedance(machine: Machine, frequency_hz: float) -> complex:
    """Standstill impedance (ohm) of the unsaturated Gamma circuit."""
    jw = 2j * math.pi * frequency_hz
    ls, leak = machine.inductance_h, machine.leakage_inductance_h
    rotor = machine.rotor_resistance_ohm + jw * leak
    return machine.stator_resistance_ohm + jw * ls * rotor / (rotor + jw * ls)


def tone_voltages(plate: dict[str, Any], machine: Machine, shares: dict[float, float]) -> list[tuple[float, float]]:
    """(amplitude_v, frequency_hz) for tone currents given as shares of rated peak; total flux held under 0.9 rated."""
    peak = math.sqrt(2.0) * plate["rated_current_a"]
    rated = plate["rated_voltage_v"] * math.sqrt(2.0 / 3.0) / (2.0 * math.pi * plate["rated_frequency_hz"])
    volts = {f: share * peak * abs(impedance(machine, f)) for f, share in shares.items()}
    flux = sum(
        v * abs(1.0 - machine.stator_resistance_ohm / impedance(machine, f)) / (2.0 * math.pi * f)
        for f, v in volts.items()
    )
    factor = min(1.0, 0.9 * rated / flux)
    return [(v * factor, f) for f, v in volts.items()]


def segments(
    plate: dict[str, Any], machine: dict[str, Any], excitation: str, random: np.random.Generator
) -> list[dict]:
    """`rich`: axes 0, 60, 120 and 0 again at two levels, with and without bias. `poor`: one axis, two tones."""
    model = Machine(**machine)
    chosen = FREQUENCIES_HZ if excitation == "rich" else FREQUENCIES_HZ[1:4:2]
    tones = [
        (v, f, float(random.uniform(-math.pi, math.pi)))
        for v, f in tone_voltages(plate, model, dict(zip(FREQUENCIES_HZ, CURRENT_SHARES, strict=True)))
        if f in chosen
    ]
    bias = 0.6 * math.sqrt(2.0) * plate["rated_current_a"] * model.stator_resistance_ohm
    entry = {"tones": tones, "ramp_s": 0.3, "zero_s": 0.5}
    if excitation == "poor":
        return [{**entry, "axis_deg": 0.0, "duration_s": 8.0, "scale": 1.0}]
    plan = [
        (0.0, 1.0, 0.0),
        (0.0, 0.5, 0.0),
        (0.0, 0.35, bias),
        (60.0, 1.0, 0.0),
        (60.0, 0.5, 0.0),
        (120.0, 1.0, 0.0),
        (120.0, 0.35, bias),
        (0.0, 1.0, 0.0),
    ]
    return [{**entry, "axis_deg": a, "scale": s, "bias_v": b, "duration_s": 6.0} for a, s, b in plan]
