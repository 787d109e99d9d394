"""What a leg loses over its current, as a smooth curve in a coordinate in which inverters are simple.

With xi = x / (x + a), x the size of the current and a a small part of the largest, zero current is at 0, infinite
current at 1, and the tail that a dead time leaves (output capacitance charged by the load current: V (1 - k / 2x)) is a
straight line at the end. A voltage in proportion to x, which would pass for resistance, rises without limit there:
holding the curvature of the tail to what a dead time can have is what tells the two apart.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from commissioner.identify.inverter.leg_pair import FORM, drawn, of_legs
from commissioner.identify.inverter.staircase import InverterError
from commissioner.records import Signal

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

Matrix = NDArray[np.float64]
CORNER = 0.03
"""a, of the largest current."""
KNOTS = (0.08, 0.18, 0.3, 0.42, 0.54, 0.66, 0.77, 0.85, 0.92, 0.97, 1.0)
"""Where the curve has free values, in xi of the largest current."""
CURVATURE, CURVATURE_STEP = 1.0, 0.4
"""Standard deviations, of the plateau: of g = xi^3 d2f/dxi2, which is -k/a for a dead time of knee k, and of what g
changes by from knot to knot in the tail. Shapes of published inverters (capacitive, tanh, arc tangent, root; knees up to
a twentieth of the largest current) then move R_s by less than 0.0015 plateau over largest current."""
FALL_OF_LEG = 0.001
"""How much of its largest value a leg error may fall from knot to knot, one standard deviation: physics lets it rise only."""
LEG_DOUBT, LEG_DOUBT_PER_KNEE = 0.0015, 0.15
"""What the drawn leg error may be off from the real one, of its plateau, at least and per knee over largest current: the
nearer the knee is to the currents of the test, the less the tail is told from a resistance. It goes into R_s."""
TAIL = 7
"""Knots from this one on belong to the tail."""
TABLE_POINTS = 61


@dataclass(frozen=True)
class LegLaw:
    """Cubic spline through zero and one free value per knot; straight in xi beyond the largest current. `form_is_known`:
    its values come from a law that describes the samples, not from the curve alone."""

    largest_a: float
    form_is_known: bool = False

    @property
    def corner_a(self) -> float:
        return CORNER * self.largest_a

    @property
    def size(self) -> int:
        return len(KNOTS)

    @cached_property
    def knots(self) -> Signal:
        """Knots in xi, without the one at zero."""
        return np.array(KNOTS) / (1.0 + CORNER)

    @cached_property
    def knots_a(self) -> Signal:
        """The same in ampere."""
        return np.asarray(self.corner_a * self.knots / (1.0 - self.knots))

    @cached_property
    def _spline(self) -> CubicSpline:
        from scipy.interpolate import CubicSpline

        values = np.vstack([np.zeros(self.size), np.eye(self.size)])
        return CubicSpline(np.append(0.0, self.knots), values, bc_type=("natural", "not-a-knot"))

    def basis(self, current_a: Signal) -> Matrix:
        """(n, size): leg voltage per unit of each value at currents of either sign."""
        size = np.abs(current_a)
        xi = size / (size + self.corner_a)
        last = self.knots[-1]
        inside = self._spline(np.minimum(xi, last))
        slope = self._spline(last, 1)
        beyond = np.maximum(xi - last, 0.0)[:, None] * slope
        return np.asarray(np.sign(current_a)[:, None] * (inside + beyond))

    def on_axis(self, current_a: Signal, axis_deg: float) -> Matrix:
        """(n, size): axis voltage per unit of each value, all current along the axis."""
        return of_legs(self.basis, current_a, axis_deg)

    @cached_property
    def expectations(self) -> Matrix:
        """(rows, size): combinations of the values that are 0 +- 1 beforehand, for a plateau of 1 V."""
        bend = self._spline(self.knots, 2) * self.knots[:, None] ** 3
        return np.vstack([bend / CURVATURE, np.diff(bend, axis=0)[TAIL:] / CURVATURE_STEP])

    def expected(self, values: Signal, plateau_v: float) -> tuple[Matrix, Signal]:
        """(rows, missed): what is known beforehand, in standard deviations. The tail bends no more than a dead time's;
        the loss rises with current."""
        falls = np.diff(np.eye(self.size), axis=0)
        falls = falls[falls @ values < 0.0] / FALL_OF_LEG
        rows = np.vstack([self.expectations, falls]) / plateau_v
        return rows, np.asarray(rows @ values)

    @staticmethod
    def admissible(values: Signal) -> Signal:
        """A leg that gives voltage at small currents and takes it at large ones is an oscillator, not an inverter."""
        return np.maximum(values, 0.0) if values[-1] > 0.0 else values

    def doubt_share(self, values: Signal) -> float:
        """What the curve may be off the real one, of the plateau."""
        if self.form_is_known:
            return FORM
        knee = self.table(values, np.zeros((values.size, values.size))).knee_a
        return max(LEG_DOUBT, LEG_DOUBT_PER_KNEE * min(knee / self.largest_a, 1.0))

    def coefficients(self, leg: InverterError) -> Signal:
        """The values of a leg error known otherwise."""
        return leg.leg_voltage_v(self.knots_a)

    def table(self, values: Matrix, covariance: Matrix) -> InverterError:
        """The curve with its standard errors up to thirty times the largest current."""
        xi = np.linspace(0.0, 1.0 / (1.0 + CORNER / 30.0), TABLE_POINTS)
        current = self.corner_a * xi / (1.0 - xi)
        return drawn(current, self.basis(current), values, covariance)
