"""What every entry of the catalogue states: its numbers, how they read, its sign, and what it is mistaken for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from commissioner.diagnose.intake.record import Facts, Record
from commissioner.diagnose.plant.model import Layout, Term

Array = NDArray[np.float64]
Sizes = Mapping[str, tuple[float, str]]
"""Engineering values by name, each with its unit; the first one decides the sign."""
PLACES = frozenset({"limit_a", "at_flux_wb", "at_current_a"})
"""Values that say where an effect acts and not how much."""


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


@dataclass(frozen=True)
class Effect:
    """One named cause. `terms(setting)` are its numbers (empty: these data cannot show it)."""

    name: str
    title: str
    sign: int
    terms: Callable[[Setting], tuple[Term, ...]]
    sizes: Callable[[Setting, Mapping[str, float]], Sizes]
    signature: str
    confounders: tuple[str, ...]
    source: str
    family: str
    split_by: str
    course: str = ""
    """What the names of numbers begin with that together are one free function of time: all one, it is one."""
    either: tuple[tuple[str, ...], ...] = ()
    """Sets of its numbers' names of which but one is at work."""
    exchanged: tuple[Term, ...] = ()
    """Numbers that are never sought alone: they come in exchange for others only."""

    def forms(self, terms: Sequence[Term]) -> tuple[tuple[Term, ...], ...]:
        """The sets of these numbers that may be at work together."""
        if not self.either:
            return (tuple(terms),)
        sets = (tuple(t for t in terms if t.symbol in names) for names in self.either)
        return tuple(s for s in sets if s)

    def form_of(self, symbols: Collection[str], terms: Sequence[Term]) -> tuple[Term, ...]:
        """Of the sets of these numbers the one that has most of these names, and what was exchanged."""
        best = max(self.forms(terms), key=lambda form: sum(t.symbol in symbols for t in form), default=())
        return (*best, *self.exchanged_in(symbols))

    def other_forms(self, symbols: Collection[str], terms: Sequence[Term]) -> tuple[tuple[Term, ...], ...]:
        """Of the sets of these numbers those that are not the one that has these names."""
        mine = {*self.form_of(symbols, terms)}
        return tuple(form for form in self.forms(terms) if {*form, *self.exchanged_in(symbols)} != mine)

    def exchanged_in(self, symbols: Collection[str]) -> tuple[Term, ...]:
        return tuple(t for t in self.exchanged if t.symbol in symbols)


def effect(
    name: str,
    title: str,
    *,
    sign: int,
    signature: str,
    confounders: tuple[str, ...],
    source: str,
    family: str,
    split_by: str,
    sizes: Callable[[Setting, Mapping[str, float]], Sizes],
    course: str = "",
    either: tuple[tuple[str, ...], ...] = (),
    exchanged: tuple[Term, ...] = (),
) -> Callable[[Callable[[Setting], tuple[Term, ...]]], Effect]:
    """Turns the function that lists an effect's terms into its catalogue entry."""

    def enter(terms: Callable[[Setting], tuple[Term, ...]]) -> Effect:
        entry = Effect(
            name, title, sign, terms, sizes, signature, confounders, source, family, split_by, course, either, exchanged
        )
        object.__setattr__(entry, "__doc__", terms.__doc__)
        return entry

    return enter


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
