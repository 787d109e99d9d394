"""The motor on an ordinary drive: what is true of it, and what the drive's own tuning finds instead."""

from __future__ import annotations

import random
from dataclasses import dataclass, field

from sim.vendors.face import Cell

COPPER_PER_K = 0.00393
HEATING_K = 3.0
"""One tuning warms the winding by so much; it cools with a time constant of COOLING_S."""
COOLING_S = 400.0
BIAS = {
    "stator_resistance": 0.03, "leakage_inductance": -0.06, "rotor_time_constant": 0.08, "no_load_current": -0.04,
    "transient_inductance": -0.05, "stator_inductance": 0.05,
}  # fmt: skip
"""Relative, of a vendor's tuning that ignores its inverter's drops (R_s too large) and iron (T_r too large)."""
SCATTER = 0.006
RAW_PER_SI = {
    "stator_resistance": 1000.0, "no_load_current": 10.0, "leakage_inductance": 1e5, "rotor_time_constant": 1000.0,
    "transient_inductance": 1e5, "stator_inductance": 1e4,
}  # fmt: skip
"""How this drive counts what its file calls raw: milliohm, 0.1 A, 0.01 mH, ms. Nobody who reads the file can know."""


@dataclass
class Motor:
    """Per phase, SI, at 20 degC."""

    stator_resistance: float = 3.7
    rotor_time_constant: float = 0.141
    leakage_inductance: float = 0.0215
    no_load_current: float = 2.9
    transient_inductance: float = 0.0215
    stator_inductance: float = 0.329
    plate: dict[str, float] = field(
        default_factory=lambda: {
            "rated_power_w": 2200.0, "rated_voltage_v": 400.0, "rated_frequency_hz": 50.0, "rated_current_a": 5.0,
            "rated_speed_rpm": 1436.0, "power_factor": 0.8, "pole_pairs": 2.0, "pole_count": 4.0,
        }
    )  # fmt: skip
    warm_k: float = 0.0

    def cool(self, seconds: float) -> None:
        self.warm_k *= 2.718281828 ** (-seconds / COOLING_S)

    def in_cell(self, cell: Cell, quantity: float) -> float:
        """A per-phase SI quantity in the cell's unit and convention."""
        if cell.unit == "raw":
            return quantity * RAW_PER_SI[cell.name]
        return quantity * (2.0 if cell.convention.endswith("line_to_line") else 1.0)

    def true(self, cell: Cell) -> float:
        return self.in_cell(cell, getattr(self, cell.name))

    def tuned(self, cell: Cell, rng: random.Random, error: float = 0.0) -> float:
        """What one tuning finds: with its bias, its scatter, the winding's warmth, and `error` where it goes wrong."""
        factor = 1.0 + BIAS[cell.name] + rng.gauss(0.0, SCATTER) + error
        if cell.name == "stator_resistance":
            factor *= 1.0 + COPPER_PER_K * self.warm_k
        return self.true(cell) * factor
