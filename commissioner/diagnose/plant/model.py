"""The extended model in engineering terms: which numbers it has and what each of them is.

A model is the four inverse-Gamma numbers plus `Term`s. Every term is zero in the nominal model and enters linearly
where physics puts it (legs, iron, leakage, rotor, sensor), so shapes are dictionaries: spline coefficients, stop
operators of fixed radius, rotor branches of fixed corner frequency.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.kernels import kinds

Array = NDArray[np.float64]
KINDS = frozenset(v for k, v in vars(kinds).items() if k.isupper() and isinstance(v, int))
"""Of numbers that a model may have."""


@dataclass(frozen=True)
class Term:
    """One number of the extended model: `value = theta * step`, in `unit`, zero in the nominal model."""

    effect: str
    symbol: str
    unit: str
    kind: int
    index: int
    step: float
    lower: float = -np.inf
    upper: float = np.inf
    start: float = 0.0
    segment: int = -1
    """Position of the only segment it acts in; -1: everywhere."""
    channel: str = ""
    """Known function of time that it multiplies, to which `index` points in one record: in another it may lie elsewhere."""
    is_beside_rotor: bool = False
    """A path beside R_R: at rest it is a part of it."""


LEG_TAIL = 0.15
"""Of the range of currents on which a leg's loss may bend: beyond, it hardly rises."""


@dataclass(frozen=True)
class Layout:
    """The fixed dictionaries: spline ranges and vectors, stop radii, branch corner frequencies."""

    legs_top: float
    legs_knee_a: float
    legs_vectors: Array
    iron_top_wb: float
    iron_vectors: Array
    leak_top_wb: float
    leak_vectors: Array
    stop_radius_wb: Array
    """(k, 2): radius (negative: scale of an exponential operator) and rate per Wb^2 at which its loop widens (0: not)."""
    branch_time_s: Array
    nonlinearity_scale_a: float
    substeps: int = 1
    crossing_substeps: int = 12
    legs_slack_v: float = 1.0
    nominal_box: tuple[tuple[float, float], ...] = ((0.0, np.inf),) * 4
    """Where R_s, R_R, L_sigma and L_M may be, from the impedance the recording shows: no effect moves them beyond."""
    leak_ratio: float = 0.0
    """L_sigma / L_M, fixed: how far the rotor current is from the stator current in (3a) of `trajectory`."""
    channel_ends_a: Array = field(default_factory=lambda: np.ones(3))
    """Largest current that each channel reported: where its end, if it has one, is near."""

    def penalty(self, terms: Sequence[Term]) -> Array:
        """(4 + terms)^2 prior: a leg curve hardly rises at large current (that slope is R_s, which no terminal data
        tell apart): each rise in the tail is about `legs_slack_v` or less.
        """
        size = 4 + len(terms)
        out = np.zeros((size, size))
        count = self.legs_vectors.shape[0]
        knots = (np.arange(count) + 0.5) * self.legs_top / count
        tail = LEG_TAIL * np.sinh(self.legs_top)
        for k, term in enumerate(terms):
            if term.kind in (kinds.LEGS, kinds.LEGS_LINK) and np.sinh(knots[term.index]) > tail:
                out[4 + k, 4 + k] = (term.step / self.legs_slack_v) ** 2
        return out


def odd_vectors(intervals: int) -> Array:
    """Rises of odd saturating functions, (intervals, intervals+3): row k climbs from 0 to 1 around knot k and stays.

    Cumulative sums of the spline vectors with F(0) = F''(0) = 0 and a flat end, so that weights >= 0 give a curve that
    never falls: a leg with falling voltage loss would be an oscillator.
    """
    vectors = np.zeros((intervals, intervals + 3))
    vectors[0, 2], vectors[0, 0] = 1.0, -1.0
    for k in range(1, intervals):
        vectors[k, k + 2] = 1.0
    # flat end: c[K+2] = c[K]
    vectors[:, intervals + 2] = vectors[:, intervals]
    return np.cumsum(vectors[::-1], axis=0)[::-1].copy()


def even_vectors(intervals: int) -> Array:
    """Rises of even functions with G(0) = G'(0) = 0, (intervals+1, intervals+3): row k climbs from knot k on.

    Weights >= 0 give a slope that never falls with size, as saturation does.
    """
    vectors = np.zeros((intervals + 1, intervals + 3))
    vectors[0, 0], vectors[0, 1], vectors[0, 2] = 1.0, -0.5, 1.0
    for k in range(1, intervals + 1):
        vectors[k, k + 2] = 1.0
    return np.cumsum(vectors[::-1], axis=0)[::-1].copy()


def with_halved_intervals(vectors: Array, weights: Array, finer: Array) -> Array:
    """The weights in a dictionary of twice the intervals that make the same cubic spline (knot insertion: E. Cohen, T. Lyche,
    R. Riesenfeld, Comput. Graph. Image Process. 14, 1980).
    """
    c = weights @ vectors
    halved = np.empty(2 * c.size - 3)
    halved[1::2] = (c[:-2] + 6.0 * c[1:-1] + c[2:]) / 8.0
    halved[::2] = 0.5 * (c[:-1] + c[1:])
    return np.asarray(np.linalg.lstsq(finer.T, halved, rcond=None)[0])


def impedance(nominal: tuple[float, float, float, float], hertz: Array) -> NDArray[np.complex128]:
    """Of the four-parameter machine at rest, ohm, seen from its terminals along one axis."""
    r_s, r_r, l_sigma, l_m = nominal
    s = 2j * np.pi * hertz
    return np.asarray(r_s + s * l_sigma + s * l_m * r_r / (r_r + s * l_m), dtype=np.complex128)


MOST_TAKEN = 0.9
"""Of the conductance of R_R in one step."""

NO_DICTIONARY = Layout(
    1.0, 1.0, odd_vectors(4), 1.0, even_vectors(2), 1.0, even_vectors(2), np.array([[1.0, 0.0]]), np.array([1.0]), 1.0
)
"""For a model without terms, which looks nothing up."""


@dataclass(frozen=True)
class Model:
    """`nominal` = (R_s, R_R, L_sigma, L_M); `values[k]` belongs to `terms[k]`, in the term's unit."""

    nominal: tuple[float, float, float, float]
    terms: tuple[Term, ...] = ()
    values: tuple[float, ...] = ()

    @cached_property
    def theta(self) -> Array:
        """Scaled parameters: logarithms of the four, then value / step."""
        scaled = [v / t.step for v, t in zip(self.values, self.terms, strict=True)]
        return np.array([*np.log(self.nominal), *scaled])

    @cached_property
    def is_free(self) -> NDArray[np.bool_]:
        """(4 + terms,) numbers that can move both ways: one that rests on its bound imitates nothing beyond it."""
        rests = [
            min(abs(v - t.lower), abs(v - t.upper)) < 1e-9 * t.step
            for t, v in zip(self.terms, self.values, strict=True)
        ]
        return np.array([True] * 4 + [not r for r in rests])

    def moved(self, theta: Array) -> Model:
        """The model at `theta`. Beside rotor branches R_R moves by its conductance: a step that gives the branches what it takes
        from R_R leaves the resistance at rest as it is, however long.
        """
        r_s, r_r, l_sigma, l_m = (float(x) for x in np.exp(theta[:4]))
        if any(t.kind == kinds.BRANCH for t in self.terms):
            r_r = self.nominal[1] / (1.0 - min(theta[1] - self.theta[1], MOST_TAKEN))
        values = tuple(float(x) * t.step for x, t in zip(theta[4:], self.terms, strict=True))
        return Model((r_s, r_r, l_sigma, l_m), self.terms, values)

    def at_rest(self, layout: Layout) -> tuple[Array, Array]:
        """The four numbers of slow currents, (4,), which fill the bars, and their derivatives by `theta`, (4, 4 + terms).

        The bars' branches g / (1 + s T) lie beside R_R: their conductance counts in full, and X = R^2 g T lies in series with it, behind
        L_M. The inverse-Gamma circuit of the same terminals has k = L_M / (L_M + X): k^2 R, L_sigma + k X, k L_M.
        """
        times_s = layout.branch_time_s
        rows = [4 + k for k, t in enumerate(self.terms) if t.kind == kinds.BRANCH and times_s[t.index] > 0.0]
        branches = np.array([self.values[k - 4] for k in rows])
        times = times_s[[self.terms[k - 4].index for k in rows]]
        steps = np.array([self.terms[k - 4].step for k in rows])
        own = 1.0 / self.nominal[1]
        low = 1.0 / (own + branches.sum())
        delayed = float(branches @ times)
        derivatives = np.zeros((4, 4 + len(self.terms)))
        derivatives[[0, 1, 2, 3], [0, 1, 2, 3]] = self.nominal
        derivatives[1, 1], derivatives[1, rows] = low**2 * own, -(low**2) * steps
        behind, l_m = low**2 * delayed, self.nominal[3]
        of_behind = 2.0 * low * delayed * derivatives[1]
        of_behind[rows] += low**2 * times * steps
        k = l_m / (l_m + behind)
        of_k = (behind * derivatives[3] - l_m * of_behind) / (l_m + behind) ** 2
        derivatives[1] = 2.0 * k * low * of_k + k**2 * derivatives[1]
        derivatives[2] += behind * of_k + k * of_behind
        derivatives[3] = l_m * of_k + k * derivatives[3]
        return np.array([self.nominal[0], k**2 * low, self.nominal[2] + k * behind, k * l_m]), derivatives

    def with_terms(self, terms: Sequence[Term]) -> Model:
        return Model(self.nominal, self.terms + tuple(terms), self.values + tuple(t.start for t in terms))

    def without(self, effect: str) -> Model:
        """The model without an effect; R_R gets back what rotor branches had of its conductance."""
        r_s, r_r, l_sigma, l_m = self.nominal
        if beside := [
            v for t, v in zip(self.terms, self.values, strict=True) if t.effect == effect and t.is_beside_rotor
        ]:
            r_r = 1.0 / (1.0 / r_r + sum(beside))
        return replace(self._where(lambda t: t.effect != effect), nominal=(r_s, r_r, l_sigma, l_m))

    def only(self, effects: Sequence[str]) -> Model:
        return self._where(lambda t: t.effect in effects)

    def without_kind(self, kind: int) -> Model:
        return self._where(lambda t: t.kind != kind)

    def on_channels(self, names: Sequence[str]) -> Model:
        """The model with its numbers pointing into a record with these channels; those whose channel is not there are left out."""
        there = self._where(lambda t: not t.channel or t.channel in names)
        return replace(there, terms=tuple(replace(t, index=_place(t, names)) if t.channel else t for t in there.terms))

    def _where(self, is_kept: Callable[[Term], bool]) -> Model:
        """The model with those of its numbers only."""
        kept = [k for k, t in enumerate(self.terms) if is_kept(t)]
        return Model(self.nominal, tuple(self.terms[k] for k in kept), tuple(self.values[k] for k in kept))

    def of(self, effect: str) -> dict[str, float]:
        return {t.symbol: v for t, v in zip(self.terms, self.values, strict=True) if t.effect == effect}

    def total(self, kind: int, index: int = 0) -> float:
        pairs = zip(self.terms, self.values, strict=True)
        return sum(v for t, v in pairs if t.kind == kind and t.index == index)

    def sum_kind(self, kind: int, size: int) -> Array:
        out = np.zeros(size)
        for term, value in zip(self.terms, self.values, strict=True):
            if term.kind == kind:
                out[term.index] += value
        return out

    def has_kind(self, *kinds: int) -> bool:
        return any(t.kind in kinds for t in self.terms)


def _place(term: Term, names: Sequence[str]) -> int:
    """Where its channel is; what a sensor picks up counts through the three phases as well."""
    at = names.index(term.channel)
    return 3 * at + term.index % 3 if term.kind == kinds.TONE else at
