"""Motors for campaigns: a row of the machine table on a drive of its size, everything moved by a seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from sim.physics.effects import CATALOGUE
from sim.physics.inductance import inverse_gamma
from sim.scenario import Scenario, ScenarioError, build, motor_of, read_document, table_machine, table_rows
from sim.truth import apparent_resistance_ohm, link_gain, sensor_gain
from sim.wire.faults import FaultError, parse
from sim.wire.in_process import Station

LARGEST_KW, VOLTAGES = 75.0, (200.0, 500.0)
MOST_EFFECTS = 3
MACHINE = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "inductance_h")
NAMES = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")


class Drawn:
    """One motor behind its drive, and the truth about it."""

    def __init__(self, motor: str, scenario: Scenario, seed: int, faults: Sequence[str]) -> None:
        self.motor, self.scenario, self.document = motor, scenario, scenario.document
        self._seed, self._faults = seed, tuple(faults)
        for text in faults:
            parse(text)
        self.effects = [effect.name for effect in scenario.plant.effects]
        plate = scenario.plant.nameplate
        self.plate: Mapping[str, Any] = {
            "rated_power_w": plate.rated_power_w, "rated_voltage_v": plate.rated_voltage_v,
            "rated_frequency_hz": plate.rated_frequency_hz, "rated_current_a": plate.rated_current_a,
            "rated_speed_rpm": plate.rated_speed_rpm, "power_factor": plate.power_factor, "pole_pairs": plate.pole_pairs,
            "connection": "star",
        }  # fmt: skip

    @cached_property
    def station(self) -> Station:
        """The drive in this process. ValueError: a fault that only a line can have."""
        try:
            return Station(self.scenario, self._seed, self._faults)
        except FaultError as error:
            raise ValueError(str(error)) from error

    @property
    def highest_flux_wb(self) -> float:
        return self.station.highest_flux_wb

    def parameters_at(self, stator_flux_wb: float, axes_deg: Sequence[float]) -> Mapping[str, float]:
        """Secant inverse-Gamma values at a peak stator flux, as they are at the drive's terminals and through its sensors along
        these axes: the stator's resistance with that of the devices, and every impedance over the gain of the sensors and of the
        link, for nothing that the drive measures tells any of them apart."""
        plant = self.scenario.plant
        secant = inverse_gamma(plant, stator_flux_wb)
        truth = {NAMES[0]: apparent_resistance_ohm(plant), **{name: float(secant[name]) for name in NAMES[1:]}}
        gain = sensor_gain(plant, axes_deg) * link_gain(plant)
        return {name: value / gain for name, value in truth.items()}


class Factory:
    """The packaged simulator, by the entry point `commissioner.simulators`."""

    def motors(self) -> list[str]:
        """Rows of the machine table that a low-voltage drive of up to 75 kW would feed."""
        low, high = VOLTAGES
        return [r["id"] for r in table_rows() if low <= float(r["V_LL"]) <= high and float(r["P_kW"]) <= LARGEST_KW]

    def draw(
        self,
        motor: str | Mapping[str, Any],
        seed: int,
        *,
        spread: float,
        effects: Sequence[str],
        noise_a: float | None,
        faults: Sequence[str],
    ) -> Drawn:
        """`motor`: a row of the machine table, a scenario file, or the tables `nameplate` and `machine` of a motor under its `name`.
        ValueError where the motor, an effect or a fault is unknown, or the plant cannot be."""
        random = np.random.default_rng([seed, 5])
        name = motor if isinstance(motor, str) else str(motor["name"])
        try:
            if isinstance(motor, str) and Path(motor).is_file():
                document = _moved(read_document(motor), motor, random, spread, noise_a)
            else:
                document = _document(motor, random, spread, noise_a)
            plate = document.get("nameplate", {})
            document["effects"] = {**document.get("effects", {}), **_effects(effects, plate, random)}
            return Drawn(name, build(document, name), seed, faults)
        except (ScenarioError, FaultError) as error:
            raise ValueError(str(error)) from error


def _moved(
    document: dict[str, Any], source: str, random: np.random.Generator, spread: float, noise_a: float | None
) -> dict[str, Any]:
    """A scenario with its machine moved and its noise replaced, all else as it says."""
    plate, machine = motor_of(document, source)
    numbers = {name: getattr(machine, name) for name in MACHINE}
    rest = {name: value for name, value in document.get("machine", {}).items() if name != "id"}
    sensors = {} if noise_a is None else {"noise_a": noise_a}
    return document | {
        "nameplate": asdict(plate), "machine": rest | _spread(numbers, random, spread),
        "sensors": document.get("sensors", {}) | sensors,
    }  # fmt: skip


def _spread(machine: Mapping[str, float], random: np.random.Generator, spread: float) -> dict[str, float]:
    return {name: value * float(random.uniform(1.0 - spread, 1.0 + spread)) for name, value in machine.items()}


def _document(
    motor: str | Mapping[str, Any], random: np.random.Generator, spread: float, noise_a: float | None
) -> dict[str, Any]:
    saturation = float(random.uniform(0.2, 0.5))
    if isinstance(motor, str):
        name, (plate, machine) = motor, table_machine(motor, saturation)
    else:
        name, plate, machine = str(motor["name"]), dict(motor["nameplate"]), dict(motor["machine"])
        machine["inductance_h"] *= 1.0 + saturation  # it is the secant value at rated flux, as the table's
    machine = _spread(machine, random, spread)
    peak_a = math.sqrt(2.0) * float(plate["rated_current_a"])
    return {
        "name": name,
        "nameplate": plate,
        "machine": {**machine, "saturation_at_rated_flux": saturation, "saturation_order": 7.0, "saturation_shape": "power"},
        "power_stage": {
            "dead_time_s": float(random.uniform(1e-6, 3.5e-6)), "dead_time_knee_a": 0.024 * peak_a, "threshold_v": 1.2,
            "threshold_knee_a": 0.016 * peak_a, "slope_ohm": 0.02 * 7.07 / peak_a,
        },
        "sensors": {
            "full_scale_a": 2.2 * peak_a, "noise_a": 0.0014 * peak_a if noise_a is None else noise_a,
            "offset_a": [float(v) for v in random.uniform(-0.004, 0.004, 3) * peak_a],
        },
        "drive": {"rated_current_a": 1.4 * float(plate["rated_current_a"]), "hardware_current_limit_a": 2.0 * peak_a},
    }  # fmt: skip


def _effects(wanted: Sequence[str], plate: Mapping[str, Any], random: np.random.Generator) -> dict[str, Any]:
    """Named effects, or up to three of any, each of a size between the catalogue's ends."""
    if tuple(wanted) in ((), ("none",)):
        return {}
    if tuple(wanted) == ("any",):
        names = [
            str(n) for n in random.choice(sorted(CATALOGUE), int(random.integers(1, MOST_EFFECTS + 1)), replace=False)
        ]
    else:
        names = list(wanted)
    unknown = [name for name in names if name not in CATALOGUE]
    if unknown:
        raise ValueError(f"effects: {unknown[0]} is unknown; known: {', '.join(sorted(CATALOGUE))}")
    scale = float(plate.get("rated_current_a", 5.0)) / 5.0
    drawn: dict[str, Any] = {}
    for name in names:
        kind = CATALOGUE[name]
        size = math.exp(random.uniform(math.log(kind.smallest), math.log(kind.largest)))
        drawn[name] = {
            "size": size * (scale if kind.unit == "A" else 1.0),
            "shape": str(random.choice(list(kind.shapes))),
        }
    return drawn
