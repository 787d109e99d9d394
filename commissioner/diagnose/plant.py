"""The extended model in engineering terms: which numbers it has, and the currents and sensitivities it predicts.

A model is the four inverse-Gamma numbers plus `Term`s. Every term is zero in the nominal model and enters linearly
where physics puts it (legs, iron, leakage, rotor, sensor), so shapes are dictionaries: spline coefficients, stop
operators of fixed radius, rotor branches of fixed corner frequency.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from commissioner.diagnose import kinds
from commissioner.diagnose.kinds import CABLE, CLOCK, DELAY, DRIFT, EVEN, FIFTH, GAIN, LAG, ODD, OFFSET, TONE
from commissioner.diagnose.record import TO_PHASES, Record, Segment
from commissioner.diagnose.resample import resample, resample_hermite
from commissioner.diagnose.tangent import sensitivities
from commissioner.diagnose.trajectory import propagate, propagate_linear

Array = NDArray[np.float64]


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
    branch_time_s: Array
    nonlinearity_scale_a: float
    substeps: int = 1
    crossing_substeps: int = 12
    legs_slack_v: float = 1.0
    nominal_box: tuple[tuple[float, float], ...] = ((0.0, np.inf),) * 4
    """Where R_s, R_R, L_sigma and L_M may be, from the impedance the recording shows: no effect moves them beyond."""
    leak_ratio: float = 0.0
    """L_sigma / L_M, fixed: how far the rotor current is from the stator current in (3a) of `trajectory`."""

    def penalty(self, terms: Sequence[Term]) -> Array:
        """(4 + terms)^2 prior: a leg curve hardly rises at large current (that slope is R_s, which no terminal data

        tell apart): each rise beyond 0.15 of the range's end is about `legs_slack_v` or less.
        """
        size = 4 + len(terms)
        out = np.zeros((size, size))
        count = self.legs_vectors.shape[0]
        knots = (np.arange(count) + 0.5) * self.legs_top / count
        tail = np.sinh(self.legs_top) * 0.15
        for k, term in enumerate(terms):
            if term.kind in (kinds.LEGS, kinds.LEGS_LINK) and np.sinh(knots[term.index]) > tail:
                out[4 + k, 4 + k] = (term.step / self.legs_slack_v) ** 2
        return out

    def finer(self) -> Layout:
        """Half the step length, for the solver-error check."""
        return replace(self, substeps=2 * self.substeps, crossing_substeps=2 * self.crossing_substeps)


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

    def moved(self, theta: Array) -> Model:
        nominal = np.exp(theta[:4])
        values = tuple(float(x) * t.step for x, t in zip(theta[4:], self.terms, strict=True))
        return Model((float(nominal[0]), float(nominal[1]), float(nominal[2]), float(nominal[3])), self.terms, values)

    def with_terms(self, terms: Sequence[Term]) -> Model:
        return Model(self.nominal, self.terms + tuple(terms), self.values + tuple(t.start for t in terms))

    def without(self, effect: str) -> Model:
        keep = [k for k, t in enumerate(self.terms) if t.effect != effect]
        return Model(self.nominal, tuple(self.terms[k] for k in keep), tuple(self.values[k] for k in keep))

    def only(self, effects: Sequence[str]) -> Model:
        keep = [k for k, t in enumerate(self.terms) if t.effect in effects]
        return Model(self.nominal, tuple(self.terms[k] for k in keep), tuple(self.values[k] for k in keep))

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


@dataclass(frozen=True)
class Prediction:
    """Currents `(phases, n)`; `jacobian` (4 + terms, phases, n) in theta units; rotor current and iron flux (2, n)."""

    currents_a: Array
    jacobian: Array
    rotor_current_a: Array
    iron_flux_wb: Array
    slope_before: Array
    last_rotor_flux_wb: tuple[float, float]


def predict(
    model: Model, record: Record, position: int, layout: Layout, wanted: Sequence[Term] | None = None
) -> Prediction:
    """Segment `position` as the model sees it. `wanted` None: no jacobian; else derivatives for the four and `wanted`."""
    segment = record.segments[position]
    channels = record.channels[position] if record.channels else np.zeros((segment.count, 1))
    listed = [] if wanted is None else list(wanted)
    inside = [k for k, t in enumerate(listed) if t.kind < kinds.FIRST_OF_SENSING and t.segment in (-1, segment.uid)]
    at_work = np.array([*kinds.NOMINAL, *(listed[k].kind for k in inside)], dtype=np.int64)
    indices = np.array([0, 0, 0, 0, *(listed[k].index for k in inside)], dtype=np.int64)
    path = _trajectory(model, segment, channels, layout, at_work)
    jacobian = np.zeros((0, record.facts.phases, segment.count))
    if wanted is not None:
        jacobian = np.zeros((4 + len(listed), record.facts.phases, segment.count))
        scale = np.array([
            model.nominal[0], model.nominal[1], -1.0 / model.nominal[2], -1.0 / model.nominal[3],
            *(listed[k].step for k in inside),
        ])
        tangent = _tangent(path, segment, channels, layout, at_work, indices)
        _to_phases(tangent, scale, jacobian, [0, 1, 2, 3, *(4 + k for k in inside)])
    measured = _sense(model, record, segment, channels, layout, (path.current, path.after, path.before), jacobian, listed)
    nu = path.machine[0][4]
    iron = (1.0 - nu) * path.states[:-1, 2:4].T + nu * path.states[:-1, 0:2].T
    last = path.states[-1, 2:4]
    return Prediction(measured, jacobian, path.rotor_current, iron, path.before, (float(last[0]), float(last[1])))


def _to_phases(tangent: Array, scale: Array, jacobian: Array, rows: list[int]) -> None:
    for source, row in enumerate(rows):
        for phase in range(jacobian.shape[1]):
            np.multiply(tangent[0, source], scale[source] * TO_PHASES[phase, 0], out=jacobian[row, phase])
            if TO_PHASES[phase, 1] != 0.0:
                jacobian[row, phase] += scale[source] * TO_PHASES[phase, 1] * tangent[1, source]


@dataclass(frozen=True)
class _Path:
    """A trajectory and what it was driven by: `drive` known functions of time, `machine` constants and dictionaries."""

    states: Array
    stops: Array
    current: Array
    after: Array
    before: Array
    rotor_current: Array
    drive: tuple[Array, ...]
    machine: tuple[Any, ...]


def _trajectory(model: Model, segment: Segment, channels: Array, layout: Layout, at_work: Array) -> _Path:
    drive = _drive(model, segment, channels)
    every = set(at_work.tolist()) | {t.kind for t in model.terms}
    machine = _machine(model, layout, every)
    period = _period(segment)
    start = _initial_state(model, segment)
    voltage = segment.voltage_ab_v
    va, vb = np.ascontiguousarray(voltage[0]), np.ascontiguousarray(voltage[1])
    acting = {t.kind for t, v in zip(model.terms, model.values, strict=True) if v} | (every & {kinds.STOP, kinds.BRANCH})
    if all(k in (kinds.INITIAL_FLUX, kinds.CARRY) or k >= kinds.FIRST_OF_SENSING for k in acting):
        transition, gain, output, slope = _exact_step(model.nominal, period)
        states, current, after, before = propagate_linear(va, vb, transition, gain, output, slope, start)
        rotor = states[:-1, 2:4].T / model.nominal[3] - current
        return _Path(states, np.zeros((0, 0, 2)), current, after, before, rotor, (va, vb, *drive), machine)
    states, stops, current, after, before, rotor = propagate(
        va, vb, *drive, period, _substeps(model, layout, segment), layout.crossing_substeps, *machine, start
    )
    return _Path(states, stops, current, after, before, rotor, (va, vb, *drive), machine)


def _exact_step(nominal: tuple[float, float, float, float], period_s: float) -> tuple[Array, Array, Array, Array]:
    r_s, r_r, l_sigma, l_m = nominal
    output = np.array([1.0 / l_sigma, -1.0 / l_sigma])
    rate = np.array([[-r_s, r_s], [r_r, -r_r * (1.0 + l_sigma / l_m)]]) / l_sigma
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[0, 2] = rate, 1.0
    step = expm(whole * period_s)
    return step[:2, :2].copy(), step[:2, 2].copy(), output, np.array([*(output @ rate), output[0]])


def _tangent(
    path: _Path, segment: Segment, channels: Array, layout: Layout, at_work: Array, indices: Array
) -> Array:
    wanted = set(at_work.tolist())
    out = np.empty((2, at_work.shape[0], segment.count))
    sensitivities(
        path.states, path.stops, *path.drive, channels, _period(segment), *path.machine, at_work, indices,
        _if(bool(wanted & {kinds.LEGS, kinds.LEGS_LINK}), layout.legs_vectors),
        _if(kinds.IRON_CURVE in wanted, layout.iron_vectors), _if(kinds.LEAKAGE_CURVE in wanted, layout.leak_vectors),
        np.array(segment.flux_before_wb), out,
    )
    return out


def _period(segment: Segment) -> float:
    return float(np.median(np.diff(segment.time_s))) if segment.count > 1 else 1e-4


def _drive(model: Model, segment: Segment, channels: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Factors on voltage, link, phase resistances and rotor resistance, and the speed, at every sample."""
    n = segment.count
    voltage_factor, rotor_factor = np.ones(n), np.ones(n)
    omega, phase_factor = np.zeros(n), np.ones((n, 3))
    for term, value in zip(model.terms, model.values, strict=True):
        if term.segment not in (-1, segment.uid):
            continue
        if term.kind == kinds.VOLTAGE_MOD:
            voltage_factor += value * channels[:, term.index]
        elif term.kind == kinds.ROTOR_MOD:
            rotor_factor += value * channels[:, term.index]
        elif term.kind == kinds.OMEGA:
            omega += value * channels[:, term.index]
        elif term.kind == kinds.PHASE_RESISTANCE:
            phase_factor += value * channels[:, term.index : term.index + 3]
    return voltage_factor, segment.link_ratio, phase_factor, rotor_factor, omega


def _machine(model: Model, layout: Layout, every: set[int]) -> tuple[Any, ...]:
    aniso = [model.sum_kind(k, 2) for k in (
        kinds.ROTOR_ANISOTROPY, kinds.LEAKAGE_ANISOTROPY, kinds.MAGNETIZING_ANISOTROPY)]
    r_s, r_r, l_sigma, l_m = model.nominal
    nu = 0.5 + model.total(kinds.NU)
    kappa = 1.0 + (0.5 + model.total(kinds.LEAK_SPLIT)) * layout.leak_ratio
    # an inductance that differs between directions, leakage half on the rotor side, tilts R_R and the other one, too
    coupled = layout.leak_ratio / (1.0 + layout.leak_ratio)
    rotor, leakage, magnetizing = aniso
    base = np.array([
        r_s, r_r, 1.0 / l_sigma, 1.0 / l_m, nu, model.total(kinds.IRON_LOSS),
        *(rotor + coupled * (leakage - magnetizing)), *(leakage + 0.5 * coupled * magnetizing),
        *(magnetizing - 0.5 * coupled * leakage), kappa, layout.leak_ratio, coupled,
    ])
    stops = layout.stop_radius_wb if kinds.STOP in every else np.zeros(0)
    branches = layout.branch_time_s if kinds.BRANCH in every else np.zeros(0)
    legs_size = layout.legs_vectors.shape[0]
    return (
        base,
        model.sum_kind(kinds.LEGS, legs_size) @ layout.legs_vectors,
        model.sum_kind(kinds.LEGS_LINK, legs_size) @ layout.legs_vectors,
        model.sum_kind(kinds.IRON_CURVE, layout.iron_vectors.shape[0]) @ layout.iron_vectors,
        model.sum_kind(kinds.LEAKAGE_CURVE, layout.leak_vectors.shape[0]) @ layout.leak_vectors,
        layout.legs_top, layout.legs_knee_a, layout.iron_top_wb, layout.leak_top_wb,
        model.sum_kind(kinds.STOP, stops.size) if stops.size else np.zeros(0), stops,
        model.sum_kind(kinds.BRANCH, branches.size) if branches.size else np.zeros(0), branches,
    )


def _if(is_used: bool, vectors: Array) -> Array:
    return vectors if is_used else vectors[:0]


def _initial_state(model: Model, segment: Segment) -> Array:
    """(psi_s, psi_R) at the first sample: index 0, 1 sets both alike (a flux without current), 2-5 one component."""
    state = np.zeros(4)
    along, across = model.total(kinds.CARRY), model.total(kinds.CARRY, 1)
    alpha, beta = segment.flux_before_wb
    left = (along * alpha - across * beta, along * beta + across * alpha)
    state[:] = [*left, *left]
    for term, value in zip(model.terms, model.values, strict=True):
        if term.kind == kinds.INITIAL_FLUX and term.segment in (-1, segment.uid):
            if term.index < 2:
                state[term.index] += value
                state[2 + term.index] += value
            else:
                state[term.index - 2] += value
    return state


def _substeps(model: Model, layout: Layout, segment: Segment) -> int:
    """Enough Runge-Kutta steps that rate x step stays below 0.25 (local error 1e-5 of the fastest mode)."""
    r_s, r_r, l_sigma, l_m = model.nominal
    rate = (r_s + r_r) / l_sigma + r_r / l_m
    if model.has_kind(kinds.BRANCH):
        rate = max(rate, 0.5 / float(layout.branch_time_s.min()))
    if model.has_kind(kinds.LEAKAGE_CURVE):
        rate *= 1.3
    period = float(np.median(np.diff(segment.time_s))) if segment.count > 1 else 1e-4
    return int(layout.substeps * np.clip(np.ceil(rate * period / 0.25), 1, 40))


def _sense(
    model: Model, record: Record, segment: Segment, channels: Array, layout: Layout,
    trajectory: tuple[Array, Array, Array], jacobian: Array, listed: Sequence[Term],
) -> Array:
    """From terminal currents to what the sensors report: cable, delay, lag, nonlinearity, gain, offset, pickup."""
    phases = record.facts.phases
    to_phases = TO_PHASES[:phases]
    current, after, before = (to_phases @ x for x in trajectory)
    period = record.facts.sample_period_s
    capacitance = model.sum_kind(CABLE, 3)
    if capacitance.any() or any(t.kind == CABLE for t in listed):
        edges = _edges(to_phases @ segment.voltage_ab_v / period)
        current = current + sum(c * e for c, e in zip(capacitance, edges, strict=True))
    elapsed = segment.time_s - segment.time_s[0]
    late = model.total(DELAY) + model.total(CLOCK) * 1e-6 * elapsed
    late = np.broadcast_to(late, elapsed.shape)
    is_late = bool(np.any(late))
    filled = [k for k, t in enumerate(listed) if t.kind < kinds.FIRST_OF_SENSING and t.segment in (-1, segment.uid)]
    rows = [0, 1, 2, 3, *(4 + k for k in filled)] if jacobian.shape[0] else []
    if is_late:
        current, slope = resample_hermite(current, after, before, late / period, period)
        for row in rows:
            jacobian[row] = resample(jacobian[row], late / period)
    else:
        slope = before
    lag = model.total(LAG)
    lag_slope = slope
    if lag > 0.0:
        current, lag_slope = _lagged(current, slope, lag, period)
        slope = _lagged(slope, np.gradient(slope, period, axis=1), lag, period)[0]
        for row in rows:
            jacobian[row] = _low_pass(jacobian[row], lag, period)
    scale = layout.nonlinearity_scale_a
    gain, even = model.sum_kind(GAIN, 3)[:phases, None], model.sum_kind(EVEN, 3)[:phases, None]
    odd, fifth = model.sum_kind(ODD, 3)[:phases, None], model.sum_kind(FIFTH, 3)[:phases, None]
    s = current / scale
    distorted = current * (1.0 + gain + even * s + odd * s * s + fifth * s**4)
    if rows and (gain.any() or even.any() or odd.any() or fifth.any()):
        slope_of_sensor = 1.0 + gain + 2.0 * even * s + 3.0 * odd * s * s + 5.0 * fifth * s**4
        for row in rows:
            jacobian[row] *= slope_of_sensor
    reported = distorted + model.sum_kind(OFFSET, 3)[:phases, None]
    ages = _ages(record, segment)
    drift = model.sum_kind(DRIFT, 3 * len(ages)).reshape(len(ages), 3)[:, :phases]
    reported = reported + sum(d[:, None] * age for d, age in zip(drift, ages, strict=True))
    for term, value in zip(model.terms, model.values, strict=True):
        if term.kind == TONE and value and term.segment in (-1, segment.uid):
            reported[term.index % 3] += value * channels[:, term.index // 3]
    for k, term in enumerate(listed):
        row = jacobian[4 + k]
        if term.kind == DELAY:
            row[:] = -slope
        elif term.kind == LAG:
            row[:] = -lag_slope
        elif term.kind == CLOCK:
            row[:] = -slope * elapsed * 1e-6
        elif term.kind == OFFSET:
            row[term.index] = 1.0
        elif term.kind == DRIFT:
            row[term.index % 3] = ages[term.index // 3]
        elif term.kind == GAIN:
            row[term.index] = current[term.index]
        elif term.kind == EVEN:
            row[term.index] = current[term.index] * s[term.index]
        elif term.kind == ODD:
            row[term.index] = current[term.index] * s[term.index] ** 2
        elif term.kind == FIFTH:
            row[term.index] = current[term.index] * s[term.index] ** 4
        elif term.kind == TONE:
            row[term.index % 3] = channels[:, term.index // 3]
        elif term.kind == CABLE:
            row[:] = edges[term.index]
        if term.kind >= kinds.FIRST_OF_SENSING:
            row *= term.step
    return reported


def _ages(record: Record, segment: Segment) -> list[Array]:
    """Minutes since the first sample, and the same settling within a quarter and a sixteenth of the recording."""
    first, last = record.segments[0].time_s[0], record.segments[-1].time_s[-1]
    age = (segment.time_s - first) / 60.0
    settling = [max(float(last - first), 1e-3) / 60.0 / share for share in (4.0, 16.0)]
    return [age, *(tau * (1.0 - np.exp(-np.maximum(age, 0.0) / tau)) for tau in settling)]


def _edges(voltage_per_period: Array) -> list[Array]:
    """Step of the command at, before and after each sample, over the period."""
    edge = np.diff(voltage_per_period, axis=1, prepend=0.0)
    none = np.zeros((edge.shape[0], 1))
    return [edge, np.hstack([none, edge[:, :-1]]), np.hstack([edge[:, 1:], none])]


def _low_pass(signal: Array, lag_s: float, period_s: float) -> Array:
    """First-order lag of a signal linear between samples (first-order hold, exact for it)."""
    x = period_s / lag_s
    decay = np.exp(-x)
    late = 1.0 - (1.0 - decay) / x
    filtered: Array = lfilter([late, 1.0 - decay - late], [1.0, -decay], signal, axis=-1)
    return filtered


def _lagged(current: Array, slope: Array, lag_s: float, period_s: float) -> tuple[Array, Array]:
    """First-order lag and minus its derivative with respect to the lag (central difference of the same filter).

    Below a twentieth of a sample the lag is expanded: i - tau i' (its second-order term is then below 1e-3 of the
    first at the excited frequencies).
    """
    if lag_s < 0.05 * period_s:
        return current - lag_s * slope, slope
    h = 1e-3 * lag_s
    high, low = _low_pass_smooth(current, lag_s + h, period_s), _low_pass_smooth(current, lag_s - h, period_s)
    return _low_pass_smooth(current, lag_s, period_s), -(high - low) / (2.0 * h)


def _low_pass_smooth(signal: Array, lag_s: float, period_s: float) -> Array:
    return _low_pass(signal, lag_s, period_s)
