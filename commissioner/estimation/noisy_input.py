"""Noise of what drives the machine: the weights that it asks for, what it does to a fit's numbers, what it only pretends to tell."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.estimation.fit import (
    INERTIA,
    LARGEST_STEP,
    Fit,
    Machine,
    Problem,
    fitted_part,
    jacobian,
    residuals,
    simulate,
)
from commissioner.estimation.noise import through_machine
from commissioner.estimation.numbers import FOUR, LOGARITHMIC, SHAPES
from commissioner.estimation.record import SMOOTH_S, between, smoothed
from commissioner.estimation.told import TOLD, inverse
from commissioner.motor.nameplate import prior

Array = NDArray[np.float64]
MOST_SHIFTED = 0.05
"""Of chi-square: what a shift by noise may add. One that adds more is drawn along a load whose knots the recording hardly tells: under a belt
it left 6.4 times the noise of a healthy motor that had been fitted to the noise, and called it unexplained."""

OF_ATTENUATION = 0.5
"""Of the logarithm by which noise makes an inertia too heavy: its standard deviation. From draw to draw it scatters by a third."""

OF_PLATE = 0.3
"""Standard deviation of a resistance's logarithm about what a plate tells of it."""


def _input_noise(problem: Problem, rng: np.random.Generator) -> list[tuple[Array, Array]]:
    """Drawn for each window: noise of the voltage (n, 2), and of the electrical speed as it is after smoothing (n,)."""
    record, drawn = problem.record, []
    for w in record.windows:
        volts = np.stack([record.sigma_v * rng.standard_normal(w.count) for _ in range(2)], axis=1)
        speed = np.zeros(w.count)
        if record.sigma_w:
            speed = smoothed(record.sigma_w * rng.standard_normal(w.count), SMOOTH_S, 0, problem.period)
        drawn.append((volts, speed))
    return drawn


def _shaken(problem: Problem, drawn: Sequence[tuple[Array, Array]], sign: float) -> Problem:
    """The same currents with noise added to what drives the machine."""
    noisy = []
    for w, (volts, speed) in zip(problem.record.windows, drawn, strict=True):
        turning = w.speed.copy()
        turning[:, 0] += sign * between(speed)
        added = np.stack([between(volts[:, k]) for k in range(2)], axis=1)
        if problem.record.scales.is_held:
            added[1::2] = added[:-2:2]
        noisy.append(replace(w, voltage=w.voltage + sign * added, speed=turning))
    return replace(problem, record=replace(problem.record, windows=tuple(noisy)))


def unbiased(problem: Problem, fit: Fit, seed: int = 6) -> Fit:
    """The fit less what the noise of voltage and speed does to its numbers, and with what it pretends to tell. `fit`: with its own Jacobian.

    An input that is noisy itself draws a fit aside by the square of its noise: L_sigma of a motor without a start by 0.5 to 0.8 %, four
    standard deviations. The fitted machine's own currents are fitted with noise of that size added to the input, once with either
    sign: what the two steps have in common is taken off, what the two Gram matrices have more than the fit's own tells nothing. Numbers that only shape a law stay: along their valley no
    step is straight (simulation extrapolation, Cook and Stefanski 1994, DOI 10.1080/01621459.1994.10476871). A shift that cannot be taken off is in the errors.
    An inertia that only a steady load's swing tells goes its own way: `_of_inertia`.
    """
    runs = zip(problem.record.windows, simulate(problem, fit.machine), strict=True)
    own = tuple(replace(w, current=run) for w, (run, _) in runs)
    ideal = replace(problem, record=replace(problem.record, windows=own))
    drawn = _input_noise(problem, np.random.default_rng(seed))
    moving = np.flatnonzero([c.kind != "p" or c.index not in SHAPES for c in fit.columns])
    shift, by_noise = np.zeros(len(fit.columns)), -fit.slopes.gram
    is_free, told_of_inertia = INERTIA in fit.columns and not problem.record.has_start, 0.0
    for sign in (1.0, -1.0):
        noisy = _shaken(ideal, drawn, sign)
        along = jacobian(noisy, fit.machine, fit.columns)
        rest = fitted_part(noisy, residuals(noisy, fit.machine))
        gram = along @ along.T
        shift[moving] += 0.5 * inverse(gram[np.ix_(moving, moving)]) @ (along[moving] @ rest)
        by_noise += 0.5 * gram
        if is_free:
            told_of_inertia += 0.5 / inverse(gram)[fit.place("inertia"), fit.place("inertia")]
    if not (np.isfinite(shift).all() and np.isfinite(by_noise).all()):
        return fit
    aside = np.zeros((1, shift.size))
    if is_free:
        place = fit.place("inertia")
        shift, aside = _of_inertia(fit, told_of_inertia * fit.influence()[place, place] - 1.0, shift)
    fit = replace(fit, by_noise=by_noise, aside=aside)
    logarithms = [c.kind == "p" and c.index in LOGARITHMIC for c in fit.columns]
    if np.max(np.abs(shift[logarithms]), initial=0.0) <= LARGEST_STEP:
        moved = fit.machine.moved(fit.columns, -shift)
        rest = fitted_part(problem, residuals(problem, moved))
        if rest @ rest < (1.0 + MOST_SHIFTED) * fit.chi2:
            return _with_plate(problem, replace(fit, machine=moved))
    return _with_plate(problem, replace(fit, aside=np.vstack([aside, shift])))


def _of_inertia(fit: Fit, by_noise: float, shift: Array) -> tuple[Array, Array]:
    """The shift with that of an inertia which no start tells, and (1, columns) what is not known of it. `by_noise`: times the fit's own that noise adds to
    what tells the inertia, all else fitted beside it.

    Noise of the voltage swings the fitted machine's shaft, less the heavier it is: the inertia comes out as many times too heavy as what tells it
    is more with noise (attenuation: Fuller, Measurement Error Models, 1987, section 1.1). One step on the fitted machine's own currents saw a third of
    it to nothing. Where noise tells more than the motor nothing is taken off for it.
    """
    place = fit.place("inertia")
    moves = fit.influence()[place]
    along, heavier = moves[None] / moves[place], np.log1p(max(by_noise, 0.0))
    if 1.0 / (1.0 + by_noise) < TOLD:
        return shift, heavier * along
    return shift + (heavier - shift[place]) * along[0], OF_ATTENUATION * heavier * along


def _with_plate(problem: Problem, fit: Fit) -> Fit:
    """Where the recording leaves a number open the errors reach to the plate's motor: the valley is flat farther than its slope here tells (three
    steady seconds with 0.3 % of noise: R_R 120 % off, where the motor's share of the sensitivities, 0.4, told of 12 %)."""
    opened = fit.not_told()
    if not opened:
        return fit
    open_, plate = fit.told().open, prior(problem.record.plate).typical.as_tuple()
    name = max(opened, key=lambda n: open_[fit.place(n), fit.place(n)])
    along = open_[fit.place(name)] / open_[fit.place(name), fit.place(name)]
    reach = abs(np.log(fit.machine.value(name) / plate[FOUR.index(name)])) + OF_PLATE
    return replace(fit, aside=np.vstack([fit.aside, reach * along]))


def with_noise_of(problem: Problem, machine: Machine, seed: int = 5) -> Problem:
    """The same problem, weighted by what noise of voltage, speed and current leaves in this machine's residual."""
    record = problem.record
    rng = np.random.default_rng(seed)
    whole = problem
    if machine.has_shaft and record.has_start:
        problem, machine = _at_its_speed(problem, machine)
    noisy = _shaken(problem, _input_noise(problem, rng), 1.0)
    plain, moved = simulate(problem, machine), simulate(noisy, machine)
    shown = np.concatenate([(b[0] - a[0])[:, :2] for a, b in zip(plain, moved, strict=True)])
    if not np.isfinite(shown).all():
        raise DataRefused(
            "the fitted machine runs away from its own voltage", step="fit", value="no finite current", limit="a stable machine",
            remedy="check the plate's rated values and the scale of voltages and currents",
        )  # fmt: skip
    return replace(whole, noise=through_machine(shown, record.sigma_a, record.has_zero, rng))


def _at_its_speed(problem: Problem, machine: Machine) -> tuple[Problem, Machine]:
    """The machine without its shaft, and the problem with the speed that this had."""
    windows = []
    for w, (_, shaft) in zip(problem.record.windows, simulate(problem, machine), strict=True):
        speed = between(shaft[:, 0])
        turning = np.stack([speed, np.gradient(speed, 0.5 * problem.period)], axis=1)
        windows.append(replace(w, speed=turning))
    return replace(problem, record=replace(problem.record, windows=tuple(windows))), replace(machine, has_shaft=False)


def chi2_by_own_noise(problem: Problem, machine: Machine) -> float:
    """Chi-square of the machine, weighted by what noise leaves in its own residual.

    Noise of the input, measured with it, goes through the fitted machine: under weights that stand, one that passes less of it gains without being
    truer. The true input taken as unknown, each machine's own weights are those of the likelihood (errors in variables: Fuller, Measurement
    Error Models, 1987, section 3.2), whose least is at the truth. The draws are the same for every machine, so that chance in them cancels.
    """
    own = with_noise_of(problem, machine)
    rest = fitted_part(own, residuals(own, machine))
    return float(rest @ rest)
