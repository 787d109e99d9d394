"""The four-parameter machine fitted to a running recording: with the measured speed, or with a shaft of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from commissioner.errors import DataRefused
from commissioner.estimation.checks import BLOCK_S
from commissioner.estimation.fit import (
    CALM_S,
    INERTIA,
    Expected,
    Fit,
    Machine,
    Problem,
    columns_of,
    fitted_part,
    jacobian,
    numbers_of,
    plain_machine,
    refine,
    residuals,
    with_knots_at,
)
from commissioner.estimation.held import best_reading
from commissioner.estimation.noisy_input import with_noise_of
from commissioner.estimation.numbers import AT, FOUR
from commissioner.estimation.record import STATES, Record
from commissioner.estimation.told import Slopes
from commissioner.motor.nameplate import prior
from commissioner.running.residual.ripple_lines import slips_of
from commissioner.running.residual.swing_lines import turns_of_swing

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
PREFIXES_S = (0.04, 0.1, 0.25, 0.5, 0.95)
"""A fit with unknown shaft grows with these: from all at once 20 of 60 ended in a wrong valley, so none of 60."""
HEAVY_PREFIXES_S = (1.2, 1.55, 2.0, 2.6, 3.4, 4.4)
"""And with these while the motor still runs up: from 0.95 s to the end of 3 s one that took 2.1 s went astray from all four starts."""
TURNS_S = 0.05
"""From where on a prefix tells the shaft."""
FREED_FROM_S = (("load_constant", 0.25), ("load_fan", 0.5))
"""What of the load is free in a prefix of this length: a fan is nothing before the shaft turns."""
RUN_UP_LOAD = ("load_constant", "load_linear", "load_fan", "load_breakaway")
"""Torque of a run-up over speed."""
RUN_UP_TORQUE = 2.0
"""Mean accelerating torque of a start, of rated."""
RIPPLE = ("speed_ripple_cos", "speed_ripple_sin")
"""Of an encoder, at the shaft's frequency."""
LOAD_RIPPLE = ("load_ripple_cos", "load_ripple_sin", "load_ripple_cos_2", "load_ripple_sin_2")
"""Of a load, once and twice a turn; like friction it takes torque from a shaft that turns, and drives none that stands."""
SWING, LEAST_SWING = ("load_swing_cos", "load_swing_sin"), 0.02
"""Of a load, at a frequency of its own; the share of the noise's power from which it is looked for before the load's changes."""
STARTS = ((1.0, 1.0, 1.0, 1.0), (0.5, 0.6, 0.6, 1.0), (2.0, 1.6, 1.5, 1.0), (0.6, 1.6, 1.0, 1.5))
"""Factors on the plate's four, tried in turn until one leaves the valley where R_s is near zero."""
USUAL = {
    "stator_resistance": 0.5, "rotor_resistance": 0.5, "leakage_inductance": 0.5, "magnetizing_inductance": 0.5, "inertia": 1.0,
    "load_constant": 0.5, "load_fan": 0.5, "line_re": 0.3, "line_im": 0.3,
}  # fmt: skip
"""Standard deviations beforehand of what is grown then, about the plate's motor at no load: what little of a start leaves open goes after whatever cause
is there otherwise (5 % of a voltage's gain: 266 times L_M after 40 ms). Of nine strong causes that had ended astray at a 90 kW motor, which runs up for
1.6 s, six came so into the right valley, two by the unbalance alone."""
UNBALANCE = ("line_re", "line_im")
"""Free beside the four where a start without a speed is grown once more: a contact, a channel's gain and shorted turns are a current of negative
sequence alike there, which the four and the inertia tried to follow (0.4 R_s in one line: ten times the inertia after 0.1 s, 800 of the noise left,
no name)."""
LEFT_OVER, NOT_THE_LOAD, LEAST_BY_LOAD, MOST_LOOKS = 5.0, 0.1, 0.5, 2
"""Standard deviations of a block's chi-square from which something is left in it; the share of that beyond which a load that changes there is
no reason; the share below which it is not even tried, for a straight line tells no more; looks at what is left (a kink shows beside the first of
them)."""
OF_WORST, MOST_WITHIN = 0.3, 6
"""Share of the worst block of a run-up from which another has its part in what is left there; the number of them up to which it may be a load's step."""
ASSUMED_RUN_UP_S = 0.3
ASSUMED_SHARES = (1.0, 0.3, 0.1)
"""Of a motor whose start was not recorded: from a load as heavy as ten of its own rotors to the bare shaft. Between two of these the valley of
inertia and load is straight enough: from four times the true inertia 50 steps did not reach it, and L_sigma stayed 4 % low."""
TELLING_S = 3.0
"""Of each window: what tells which of these is nearest. (Eleven steady seconds: 84 CPU-seconds, most of them to choose.)"""
NEAR = 5.0
"""Change of chi-square a sample below which a fit that another follows has ended."""
OPEN_INERTIA = 0.5
"""Standard deviation of the inertia, of itself, from which it is left as assumed."""
WRONG_VALLEY = 300.0
"""Chi-square a sample above which another start is tried: strong causes leave 20 to 100, wrong valleys thousands."""
WEIGHTED_ROUNDS, STAYS, RUNS_AWAY = 4, 0.01, 0.5
"""Of noise and fit in turn; the change of a parameter's logarithm from which the noise no longer differs, and the one that is no refinement."""
MOST_OFF = 30.0
"""Times the plate's value, or a part of it: no motor."""
LEAST_CHI2 = 1e4
"""Chi-square a sample beyond which nothing has been fitted."""


def nominal(problem: Problem) -> tuple[Problem, Fit]:
    """The problem with noise that went through the machine, and the fit. DataRefused where no machine fits at all."""
    record = problem.record
    fit = with_speed(problem) if record.has_speed else with_shaft(problem)
    problem, fit = weighted(*best_reading(problem, fit))
    if not record.has_speed:
        fit = with_turns_of_swing(problem, fit)
        if not swings(problem, fit):
            fit = with_turns_of_swing(problem, with_load_changes(problem, fit))
    require_a_motor(problem, fit)
    return problem, fit


def with_turns_of_swing(problem: Problem, fit: Fit) -> Fit:
    """The same fit, told how often a turn the load would pulsate, if it does: that number moves nothing before it has a size."""
    machine = fit.machine
    if any(machine.value(name) for name in SWING):
        return fit
    return replace(fit, machine=machine.with_values({"load_swing_turns": turns_of_swing(problem, machine)}))


def swings(problem: Problem, fit: Fit) -> bool:
    """Whether a load that pulsates at a frequency of its own makes most of what is left: knots near each other, of which a short recording has enough to follow
    it, would pass for a load that changes."""
    excess = fit.chi2 - fit.count
    if fit.chi2 < (1.0 + LEAST_SWING) * fit.count:
        return False
    own = jacobian(problem, fit.machine, numbers_of(SWING, problem.record))
    left = Slopes.known(np.concatenate([fit.jacobian, own])).apart(fit.rest[None])[0]
    return float(fit.rest @ fit.rest - left @ left) > LEAST_BY_LOAD * excess


def require_a_motor(problem: Problem, fit: Fit) -> None:
    """DataRefused where nothing was fitted, or what was is no motor of this plate."""
    four = prior(problem.record.plate).typical.as_tuple()
    off = [abs(np.log(fit.machine.value(n) / v)) for n, v in zip(FOUR, four, strict=True)]
    if fit.chi2 / fit.count > LEAST_CHI2 * 100 or max(off) > np.log(MOST_OFF):
        worst = FOUR[int(np.argmax(off))]
        raise problem.record.refusal_of_standing("fit of four parameters") or DataRefused(
            f"no machine near the plate's values makes these currents: {worst.replace('_', ' ')} would be {fit.machine.value(worst):.3g} (SI)",
            step="fit of four parameters", value=fit.machine.value(worst), limit=f"within {MOST_OFF:g} times {dict(zip(FOUR, four, strict=True))[worst]:.3g}",
            remedy="check the scale and the phase order of currents and voltages, and the plate; whether all currents come late `commissioner diagnose` tells",
        )  # fmt: skip


def weighted(problem: Problem, fit: Fit) -> tuple[Problem, Fit]:
    """The fit repeated with the noise that its own machine leaves, until the machine stays: fitted with white noise, a motor in steady
    state gets resistances that keep the voltage's noise small. A round that runs away is not taken: a cause is missing then. (Of the first one
    the noise is: a shorted turn under one steady load drew R_s to 4e-6 of an ohm, and the recording was refused.)"""
    for round_ in range(WEIGHTED_ROUNDS):
        anew = with_noise_of(problem, fit.machine)
        other = refine(anew, fit.machine, fit.columns)
        moved = max(abs(np.log(other.machine.value(name) / fit.machine.value(name))) for name in FOUR)
        if moved > (RUNS_AWAY if round_ else np.log(MOST_OFF)):
            return (problem, fit) if round_ else (anew, refine(anew, fit.machine, fit.columns, most=0))
        problem, fit = anew, other
        if moved < STAYS:
            break
    return problem, fit


def with_load_changes(problem: Problem, fit: Fit) -> Fit:
    """With knots of the load near each other where something is left, if they explain it: after the run-up, then at a few places within it.

    A step or a ramp that changes the current by less than `MOVES` in a block lies between knots 0.15 s apart: a healthy motor was
    called unexplained; so does one while a heavy motor still runs up. What such knots do not take away is no load.
    """
    block = max(round(BLOCK_S / problem.period), 8)
    left, known = residuals(problem, fit.machine), [np.zeros(w.count, bool) for w in problem.record.windows]
    looks, is_refused = [_left_within, *MOST_LOOKS * [_left_over]], False
    while looks:
        mark = looks.pop()
        new = [mark(rest, w.state, block) for w, rest in zip(problem.record.windows, left, strict=True)]
        if not any(m.any() for m in new) or (is_refused and mark is _left_over):
            continue
        marks = [a | b for a, b in zip(known, new, strict=True)]
        denser = _with_denser_load(problem, fit, marks, _excess(left, new))
        left_then = residuals(problem, denser.machine) if denser else left
        is_refused = denser is None or _excess(left_then, new) > NOT_THE_LOAD * _excess(left, new)
        if denser and not is_refused:
            fit, left, known = denser, left_then, marks
    return fit


def _with_denser_load(problem: Problem, fit: Fit, marks: Sequence[Bools], excess: float) -> Fit | None:
    """Refitted with dense knots there; None where a straight line tells that they take away little of this excess in chi-square."""
    machine, columns = with_knots_at(problem.record, fit, marks)
    slopes = Slopes.known(jacobian(problem, machine, columns))
    left = slopes.apart(fit.rest[None])[0]
    if float(fit.rest @ fit.rest - left @ left) < LEAST_BY_LOAD * excess:
        return None
    return refine(problem, machine, columns, first_jacobian=slopes.jacobian)


def _left_over(rest: Array, state: NDArray[np.int64], block: int) -> Bools:
    """Samples of the blocks after the run-up in which more is left than chance leaves."""
    return np.asarray((_over_chance(rest, block) > 0.0) & (state != STATES.index("start")))


def _left_within(rest: Array, state: NDArray[np.int64], block: int) -> Bools:
    """Samples of the few blocks of a run-up in which most is left; none where it is left all along: a cause does so."""
    over = np.where(state == STATES.index("start"), _over_chance(rest, block), 0.0)
    marks = np.asarray(over > OF_WORST * over.max(initial=0.0))
    return np.asarray(marks & (marks.sum() <= MOST_WITHIN * block))


def _over_chance(rest: Array, block: int) -> Array:
    """(n,): by how much more than what chance leaves is left, mean square of a sample's block."""
    whole, width = rest.shape[0] // block, rest.shape[1]
    square = np.mean(rest[: whole * block].reshape(whole, -1) ** 2, axis=1)
    over = np.maximum(square - 1.0 - LEFT_OVER * np.sqrt(2.0 / (block * width)), 0.0)
    return np.concatenate([np.repeat(over, block), np.zeros(rest.shape[0] - whole * block)])


def _excess(left: Sequence[Array], marks: Sequence[Bools]) -> float:
    """Chi-square above the noise's at these samples."""
    parts = [rest[m] for rest, m in zip(left, marks, strict=True)]
    return float(sum(np.sum(x**2) - x.size for x in parts))


def with_speed(problem: Problem) -> Fit:
    """The measured speed is an input; the encoder's ripple at shaft frequency is free once the four are near: from far off it ran away."""

    def fitted(four: list[float]) -> Fit:
        machine = plain_machine(four, problem.record)
        for seconds in (0.1, 0.4):
            machine = _settled(problem.cut(seconds), machine, FOUR)
        return refine(problem, machine, columns_of((*FOUR, *RIPPLE), problem.record, machine))

    return _from_several_starts(problem, fitted)


def _from_several_starts(
    problem: Problem, fitted: Callable[[list[float]], Fit], *instead: Callable[[list[float]], Fit]
) -> Fit:
    """The best fit from the plate's four and, as long as that is a wrong valley, from there otherwise, and from others."""
    typical = np.array(prior(problem.record.plate).typical.as_tuple())
    best: Fit | None = None
    tries = [(STARTS[0], fitted), *((STARTS[0], other) for other in instead), *((f, fitted) for f in STARTS[1:])]
    for factors, one in tries:
        fit = one((typical * factors).tolist())
        best = fit if best is None or fit.chi2 < best.chi2 else best
        if best.chi2 < WRONG_VALLEY * best.count:
            break
    assert best is not None
    return best


def _settled(
    part: Problem, machine: Machine, numbers: tuple[str, ...], *, knots: bool = False, expected: Expected | None = None
) -> Machine:
    """`expected`: held near that, what the machine cannot follow counted as noise, as the fit before leaves it."""
    columns = columns_of(numbers, part.record, machine, knots=knots)
    if expected is None:
        return refine(part, machine, columns, most=15, tolerance=NEAR).machine
    for _ in range(2):
        rest = fitted_part(part, residuals(part, machine))
        now = replace(expected, scale=max(float(rest @ rest) / rest.size, 1.0))
        machine = refine(part, machine, columns, most=15, tolerance=NEAR, expected=now).machine
    return machine


def with_shaft(problem: Problem, *, smooth_load: bool = False) -> Fit:
    """Speed from the shaft: inertia (from a start) and load are fitted too, first to little of the recording, then to more.

    `smooth_load`: torque over speed only, as a start from rest has it. Else knots beside it, denser around load steps: held as a prefix
    left it, that torque drew R_s aside by up to 22 standard errors where the load drives or pulls a shaft at rest. Where no start was recorded
    the noise is weighted as the plate's machine leaves it from the first fit on: with white noise two of four healthy motors in one steady load
    ended at a fiftieth of their slip, R_R 96 % low and R_s 36 and 51 % high, 30 to 180 standard errors without a word, and no later weight led back.
    """
    record = problem.record
    if not record.has_start:
        problem = with_noise_of(problem, _free_to_turn(prior(record.plate).typical.as_tuple(), record))
    grown = partial(_with_shaft_from, problem=problem, smooth_load=smooth_load)
    fit = _from_several_starts(problem, grown, *([partial(grown, unlike=UNBALANCE)] if record.has_start else []))
    return fit if record.has_start else _in_step_with_ripple(problem, fit)


def _in_step_with_ripple(problem: Problem, fit: Fit) -> Fit:
    """Fitted anew from the slip that lines of a rippling load show, where that leaves less: R_R of a steady compressor had been 32 % off."""
    slips = slips_of(problem, fit.machine)
    if slips is None:
        return fit
    machine, first = fit.machine, fit.machine.first.copy()
    first[:, 8] *= (1.0 - slips.shown) / (1.0 - slips.fitted)
    resistance = machine.value("rotor_resistance") * slips.shown / slips.fitted
    machine = replace(
        machine.with_values({"rotor_resistance": resistance, **dict.fromkeys(LOAD_RIPPLE, 0.0)}), first=first
    )
    held = [c for c in fit.columns if c.kind != "p" or c.index != AT["rotor_resistance"]]
    other = refine(problem, refine(problem, machine, held, tolerance=NEAR).machine, fit.columns)
    return min(fit, other, key=lambda f: f.chi2)


def _free_to_turn(four: Sequence[float], record: Record) -> Machine:
    """With a shaft, whose inertia is the plate's or what the run-up takes."""
    torque, w = record.scales.torque_nm, record.scales.frequency_rad_per_s / record.scales.pole_pairs
    inertia = record.plate.inertia_kg_m2 or RUN_UP_TORQUE * torque * _run_up_s(record) / w
    return plain_machine(four, record, inertia=inertia, has_shaft=True)


def _with_shaft_from(four: list[float], problem: Problem, *, smooth_load: bool, unlike: Sequence[str] = ()) -> Fit:
    """`unlike`: numbers that are free while the motor is grown, and none afterwards."""
    record = problem.record
    machine = _free_to_turn(four, record)
    numbers: tuple[str, ...] = FOUR
    if record.has_start:
        numbers = (*FOUR, "inertia")
        expected = Expected(machine.theta, USUAL) if unlike else None
        machine = _grown(problem, machine, unlike=unlike, expected=expected).with_values(dict.fromkeys(unlike, 0.0))
    law = RUN_UP_LOAD if smooth_load or record.has_start else ()
    free = (*numbers, *law, *LOAD_RIPPLE)
    if record.has_start or record.plate.inertia_kg_m2:
        return refine(problem, machine, columns_of(free, record, machine, knots=not smooth_load))
    return _with_inertia(problem, machine, free, knots=not smooth_load)


def _grown(
    problem: Problem,
    machine: Machine,
    beside: Sequence[str] = (),
    unlike: Sequence[str] = (),
    expected: Expected | None = None,
) -> Machine:
    """Fitted to more and more of a start, with the numbers `beside` once the shaft turns, `unlike` from the first on; a heavy motor may be
    loaded while it runs up."""
    run_up_s = _run_up_s(problem.record)
    for seconds in (*PREFIXES_S, *(s for s in HEAVY_PREFIXES_S if s < run_up_s)):
        if seconds < problem.record.windows[0].time_s[-1]:
            turning = ("inertia", *beside, *(name for name, least in FREED_FROM_S if seconds >= least))
            own = (*FOUR, *unlike) if seconds < TURNS_S else (*FOUR, *unlike, *turning)
            is_heavy = seconds in HEAVY_PREFIXES_S
            machine = _settled(problem.cut(seconds), machine, own, knots=is_heavy, expected=expected)
            machine = _going_on(machine, seconds) if is_heavy else machine
    return machine


def _going_on(machine: Machine, until_s: float) -> Machine:
    """With the load of its last knot before `until_s` from there on: what a prefix hardly tells of the next one throws the shaft about."""
    knots = machine.knots.copy()
    for own, times in zip(knots, machine.knot_times_s, strict=True):
        known = times < until_s - 0.5 * CALM_S
        own[~known] = own[known][-1] if known.any() else 0.0
    return replace(machine, knots=knots)


def grown_anew(problem: Problem, machine: Machine, beside: Sequence[str]) -> Machine:
    """The machine whose load and inertia are sought once more, from its start on, with these numbers free beside the four."""
    fresh = _free_to_turn([machine.value(name) for name in FOUR], problem.record)
    none = dict.fromkeys((*RUN_UP_LOAD, *LOAD_RIPPLE), 0.0)
    start = replace(machine, first=fresh.first, knots=np.zeros_like(machine.knots))
    return _grown(problem, start.with_values({**none, "inertia": fresh.value("inertia")}), beside)


def held_at_plate(problem: Problem, fit: Fit, names: Sequence[str]) -> Fit:
    """All else fitted with these of the four held at what the plate tells of them."""
    plate = dict(zip(FOUR, prior(problem.record.plate).typical.as_tuple(), strict=True))
    machine = fit.machine.with_values({name: plate[name] for name in names})
    fixed = {AT[name] for name in names}
    others = [c for c in fit.columns if c.kind != "p" or c.index not in fixed]
    return refine(problem, machine, others, tolerance=NEAR)


def _with_inertia(problem: Problem, machine: Machine, free: Sequence[str], *, knots: bool) -> Fit:
    """The fit with an inertia of its own where the recording tells it, from the best of several that are held.

    Held at an assumed one, ten times the true, a healthy motor's R_R was 12 % off (six standard errors) and a leakage that saturates was
    named. Where the recording tells nothing of it, it draws nothing aside either.
    """
    assumed, part = machine.value("inertia"), problem.cut(TELLING_S)
    columns = columns_of(free, part.record, machine, knots=knots)
    held = [refine(part, machine.with_values({"inertia": share * assumed}), columns) for share in ASSUMED_SHARES]
    fit = min(held, key=lambda f: f.chi2)
    if part.until != problem.until:
        fit = refine(problem, _carried_on(fit), columns_of(free, problem.record, machine, knots=knots))
    both = np.concatenate([fit.jacobian, jacobian(problem, fit.machine, (INERTIA,))])
    wide = replace(fit, columns=(*fit.columns, INERTIA), slopes=Slopes.known(both))
    if wide.std("inertia") > OPEN_INERTIA * fit.machine.value("inertia"):
        return fit
    return refine(problem, fit.machine, wide.columns, first_jacobian=wide.jacobian)


def _carried_on(fit: Fit) -> Machine:
    """The machine with its load's mean where its windows went on behind what was fitted."""
    knots = fit.machine.knots.copy()
    for k, own in enumerate(knots):
        fitted = [c.index for c in fit.columns if c.kind == "k" and c.window == k]
        if fitted:
            own[max(fitted) + 1 :] = own[fitted].mean()
    return replace(fit.machine, knots=knots)


def _run_up_s(record: Record) -> float:
    """How long the current is that of a start, s."""
    for w in record.windows:
        if w.is_from_rest:
            return max(float(np.sum(w.state == 1)) * record.period_s, 0.05)
    return ASSUMED_RUN_UP_S
