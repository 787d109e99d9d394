"""The T circuit of a running machine: its impedance, and the slip that belongs to a power, a current or a lag.

C. J. Schantz, S. B. Leeb, "Self-Sensing Induction Motors for Condition Monitoring", equations (4)-(9), with the signs
corrected: i_s = (L_m lambda_r - L_ar lambda_s) / D and i_r = (L_m lambda_s - L_as lambda_r) / D, D = L_m^2 - L_as L_ar < 0.
Space vectors are complex, d real, q imaginary, amplitude-invariant; the circuit is per phase of the star equivalent.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from commissioner.motor.circuit import InverseGamma, from_t_model, to_t_model
from commissioner.motor.nameplate import Nameplate


@dataclass(frozen=True)
class TCircuit:
    """The T circuit, per-phase star equivalent, rotor referred to the stator. All five in SI."""

    stator_resistance_ohm: float
    rotor_resistance_ohm: float
    stator_leakage_h: float
    rotor_leakage_h: float
    magnetizing_inductance_h: float

    @property
    def stator_inductance_h(self) -> float:
        """L_as = L_m + L_ls."""
        return self.magnetizing_inductance_h + self.stator_leakage_h

    @property
    def rotor_inductance_h(self) -> float:
        """L_ar = L_m + L_lr."""
        return self.magnetizing_inductance_h + self.rotor_leakage_h

    @property
    def determinant_h2(self) -> float:
        """D of equation (9), negative."""
        return self.magnetizing_inductance_h**2 - self.stator_inductance_h * self.rotor_inductance_h

    def as_inverse_gamma(self) -> InverseGamma:
        """What the terminals can tell of it."""
        return from_t_model(*astuple(self))


def equal_leakages(circuit: InverseGamma) -> TCircuit:
    """The T circuit with L_ls = L_lr that has the same terminals."""
    return TCircuit(*(quantity.value for quantity in astuple(to_t_model(circuit))[:5]))


def stator_impedance(circuit: TCircuit, supply_rad_per_s: float, slip: float) -> complex:
    """V/I of the steady state at `slip`: R_s + j w L_ls + (j w L_m) parallel to (R_r/s + j w L_lr)."""
    w = supply_rad_per_s
    main = 1j * w * circuit.magnetizing_inductance_h
    stator = circuit.stator_resistance_ohm + 1j * w * circuit.stator_leakage_h
    if slip == 0.0:
        return stator + main
    rotor = circuit.rotor_resistance_ohm / slip + 1j * w * circuit.rotor_leakage_h
    return stator + main * rotor / (main + rotor)


def pull_out_slip(circuit: TCircuit, supply_rad_per_s: float) -> float:
    """The slip of the largest air-gap power: R_r over the impedance that the rotor branch sees."""
    w = supply_rad_per_s
    main = 1j * w * circuit.magnetizing_inductance_h
    stator = circuit.stator_resistance_ohm + 1j * w * circuit.stator_leakage_h
    seen = stator * main / (stator + main) + 1j * w * circuit.rotor_leakage_h
    return circuit.rotor_resistance_ohm / abs(seen)


def slip_at_power(circuit: TCircuit, supply_rad_per_s: float, voltage_v: float, power_w: float) -> float:
    """The slip below pull-out at which the circuit draws `power_w` (all three phases) at the phase amplitude: negative, up to that of
    the largest power it can give, where it draws less than at synchronous speed."""

    def excess(slip: float) -> float:
        return 1.5 * voltage_v**2 * (1 / stator_impedance(circuit, supply_rad_per_s, slip)).real - power_w

    from scipy.optimize import brentq, minimize_scalar

    edge = pull_out_slip(circuit, supply_rad_per_s)
    if excess(0.0) > 0.0:
        low, high = float(minimize_scalar(excess, bounds=(-edge, 0.0), method="bounded").x), 0.0
        return low if excess(low) >= 0.0 else float(brentq(excess, low, high))
    return edge if excess(edge) <= 0.0 else float(brentq(excess, 0.0, edge))


def slip_at_current(circuit: TCircuit, supply_rad_per_s: float, voltage_v: float, current_a: float) -> float:
    """The slip below pull-out at which the circuit draws the phase amplitude `current_a`."""

    def excess(slip: float) -> float:
        return voltage_v / abs(stator_impedance(circuit, supply_rad_per_s, slip)) - current_a

    from scipy.optimize import brentq

    low, high = 0.0, pull_out_slip(circuit, supply_rad_per_s)
    if excess(low) >= 0.0:
        return low
    return high if excess(high) <= 0.0 else float(brentq(excess, low, high))


def slip_at_lag(circuit: TCircuit, supply_rad_per_s: float, lag_rad: float) -> float:
    """The slip up to that of the best power factor at which the current lags by `lag_rad`; negative where it lags by more than 90 degrees."""

    def lag(slip: float) -> float:
        return float(np.angle(stator_impedance(circuit, supply_rad_per_s, slip)))

    from scipy.optimize import brentq, minimize_scalar

    way = 1.0 if lag_rad <= np.pi / 2 else -1.0
    edge = pull_out_slip(circuit, supply_rad_per_s)

    def short(share: float) -> float:
        return way * (lag(way * share) - lag_rad)

    best = float(minimize_scalar(short, bounds=(0.0, edge), method="bounded").x)
    if short(best) >= 0.0:
        return way * best
    return 0.0 if short(0.0) <= 0.0 else way * float(brentq(short, 0.0, best))


STARTING_CURRENT = 6.5
"""Locked-rotor over rated current of standard cage motors (35 published circuits: median 6.9, from 3.6 to 14)."""
STATOR_SHARE_OF_REST = 0.75
"""Share of the losses left after the rotor copper that is stator copper; the rest is iron and friction."""


def from_nameplate(plate: Nameplate) -> TCircuit:
    """A T circuit that draws the rated current at the rated power factor and slip: a start value, good to 20-40 %.

    R_s from the rated losses, the leakage from a typical starting current, R_r and L_m from the rated operating point.
    """
    w = 2 * np.pi * plate.rated_frequency_hz
    voltage = plate.rated_voltage_v / np.sqrt(3.0)
    slip = max(1 - plate.rated_speed_rpm / 60 * plate.pole_pairs / plate.rated_frequency_hz, 0.002)
    power_in = 3 * voltage * plate.rated_current_a * plate.power_factor
    gap = plate.rated_power_w / (1 - slip)
    rest = max(power_in - gap, 0.02 * power_in)
    resistance = STATOR_SHARE_OF_REST * rest / (3 * plate.rated_current_a**2)
    leakage = 0.5 * voltage / (STARTING_CURRENT * plate.rated_current_a) / w
    current = plate.rated_current_a * np.exp(-1j * np.arccos(plate.power_factor))
    gap_voltage = voltage - (resistance + 1j * w * leakage) * current
    admittance = current / gap_voltage
    rotor = slip * (1 / admittance.real) if admittance.real > 0 else slip * voltage / plate.rated_current_a
    for _ in range(20):
        branch = 1 / (rotor / slip + 1j * w * leakage)
        rotor *= branch.real / admittance.real
    main = -1 / (w * min((admittance - branch).imag, -0.05 * abs(admittance)))
    return TCircuit(float(resistance), float(rotor), float(leakage), float(leakage), float(main))
