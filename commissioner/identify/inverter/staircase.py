"""DC staircase: stator resistance and what the inverter loses to dead time and device drop.

At steady state a DC voltage u along the axis gives u = R_s i + F(i), where F adds up the three legs' voltage errors
f(i_leg) along the axis. Each leg's error is odd in its current, grows over a knee near zero (capacitance, ripple) and
stays constant beyond; a device's slope resistance cannot be told from R_s and is counted with it
(`standstill_identification` table 3.3). Both signs make sensor offsets drop out.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.motor.circuit import Quantity
from commissioner.motor.nameplate import Nameplate, prior
from commissioner.motor.space_vector import phase_cosines
from commissioner.motor.standstill import poles_per_s
from commissioner.records import Signal, peak


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
    """Mean voltage and current of a stretch of nearly constant voltage; `std_a` is that of the mean current."""

    voltage_v: float
    current_a: float
    std_a: float


def dc_levels(voltage_v: Signal, current_a: Signal, tail: float = 0.4) -> list[DcLevel]:
    """Means over the last `tail` of every stretch of constant voltage that is long enough to settle."""
    top = peak(voltage_v)
    edges = np.flatnonzero(np.abs(np.diff(voltage_v)) > 1e-6 * top) + 1
    bounds = [0, *edges.tolist(), voltage_v.size]
    longest = max(b - a for a, b in itertools.pairwise(bounds))
    levels = []
    for a, b in itertools.pairwise(bounds):
        if b - a < max(0.3 * longest, 20) or abs(voltage_v[a]) < 1e-6 * top:
            continue
        part = current_a[b - int(tail * (b - a)) : b]
        levels.append(DcLevel(float(voltage_v[a]), float(np.mean(part)), float(np.std(part) / math.sqrt(part.size))))
    return levels


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
    largest_inductance_h: float
    climb_v_per_s: float
    longest_dwell_s: float
    window_s: float


CLIMB_S = 0.5
"""The climb drives the top current through the typical resistance in this time, whatever dead time takes before it."""
MOST_INDUCTIVE, SEEN_DOUBT = 1.35, 1.3
"""Of the plate's typical motor: the most inductive of 35 published ones. Of an inductance seen at a small current: the most
that it may be more at a larger one, where iron's permeability first rises, and for what that measurement is off."""


def staircase(nameplate: Nameplate, limits: StaircaseLimits, seen_inductance_h: float | None = None) -> StaircasePlan:
    """The plan for a motor of which the plate and, if so, the inductance at a small current is known.

    Its top current keeps the stator flux L_s i of the most inductive motor that this can be under the limit, iron
    unsaturated. A small current can show too little inductance, behind an inverter that loses much: it raises the top never.
    """
    box = prior(nameplate)
    inductance_h = MOST_INDUCTIVE * (box.typical.leakage_inductance_h + box.typical.magnetizing_inductance_h)
    if seen_inductance_h is not None:
        inductance_h = max(inductance_h, SEEN_DOUBT * seen_inductance_h)
    top_a = 0.9 * min(limits.current_a, limits.flux_wb / inductance_h)
    slow = -poles_per_s(box.typical)[0]
    return StaircasePlan(
        top_current_a=top_a,
        largest_inductance_h=inductance_h,
        climb_v_per_s=top_a * box.typical.stator_resistance_ohm / CLIMB_S,
        longest_dwell_s=min(max(4.0 / slow, 0.3), 3.0),
        window_s=0.5 / slow,
    )


@dataclass(frozen=True)
class Staircase:
    """What the levels say. `error_voltage` is one leg's plateau."""

    stator_resistance: Quantity
    error_voltage: Quantity
    offset_a: float
    inverter: InverterError
    levels: tuple[DcLevel, ...]


KNEE_POINTS = np.concatenate([[0.0], np.geomspace(0.05, 200.0, 40)])
"""Where a fitted knee shape is tabulated, in knee currents."""
SHAPE_DOUBT = 0.01
TAILS = (1.0, 1.5, 2.0, 4.0)
"""Exponents n of the knee shapes tried, x / (1 + x^n)^(1/n): from a hyperbola, whose tail is long, to almost a
corner."""


def fit_staircase(levels: Sequence[DcLevel], axis_deg: float) -> Staircase:
    """Least squares of u = R_s i + F(i - offset) over the levels, leg error f(x) = V s(x / knee), for several knee
    shapes.

    Shapes weigh with how well they fit; what they disagree about is part of the standard errors. Fewer than three
    levels with current, or fewer than two of one sign, cannot separate resistance from lost voltage: DataRefused.
    """
    largest = max((abs(level.current_a) for level in levels), default=0.0)
    carrying = [level for level in levels if abs(level.current_a) > 0.1 * largest]
    positive = sum(level.current_a > 0 for level in carrying)
    if largest <= 0.0 or len(carrying) < 3 or max(positive, len(carrying) - positive) < 2:
        raise DataRefused(
            "the DC staircase has too few levels that carry current",
            step="fit DC staircase",
            value=f"{len(carrying)} levels above a tenth of the largest current",
            limit="3 levels, 2 of one sign",
            remedy="raise the DC levels or the current limit",
        )
    fits = [_fit_shape(tuple(levels), axis_deg, tail, largest, 0 < positive < len(carrying)) for tail in TAILS]
    best = min(fits, key=lambda f: f.misfit)
    weights = np.array([math.exp(-0.5 * max(len(levels) - 4, 1) * (f.misfit / best.misfit - 1.0)) for f in fits])
    weights /= weights.sum()
    values = np.array([f.values for f in fits])
    mean = weights @ values
    spread = np.sqrt(weights @ (values - mean) ** 2 + weights @ np.array([np.square(f.std) for f in fits]))
    shape = knee_shape(best.values[1], best.values[2], best.tail)
    # A shape outside the family (an arc tangent) moves R_s by up to the hundredth part of the plateau over the largest
    # current.
    doubt = SHAPE_DOUBT * abs(float(best.values[1])) / largest
    return Staircase(
        stator_resistance=Quantity(
            float(best.values[0]), float(math.hypot(spread[0], doubt) + abs(mean[0] - best.values[0]))
        ),
        error_voltage=Quantity(float(best.values[1]), float(spread[1] + abs(mean[1] - best.values[1]))),
        offset_a=float(best.values[3]),
        inverter=InverterError(shape.current_a, shape.voltage_v, (float(spread[1]),) * len(shape.current_a)),
        levels=tuple(levels),
    )


@dataclass(frozen=True)
class _ShapeFit:
    """(R_s, V, knee, offset) for one knee shape, their standard errors and the mean square misfit of the levels in
    V^2."""

    tail: float
    values: Signal
    std: Signal
    misfit: float


@lru_cache(maxsize=4 * len(TAILS))
def _fit_shape(
    levels: tuple[DcLevel, ...], axis_deg: float, tail: float, largest: float, has_both_signs: bool
) -> _ShapeFit:
    """Kept: every look of a run sees the staircase of its first test again."""
    from scipy.optimize import least_squares

    voltage = np.array([level.voltage_v for level in levels])
    current = np.array([level.current_a for level in levels])
    start, scale, lower = _staircase_start(voltage, current, largest)
    top_v = peak(voltage)
    noise = 0.002 * top_v

    def misfit(p: Signal) -> Signal:
        true = current - (p[3] if has_both_signs else 0.0)
        shape = knee_shape(p[1], p[2], tail)
        wide = [0.3 * math.log(p[2] / (0.02 * largest)), p[3] / (0.03 * largest)]
        return np.concatenate([(voltage - p[0] * true - shape.on_axis(true, axis_deg)) / noise, wide])

    def jacobian(p: Signal) -> NDArray[np.float64]:
        """The unit loss is a function of current over knee."""
        true = current - (p[3] if has_both_signs else 0.0)
        shape = knee_shape(1.0, p[2], tail)
        unit, slope = shape.on_axis(true, axis_deg), _slope_on_axis(shape, true, axis_deg)
        rows = np.column_stack([-true, -unit, p[1] / p[2] * true * slope, has_both_signs * (p[0] + p[1] * slope)])
        return np.vstack([rows / noise, [0.0, 0.0, 0.3 / p[2], 0.0], [0.0, 0.0, 0.0, 1.0 / (0.03 * largest)]])

    for _ in range(2):
        fit = least_squares(misfit, start, jacobian, bounds=(lower, np.inf), x_scale=scale)
        start = fit.x
        residual = misfit(fit.x)[: voltage.size] * noise
        noise = max(math.sqrt(float(residual @ residual) / max(voltage.size - 4, 1)), 3e-5 * top_v)
    std = np.sqrt(np.diag(np.linalg.pinv(fit.jac.T @ fit.jac)))
    if not has_both_signs:
        fit.x[3] = 0.0
    return _ShapeFit(tail, fit.x, std, max(float(np.mean(residual**2)), (1e-5 * top_v) ** 2))


def _slope_on_axis(shape: InverterError, axis_current_a: Signal, axis_deg: float) -> Signal:
    """Derivative of `shape.on_axis` by the axis current."""
    knots, volts = np.array(shape.current_a), np.array(shape.voltage_v)
    per_a = np.append(np.diff(volts) / np.diff(knots), 0.0)
    slope = np.zeros_like(axis_current_a)
    for cosine in phase_cosines(axis_deg):
        cell = np.searchsorted(knots, np.abs(cosine * axis_current_a), side="right") - 1
        slope += 2.0 / 3.0 * cosine**2 * per_a[cell]
    return slope


def knee_shape(plateau_v: float, knee_a: float, tail: float) -> InverterError:
    """V x / (1 + x^n)^(1/n), x = current / knee, tabulated."""
    values = plateau_v * KNEE_POINTS / (1.0 + KNEE_POINTS**tail) ** (1.0 / tail)
    return InverterError(tuple((knee_a * KNEE_POINTS).tolist()), tuple(values.tolist()))


def _staircase_start(voltage: Signal, current: Signal, largest: float) -> tuple[Signal, Signal, Signal]:
    """(R_s, V, knee, offset): resistance and plateau from the straight line through the upper levels; scales, lower
    bounds."""
    upper = np.abs(current) > 0.4 * largest
    if upper.sum() < 2:
        upper = np.abs(current) > 0.1 * largest
    design = np.column_stack([current[upper], np.sign(current[upper])])
    (resistance, loss), *_ = np.linalg.lstsq(design, voltage[upper], rcond=None)
    top_v = peak(voltage)
    resistance = max(float(resistance), 0.05 * top_v / largest)
    start = np.array([resistance, max(0.75 * float(loss), 1e-3 * top_v), 0.02 * largest, 0.0])
    scale = np.array([resistance, top_v, 0.02 * largest, 0.01 * largest])
    lower = np.array([0.0, -np.inf, 1e-5 * largest, -np.inf])
    return start, scale, lower
