"""What a batch fit estimates: the Gamma circuit at standstill and, where the data ask for them, saturating iron, the
inverter's leg loss and a delay. One vector `theta` holds it all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.identify.batch import output_error
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.leg_pair import PairLaw
from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.circuit import Gamma, InverseGamma
from commissioner.records import Signal

Matrix = NDArray[np.float64]
CIRCUIT, DELAY, SHARED, OWN = output_error.CIRCUIT, output_error.DELAY, output_error.SHARED, output_error.OWN


IRON = {0: (), 1: (7,), 4: (3, 5, 7, 9), 6: (3, 5, 7, 9, 11, 13)}
"""Powers of flux in the magnetizing current by their number: iron bends late (powers 6 to 10 fit published curves), so a
trace of saturation is a high power. Two powers (5, 9) were dropped: just wrong enough to move L_M by four of its errors."""


@dataclass(frozen=True)
class ModelChoice:
    """What beyond the linear circuit is fitted: `extra_powers` powers (`IRON`) of flux in the magnetizing current
    relative to `flux_scale_wb`, the values of the inverter's `leg` law, a delay; with drift every segment has a sensor offset of its own, else one is common."""

    extra_powers: int = 0
    flux_scale_wb: float = 1.0
    leg: LegLaw | PairLaw | None = None
    with_delay: bool = False
    with_drift: bool = True

    @property
    def size(self) -> int:
        return SHARED + self.extra_powers + self.leg_size

    @property
    def exponents(self) -> tuple[int, ...]:
        return IRON[self.extra_powers]

    @property
    def leg_size(self) -> int:
        return self.leg.size if self.leg else 0

    @property
    def leg_slice(self) -> slice:
        return slice(SHARED + self.extra_powers, self.size)

    @property
    def free_shared(self) -> NDArray[np.bool_]:
        free = np.ones(self.size, dtype=bool)
        free[DELAY] = self.with_delay
        return free


def start_theta(start: InverseGamma, model: ModelChoice, leg: InverterError | None = None) -> Matrix:
    """The model's parameter vector for a machine and, where it is modelled, a leg error."""
    gamma = Gamma.from_inverse_gamma(start)
    theta = np.zeros(model.size)
    theta[:CIRCUIT] = (
        gamma.stator_resistance_ohm,
        gamma.rotor_resistance_ohm,
        gamma.leakage_inductance_h,
        gamma.stator_inductance_h,
    )
    if leg is not None and model.leg:
        theta[model.leg_slice] = model.leg.coefficients(leg)
    return theta


def extra_current(theta: Matrix, model: ModelChoice, flux_wb: Signal) -> Signal:
    """Magnetizing current (A) beyond psi / L_0 at these stator fluxes."""
    relative = flux_wb / model.flux_scale_wb
    return np.asarray(sum(theta[SHARED + m] * relative**n for m, n in enumerate(model.exponents)))


def secant(theta: Matrix, model: ModelChoice, flux_wb: float) -> Matrix:
    """(R_s, R_R, L_sigma, L_M) of the linear machine that takes the same magnetizing current at this stator flux."""
    inductance = float(theta[3])
    if model.extra_powers and flux_wb > 0.0:
        extra = float(extra_current(theta, model, np.array([flux_wb]))[0])
        inductance = flux_wb / (flux_wb / inductance + extra)
    machine = Gamma(float(theta[0]), float(theta[1]), float(theta[2]), inductance)
    return np.array(machine.as_inverse_gamma().as_tuple())
