"""Equivalent circuits of an induction machine: T, Gamma and inverse-Gamma, per-phase star equivalent.

Standstill terminal data fix four numbers, the inverse-Gamma set (G. R. Slemon, IEEE Trans. Ind. Appl. 25(6), 1989;
Castaldi & Tilli 2005, Remark 2). The T circuit has five and needs an assumption, which is named.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import NamedTuple


class Quantity(NamedTuple):
    """A value with its standard deviation, both in the unit the field name says."""

    value: float
    std: float


@dataclass(frozen=True)
class InverseGamma:
    """The four numbers that standstill data fix, SI, per-phase star equivalent, rotor referred to the stator."""

    stator_resistance_ohm: float
    rotor_resistance_ohm: float
    leakage_inductance_h: float
    magnetizing_inductance_h: float

    @property
    def rotor_time_constant_s(self) -> float:
        """L_M / R_R, equal to L_r / R_r of the T circuit."""
        return self.magnetizing_inductance_h / self.rotor_resistance_ohm

    def as_tuple(self) -> tuple[float, float, float, float]:
        """(R_s, R_R, L_sigma, L_M)."""
        return astuple(self)
