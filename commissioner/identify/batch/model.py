"""What a batch fit estimates: the Gamma circuit at standstill and, where the data ask for them, saturating iron, the
inverter's leg loss and a delay. One vector `theta` holds it all."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from commissioner.identify.batch import output_error
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.leg_pair import PairLaw
from commissioner.identify.inverter.staircase import InverterError
from commissioner.motor.circuit import Gamma, InverseGamma
from commissioner.records import Signal

Matrix = NDArray[np.float64]
CIRCUIT, DELAY, SPLIT, SHARED, OWN = (
    output_error.CIRCUIT, output_error.DELAY, output_error.SPLIT, output_error.SHARED, output_error.OWN,
)  # fmt: skip


IRON = {0: (), 1: (7,), 4: (3, 5, 7, 9), 6: (3, 5, 7, 9, 11, 13)}
"""Powers of flux in the magnetizing current by their number: iron bends late (powers 6 to 10 fit published curves), so a
trace of saturation is a high power. Two powers (5, 9) were dropped: just wrong enough to move L_M by four of its errors."""


@dataclass(frozen=True)
class ModelChoice:
    """What beyond the linear circuit is fitted: `extra_powers` powers (`IRON`) of flux in the magnetizing current
    relative to `flux_scale_wb`, the values of the inverter's `leg` law, a delay, the iron's place between the leakages of stator and rotor (`with_split`; else it is the stator's
    flux that saturates); with drift every segment has a sensor offset of its own, else one is common."""

    extra_powers: int = 0
    flux_scale_wb: float = 1.0
    leg: LegLaw | PairLaw | None = None
    with_delay: bool = False
    with_split: bool = False
    with_drift: bool = True

    @property
    def size(self) -> int:
        return SHARED + self.extra_powers + self.leg_size

    @property
    def is_linear(self) -> bool:
        """Nothing but the circuit: two modes will do, at a tenth of the time."""
        return self.size == SHARED and not self.with_delay

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
        free[DELAY], free[SPLIT] = self.with_delay, self.with_split
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
    """Magnetizing current (A) beyond psi / L_0 at these fluxes of the iron."""
    relative = flux_wb / model.flux_scale_wb
    return np.asarray(sum(theta[SHARED + m] * relative**n for m, n in enumerate(model.exponents)))


def secant(theta: Matrix, model: ModelChoice, flux_wb: float) -> Matrix:
    """(R_s, R_R, L_sigma, L_M) of the linear machine that takes the same magnetizing current at this stator flux: its inductances
    are those of iron of the secant's inductance, in the iron's own place."""
    r_s, r_r, l_l, l_0 = map(float, theta[:CIRCUIT])
    split, iron_wb, extra = float(theta[SPLIT]), flux_wb, 0.0
    if model.extra_powers and flux_wb > 0.0:
        iron_wb = iron_flux(theta, model, flux_wb)
        extra = float(extra_current(theta, model, np.array([iron_wb]))[0]) / iron_wb
    if split == 0.0:
        return np.array(Gamma(r_s, r_r, l_l, 1.0 / (1.0 / l_0 + extra)).as_inverse_gamma().as_tuple())
    own = 1.0 / l_0 + 1.0 / l_l + (1.0 - split) ** 2 * extra
    mutual = (1.0 - split) * split * extra - 1.0 / l_l
    rotor = 1.0 / l_l + split**2 * extra
    ratio = mutual / own
    return np.array((r_s, r_r * ratio * ratio, 1.0 / own, ratio * ratio * own / (own * rotor - mutual * mutual)))


def stator_flux(theta: Matrix, model: ModelChoice, iron_wb: float) -> float:
    """Of the motor magnetized at rest, no current in the rotor, where the iron carries this flux."""
    extra = float(extra_current(theta, model, np.array([iron_wb]))[0]) if model.extra_powers else 0.0
    return iron_wb + float(theta[SPLIT] ** 2 * theta[2]) * extra


def stator_flux_of_current(theta: Matrix, model: ModelChoice, iron_wb: Signal, current_a: Signal) -> Signal:
    """What the leakage between stator and iron adds to the iron's flux at these currents."""
    split, l_l, l_0 = float(theta[SPLIT]), float(theta[2]), float(theta[3])
    if split == 0.0:
        return iron_wb
    straight_a = current_a - (1.0 - split) * extra_current(theta, model, iron_wb)
    return np.asarray((iron_wb + split * l_l * straight_a) / (1.0 + split * l_l / l_0))


def iron_flux(theta: Matrix, model: ModelChoice, stator_wb: float) -> float:
    """The inverse of `stator_flux`."""
    if theta[SPLIT] == 0.0:
        return stator_wb
    from scipy.optimize import brentq

    beyond = partial(_beyond, theta, model, stator_wb)
    return float(brentq(beyond, 0.0, stator_wb)) if beyond(stator_wb) > 0.0 else stator_wb


def _beyond(theta: Matrix, model: ModelChoice, stator_wb: float, iron_wb: float) -> float:
    return stator_flux(theta, model, iron_wb) - stator_wb
