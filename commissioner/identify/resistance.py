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
    """One step of the staircase after settling: means over the tail of its dwell time."""

    voltage_v: float
    current_a: float
    std_a: float  # of the mean


@dataclass(frozen=True)
class StaircaseLimits:
    """What the staircase must not pass: axis current and stator flux (both peak), voltage."""

    current_a: float
    flux_wb: float
    voltage_v: float


@dataclass(frozen=True)
class StaircasePlan:
    """DC voltages that climb to `top_current_a` from below, for a motor and an inverter not yet known, then mirror.

    `first_v` drives at most `top_current_a` through the smallest resistance the plate allows. Every level is to be held
    `dwell_s`; its mean is taken over the last `tail` of it.
    """

    top_current_a: float
    first_v: float
    voltage_limit_v: float
    lowest_resistance_ohm: float
    dwell_s: float
    tail: float = 0.4
    rising_levels: int = 5

    def next_level(self, history: Sequence[DcLevel]) -> float | None:
        """The next voltage, given the levels measured so far; None when done."""
        positive = [level for level in history if level.voltage_v > 0]
        negative = len(history) - len(positive)
        if negative == 0 and not self._is_complete(positive):
            return self._higher(positive)
        kept = self._mirrored(positive)
        return -kept[negative] if negative < len(kept) else None

    def _is_complete(self, rising: Sequence[DcLevel]) -> bool:
        if not rising:
            return False
        last = rising[-1]
        carrying = sum(level.current_a > 0.1 * self.top_current_a for level in rising)
        reached = last.current_a >= 0.9 * self.top_current_a and carrying >= 3
        return reached or last.voltage_v >= 0.999 * self.voltage_limit_v or len(rising) >= 24 + self.rising_levels

    def _higher(self, rising: Sequence[DcLevel]) -> float:
        """A step that adds at most one rung of current, whichever resistance is believable after what was seen."""
        if not rising:
            return min(self.first_v, self.voltage_limit_v)
        rung_a = self.top_current_a / self.rising_levels
        last = rising[-1]
        room_a = max(min(rung_a, self.top_current_a - last.current_a), 0.1 * rung_a)
        step_v = room_a * max(self.lowest_resistance_ohm, self._seen_slope(rising))
        return min(last.voltage_v + step_v, self.voltage_limit_v)

    def _seen_slope(self, rising: Sequence[DcLevel]) -> float:
        """dV/dI of the last two levels that carry current; before the knee it is too steep to be trusted whole."""
        carrying = [level for level in rising if level.current_a > 0.05 * self.top_current_a]
        if len(carrying) < 2:
            return 2.0 * self.lowest_resistance_ohm
        rise_v = carrying[-1].voltage_v - carrying[-2].voltage_v
        rise_a = carrying[-1].current_a - carrying[-2].current_a
        return 0.8 * rise_v / rise_a if rise_a > 0.0 else 0.0

    def _mirrored(self, positive: Sequence[DcLevel]) -> list[float]:
        """At most `rising_levels` voltages, spread over current: the largest, and those nearest equal rungs."""
        targets = [self.top_current_a * k / self.rising_levels for k in range(1, self.rising_levels + 1)]
        chosen = {min(positive, key=lambda level: abs(level.current_a - target)).voltage_v for target in targets}
        return sorted(chosen)


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
        first_v=0.3 * top_a * box.lower.stator_resistance_ohm,
        voltage_limit_v=limits.voltage_v,
        lowest_resistance_ohm=box.lower.stator_resistance_ohm,
        dwell_s=min(max(4.0 / slow, 0.3), 3.0),
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


KNEE_POINTS = (0.0, 0.15, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.5, 7.0)


def fit_staircase(levels: Sequence[DcLevel], axis_deg: float) -> Staircase:
    """Least squares of u = R_s i + F(i - offset) over the levels, with f(x) = V (1 - exp(-|x|/knee)) sign(x).

    Fewer than three levels with current on one side and one on the other cannot separate resistance from lost voltage:
    DataRefused.
    """
    largest = max((abs(level.current_a) for level in levels), default=0.0)
    carrying = [level for level in levels if abs(level.current_a) > 0.1 * largest]
    positive = sum(level.current_a > 0 for level in carrying)
    if largest <= 0.0 or len(carrying) < 3 or max(positive, len(carrying) - positive) < 2:
        raise DataRefused(
            "the DC staircase has too few levels that carry current", step="fit DC staircase",
            value=f"{len(carrying)} levels above a tenth of the largest current",
            limit="3 levels, 2 of one sign", remedy="raise the DC levels or the current limit",
        )
    voltage = np.array([level.voltage_v for level in levels])
    current = np.array([level.current_a for level in levels])
    has_both_signs = 0 < positive < len(carrying)
    start, scale, lower = _staircase_start(voltage, current, largest)

    def misfit(p: Signal) -> Signal:
        offset = p[3] if has_both_signs else 0.0
        true = current - offset
        shape = _knee_shape(p[1], p[2])
        prior_terms = np.array([math.log(p[2] / (0.02 * largest)) / 2.0, p[3] / (0.02 * largest)])
        return np.concatenate([(voltage - p[0] * true - shape.on_axis(true, axis_deg)) / noise, prior_terms])

    noise = 0.003 * float(np.max(np.abs(voltage)))
    for _ in range(2):
        fit = least_squares(misfit, start, bounds=(lower, np.inf), x_scale=scale)
        start = fit.x
        residual = misfit(fit.x)[: voltage.size] * noise
        noise = max(float(np.sqrt(np.mean(residual**2))), 1e-5 * float(np.max(np.abs(voltage))))
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
    std = np.sqrt(np.diag(covariance))
    inverter = _knee_shape(fit.x[1], fit.x[2])
    return Staircase(
        stator_resistance=Quantity(float(fit.x[0]), float(std[0])),
        error_voltage=Quantity(float(fit.x[1]), float(std[1])),
        offset_a=float(fit.x[3]) if has_both_signs else 0.0,
        inverter=InverterError(inverter.current_a, inverter.voltage_v, (float(std[1]),) * len(KNEE_POINTS)),
        residual_v=float(np.sqrt(np.mean(residual**2))),
        levels=tuple(levels),
    )


def _knee_shape(plateau_v: float, knee_a: float) -> InverterError:
    points = np.array(KNEE_POINTS)
    values = plateau_v * (1.0 - np.exp(-points))
    values[-1] = plateau_v
    return InverterError(tuple(map(float, knee_a * points)), tuple(map(float, values)))


def _staircase_start(voltage: Signal, current: Signal, largest: float) -> tuple[Signal, Signal, Signal]:
    """Resistance and plateau from the straight line through the upper levels."""
    upper = np.abs(current) > 0.4 * largest
    if upper.sum() < 2:
        upper = np.abs(current) > 0.1 * largest
    design = np.column_stack([current[upper], np.sign(current[upper])])
    (resistance, loss), *_ = np.linalg.lstsq(design, voltage[upper], rcond=None)
    resistance = max(float(resistance), 0.05 * float(np.max(np.abs(voltage))) / largest)
    plateau = max(0.75 * float(loss), 1e-3 * resistance * largest)
    start = np.array([resistance, plateau, 0.02 * largest, 0.0])
    scale = np.array([resistance, resistance * largest, 0.02 * largest, 0.01 * largest])
    lower = np.array([0.0, -np.inf, 1e-5 * largest, -np.inf])
    return start, scale, lower


def flux_limit_wb(nameplate: Nameplate, fraction: float) -> float:
    """`fraction` of the rated stator-flux peak, with the typical resistance while none is measured."""
    return fraction * rated_flux(nameplate, prior(nameplate).typical.stator_resistance_ohm).stator_peak_wb
