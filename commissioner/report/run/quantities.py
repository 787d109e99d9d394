"""The five values of a result as a report names them: symbol, words, unit."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from commissioner.report.sheet import marks


@dataclass(frozen=True)
class Quantity:
    """`factor` leads from SI to `unit`."""

    field: str
    symbol: Markup
    words: str
    factor: float
    unit: str


QUANTITIES = (
    Quantity("stator_resistance_ohm", marks.R_S, "stator resistance", 1.0, "Ω"),
    Quantity("rotor_resistance_ohm", marks.R_R, "rotor resistance", 1.0, "Ω"),
    Quantity("leakage_inductance_h", marks.L_SIGMA, "leakage inductance", 1e3, "mH"),
    Quantity("magnetizing_inductance_h", marks.L_M, "magnetizing inductance", 1e3, "mH"),
    Quantity("rotor_time_constant_s", marks.T_R, "rotor time constant", 1e3, "ms"),
)
FOUR = QUANTITIES[:4]
"""What standstill data fix."""
BY_FIELD = {quantity.field: quantity for quantity in QUANTITIES}
