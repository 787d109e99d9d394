"""Equivalent circuits of an induction machine: T, Gamma and inverse-Gamma, per-phase star equivalent.

Standstill terminal data fix four numbers, the inverse-Gamma set (G. R. Slemon, IEEE Trans. Ind. Appl. 25(6), 1989;
Castaldi & Tilli 2005, Remark 2). The T circuit has five and needs an assumption, which is named.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

PARAMETERS = ("stator_resistance_ohm", "rotor_resistance_ohm", "leakage_inductance_h", "magnetizing_inductance_h")
"""The inverse-Gamma circuit's four as results name them, in its order."""
SYMBOLS = ("R_s", "R_R", "L_sigma", "L_M")
"""The same as a sentence writes them."""


class Quantity(NamedTuple):
    """A value with its standard deviation, both in the unit the field name says."""

    value: float
    std: float


QUANTILE = 1.96
"""Half of a 95 % interval over one standard deviation of a normal distribution."""


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

    def with_rotor_leakage(self, leakage_h: float) -> InverseGamma:
        """The circuit of the same terminals where the rotor branch has so much leakage: g = L_M / (L_M + l) refers the rotor once more."""
        ratio = self.magnetizing_inductance_h / (self.magnetizing_inductance_h + leakage_h)
        return InverseGamma(
            self.stator_resistance_ohm,
            ratio * ratio * self.rotor_resistance_ohm,
            self.leakage_inductance_h + ratio * leakage_h,
            ratio * self.magnetizing_inductance_h,
        )

    def as_tuple(self) -> tuple[float, float, float, float]:
        """(R_s, R_R, L_sigma, L_M)."""
        return (
            self.stator_resistance_ohm,
            self.rotor_resistance_ohm,
            self.leakage_inductance_h,
            self.magnetizing_inductance_h,
        )


@dataclass(frozen=True)
class Gamma:
    """The same machine with all leakage on the rotor side; the stator inductance carries the stator flux."""

    stator_resistance_ohm: float
    rotor_resistance_ohm: float
    leakage_inductance_h: float
    stator_inductance_h: float

    def as_inverse_gamma(self) -> InverseGamma:
        """L_sigma = L_s L_l / (L_s + L_l), L_M = L_s^2 / (L_s + L_l), R_R = (L_s / (L_s + L_l))^2 R_r."""
        total_h = self.stator_inductance_h + self.leakage_inductance_h
        ratio = self.stator_inductance_h / total_h
        return InverseGamma(
            self.stator_resistance_ohm,
            ratio * ratio * self.rotor_resistance_ohm,
            ratio * self.leakage_inductance_h,
            ratio * self.stator_inductance_h,
        )

    @staticmethod
    def from_inverse_gamma(machine: InverseGamma) -> Gamma:
        stator_h = machine.leakage_inductance_h + machine.magnetizing_inductance_h
        ratio = stator_h / machine.magnetizing_inductance_h
        return Gamma(
            machine.stator_resistance_ohm,
            ratio * ratio * machine.rotor_resistance_ohm,
            ratio * machine.leakage_inductance_h,
            stator_h,
        )


@dataclass(frozen=True)
class TModel:
    """The T circuit under a named assumption; each quantity with its standard deviation (assumption taken as exact)."""

    stator_resistance_ohm: Quantity
    rotor_resistance_ohm: Quantity
    stator_leakage_h: Quantity
    rotor_leakage_h: Quantity
    magnetizing_inductance_h: Quantity
    assumption: str


STATOR_SHARE_OF_LEAKAGE: Mapping[str, float] = {
    "equal leakage (L_s = L_r)": 0.5,
    "NEMA design A, 0.5 of the leakage in the stator": 0.5,
    "NEMA design B (IEC design N), 0.4 of the leakage in the stator": 0.4,
    "NEMA design C (IEC design H), 0.3 of the leakage in the stator": 0.3,
    "NEMA design D, 0.5 of the leakage in the stator": 0.5,
}
"""Assumptions that turn four numbers into five (shares: IEEE Std 112-2017, 5.9). Keys are what a result names."""
EQUAL_LEAKAGE = "equal leakage (L_s = L_r)"


def to_t_model(
    machine: InverseGamma, covariance: NDArray[np.float64] | None = None, assumption: str = EQUAL_LEAKAGE
) -> TModel:
    """The T circuit that has these inverse-Gamma values under the assumption.

    `covariance` is (4, 4) in the order of `InverseGamma.as_tuple`, None = exactly known. An unknown assumption raises
    KeyError.
    """
    share = STATOR_SHARE_OF_LEAKAGE[assumption]
    values = _t_values(machine.as_tuple(), share)
    if covariance is None:
        return _named([Quantity(value, 0.0) for value in values], assumption)
    jacobian = np.empty((5, 4))
    for column, value in enumerate(machine.as_tuple()):
        moved = [[*machine.as_tuple()], [*machine.as_tuple()]]
        step = 1e-5 * value
        moved[0][column] -= step
        moved[1][column] += step
        low, high = (_t_values((m[0], m[1], m[2], m[3]), share) for m in moved)
        jacobian[:, column] = (np.array(high) - np.array(low)) / (2.0 * step)
    variance = np.einsum("ij,jk,ik->i", jacobian, covariance, jacobian)
    stds = np.sqrt(np.maximum(variance, 0.0))
    return _named([Quantity(value, float(std)) for value, std in zip(values, stds, strict=True)], assumption)


def from_t_model(
    stator_resistance_ohm: float,
    rotor_resistance_ohm: float,
    stator_leakage_h: float,
    rotor_leakage_h: float,
    magnetizing_inductance_h: float,
) -> InverseGamma:
    """L_sigma = L_s - L_m^2 / L_r, L_M = L_m^2 / L_r, R_R = (L_m / L_r)^2 R_r."""
    rotor_h = rotor_leakage_h + magnetizing_inductance_h
    ratio = magnetizing_inductance_h / rotor_h
    magnetizing_h = ratio * magnetizing_inductance_h
    leakage_h = stator_leakage_h + magnetizing_inductance_h - magnetizing_h
    return InverseGamma(stator_resistance_ohm, ratio * ratio * rotor_resistance_ohm, leakage_h, magnetizing_h)


def _named(quantities: list[Quantity], assumption: str) -> TModel:
    r_s, r_r, l_ls, l_lr, l_m = quantities
    return TModel(r_s, r_r, l_ls, l_lr, l_m, assumption)


def _t_values(inverse_gamma: tuple[float, float, float, float], share: float) -> tuple[float, ...]:
    """(R_s, R_r, L_ls, L_lr, L_m): with X = L_ls + L_lr and L_s = L_sigma + L_M the equation
    (L_s - k X)^2 = L_M (L_s + (1 - 2 k) X) is quadratic in X; its smaller root is the machine."""
    r_s, r_r, l_sigma, l_m = inverse_gamma
    l_s = l_sigma + l_m
    half = 0.5 * (2.0 * share * l_s + l_m * (1.0 - 2.0 * share))
    constant = l_s * l_sigma
    leakage = constant / (half + math.sqrt(half * half - share * share * constant))
    mutual = l_s - share * leakage
    rotor = mutual + (1.0 - share) * leakage
    return r_s, r_r * (rotor / mutual) ** 2, share * leakage, (1.0 - share) * leakage, mutual
