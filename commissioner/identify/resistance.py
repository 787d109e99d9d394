"""DC staircase: stator resistance and what the inverter loses to dead time and device drop.

At steady state a DC voltage u along the axis gives u = R_s i + F(i), where F adds up the three legs' voltage errors
f(i_leg) along the axis. Each leg's error is odd in its current, grows over a knee near zero (capacitance, ripple) and
stays constant beyond; a device's slope resistance cannot be told from R_s and is counted with it
(`standstill_identification` table 3.3). Both signs make sensor offsets drop out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from commissioner.errors import DataRefused
from commissioner.motor.circuit import Quantity
from commissioner.motor.nameplate import Nameplate, prior, rated_flux
from commissioner.motor.space_vector import phase_cosines
from commissioner.motor.standstill import poles_per_s
from commissioner.records import Signal


@dataclass(frozen=True)
class InverterError:
    """One leg's lost voltage over its current: odd, linear between the points, constant beyond the last.

    `current_a[0]` is 0; `std_v` is the standard deviation of each value.
    """

    current_a: tuple[float, ...]
    voltage_v: tuple[float, ...]
    std_v: tuple[float, ...] = ()

    @property
    def plateau_v(self) -> float:
        """What a leg loses at currents far from zero: dead time x DC link x switching frequency + device threshold."""
        return self.voltage_v[-1]

    @property
    def knee_a(self) -> float:
        """The current at which 63 % of the plateau is reached."""
        rising = np.maximum.accumulate(np.abs(self.voltage_v))
        return float(np.interp(0.632 * abs(self.plateau_v), rising, self.current_a)) if self.plateau_v else 0.0

    def leg_voltage_v(self, current_a: Signal) -> Signal:
        size = np.abs(current_a)
        return np.asarray(np.sign(current_a) * np.interp(size, self.current_a, self.voltage_v))

    def voltage_on_axis(self, current_u: Signal, current_v: Signal, current_w: Signal, axis_deg: float) -> Signal:
        """What is missing from the commanded voltage along the axis, `(n,)`: 2/3 sum of leg errors x cosines."""
        cosines = phase_cosines(axis_deg)
        legs = (current_u, current_v, current_w)
        return np.asarray(
            2.0 / 3.0 * sum(c * self.leg_voltage_v(i) for c, i in zip(cosines, legs, strict=True)), dtype=np.float64
        )

    def on_axis(self, axis_current_a: Signal, axis_deg: float) -> Signal:
        """The same where all current flows along the axis."""
        u, v, w = (c * np.asarray(axis_current_a) for c in phase_cosines(axis_deg))
        return self.voltage_on_axis(u, v, w, axis_deg)


IDEAL_INVERTER = InverterError((0.0, 1.0), (0.0, 0.0), (0.0, 0.0))


@dataclass(frozen=True)
class DcLevel:
    """Mean voltage and current of a stretch of nearly constant voltage; `std_a` is that of the mean current.

    `rise_a_per_s` is the current's slope there: zero at a settled level, not while the voltage climbs.
    """

    voltage_v: float
    current_a: float
    std_a: float
    rise_a_per_s: float = 0.0


@dataclass(frozen=True)
class StaircaseLimits:
    """What the staircase must not pass: axis current and stator flux (both peak), voltage."""

    current_a: float
    flux_wb: float
    voltage_v: float


@dataclass(frozen=True)
class StaircasePlan:
    """What a staircase may reach on a motor of which only the plate is known, and how long a level takes to settle."""

    top_current_a: float
    climb_v_per_s: float
    longest_dwell_s: float
    window_s: float


CLIMB_S = 0.5
"""The climb drives the top current through the typical resistance in this time, whatever dead time takes before it."""


def staircase(nameplate: Nameplate, limits: StaircaseLimits) -> StaircasePlan:
    """The plan for a motor of which only the plate is known.

    Its top current keeps the stator flux L_s i of the most inductive of 35 published machines (1.35 times the typical
    member of the prior) under the limit, iron unsaturated.
    """
    box = prior(nameplate)
    inductance_h = 1.35 * (box.typical.leakage_inductance_h + box.typical.magnetizing_inductance_h)
    top_a = 0.95 * min(limits.current_a, limits.flux_wb / inductance_h)
    slow = -poles_per_s(box.typical)[0]
    return StaircasePlan(
        top_current_a=top_a,
        climb_v_per_s=top_a * box.typical.stator_resistance_ohm / CLIMB_S,
        longest_dwell_s=min(max(4.0 / slow, 0.3), 3.0),
        window_s=0.5 / slow,
    )


@dataclass(frozen=True)
class Staircase:
    """What the levels say. `error_voltage` is one leg's plateau; `residual_v` the rms misfit of the levels."""

    stator_resistance: Quantity
    error_voltage: Quantity
    offset_a: float
    inverter: InverterError
    residual_v: float
    levels: tuple[DcLevel, ...]


KNEE_POINTS = (0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.4, 2.0, 3.0, 5.0, 8.0, 14.0, 25.0)
CLIMB_WEIGHT = 0.2
"""A climbing point is worth less than a settled level: its flux lags behind its current."""


def fit_staircase(levels: Sequence[DcLevel], axis_deg: float) -> Staircase:
    """Least squares of u = R_s i + F(i - offset) + L di/dt over the levels.

    A leg loses f(x) = V z / (1 + z^p)^(1/p), z = x / knee: from a long tail (output capacitance) to a sharp corner.
    L, the inductance seen while climbing, counts only where a level has a slope. Fewer than three levels with current,
    two of one sign, cannot separate resistance from lost voltage: DataRefused.
    """
    voltage = np.array([level.voltage_v for level in levels])
    current = np.array([level.current_a for level in levels])
    rise = np.array([level.rise_a_per_s for level in levels])
    largest = float(np.max(np.abs(current), initial=0.0))
    _require_levels(current[rise == 0.0], largest)
    weight = np.where(rise == 0.0, 1.0, CLIMB_WEIGHT)
    has_both_signs = bool(np.any(current > 0.1 * largest) and np.any(current < -0.1 * largest))

    def misfit(p: Signal) -> Signal:
        resistance, plateau, log_knee, log_power, offset, inductance = p
        true = current - (offset if has_both_signs else 0.0)
        leg = _knee_shape(plateau, math.exp(log_knee), math.exp(log_power))
        model = resistance * true + leg.on_axis(true, axis_deg) + inductance * rise
        prior_terms = [(log_knee - math.log(0.05 * largest)) / 2.0, (log_power - 0.4) / 0.5, offset / (0.02 * largest)]
        return np.concatenate([weight * (voltage - model) / noise, prior_terms])

    start, scale, low, high = _staircase_start(voltage, current, largest)
    noise = 0.003 * float(np.max(np.abs(voltage)))
    for _ in range(3):
        fit = least_squares(misfit, start, bounds=(low, high), x_scale=scale)
        start = fit.x
        residual = misfit(fit.x)[: voltage.size] * noise
        noise = max(float(np.sqrt(np.sum(residual**2) / np.sum(weight**2))), 1e-5 * float(np.max(np.abs(voltage))))
    std = np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)))
    inverter = _knee_shape(fit.x[1], math.exp(fit.x[2]), math.exp(fit.x[3]))
    return Staircase(
        stator_resistance=Quantity(float(fit.x[0]), float(std[0])),
        error_voltage=Quantity(float(fit.x[1]), float(std[1])),
        offset_a=float(fit.x[4]) if has_both_signs else 0.0,
        inverter=InverterError(inverter.current_a, inverter.voltage_v, (float(std[1]),) * len(KNEE_POINTS)),
        residual_v=noise,
        levels=tuple(levels),
    )


def _require_levels(settled_a: Signal, largest_a: float) -> None:
    carrying = settled_a[np.abs(settled_a) > 0.1 * largest_a]
    positive = int(np.sum(carrying > 0))
    if largest_a <= 0.0 or carrying.size < 3 or max(positive, carrying.size - positive) < 2:
        raise DataRefused(
            "the DC staircase has too few levels that carry current", step="fit DC staircase",
            value=f"{carrying.size} levels above a tenth of the largest current",
            limit="3 levels, 2 of one sign", remedy="raise the DC levels or the current limit",
        )


def _knee_shape(plateau_v: float, knee_a: float, power: float) -> InverterError:
    points = np.array(KNEE_POINTS)
    values = plateau_v * points / (1.0 + points**power) ** (1.0 / power)
    return InverterError(tuple(map(float, knee_a * points)), tuple(map(float, values)))


def _staircase_start(voltage: Signal, current: Signal, largest: float) -> tuple[Signal, Signal, Signal, Signal]:
    """Resistance and plateau from the straight line through the upper levels; start, scale, lower and upper bounds."""
    upper = np.abs(current) > 0.4 * largest
    if upper.sum() < 2:
        upper = np.abs(current) > 0.1 * largest
    design = np.column_stack([current[upper], np.sign(current[upper])])
    (resistance, loss), *_ = np.linalg.lstsq(design, voltage[upper], rcond=None)
    top_v = float(np.max(np.abs(voltage)))
    resistance = max(float(resistance), 0.05 * top_v / largest)
    start = np.array([resistance, max(0.75 * float(loss), 1e-3 * top_v), math.log(0.05 * largest), 0.4, 0.0, 0.0])
    scale = np.array([resistance, top_v, 1.0, 0.5, 0.01 * largest, 0.1 * top_v / largest])
    low = np.array([0.0, -top_v, math.log(1e-4 * largest), math.log(0.7), -0.1 * largest, 0.0])
    high = np.array([np.inf, top_v, math.log(largest), math.log(8.0), 0.1 * largest, np.inf])
    return start, scale, low, high


def flux_limit_wb(nameplate: Nameplate, fraction: float) -> float:
    """`fraction` of the rated stator-flux peak, with the typical resistance while none is measured."""
    return fraction * rated_flux(nameplate, prior(nameplate).typical.stator_resistance_ohm).stator_peak_wb
