"""What a manufacturer's sheet says: each value as printed, in SI or per unit, with half the step of its last digit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

KEYS: Mapping[str, tuple[str, str]] = {
    "rated_power_w": ("rated power", "W"), "rated_voltage_v": ("rated voltage", "V"), "rated_frequency_hz": ("rated frequency", "Hz"),
    "rated_speed_rpm": ("rated speed", "1/min"), "rated_slip": ("rated slip", ""), "rated_current_a": ("rated current", "A"),
    "power_factor": ("power factor", ""), "power_factor_75": ("power factor at 3/4 load", ""),
    "power_factor_50": ("power factor at 1/2 load", ""), "efficiency": ("efficiency", ""),
    "efficiency_75": ("efficiency at 3/4 load", ""), "efficiency_50": ("efficiency at 1/2 load", ""),
    "rated_torque_nm": ("rated torque", "N m"), "starting_current_ratio": ("starting current I_A/I_N", ""),
    "starting_current_a": ("starting current", "A"), "starting_torque_ratio": ("starting torque M_A/M_N", ""),
    "starting_torque_nm": ("starting torque", "N m"), "breakdown_torque_ratio": ("breakdown torque M_K/M_N", ""),
    "breakdown_torque_nm": ("breakdown torque", "N m"), "pull_up_torque_ratio": ("pull-up torque M_S/M_N", ""),
    "pull_up_torque_nm": ("pull-up torque", "N m"), "no_load_current_a": ("no-load current", "A"),
    "inertia_kg_m2": ("inertia", "kg m2"), "winding_resistance_uv_ohm": ("resistance between two terminals", "ohm"),
    "winding_resistance_phase_ohm": ("resistance of a phase winding", "ohm"), "winding_temperature_c": ("its temperature", "degC"),
    "pole_pairs": ("pole pairs", ""),
}  # fmt: skip
"""Keys, words and units of a sheet's values."""
ABSOLUTE = {"starting_current": "rated_current_a", "starting_torque": "rated_torque_nm", "breakdown_torque": "rated_torque_nm",
            "pull_up_torque": "rated_torque_nm"}  # fmt: skip


@dataclass(frozen=True)
class Value:
    """`half_step`: half the step of the last printed digit, in the unit of `value`."""

    value: float
    half_step: float
    printed: str = ""

    @property
    def std(self) -> float:
        """Of a rounding, uniform."""
        return self.half_step / math.sqrt(3.0)


@dataclass(frozen=True)
class Sheet:
    """Values by the keys of `KEYS`; `connection`: star, delta or nothing; `design_class`: a letter or nothing."""

    values: Mapping[str, Value]
    connection: str = ""
    design_class: str = ""
    source: str = "the sheet"
    remarks: tuple[str, ...] = field(default=())

    def get(self, key: str) -> float | None:
        found = self.values.get(key)
        return None if found is None else found.value

    def has(self, *keys: str) -> bool:
        return all(k in self.values for k in keys)

    def with_value(self, key: str, value: float, half_step: float = 0.0) -> Sheet:
        return replace(self, values={**self.values, key: Value(value, half_step)})

    def without(self, *keys: str) -> Sheet:
        return replace(self, values={k: v for k, v in self.values.items() if k not in keys})


def synchronous_rpm(sheet: Sheet) -> float | None:
    """60 f / p; pole pairs, where they are not said, those of the next synchronous speed above the rated one."""
    frequency, pairs = sheet.get("rated_frequency_hz"), pole_pairs(sheet)
    return None if frequency is None or pairs is None else 60.0 * frequency / pairs


def pole_pairs(sheet: Sheet) -> int | None:
    said, frequency, speed = sheet.get("pole_pairs"), sheet.get("rated_frequency_hz"), sheet.get("rated_speed_rpm")
    if said is not None:
        return round(said)
    if frequency is None or speed is None or speed <= 0.0:
        return None
    return max(int(60.0 * frequency / speed), 1)
