"""A started and loaded motor as a recording: scenario documents, columns, metadata, answer key."""

from __future__ import annotations

import dataclasses
from dataclasses import asdict
from typing import Any

import numpy as np

from sim.motoring.effects import CATALOGUE, UNLISTED
from sim.motoring.machine import Course, Effect, Machine, Played, Scenario, Sensors, Supply
from sim.motoring.play import play
from sim.motoring.sensors import sensed

KEYS = (
    "rated_power_w", "rated_voltage_v", "rated_frequency_hz", "rated_current_a", "rated_speed_rpm", "power_factor",
    "pole_pairs", "connection",
)  # fmt: skip


def build(document: dict[str, Any], source: str = "scenario") -> Scenario:
    """A scenario from a parsed document with [nameplate], [machine], [supply], [course], [sensors], [effects].

    ValueError names a key or an effect that is not known.
    """
    known = {"name", "kind", "description", "nameplate", "machine", "supply", "course", "sensors", "effects"}
    for key in document:
        if key not in known:
            raise ValueError(f"{source}: unknown key {key}; known: {', '.join(sorted(known))}")
    for key in ("nameplate", "machine", "supply"):
        if key not in document:
            raise ValueError(f"{source}: [{key}] is missing")
    return Scenario(
        str(document.get("name", source)),
        dict(document["nameplate"]),
        _table(Machine, document["machine"], source, "machine"),
        _table(Supply, document["supply"], source, "supply"),
        _table(Course, document.get("course", {}), source, "course"),
        _table(Sensors, document.get("sensors", {}), source, "sensors"),
        tuple(_effect(name, entry, source) for name, entry in document.get("effects", {}).items()),
    )


def _table(kind: Any, table: dict[str, Any], source: str, where: str) -> Any:
    fields = {f.name for f in dataclasses.fields(kind)}
    for key in table:
        if key not in fields:
            raise ValueError(f"{source}: unknown key {where}.{key}; known: {', '.join(sorted(fields))}")
    values = {
        k: tuple(tuple(x) if isinstance(x, list) else x for x in v) if isinstance(v, list) else v
        for k, v in table.items()
    }
    try:
        return kind(**values)
    except TypeError as error:
        raise ValueError(f"{source}: [{where}] {error}") from error


WINDINGS = {0: "u", 1: "v", 2: "w", -0.25: "uv", 0.75: "vw", 1.75: "wu"}
"""By where they lie, in thirds of a turn."""


def _effect(name: str, entry: Any, source: str) -> Effect:
    entry = {"size": entry} if isinstance(entry, int | float) else dict(entry)
    if name not in (*CATALOGUE, *UNLISTED) or not isinstance(entry.get("size"), int | float):
        raise ValueError(f"{source}: effects.{name} must be one of {', '.join((*CATALOGUE, *UNLISTED))}, with a size")
    size, phase = float(entry.pop("size")), entry.pop("phase", 0)
    if phase not in (WINDINGS if name == "stator_asymmetry" else (0, 1, 2)):
        raise ValueError(
            f"{source}: effects.{name} is in no phase {phase}: 0, 1, 2 are u, v, w; -0.25, 0.75, 1.75 a delta's uv, vw, wu"
        )
    return Effect(name, size, phase, {k: float(v) for k, v in entry.items()})


def record(scenario: Scenario, seed: int) -> tuple[dict[str, np.ndarray], dict[str, Any], dict[str, Any]]:
    """(columns, metadata, answer key); same scenario and seed, same numbers."""
    played = play(scenario)
    columns = sensed(scenario, played, np.random.default_rng([seed, 77]))
    metadata = {k: scenario.nameplate[k] for k in KEYS if k in scenario.nameplate}
    metadata["sample_period_s"] = 1.0 / scenario.course.rate_hz
    if scenario.supply.switching_frequency_hz:
        metadata["switching_frequency_hz"] = scenario.supply.switching_frequency_hz
    return columns, metadata, answer_key(scenario, played, seed)


def answer_key(scenario: Scenario, played: Played, seed: int) -> dict[str, Any]:
    """Plain numbers: the machine, its inverse-Gamma form, what was hidden, and the shaft."""
    machine = scenario.machine
    ratio = machine.inductance_h / (machine.inductance_h + machine.leakage_inductance_h)
    tail = slice(-len(played.time_s) // 10, None)
    return {
        "kind": "running",
        "seed": seed,
        "machine": asdict(machine),
        "inverse_gamma": {
            "stator_resistance_ohm": machine.stator_resistance_ohm,
            "rotor_resistance_ohm": ratio * ratio * machine.rotor_resistance_ohm,
            "leakage_inductance_h": ratio * machine.leakage_inductance_h,
            "magnetizing_inductance_h": ratio * machine.inductance_h,
        },
        "inertia_kg_m2": machine.inertia_kg_m2,
        "effects": [
            {
                "name": e.name,
                "size": e.size,
                "phase": WINDINGS[e.phase],
                "unit": CATALOGUE[e.name].unit if e.name in CATALOGUE else "",
            }
            for e in scenario.effects
        ],
        "final_speed_rad_per_s": float(played.speed_rad_per_s[tail].mean()),
        "final_torque_nm": float(played.torque_nm[tail].mean()),
    }
