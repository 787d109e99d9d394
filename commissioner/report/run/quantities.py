"""The five values of a result as a report names them: symbol, words, unit."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from commissioner.motor.quantities import FIVE
from commissioner.report.sheet import marks


@dataclass(frozen=True)
class Quantity:
    """`factor` leads from SI to `unit`."""

    field: str
    symbol: Markup
    words: str
    factor: float
    unit: str


_SYMBOLS = (marks.R_S, marks.R_R, marks.L_SIGMA, marks.L_M, marks.T_R)
QUANTITIES = tuple(
    Quantity(q.field, symbol, q.words, q.factor, q.unit) for q, symbol in zip(FIVE, _SYMBOLS, strict=True)
)
FOUR = QUANTITIES[:4]
"""What standstill data fix."""
BY_FIELD = {quantity.field: quantity for quantity in QUANTITIES}
