"""The JSON of the extended model, as promised: what `model.json` holds, and `simulate` and `python -m sim` accept."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

from typing_extensions import TypedDict

from commissioner.motor.nameplate import Plate

Entry: TypeAlias = Mapping[str, float | str]
"""A cause in the simulated inverter's catalogue, in that one's units."""


class Nominal(TypedDict):
    """The inverse-Gamma set, SI, per-phase star equivalent, referred to the stator."""

    stator_resistance_ohm: float
    rotor_resistance_ohm: float
    leakage_inductance_h: float
    magnetizing_inductance_h: float


class TermRow(TypedDict):
    """One number of the model, in `unit`: of which effect, of what kind, and what it multiplies."""

    effect: str
    symbol: str
    unit: str
    kind: int
    index: int
    segment: int
    channel: str
    value: float


class PowerStage(TypedDict):
    """Of an ideal one every number is none."""

    dead_time_s: float
    threshold_v: float
    slope_ohm: float
    link_ripple: float


class Sensors(TypedDict):
    """`(3,)`, a phase each, where it is a list."""

    noise_a: float
    bits: int
    offset_a: list[float]
    gain: list[float]
    delay_s: float
    lag_s: float
    full_scale_a: float


class Heating(TypedDict):
    """Relative rise of the resistances a minute."""

    stator_per_min: float
    rotor_per_min: float


class Scenario(TypedDict):
    """What `python -m sim --scenario` reads; `machine`: the Gamma circuit and its saturation."""

    nameplate: Plate
    machine: dict[str, float]
    power_stage: PowerStage
    sensors: Sensors
    heating: Heating
    effects: Mapping[str, Entry]


class Described(TypedDict):
    """What a scenario says of a motor alone."""

    name: str
    nameplate: Plate
    machine: dict[str, float]


class ModelDocument(TypedDict):
    """Of a motor at standstill. `terms` and `dictionary` are exact, `effects` the same in engineering sizes, `scenario` the nearest
    machine of the simulated inverter; no effects: the plain motor."""

    kind: str
    format: int
    nominal: Nominal
    nameplate: Plate
    effects: dict[str, dict[str, float]]
    terms: list[TermRow]
    dictionary: dict[str, DictionaryEntry]
    lines_hz: dict[str, float]
    scenario: Scenario


DictionaryEntry: TypeAlias = float | int | bool | str | list[float] | list[list[float]] | None
"""Of the shapes that terms refer to: a number, or `(n,)` and `(m, n)` lists."""
