"""Four parameters and the inertia from recordings of a running motor: a direct start, load steps, several steady loads.

With a speed column the electrical fit uses it, and inertia and load of the start follow from torque against speed. Without one
the shaft is part of the fit (constant and fan load, from rest), up to the first load step.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from commissioner.errors import DataRefused
from commissioner.estimation.fit import (
    INERTIA,
    Column,
    Fit,
    Machine,
    Problem,
    jacobian,
    made_of,
    problem_of,
    refine,
    scattered,
    simulate,
)
from commissioner.estimation.held import best_reading
from commissioner.estimation.hidden import at_small_slip, by_laws, drawn_aside, told_in, with_told
from commissioner.estimation.kernels.march import SLOW2, SLOWEST2
from commissioner.estimation.noisy_input import unbiased, with_noise_of
from commissioner.estimation.numbers import AT, FOUR
from commissioner.estimation.record import STATES, Record, prepare, scales_of
from commissioner.estimation.window import first_part
from commissioner.identify.contract import Measured, RunningDocument
from commissioner.motor.channels.faults import currents_on_time
from commissioner.motor.circuit import PARAMETERS, InverseGamma, Quantity, TModel, to_t_model
from commissioner.motor.nameplate import Nameplate
from commissioner.records import RunningRecording
from commissioner.running.at_flux import OF_IRON, at_flux, is_saturated, stator_flux_wb
from commissioner.running.nominal import OPEN_INERTIA, require_a_motor, with_shaft, with_speed
from commissioner.running.residual.lack import Lack, lack_of_fit, not_told

Array = NDArray[np.float64]
SPEED_STEP_S = 4e-3
"""Between speeds that count as independent: the span over which they were smoothed."""
AFTER_START_S = 0.15
SPEED_LAG = Column("p", AT["speed_lag"])
"""Every column of speed may be late: a counting interval, a filter."""
PARTS = 10
"""Of the run-up: left out one by one they show how far the inertia depends on each (jackknife: what is left is no white noise)."""
MOST_LEFT_OF_SPEED, MOST_STD_OF_INERTIA = 0.002, 0.25
"""Of synchronous speed, rms over the parts, what friction, linear and fan load may leave of a run-up; of the inertia. Beyond, it is not given."""
OF_ASSUMED_INERTIA = 3.0
"""Standard deviation of the assumed inertia over the true one, less 1, where neither a start nor the plate tells it: 4 of a bare shaft."""
LEAST_LAG_S, SURE = 3e-4, 5.0
"""A lag of the speed that is said, and its size in standard deviations."""
LEAST_OVER_NOISE = 0.3
"""Of the noise, left by the four numbers, from which a remark sends the reader to `diagnose`."""


@dataclass(frozen=True)
class Identified:
    """`bound`: smallest standard deviations that the noise allows (Cramer-Rao); those of `parameters` are widened by what is left."""

    parameters: Mapping[str, Quantity]
    bound: Mapping[str, float]
    covariance: Array
    inertia: Quantity | None
    load: Mapping[str, float]
    t_model: TModel
    left: Lack
    chi2: float
    stator_flux_wb: float
    record: Record
    fit: Fit
    remarks: tuple[str, ...]


def identify(recordings: Sequence[RunningRecording], plate: Nameplate) -> Identified:
    """DataRefused where the recordings cannot carry four parameters."""
    record = _prepared(recordings, plate)
    if not record.has_speed and record.has_start:
        record = _until_first_step(record)
    problem = problem_of(record, 0.0)
    fit = with_speed(problem) if record.has_speed else with_shaft(problem, smooth_load=record.has_start)
    problem, fit = best_reading(problem, fit)
    record, problem = problem.record, with_noise_of(problem, fit.machine)
    columns, shift = fit.columns, 0.0
    if record.has_speed and record.has_start:
        columns = (*columns, SPEED_LAG)
        fit = refine(problem, fit.machine, columns, is_final=False)
        shift = fit.machine.value("speed_lag")
        problem = _earlier(problem, shift)
        record = problem.record
    start = fit.machine.with_values({"speed_lag": fit.machine.value("speed_lag") - shift})
    of_slope, fit = fit.machine.theta[: len(FOUR)], refine(problem, start, columns)
    by_lag = fit.machine.theta[: len(FOUR)] - of_slope if shift else np.zeros(len(FOUR))
    require_a_motor(problem, fit)
    fit = with_told(problem, fit)
    fit = unbiased(problem, fit)
    late = Quantity(shift + fit.machine.value("speed_lag"), fit.std("speed_lag"))
    moves = _moves(record, fit)
    noise_only = moves @ fit.covariance() @ moves.T
    whole = _covariance(problem, fit)
    beside = np.vstack([by_lag, by_laws(fit, moves)])  # a filter or a counter, where iron acts: not known
    covariance = moves @ whole @ moves.T + beside.T @ beside
    if not np.isfinite(covariance).all() or np.sqrt(covariance.diagonal().max()) > 1.0:
        worst = FOUR[int(np.argmax(covariance.diagonal()))].replace("_", " ")
        raise record.refusal_of_standing("identify") or DataRefused(
            f"the recording says nothing about the {worst}", step="identify", value=float(np.sqrt(covariance.diagonal().max())),
            limit="a relative standard deviation below 1", remedy="record a direct start, or two loads that differ by half of rated torque; one steady load is for `commissioner monitor`",
        )  # fmt: skip
    aside = drawn_aside(problem, fit)
    whole, covariance = whole + aside.T @ aside, covariance + moves @ aside.T @ aside @ moves.T
    left = lack_of_fit(problem, fit.machine)
    inertia, load = _shaft(problem, fit, covariance, _inertia_of(fit, whole))
    four = _four_at_flux(record, fit.machine.values())
    absolute = covariance * np.outer(four.as_tuple(), four.as_tuple())
    bound = {name: quantity.std for name, quantity in _parameters(four, noise_only / fit.scale).items()}
    return Identified(
        _parameters(four, covariance), bound, covariance, inertia, load, to_t_model(four, absolute), left,
        fit.chi2 / fit.count, abs(stator_flux_wb(record, fit.machine.values())), record, fit, _remarks(record, left, late, inertia, fit),
    )  # fmt: skip


def _prepared(recordings: Sequence[RunningRecording], plate: Nameplate) -> Record:
    """Windows of the recordings, their currents shifted by the whole rows that a start shows them to be late: what is left the fit finds."""
    peak = scales_of(plate).voltage_v
    on_time = [currents_on_time(one, peak, by_whole_rows=True)[0] for one in recordings]
    record = prepare(on_time, plate)
    said = (
        f"{one.source}: {one.notes[-1].what}."
        for one, raw in zip(on_time, recordings, strict=True)
        if len(one.notes) > len(raw.notes)
    )
    return replace(record, remarks=(*said, *record.remarks))


def _until_first_step(record: Record) -> Record:
    """The start and what follows it, as long as the load is smooth."""
    windows = []
    for w in record.windows:
        steps = np.flatnonzero(w.state == STATES.index("transient"))
        after_start = (
            steps[steps > np.flatnonzero(w.state == STATES.index("start")).max(initial=0) + 2]
            if w.is_from_rest
            else steps
        )
        quiet = round(0.1 / record.period_s)
        later = after_start[
            after_start > np.flatnonzero(w.state == STATES.index("steady")).min(initial=w.count) + quiet
        ]
        end = int(later[0]) - round(0.04 / record.period_s) if later.size else w.count
        windows.append(first_part(w, max(end, round(0.2 / record.period_s))) if w.is_from_rest else w)
    return replace(record, windows=tuple(windows))


def _earlier(problem: Problem, late_s: float) -> Problem:
    """The same with its speeds read so much later: a lag that is long against what the speed does is a shift, and no slope."""
    windows = []
    for w in problem.record.windows:
        time = 0.5 * problem.period * np.arange(2 * w.count - 1)
        speed = np.stack([np.interp(time + late_s, time, x) for x in w.speed.T], axis=1)
        windows.append(replace(w, speed=speed))
    return replace(problem, record=replace(problem.record, windows=tuple(windows)))


def _covariance(problem: Problem, fit: Fit) -> Array:
    """Of the columns' numbers, with what is left and an inertia that is assumed."""
    aside = _by_inertia(problem, fit)
    return np.asarray(scattered(problem, fit) + np.outer(aside, aside))


def _by_inertia(problem: Problem, fit: Fit) -> Array:
    """How far an error of an inertia that is assumed, not fitted, draws the columns' numbers aside."""
    if not fit.machine.has_shaft or INERTIA in fit.columns or problem.record.plate.inertia_kg_m2 is not None:
        return np.zeros(len(fit.columns))
    along = jacobian(problem, fit.machine, (INERTIA,))[0]
    return np.asarray(OF_ASSUMED_INERTIA * fit.influence() @ (fit.jacobian @ along))


def _moves(record: Record, fit: Fit) -> Array:
    """(four, columns): by how much each column moves the logarithms of R_s, R_R, L_sigma, L_M at small slip and at the recording's flux."""

    def logarithms(values: Mapping[str, float]) -> dict[str, float]:
        return dict(zip(FOUR, np.log(_four_at_flux(record, values).as_tuple()).tolist(), strict=True))

    told = made_of(fit, logarithms)
    return np.array([told[name][1] for name in FOUR])


def _four_at_flux(record: Record, values: Mapping[str, float]) -> InverseGamma:
    """Of iron that saturates those that hold at the recording's flux; else at every."""
    small = at_small_slip(values)
    if not is_saturated(values):
        return small
    held = at_flux(record, values)
    return InverseGamma(small.stator_resistance_ohm, *(held[name] for name in PARAMETERS[1:]))


def _parameters(four: InverseGamma, covariance: Array) -> dict[str, Quantity]:
    out = {
        k: Quantity(v, float(v * np.sqrt(covariance[j, j])))
        for j, (k, v) in enumerate(zip(PARAMETERS, four.as_tuple(), strict=True))
    }
    spread = covariance[3, 3] + covariance[1, 1] - 2.0 * covariance[1, 3]
    t = four.rotor_time_constant_s
    return {**out, "rotor_time_constant_s": Quantity(t, float(t * np.sqrt(max(spread, 0.0))))}


def _inertia_of(fit: Fit, whole: Array) -> Quantity | None:
    """Where the shaft is in the fit and its inertia free and told; `whole`: covariance of the columns' numbers."""
    if INERTIA not in fit.columns:
        return None
    place, value = fit.place("inertia"), fit.machine.value("inertia")
    std = float(np.sqrt(whole[place, place]))
    return Quantity(value, value * std) if std < OPEN_INERTIA else None


def _shaft(
    problem: Problem, fit: Fit, covariance: Array, fitted: Quantity | None
) -> tuple[Quantity | None, dict[str, float]]:
    """Inertia and load of a start: from the fit where the shaft is in it, else from torque against measured speed. Without a start the
    inertia alone, where a load that moves tells it."""
    record = problem.record
    torque = record.scales.torque_nm
    if not record.has_start:
        return fitted, {}
    if fit.machine.has_shaft:
        load = {
            "constant_nm": fit.machine.value("load_constant") * torque,
            "linear_at_synchronous_nm": fit.machine.value("load_linear") * torque,
            "fan_at_synchronous_nm": fit.machine.value("load_fan") * torque,
        }
        return fitted, load
    own = _inertia(problem, fit.machine)
    if own is None:
        return None, {}
    values, std = own
    spread = 0.0
    for step in np.linalg.cholesky(covariance + 1e-18 * np.eye(4)).T:
        theta = fit.machine.theta.copy()
        theta[: len(FOUR)] += step
        moved = _inertia(problem, replace(fit.machine, theta=theta))
        spread += (moved[0][0] - values[0]) ** 2 if moved else 0.0
    load = {
        "constant_nm": float(values[1]),
        "linear_at_synchronous_nm": float(values[2]),
        "fan_at_synchronous_nm": float(values[3]),
    }
    return Quantity(float(values[0]), float(np.hypot(std, np.sqrt(spread)))), load


def _inertia(problem: Problem, machine: Machine) -> tuple[Array, float] | None:
    """(J, constant, linear, fan) and the standard deviation of J from J w = J w0 + integral of (torque - load); None where no such
    load makes the run-up."""
    record = problem.record
    for w, (_, shaft) in zip(record.windows, simulate(problem, machine), strict=True):
        if not w.is_from_rest:
            continue
        start = int(np.flatnonzero(w.state == STATES.index("start")).max(initial=0))
        last = min(start + round(AFTER_START_S / problem.period), w.count)
        design, speed = _run_up(problem, shaft[:last])
        if speed.size < 2 * PARTS:
            return None
        parts = np.array_split(np.arange(speed.size), PARTS)
        solved = _solved(design, speed)
        rest = speed - design @ solved
        synchronous = record.scales.frequency_rad_per_s / record.scales.pole_pairs
        if np.sqrt(np.mean([rest[k].mean() ** 2 for k in parts])) > MOST_LEFT_OF_SPEED * synchronous:
            return None
        without = np.array([1.0 / _solved(np.delete(design, k, 0), np.delete(speed, k))[0] for k in parts])
        j = 1.0 / float(solved[0])
        std = float(np.sqrt((PARTS - 1) * without.var()))
        return (j * np.array([1.0, *solved[1:4]]), std) if 0.0 < std < MOST_STD_OF_INERTIA * j else None
    return None


def _run_up(problem: Problem, shaft: Array) -> tuple[Array, Array]:
    """What adds up to the speed, and the speed: integrals of torque, friction, linear, fan and breaking away; a first speed; ripple of an encoder."""
    h, scales = problem.period, problem.record.scales
    speed = shaft[:, 0] / scales.pole_pairs
    share = shaft[:, 0] / scales.frequency_rad_per_s
    friction = share / np.sqrt(share**2 + SLOWEST2)
    rates = (shaft[:, 1], -friction, -share, -share * np.abs(share), -friction * SLOW2 / (share**2 + SLOW2))
    sums = [np.concatenate([[0.0], np.cumsum(0.5 * h * (x[1:] + x[:-1]))]) for x in rates]
    angle = np.cumsum(speed) * h
    design = np.stack([*sums, np.ones(speed.size), np.cos(angle) * share, np.sin(angle) * share], axis=1)
    every = max(round(SPEED_STEP_S / h), 1)
    return design[every:-every:every], speed[every:-every:every]


def _solved(design: Array, target: Array) -> Array:
    """Least squares; no linear, fan or breaking-away torque drives: unbounded they took up what a turn fault left, -4 against 6 N m."""
    lower = np.full(design.shape[1], -np.inf)
    lower[2:5] = 0.0
    return np.asarray(lsq_linear(design, target, (lower, np.inf), method="bvls").x)


def _remarks(record: Record, left: Lack, late: Quantity, inertia: Quantity | None, fit: Fit) -> tuple[str, ...]:
    out = [*record.remarks, *not_told(fit)]
    worst = max(left.sigma, left.burst_sigma)
    if worst > LEAST_OVER_NOISE:
        out.append(
            f"The four numbers leave {worst:.2g} times the noise: something is missing (a fault, a sensor, iron or bars of another form) that may have drawn them aside by more than their intervals, widened as these are; `commissioner diagnose` names it."
        )
    if told := dict.fromkeys(hidden.words for hidden in told_in(fit)):
        out.append(f"In the fit besides: {' and '.join(told)}, which explain what the four numbers left.")
    if not record.has_speed and record.has_start:
        out.append(
            "No speed column: inertia and load come from the run-up: friction, and torques that grow with speed and with its square."
        )
    if abs(late.value) > max(LEAST_LAG_S, SURE * late.std):
        out.append(f"The speed column is {1e3 * late.value:.2g} +- {2e3 * late.std:.1g} ms late: taken off.")
    if record.has_speed and record.has_start and inertia is None:
        out.append(
            f"The inertia is not given: friction, linear and fan load leave more than {100 * MOST_LEFT_OF_SPEED:g} % of synchronous speed of this run-up, or leave the inertia open. Record a run-up with one steady load."
        )
    if not record.has_start and inertia is not None:
        out.append(
            "No start: the inertia is what a load that moves shows of it, and R_s is the least certain of the four."
        )
    if not record.has_start and inertia is None:
        out.append("No start: the inertia is not in these data, and R_s is the least certain of the four.")
    return tuple(out)


def as_document(seen: Identified) -> RunningDocument:
    """The contract's keys, and the inertia, the bound and the covariance beside them."""
    flux = seen.stator_flux_wb
    t = seen.t_model
    seconds = {
        name: float(sum((w.state == k).sum() for w in seen.record.windows)) * seen.record.period_s
        for k, name in enumerate(STATES)
    }
    return {
        "outcome": "identified",
        "reason": "Fitted to a running motor's currents and voltages.",
        "kind": "running",
        "convention": "SI, per-phase star equivalent, referred to the stator; std is one standard deviation",
        "estimator": "least squares on a running machine",
        "parameters": {k: _measured(q, flux if k in OF_IRON else None) for k, q in seen.parameters.items()},
        "inertia_kg_m2": None if seen.inertia is None else _measured(seen.inertia),
        "load": dict(seen.load),
        "bound_std": dict(seen.bound),
        "covariance": {"of": [f"log {k}" for k in PARAMETERS], "matrix": seen.covariance.tolist()},
        "holds_for_stator_flux_wb": flux,
        "t_model": {
            "stator_resistance_ohm": _measured(t.stator_resistance_ohm), "rotor_resistance_ohm": _measured(t.rotor_resistance_ohm),
            "stator_leakage_h": _measured(t.stator_leakage_h), "rotor_leakage_h": _measured(t.rotor_leakage_h),
            "magnetizing_inductance_h": _measured(t.magnetizing_inductance_h), "assumption": t.assumption,
        },
        "residual_over_noise": float(np.sqrt(seen.chi2)),
        "left_over_noise": seen.left.sigma,
        "speed": "measured" if seen.record.has_speed else "from the shaft",
        "seconds": {k: v for k, v in seconds.items() if v},
        "duration_s": float(sum(w.count for w in seen.record.windows)) * seen.record.period_s,
        "remarks": list(seen.remarks),
        "written": [],
    }  # fmt: skip


def _measured(q: Quantity, at_stator_flux_wb: float | None = None) -> Measured:
    made: Measured = {"value": q.value, "std": q.std}
    if at_stator_flux_wb is not None:
        made["at_stator_flux_wb"] = at_stator_flux_wb
    return made
