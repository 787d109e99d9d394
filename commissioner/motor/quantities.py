"""The five numbers a motor is known by: what people call them, and in which unit they are shown; its plate in words; digits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Quantity:
    """`field` names the value in SI; times `factor` it is in `unit`. `symbol` in plain text, empty where the words do."""

    field: str
    words: str
    symbol: str
    factor: float
    unit: str

    @property
    def name(self) -> str:
        """Words and symbol."""
        return f"{self.words} {self.symbol}".rstrip()


FIVE = (
    Quantity("stator_resistance_ohm", "stator resistance", "R_s", 1.0, "Ω"),
    Quantity("rotor_resistance_ohm", "rotor resistance", "R_R", 1.0, "Ω"),
    Quantity("leakage_inductance_h", "leakage inductance", "L_σ", 1e3, "mH"),
    Quantity("magnetizing_inductance_h", "magnetizing inductance", "L_M", 1e3, "mH"),
    Quantity("rotor_time_constant_s", "rotor time constant", "", 1e3, "ms"),
)
FOUR = FIVE[:4]
"""What standstill data fix; the fifth follows."""
FIELDS = tuple(q.field for q in FIVE)


def quantity_of(field: str) -> Quantity | None:
    """One of the five; None of another field."""
    return next((q for q in FIVE if q.field == field), None)


def field_name(field: str) -> str:
    """`stator resistance R_s` of `stator_resistance_ohm`; another name as it is."""
    quantity = quantity_of(field)
    return field if quantity is None else quantity.name


def in_shown_unit(field: str, *values: float) -> str:
    """SI values of one of the five as people read them: `214 mH`, `4 ... 90 mH`."""
    quantity = quantity_of(field)
    assert quantity is not None
    return f"{' ... '.join(four_digits(quantity.factor * value) for value in values)} {quantity.unit}"


def plate_words(plate: Mapping[str, Any], connection: str = "") -> str:
    """`2.2 kW, 400 V star, 5 A, 1436 1/min`, by the fields' names; empty where the plate is not known."""
    names = ("rated_power_w", "rated_voltage_v", "rated_current_a", "rated_speed_rpm")
    try:
        power, voltage, current, speed = (float(plate[name]) for name in names)
    except (KeyError, TypeError, ValueError):
        return ""
    volts = f"{four_digits(voltage)} V {connection}".rstrip()
    return f"{four_digits(1e-3 * power)} kW, {volts}, {four_digits(current)} A, {four_digits(speed)} 1/min"


def four_digits(value: float) -> str:
    """What has no interval of its own, as a plate's values: at most four significant digits, no exponent below a million."""
    return f"{float(f'{value:.4g}'):g}"


def places(half: float) -> int:
    """Decimal places at which a 95 % interval (its half, above zero) has two digits, and its value ends; below zero: tens."""
    exponent = math.floor(math.log10(half))
    if round(half / 10.0**exponent, 1) >= 10.0:  # 0.0996 has two digits as 0.10
        exponent += 1
    return 1 - exponent
