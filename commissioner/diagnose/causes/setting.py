"""What a cause may look at to set up its numbers, and how its curves and courses are read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from commissioner.diagnose.intake.record import Facts, Record
from commissioner.diagnose.plant.model import Layout

Array = NDArray[np.float64]
Numbers = Mapping[str, float]
Sizes = Mapping[str, tuple[float, str]]
"""Engineering values by name, each with its unit; the first one decides the sign."""
PHASES = ("u", "v", "w")


@dataclass(frozen=True)
class Setting:
    """What an effect may look at to set up its numbers: scales, dictionaries, known functions of time."""

    record: Record
    layout: Layout
    iron_flux_wb: float
    leakage_flux_wb: float
    """Largest fluxes of iron and leakage path that the fitted machine reaches."""
    nominal: tuple[float, float, float, float]
    """R_s, R_R, L_sigma and L_M of the fitted machine."""
    lines_hz: Mapping[str, float]

    @property
    def facts(self) -> Facts:
        return self.record.facts

    @property
    def axes(self) -> int:
        """Directions of the plane that were excited (0 and 180 degrees are one)."""
        return len({round(s.axis_deg % 180.0, 3) for s in self.record.segments})

    @property
    def spans_segments(self) -> bool:
        """Whether some segment is recorded after another, by the time stamps of one file."""
        return any(s.age_s > 0.0 for s in self.record.segments)

    @property
    def link_varies(self) -> bool:
        ratios = [float(np.mean(s.link_ratio)) for s in self.record.segments]
        return max(ratios) > 1.05 * min(ratios)


def spline_value(vectors: Array, coefficients: Array, top: float, at: float) -> float:
    """The curve `coefficients @ vectors` of a uniform cubic B-spline on [0, top], at one point (clamped)."""
    spline = coefficients @ vectors
    intervals = spline.shape[0] - 3
    y = min(max(at, 0.0), top)
    j = min(int(y / top * intervals), intervals - 1)
    u = y / top * intervals - j
    weights = np.array([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]) / 6.0
    return float(weights @ spline[j : j + 4])


def listed(values: Mapping[str, float], prefix: str, count: int) -> Array:
    """`prefix_0 ... prefix_{count-1}` as an array, zero where absent."""
    return np.array([values.get(f"{prefix}_{k}", 0.0) for k in range(count)])


def nearest_course(
    course: Array, of: Callable[[float], Array], tried: Array, weight: float | Array = 1.0
) -> tuple[float, float]:
    """Size >= 0 and number x of the one course `of(x)` that comes nearest to `course` but for a constant; x from those `tried`

    (ascending) and between them.
    """

    def misfit(x: float) -> float:
        return float(np.linalg.norm(as_much_of(of(x), course, weight)[1]))

    at = int(np.argmin([misfit(float(x)) for x in tried]))
    ends = float(tried[max(at - 1, 0)]), float(tried[min(at + 1, tried.size - 1)])
    best = float(
        minimize_scalar(misfit, bounds=ends, method="bounded", options={"xatol": 1e-6 * (ends[1] - ends[0])}).x
    )
    return as_much_of(of(best), course, weight)[0], best


def as_much_of(one: Array, course: Array, weight: float | Array = 1.0) -> tuple[float, Array]:
    """How much >= 0 of `one` comes nearest to `course` but for a constant, and what is left of it, times the weight."""
    constant = np.broadcast_to(np.asarray(weight, dtype=np.float64), course.shape)
    power = max(float(constant @ constant), 1e-300)
    one, course = (constant * x - constant * (float(constant @ (constant * x)) / power) for x in (one, course))
    size = max(float(one @ course) / max(float(one @ one), 1e-300), 0.0)
    return size, course - size * one
