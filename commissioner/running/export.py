"""The extended model: numbers that `simulate` plays, and the same as a scenario for the simulator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from commissioner.estimation.fit import Machine
from commissioner.estimation.kernels.march import STATES
from commissioner.estimation.numbers import AT, COUNT, DEFAULTS, FOUR, Scales
from commissioner.estimation.record import Record
from commissioner.motor.circuit import Gamma, InverseGamma
from commissioner.motor.nameplate import Nameplate, Plate
from commissioner.running.causes import CATALOGUE
from commissioner.running.causes.cause import Entry
from commissioner.running.search import Found

FORMAT = "commissioner extended running model 1"


LOAD, STEPS = 0.1, ((1.0, 0.4), (2.0, 0.4))
"""Of rated torque, from the start, and (s after closing, added): the scenario's course."""


class RunningScenario(TypedDict):
    """The simulator's document: Gamma circuit, mains, a start with load steps (s, N m) and what pulsates (share of the load, times a turn), noise, the
    causes' sizes."""

    kind: str
    nameplate: Plate
    machine: dict[str, float]
    supply: dict[str, float]
    course: dict[str, float | list[float] | list[list[float]]]
    sensors: dict[str, float]
    effects: dict[str, Entry]


class RunningModel(TypedDict):
    """What `model.json` of a running diagnosis holds. `numbers`: those of the machine that are not none, by name."""

    format: str
    kind: str
    nameplate: Plate
    sample_period_s: float
    numbers: dict[str, float]
    has_shaft: bool
    effects: list[str]
    effect_numbers: dict[str, list[str]]
    scenario: RunningScenario


def model_document(found: Found, record: Record) -> RunningModel:
    """What `model.json` holds. `numbers`: those of the machine that are not none; relative ones as in the chapter `running`."""
    machine = found.fit.machine
    values = machine.values()
    if not (values["load_swing_cos"] or values["load_swing_sin"]):
        values["load_swing_turns"] = 0.0  # where one was looked for
    kept = {n: v for n, v in values.items() if v != 0.0 and (n in FOUR or n == "inertia" or v != DEFAULTS.get(n))}
    return {
        "format": FORMAT,
        "kind": "running",
        "nameplate": record.plate.known(),
        "sample_period_s": record.period_s,
        "numbers": kept,
        "has_shaft": machine.has_shaft,
        "effects": [one.cause for one in found.accepted],
        "effect_numbers": {one.cause: list(one.numbers) for one in found.accepted},
        "scenario": scenario(found, record),
    }


def scenario(found: Found, record: Record) -> RunningScenario:
    """The simulator's document: Gamma circuit, mains of the plate, a start with two load steps, the causes' sizes."""
    machine, scales, plate = found.fit.machine, record.scales, record.plate
    values = machine.values()
    gamma = Gamma.from_inverse_gamma(InverseGamma(*(values[n] for n in FOUR)))
    inertia = (
        values["inertia"]
        if machine.has_shaft
        else plate.inertia_kg_m2 or 0.5 * scales.torque_nm * scales.pole_pairs / scales.frequency_rad_per_s
    )
    effects = {
        one.cause: entry(values, scales)
        for one in found.accepted
        if (entry := CATALOGUE[one.cause].scenario) is not None
    }
    return {
        "kind": "running",
        "nameplate": {k: v for k, v in plate.known().items() if k != "inertia_kg_m2"},
        "machine": {
            "stator_resistance_ohm": gamma.stator_resistance_ohm, "rotor_resistance_ohm": gamma.rotor_resistance_ohm,
            "leakage_inductance_h": gamma.leakage_inductance_h, "inductance_h": gamma.stator_inductance_h,
            "inertia_kg_m2": inertia, "pole_pairs": plate.pole_pairs,
        },
        "supply": {"voltage_v": plate.rated_voltage_v, "frequency_hz": plate.rated_frequency_hz, "unbalance": 0.005, "fifth": 0.005},
        "course": {
            "duration_s": 3.0, "rate_hz": 1.0 / record.period_s, "constant_nm": LOAD * scales.torque_nm,
            "steps": [[at_s, added * scales.torque_nm] for at_s, added in STEPS],
            **_swing(found, values),
        },
        "sensors": {"current_noise_a": record.sigma_a[0], "voltage_noise_v": record.sigma_v},
        "effects": effects,
    }  # fmt: skip


def _swing(found: Found, values: Mapping[str, float]) -> dict[str, list[float]]:
    """What pulsates in the load, as a share of the heaviest one."""
    for one in found.accepted:
        if (swing := CATALOGUE[one.cause].swing) is not None:
            part, turns = swing(values)
            return {"swing": [part / (LOAD + sum(added for _, added in STEPS)), turns]}
    return {}


def machine_of(document: Mapping[str, Any], *, is_plain: bool) -> tuple[Machine, Scales, Nameplate]:
    """The machine of a `model.json`. KeyError, ValueError, TypeError where it is none."""
    if document.get("format") != FORMAT:
        raise ValueError(f"format {document.get('format')!r}, expected {FORMAT!r}")
    plate = Nameplate(**document["nameplate"])
    from commissioner.estimation.record import scales_of

    left_out = {n for names in document["effect_numbers"].values() for n in names} if is_plain else set()
    first, knots, beside = (np.zeros((1, count)) for count in (STATES, 2, COUNT))
    machine = Machine(np.zeros(COUNT), first, knots, knots, beside, bool(document["has_shaft"]))
    values = {**DEFAULTS, **{str(n): float(v) for n, v in document["numbers"].items() if n not in left_out}}
    unknown = [n for n in values if n not in AT]
    if unknown:
        raise ValueError(f"number {unknown[0]!r} is not one of the machine's")
    return machine.with_values(values), scales_of(plate), plate
