"""Currents and sensitivities the extended model predicts for a segment: trajectory, tangent, then the sensors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from commissioner.diagnose.intake.record import TO_PHASES, Record, Segment
from commissioner.diagnose.kernels import kinds
from commissioner.diagnose.kernels.spline import cells_of
from commissioner.diagnose.kernels.structures import Asked, Drive, Machine
from commissioner.diagnose.kernels.tangent import sensitivities
from commissioner.diagnose.kernels.trajectory import (
    propagate,
    propagate_linear,
    propagate_varying,
    rates_of_unit_states,
)
from commissioner.diagnose.plant.initial_state import initial_state, slopes_of_start
from commissioner.diagnose.plant.model import Layout, Model, Term
from commissioner.diagnose.plant.terminals import sense
from commissioner.estimation.cancelling import ask_for_time

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """Currents `(phases, n)`; `jacobian` (4 + terms, phases, n) in theta units; rotor current and fluxes (2, n)."""

    currents_a: Array
    jacobian: Array
    rotor_current_a: Array
    iron_flux_wb: Array
    leakage_flux_wb: Array
    last_rotor_flux_wb: tuple[float, float]


def predict(
    model: Model,
    record: Record,
    position: int,
    layout: Layout,
    wanted: Sequence[Term] | None = None,
    path: Path | None = None,
) -> Prediction:
    """Segment `position` as the model sees it. `wanted` None: no jacobian; else derivatives for the four and `wanted`.

    `path` is the trajectory where it is known already.
    """
    segment = record.segments[position]
    channels = _channels(record, position)
    listed = [] if wanted is None else list(wanted)
    inside = _inside(listed, segment)
    asked = [listed[k] for k in inside]
    path = path or trajectory(model, record, position, layout, listed)
    jacobian = np.zeros((0, record.facts.phases, segment.count))
    if wanted is not None:
        jacobian = np.zeros((4 + len(listed), record.facts.phases, segment.count))
        scale = np.array(
            [
                model.nominal[0],
                model.nominal[1],
                -1.0 / model.nominal[2],
                -1.0 / model.nominal[3],
                *(t.step for t in asked),
            ]
        )
        _to_phases(
            _tangent(path, model, segment, channels, layout, asked),
            scale,
            jacobian,
            [0, 1, 2, 3, *(4 + k for k in inside)],
        )
    held_v = segment.voltage_ab_v * path.drive.voltage_factor
    terminal = (path.current, path.after, path.before)
    measured = sense(model, record, segment, channels, layout, terminal, held_v, jacobian, listed)
    nu = path.machine.base[4]
    iron = (1.0 - nu) * path.states[:-1, 2:4].T + nu * path.states[:-1, 0:2].T
    leakage = (path.states[:-1, 0:2] - path.machine.base[12] * path.states[:-1, 2:4]).T
    last = path.states[-1, 2:4]
    return Prediction(measured, jacobian, path.rotor_current, iron, leakage, (float(last[0]), float(last[1])))


def _to_phases(tangent: Array, scale: Array, jacobian: Array, rows: list[int]) -> None:
    for source, row in enumerate(rows):
        for phase in range(jacobian.shape[1]):
            np.multiply(tangent[0, source], scale[source] * TO_PHASES[phase, 0], out=jacobian[row, phase])
            if TO_PHASES[phase, 1] != 0.0:
                jacobian[row, phase] += scale[source] * TO_PHASES[phase, 1] * tangent[1, source]


@dataclass(frozen=True)
class Path:
    """A trajectory and what it was driven by."""

    states: Array
    stops: Array
    current: Array
    after: Array
    before: Array
    rotor_current: Array
    drive: Drive
    machine: Machine
    at_work: Mapping[int, list[int]]
    """Memory operators and branches, by kind, that have a size or were asked for: all that a derivative along this path may be by."""


def _channels(record: Record, position: int) -> Array:
    return record.channels[position] if record.channels else np.zeros((record.segments[position].count, 1))


def _inside(listed: Sequence[Term], segment: Segment) -> list[int]:
    """Which of the terms act on the motor's side of the terminals, in this segment."""
    return [k for k, t in enumerate(listed) if t.kind < kinds.FIRST_OF_SENSING and t.segment in (-1, segment.uid)]


def trajectory(model: Model, record: Record, position: int, layout: Layout, wanted: Sequence[Term]) -> Path:
    """The motor's path through segment `position`, integrated finely enough for derivatives for `wanted`. TimeOver: given up."""
    ask_for_time()
    segment, channels = record.segments[position], _channels(record, position)
    asked = [wanted[k] for k in _inside(wanted, segment)]
    voltage = segment.voltage_ab_v
    va, vb = np.ascontiguousarray(voltage[0]), np.ascontiguousarray(voltage[1])
    drive = Drive(va, vb, *modulation(model, segment, channels))
    at_work = {kind: _at_work(kind, model, asked) for kind in (kinds.STOP, kinds.BRANCH)}
    machine = _machine(model, layout, asked, at_work)
    period = segment.period_s
    start, memory = initial_state(model, segment, machine)
    acting = {t.kind for t, v in zip(model.terms, model.values, strict=True) if v}
    acting |= {t.kind for t in asked} & {kinds.STOP, kinds.BRANCH}
    if all(k in (kinds.INITIAL_FLUX, kinds.CARRY) or k >= kinds.FIRST_OF_SENSING for k in acting):
        transition, gain, output, slope = exact_step(model.nominal, period)
        course = propagate_linear(va, vb, transition, gain, output, slope, start)
        rotor = course.states[:-1, 2:4].T / model.nominal[3] - course.current
        return Path(*course._replace(rotor_current=rotor), drive, machine, at_work)
    if not acting & kinds.NONLINEAR:
        rate = _fastest(model, machine.branch_gain, machine.branch_time) * period
        steps = max(int(np.ceil(rate)), 1) * layout.substeps
        whole = _whole_step(drive, period, machine)
        course = propagate_varying(drive, period, steps, _taylor_order(rate / steps), whole, machine, start)
        return Path(*course, drive, machine, at_work)
    steps = _substeps(model, layout, segment, asked)
    course = propagate(drive, period, steps, layout.crossing_substeps, machine, start, memory)
    return Path(*course, drive, machine, at_work)


def exact_step(nominal: tuple[float, float, float, float], period_s: float) -> tuple[Array, Array, Array, Array]:
    """Of the four-parameter machine, per axis, states (stator, rotor flux): (2, 2) transition over one period, (2,) gain of
    the held voltage, (2,) current of the states, (3,) slope of the current by states and voltage.
    """
    r_s, r_r, l_sigma, l_m = nominal
    output = np.array([1.0 / l_sigma, -1.0 / l_sigma])
    rate = np.array([[-r_s, r_s], [r_r, -r_r * (1.0 + l_sigma / l_m)]]) / l_sigma
    whole = np.zeros((3, 3))
    whole[:2, :2], whole[0, 2] = rate, 1.0
    step = expm(whole * period_s)
    return step[:2, :2].copy(), step[:2, 2].copy(), output, np.array([*(output @ rate), output[0]])


def _tangent(
    path: Path, model: Model, segment: Segment, channels: Array, layout: Layout, asked: Sequence[Term]
) -> Array:
    wanted = {t.kind for t in asked}
    place = path.at_work
    at_work = np.array([*kinds.NOMINAL, *(t.kind for t in asked)], dtype=np.int64)
    indices = np.array(
        [0, 0, 0, 0, *(place[t.kind].index(t.index) if t.kind in place else t.index for t in asked)], dtype=np.int64
    )
    out = np.empty((2, at_work.shape[0], segment.count))
    derivatives = Asked(
        at_work,
        indices,
        _if(bool(wanted & {kinds.LEGS, kinds.LEGS_LINK, kinds.LEG_SHARE}), layout.legs_vectors),
        cells_of(_if(kinds.IRON_CURVE in wanted, layout.iron_vectors)),
        cells_of(_if(kinds.LEAKAGE_CURVE in wanted, layout.leak_vectors)),
        slopes_of_start(model, segment, path.machine, layout, asked),
    )
    sensitivities((path.states, path.stops), path.drive, channels, segment.period_s, path.machine, derivatives, out)
    return out


def modulation(model: Model, segment: Segment, channels: Array) -> tuple[Array, Array, Array, Array, Array]:
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


def _at_work(kind: int, model: Model, asked: Sequence[Term]) -> list[int]:
    """Which of a dictionary's operators have a size or are asked for."""
    acting = {t.index for t, v in zip(model.terms, model.values, strict=True) if t.kind == kind and v}
    return sorted(acting | {t.index for t in asked if t.kind == kind})


def _machine(model: Model, layout: Layout, asked: Sequence[Term], at_work: Mapping[int, list[int]]) -> Machine:
    aniso = [
        model.sum_kind(k, 2) for k in (kinds.ROTOR_ANISOTROPY, kinds.LEAKAGE_ANISOTROPY, kinds.MAGNETIZING_ANISOTROPY)
    ]
    r_s, r_r, l_sigma, l_m = model.nominal
    nu = float(np.clip(0.5 + model.total(kinds.NU), 0.0, 1.0))
    kappa = 1.0 + (0.5 + model.total(kinds.LEAK_SPLIT)) * layout.leak_ratio
    # where L_sigma and L_M tilt differently, the turns ratio of the inverse-Gamma circuit does, and R_R by its square
    per_share = 2.0 * layout.leak_ratio / (1.0 + layout.leak_ratio)
    rotor, leakage, magnetizing = aniso
    coupled = per_share * (0.5 + model.total(kinds.ANISOTROPY_SPLIT))
    shares = model.sum_kind(kinds.LEG_SHARE, 3)[1:]
    base = np.array(
        [
            r_s,
            r_r,
            1.0 / l_sigma,
            1.0 / l_m,
            nu,
            model.total(kinds.IRON_LOSS),
            *(rotor + coupled * (leakage - magnetizing)),
            *leakage,
            *magnetizing,
            kappa,
            layout.leak_ratio,
            coupled,
            *(per_share * (leakage - magnetizing)),
            1.0 - shares.sum(),
            *(1.0 + shares),
        ]
    )
    stops, branches = at_work[kinds.STOP], at_work[kinds.BRANCH]
    wanted = {t.kind for t in asked}

    def shape(kind: int, vectors: Array) -> Array:
        weights = model.sum_kind(kind, vectors.shape[0]) @ vectors
        return cells_of(weights if weights.any() or kind in wanted else weights[:3])

    return Machine(
        base,
        shape(kinds.LEGS, layout.legs_vectors),
        shape(kinds.LEGS_LINK, layout.legs_vectors),
        shape(kinds.IRON_CURVE, layout.iron_vectors),
        shape(kinds.LEAKAGE_CURVE, layout.leak_vectors),
        layout.legs_top,
        layout.legs_knee_a,
        layout.iron_top_wb,
        layout.leak_top_wb,
        model.sum_kind(kinds.STOP, layout.stop_radius_wb.shape[0])[stops],
        layout.stop_radius_wb[stops],
        model.sum_kind(kinds.BRANCH, layout.branch_time_s.size)[branches],
        layout.branch_time_s[branches],
    )


def _if(is_used: bool, vectors: Array) -> Array:
    return vectors if is_used else vectors[:0]


def _fastest(model: Model, branch_gain: Array, branch_time: Array) -> float:
    """Rate of the fastest mode, 1/s (an upper bound)."""
    r_s, r_r, l_sigma, l_m = model.nominal
    rate = (r_s + r_r) / l_sigma + r_r / l_m
    return max(rate, *((1.0 + max(r_r, r_s) * branch_gain) / np.abs(branch_time))) if branch_time.size else rate


def _whole_step(drive: Drive, period_s: float, machine: Machine) -> Array:
    """The exact step of a linear machine in which nothing varies, (size, size + 2) of states and held voltage; empty where
    something does. Strong paths beside a cage of hardly any conductance are a hundred times faster than the sampling.
    """
    phase_factor, rotor_factor, omega = drive.phase_factor, drive.rotor_factor, drive.omega
    if np.ptp(phase_factor, axis=0).any() or np.ptp(rotor_factor) or np.ptp(omega):
        return np.zeros((0, 0))
    rates = rates_of_unit_states(phase_factor[0], float(rotor_factor[0]), float(omega[0]), machine)
    size = rates.shape[0]
    step = expm(np.vstack([rates, np.zeros((2, size + 2))]) * period_s)
    return np.ascontiguousarray(step[:size]) if np.isfinite(step).all() else np.zeros((0, 0))


def _taylor_order(rate_times_step: float) -> int:
    """Terms after which the series of the fastest mode is within 1e-7."""
    term, order = rate_times_step, 1
    while term > 1e-7 or order < 4:
        order += 1
        term *= rate_times_step / order
    return order


def _substeps(model: Model, layout: Layout, segment: Segment, asked: Sequence[Term]) -> int:
    """Enough Runge-Kutta steps that rate x step stays below 0.25 (local error 1e-5 of the fastest mode); below 2.5, which is stable,
    for a second path that is asked for and has no size yet, and for what strong ones make of one another.
    """
    r_s, r_r, l_sigma, l_m = model.nominal
    rate = (r_s + r_r) / l_sigma + r_r / l_m
    for terms, share in (((), 0.5), (asked, 0.1)):
        times = np.abs(layout.branch_time_s[_at_work(kinds.BRANCH, model, terms)])
        rate = max(rate, share / float(times.min(initial=np.inf)))
    acting = _at_work(kinds.BRANCH, model, ())
    gains = model.sum_kind(kinds.BRANCH, layout.branch_time_s.size)[acting]
    rate = max(rate, 0.1 * _fastest(model, gains, layout.branch_time_s[acting]))
    if model.has_kind(kinds.LEAKAGE_CURVE):
        rate *= 1.3
    return int(layout.substeps * np.clip(np.ceil(rate * segment.period_s / 0.25), 1, 40))
