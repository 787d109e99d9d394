"""An extended model as a scenario of the simulated inverter: machine, plate and every cause in that catalogue's units.

Two models of one machine: shapes that the simulator parameterises otherwise (saturation, leakage, bars) are matched at
the operating point the diagnosis states.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import sqrt
from typing import Any

from commissioner.diagnose.causes import CATALOGUE, Setting
from commissioner.diagnose.export.contract import Described, Entry, Scenario
from commissioner.diagnose.plant.model import Model
from commissioner.identify.intake.plate import NAMEPLATE_KEYS
from commissioner.motor.nameplate import Nameplate, Plate, prior

FULL_SCALE = 3.0
"""Sensor range of the scenario over the rated peak current; half again what the diagnosis calls full scale."""


def scenario(model: Model, setting: Setting, causes: Sequence[Any]) -> Scenario:
    """The document `python -m sim --scenario` reads: an ideal drive but for the causes."""
    plate = {k: setting.facts.metadata[k] for k in NAMEPLATE_KEYS if k in setting.facts.metadata}
    if "pole_pairs" in plate:
        plate["pole_pairs"] = int(plate["pole_pairs"])
    effects: dict[str, Entry] = {}
    for cause in causes:
        sizes = {key: value for key, (value, _, _) in cause.sizes.items()}
        if entry := CATALOGUE[cause.name].to_scenario(sizes, model.of(cause.name), setting, model):
            effects[cause.name] = entry
    machine = {**gamma_machine(model.at_rest(setting.layout)[0]), "saturation_at_rated_flux": 0.0}
    return _document(plate, machine, setting.facts.rated_current_peak_a, effects)


def plain_scenario(nominal: Iterable[float], plate: Mapping[str, Any]) -> Scenario:
    """Of a motor by its four numbers alone, behind an ideal drive."""
    peak_a = sqrt(2.0) * float(plate["rated_current_a"])
    return _document(_kept(plate), {**gamma_machine(nominal), "saturation_at_rated_flux": 0.0}, peak_a, {})


def typical_motor(name: str, plate: Nameplate) -> Described:
    """What a scenario says of a motor of which only the plate is known: the machine is what its plate makes most likely."""
    return {"name": name, "nameplate": _kept(plate.known()), "machine": gamma_machine(prior(plate).typical.as_tuple())}


def _kept(plate: Mapping[str, Any]) -> Plate:
    return {k: plate[k] for k in NAMEPLATE_KEYS if k in plate}


def _document(plate: Plate, machine: dict[str, float], rated_peak_a: float, effects: Mapping[str, Entry]) -> Scenario:
    return {
        "nameplate": plate,
        "machine": machine,
        "power_stage": {"dead_time_s": 0.0, "threshold_v": 0.0, "slope_ohm": 0.0, "link_ripple": 0.0},
        "sensors": {
            "noise_a": 0.0,
            "bits": 0,
            "offset_a": [0.0] * 3,
            "gain": [1.0] * 3,
            "delay_s": 0.0,
            "lag_s": 0.0,
            "full_scale_a": FULL_SCALE * rated_peak_a,
        },
        "heating": {"stator_per_min": 0.0, "rotor_per_min": 0.0},
        "effects": effects,
    }


def gamma_machine(nominal: Iterable[float]) -> dict[str, float]:
    """Gamma form (R_s, R_r, L_leak, L_s) of the inverse-Gamma set (Slemon 1989): ratio L_s / L_M."""
    r_s, r_r, l_sigma, l_m = nominal
    ratio = (l_m + l_sigma) / l_m
    keys = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "inductance_h")
    return dict(zip(keys, (r_s, r_r * ratio**2, l_sigma * ratio, l_m + l_sigma), strict=True))
