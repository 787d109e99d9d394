"""A recording cut into segments, and what a fit of all of them together says: estimates, covariance, residuals."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from commissioner.identify.batch.model import (
    CIRCUIT,
    DELAY,
    SHARED,
    SPLIT,
    Matrix,
    ModelChoice,
    extra_current,
    iron_flux,
    secant,
    stator_flux,
)
from commissioner.identify.batch.whiteness import Whiteness, whiteness
from commissioner.identify.inverter.compensation import Compensation
from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.circuit import Gamma, InverseGamma, Quantity
from commissioner.records import Signal, peak

TABLE_ROWS = 2049
PRICE = 4.0


@dataclass(frozen=True)
class Segment:
    """One uninterrupted stretch: voltage along the axis held over each period, current along it at the period's
    start. `weight`: 0 where the current was not measured, 1 elsewhere; None: all was."""

    voltage_v: Signal
    current_a: Signal
    axis_deg: float
    starts_at_rest: bool
    kind: str = "multitone"
    weight: Signal | None = None

    def measured(self, signal: Signal) -> Signal:
        """The signal where the current was measured."""
        return signal if self.weight is None else signal[self.weight > 0.0]


@dataclass(frozen=True)
class BatchFit:
    """The fit. `theta` holds (R_s, R_r, L_l, L_0, delay in s, split, magnetizing coefficients in A, leg voltages in V) of the
    Gamma circuit, `covariance` theirs (zero rows where not fitted)."""

    model: ModelChoice
    theta: Matrix
    covariance: Matrix
    sum_of_squares: float
    samples: int
    free_parameters: int
    residuals: tuple[Signal, ...]
    iron_flux_wb: tuple[Signal, ...]
    stator_flux_wb: tuple[Signal, ...]
    own: Matrix
    """(segments, 3): each segment's sensor offset in A and initial fluxes in Wb."""
    has_converged: bool
    sample_period_s: float

    @property
    def noise_a(self) -> float:
        return math.sqrt(self.sum_of_squares / max(self.samples - self.free_parameters, 1))

    @property
    def offsets_a(self) -> tuple[float, ...]:
        """The current sensors' offset along the axis, one per segment."""
        return tuple(map(float, self.own[:, 0]))

    @property
    def delay(self) -> Quantity:
        return Quantity(float(self.theta[DELAY]), math.sqrt(self.covariance[DELAY, DELAY]))

    @property
    def peak_flux_wb(self) -> float:
        """Of the stator, where the iron carries at rest what it carried at most: iron that the leakage parts from the stator has not
        seen all of the stator's flux."""
        return stator_flux(self.theta, self.model, self.peak_iron_flux_wb)

    @property
    def peak_iron_flux_wb(self) -> float:
        return max(peak(f) for f in self.iron_flux_wb)

    @property
    def gamma(self) -> Gamma:
        """The unsaturated machine."""
        r_s, r_r, l_l, l_0 = map(float, self.theta[:CIRCUIT])
        return Gamma(r_s, r_r, l_l, l_0)

    def criterion(self) -> float:
        """N ln(SSE/N) + 4 p: of nested models the larger where what it adds is beyond two standard errors. What a stricter
        one (Bayes: p ln N) leaves out biases the rest by up to three or four of theirs."""
        n = self.samples
        return n * math.log(self.sum_of_squares / n + 1e-300) + PRICE * self.free_parameters

    def inverse_gamma_at(self, flux_wb: float) -> tuple[InverseGamma, Matrix]:
        """The secant machine at this peak stator flux and its (4, 4) covariance."""
        values = secant(self.theta, self.model, flux_wb)
        jacobian = np.empty((4, self.theta.size))
        for j in range(self.theta.size):
            step = 1e-5 * abs(self.theta[j]) or 1e-7
            up, down = self.theta.copy(), self.theta.copy()
            up[j] += step
            down[j] -= step
            jacobian[:, j] = (secant(up, self.model, flux_wb) - secant(down, self.model, flux_wb)) / (2.0 * step)
        a, b, c, d = map(float, values)
        return InverseGamma(a, b, c, d), jacobian @ self.covariance @ jacobian.T

    def magnetizing_curve(self, points: int = 12) -> tuple[Signal, Signal, Signal]:
        """(stator flux, secant L_M, its std) over the range visited; nothing beyond it."""
        flux = np.linspace(0.05, 1.0, points) * self.peak_flux_wb
        machines = [self.inverse_gamma_at(float(f)) for f in flux]
        inductance = np.array([m.magnetizing_inductance_h for m, _ in machines])
        return flux, inductance, np.sqrt(np.array([c[3, 3] for _, c in machines]))

    @property
    def leg_doubt_ohm(self) -> float:
        """What the form of the leg error leaves open in R_s."""
        if self.model.leg is None:
            return 0.0
        leg, values = self.model.leg, self.theta[self.model.leg_slice]
        return leg.doubt_share(values) * peak(values) / leg.largest_a

    def inverter_covariance_at(self, flux_wb: float) -> Matrix:
        """(4, 4): the part of the secant machine's covariance that comes from the inverter and is common to all axes."""
        if self.model.leg is None:
            return np.zeros((4, 4))
        part = self.model.leg_slice
        crossed = self.covariance[:, part]
        common = crossed @ np.linalg.pinv(self.covariance[part, part], rcond=1e-12, hermitian=True) @ crossed.T
        common[0, 0] += self.leg_doubt_ohm**2
        return replace(self, covariance=common).inverse_gamma_at(flux_wb)[1]

    def inverter(self) -> InverterError | None:
        """The leg error, None where it was not fitted."""
        if self.model.leg is None:
            return None
        part = self.model.leg_slice
        return self.model.leg.table(self.theta[part], self.covariance[part, part])

    def compensation(self, axis_deg: float, current_span_a: float) -> Compensation:
        """What an observer has to take off along this axis to see the unsaturated linear machine."""
        inverter = self.inverter()
        lost = inverter.on_axis(np.linspace(0.0, current_span_a, TABLE_ROWS), axis_deg) if inverter else np.zeros(1)
        flux = np.linspace(0.0, 1.2 * self.peak_flux_wb, TABLE_ROWS)
        extra = np.zeros(1)
        if self.model.extra_powers:
            of_iron = np.array([iron_flux(self.theta, self.model, float(f)) for f in flux])
            extra = extra_current(self.theta, self.model, of_iron)
        return Compensation(lost, current_span_a, extra, float(flux[-1]), float(self.theta[DELAY]))

    def whiteness(self) -> Whiteness:
        return whiteness(self.residuals)


def extended(fit: BatchFit, model: ModelChoice) -> Matrix:
    """A start for another model from a finished fit: what both have is kept, what is new starts at zero."""
    theta = np.zeros(model.size)
    theta[:SHARED] = fit.theta[:SHARED]
    theta[DELAY] *= float(model.with_delay)
    theta[SPLIT] *= float(model.with_split)
    ratio = model.flux_scale_wb / fit.model.flux_scale_wb
    for m, n in enumerate(model.exponents):
        if n in fit.model.exponents:
            theta[SHARED + m] = fit.theta[SHARED + fit.model.exponents.index(n)] * ratio**n
    leg = fit.inverter()
    if leg is not None and model.leg:
        theta[model.leg_slice] = model.leg.coefficients(leg)
    return theta
