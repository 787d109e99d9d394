"""A leg's loss as the sum of two known laws: a dead time and a device threshold, each with its knee.

A dead time is lost while the load current charges the legs' output capacitance, or described by one of the smooth
signs in use; a device's threshold likewise. The pair is linear in what is fitted: both plateaus, and steps of both knees
(logarithms) from where the law is laid down; `moved` lays it down anew.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.space_vector import phase_cosines
from commissioner.records import Signal

Matrix = NDArray[np.float64]
Shape = Callable[[Signal], Signal]
TYPICAL_KNEE, KNEE_SPREAD = 0.02, 1.5
"""Median knee, of the largest current, and standard deviation of its logarithm."""
TYPICAL_SHARE, SHARE_SPREAD = 0.2, 1.0
"""The threshold over the dead time's loss, likewise."""
FORM = 5e-4
"""What a curve of known form may be off although the fit is sure of it, of the plateau."""
KNEE_STEP = 1e-3
LARGEST_STEP = 0.7


def of_legs(basis: Callable[[Signal], Matrix], current_a: Signal, axis_deg: float) -> Matrix:
    """(n, size): axis voltage per unit of each value of a leg's law, all current along the axis: 2/3 sum of legs x cosines."""
    return np.asarray(2.0 / 3.0 * sum(c * basis(c * current_a) for c in phase_cosines(axis_deg)))


def drawn(current_a: Signal, basis: Matrix, values: Signal, covariance: Matrix) -> InverterError:
    """The law as a curve through `current_a` with its standard errors."""
    std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, covariance, basis), 0.0))
    return InverterError(tuple(current_a.tolist()), tuple((basis @ values).tolist()), tuple(std.tolist()))


def _capacitive(z: Signal) -> Signal:
    reach = 1.0 / np.maximum(z, 1.0)
    return np.asarray(z * reach * (1.0 - 0.5 * reach))


def _power(n: float) -> Shape:
    return lambda z: np.asarray(z / (1.0 + z**n) ** (1.0 / n))


DEAD_TIME: dict[str, Shape] = {
    "capacitive": _capacitive,
    "tanh": np.tanh,
    "arc tangent": lambda z: np.asarray(2.0 / math.pi * np.arctan(0.5 * math.pi * z)),
    "hyperbola": _power(1.0),
    "root": _power(2.0),
    "corner": _power(5.0),
    "ramp": lambda z: np.minimum(z, 1.0),
    "clamped": lambda z: np.asarray(z**3 / (1.0 + z**3)),
}
THRESHOLD: dict[str, Shape] = {"hyperbola": _power(1.0), "root": _power(2.0), "tanh": np.tanh}


def law_of_knee(law: Shape, of_knee: Signal) -> Matrix:
    """(n, 2): the law at currents counted in its knee, and its derivative by the knee's logarithm."""
    less, more = law(of_knee * math.exp(-KNEE_STEP)), law(of_knee * math.exp(KNEE_STEP))
    return np.column_stack([law(of_knee), (less - more) / (2.0 * KNEE_STEP)])


@dataclass(frozen=True)
class PairLaw:
    """Values: plateau of the dead time (V), of the threshold (V), and their knees' logarithmic steps times them (V)."""

    dead_time: str
    threshold: str
    dead_time_knee_a: float
    threshold_knee_a: float
    largest_a: float

    @property
    def size(self) -> int:
        return 4

    def basis(self, current_a: Signal) -> Matrix:
        """(n, 4): leg voltage per unit of each value at currents of either sign."""
        size = np.abs(current_a)
        laws = (
            (DEAD_TIME[self.dead_time], self.dead_time_knee_a),
            (THRESHOLD[self.threshold], self.threshold_knee_a),
        )
        (dead, dead_step), (drop, drop_step) = (law_of_knee(law, size / knee).T for law, knee in laws)
        return np.asarray(np.sign(current_a)[:, None] * np.column_stack([dead, drop, dead_step, drop_step]))

    def on_axis(self, current_a: Signal, axis_deg: float) -> Matrix:
        """(n, 4): axis voltage per unit of each value, all current along the axis."""
        return of_legs(self.basis, current_a, axis_deg)

    def expected(self, values: Signal, plateau_v: float) -> tuple[Matrix, Signal]:
        """(rows, missed): how far knees and the threshold's share are from typical ones, in standard deviations."""
        dead, drop, dead_step, drop_step = values
        typical_a = TYPICAL_KNEE * self.largest_a
        missed = np.array(
            [
                (math.log(self.dead_time_knee_a / typical_a) + dead_step / dead) / KNEE_SPREAD,
                (math.log(self.threshold_knee_a / typical_a) + drop_step / drop) / KNEE_SPREAD,
                math.log(drop / dead / TYPICAL_SHARE) / SHARE_SPREAD,
            ]
        )
        rows = np.array(
            [
                [-dead_step / dead**2 / KNEE_SPREAD, 0.0, 1.0 / dead / KNEE_SPREAD, 0.0],
                [0.0, -drop_step / drop**2 / KNEE_SPREAD, 0.0, 1.0 / drop / KNEE_SPREAD],
                [-1.0 / dead / SHARE_SPREAD, 1.0 / drop / SHARE_SPREAD, 0.0, 0.0],
            ]
        )
        return rows, missed

    def admissible(self, values: Signal) -> Signal:
        """The nearest values that are an inverter's: both plateaus take voltage, knees stay in reach of the steps."""
        total = max(abs(float(values[0])) + abs(float(values[1])), 1e-6)
        plateaus = np.maximum(values[:2], 1e-3 * total)
        return np.append(plateaus, np.clip(values[2:], -LARGEST_STEP * plateaus, LARGEST_STEP * plateaus))

    def doubt_share(self, values: Signal) -> float:
        """What the form may be off, of the plateau."""
        return FORM

    def moved(self, values: Signal) -> tuple[PairLaw, Signal]:
        """The same loss with the knees' steps taken: law and values."""
        dead, drop, dead_step, drop_step = map(float, values)
        law = replace(
            self,
            dead_time_knee_a=self.dead_time_knee_a * math.exp(dead_step / dead),
            threshold_knee_a=self.threshold_knee_a * math.exp(drop_step / drop),
        )
        return law, np.array([dead, drop, 0.0, 0.0])

    def coefficients(self, leg: InverterError) -> Signal:
        """Plateaus of a leg error known otherwise, in typical shares."""
        share = TYPICAL_SHARE / (1.0 + TYPICAL_SHARE)
        return leg.plateau_v * np.array([1.0 - share, share, 0.0, 0.0])

    def table(self, values: Signal, covariance: Matrix) -> InverterError:
        """The curve with its standard errors up to thirty times the largest current."""
        current = np.append(0.0, np.geomspace(1e-3, 30.0, 60)) * self.largest_a
        return drawn(current, self.basis(current), values, covariance)
