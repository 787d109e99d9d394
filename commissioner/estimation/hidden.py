"""Causes that are in every motor or every record of it: in the fit where they explain all that is left of it, else how far they may have drawn it aside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.fit import Column, Fit, Machine, Problem, jacobian, refine
from commissioner.estimation.numbers import AT, DEFAULTS, FOUR
from commissioner.motor.circuit import InverseGamma

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Hidden:
    """`usual`: its size's standard deviation beforehand where a recording tells nothing, 0 of what is not in every motor, or draws nothing
    aside unseen; `of_law`: of what it moved, by one standard deviation, for its law is not known. `powers`: further numbers of its law, which count
    together with the size, and where `is_either` each tell it alone; `shapes`: others of it, free once it has a size. Causes of the same words are
    forms of one, and the one that fits best is it."""

    words: str
    size: str
    usual: float = 0.0
    of_law: float = 0.0
    powers: tuple[str, ...] = ()
    is_either: bool = False
    shapes: tuple[str, ...] = ()
    corner: str = ""
    corners: tuple[float, ...] = ()
    has_sign: bool = False
    is_of_inverter: bool = False
    is_sought: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """Of the numbers that are fitted for it."""
        return (self.size, *self.powers, *self.shapes, *([self.corner] if self.corner else []))

    @property
    def told_by(self) -> tuple[str, ...]:
        """By which of them it is seen."""
        return (self.size, *self.powers) if self.is_either else (self.size,)


HIDDEN = (
    Hidden("an iron loss", "iron_conductance", usual=0.02, of_law=0.33),
    Hidden(
        "current displacement in the bars", "bar_resistance", usual=1.0, of_law=0.1, corner="bar_corner",
        corners=(DEFAULTS["bar_corner"], 45.0, 420.0, 1300.0),
    ),
    Hidden("a time between currents and voltages", "delay", has_sign=True),
    Hidden("what the inverter's legs lose", "dead_voltage", corner="dead_knee", corners=(DEFAULTS["dead_knee"],), is_of_inverter=True),
    *(
        Hidden(
            "saturation of the main flux", f"{side}_saturation_1", powers=(f"{side}_saturation_2", f"{side}_saturation_3"),
            shapes=("leakage_split",) if side == "gap" else (),
        )
        for side in ("stator", "gap", "rotor")
    ),
    *(
        Hidden("saturation of the leakage", size, shapes=("leakage_knee", "leakage_bend"))
        for size in ("leakage_softness", "rotor_leakage_softness")
    ),
    Hidden("heating of the windings", "stator_heat", usual=0.01, powers=("rotor_heat",), is_either=True),
    *(Hidden("unlike gains of the voltages", f"voltage_gain_{part}", usual=0.001, has_sign=True, is_sought=False) for part in ("re", "im")),
)  # fmt: skip
"""Usual sizes: a loss of 2 % of rated apparent power, bars that double R_R at starting slip, gains of three voltages that make 0.1 % of unbalance. In one steady load nothing is left of either: with a second
cage and an iron loss R_s was 15 % off at a stated 0.3 %, R_R of an iron loss alone 4.6 % at 0.02 %, and the residual white.

Of laws: whether an iron loss acts on the stator's flux or on the air gap's is not told. (Another simulator's, at the air gap, fitted behind R_s: R_s
0.9 % low where it had been 2.2 % high, L_M 0.3 % low for 0.5 % high.) Of bars a corner is fitted; from 7 to 200 Hz they differ (held at 22 Hz: a
double cage of 95 Hz left L_sigma 21 % off, five stated errors, R_s 9 %)."""

LEAST_GAIN = 36.0
"""Of chi-square, for each further number: what a name asks for."""
SURE = 0.2
"""Standard deviation of such a size, of itself, from which the recording tells it."""
MOST_DELAY = 1.5
"""Sample periods: what a cubic through four samples can be moved by."""
ALL_OF_IT, BY_CHANCE = 0.02, 5.0
"""What may be left: a share of what was gained, and standard deviations of the noise's own chi-square."""
AS_NOISE = 0.05
"""Of the noise's power, which is known to some per cent itself, as much may be left as well: a quarter of the noise, of which nothing is said."""
LEAST_SHARE, MOST_OF_IT = 0.01, 0.5
"""Of what the first ones gained: less is what their laws leave, simpler than nature's, unless it is this share of all that is left (of an iron loss beside
bars)."""
LEAST_OF_REST = 0.25
"""Of what was left, that a cause must take when refitted for others to be looked for: what none of these makes (shorted turns, a line's resistance)
cost 24 and 31 s and was never explained; motors that do all of these lose none of them by it."""


def with_told(problem: Problem, fit: Fit) -> Fit:
    """The fit with those of the causes that explain together all that the four leave; else as it was.

    What an iron loss leaves tells its size, and only by a straight line how far it drew the four aside (starts of five motors with 2 % of loss: R_R 2.0
    to 2.2 % off so, 0.07 to 0.15 % in the fit). Where more is left another cause may lend them its own size. The one that gains most is
    taken first: a loss that is not there, asked for beside bars, kept these out.
    """
    if problem.record.has_one_load:
        return fit
    wide, open_ = fit, [h for h in HIDDEN if h.is_sought and (not h.is_of_inverter or problem.record.is_commanded)]
    while open_:
        gains = [_best(problem, wide, hidden) for hidden in open_]
        best = int(np.argmax([gain for gain, _ in gains]))
        least = min(LEAST_SHARE * (fit.chi2 - wide.chi2), MOST_OF_IT * _left(wide))
        if gains[best][0] < max(LEAST_GAIN, least):
            break
        left = _left(wide)
        forms = sorted((k for k, h in enumerate(open_) if h.words == open_[best].words), key=lambda k: -gains[k][0])
        wide = _best_form(problem, wide, [(gains[k][1], open_[k]) for k in forms])
        open_ = [hidden for k, hidden in enumerate(open_) if k not in forms]
        if _left(wide) > max(_by_chance(wide), AS_NOISE * fit.count, (1.0 - LEAST_OF_REST) * left):
            return fit
    unsure = {AT[n] for h in told_in(wide) if not _is_sure(problem, wide, h) for n in h.names}
    if unsure:
        kept = [c for c in wide.columns if c.kind != "p" or c.index not in unsure]
        none = {n: 0.0 for h in HIDDEN if AT[h.size] in unsure for n in (h.size, *h.powers)}
        wide = refine(problem, wide.machine.with_values(none), kept)
    gain, more = fit.chi2 - wide.chi2, len(wide.columns) - len(fit.columns)
    is_all = _left(wide) < max(ALL_OF_IT * gain, _by_chance(wide), AS_NOISE * fit.count)
    is_sure = all(_is_sure(problem, wide, h) for h in told_in(wide))
    return wide if is_all and is_sure and gain > LEAST_GAIN * max(more, 1) else fit


def told_in(fit: Fit) -> tuple[Hidden, ...]:
    """The causes that are in the fit."""
    return tuple(h for h in HIDDEN if Column("p", AT[h.size]) in fit.columns)


def _left(fit: Fit) -> float:
    return fit.chi2 - fit.count


def _by_chance(fit: Fit) -> float:
    return float(BY_CHANCE * np.sqrt(2.0 * fit.count))


def _is_sure(problem: Problem, fit: Fit, hidden: Hidden) -> bool:
    size, std = _size_of(fit, hidden)
    if hidden.has_sign:
        size = abs(size) if abs(size) < MOST_DELAY * problem.period else 0.0
    return size * SURE > std


def _size_of(fit: Fit, hidden: Hidden) -> tuple[float, float]:
    """What its law adds in all, and the standard deviation of that with the law's shapes as they are: along these it is not told."""
    names = (hidden.size, *hidden.powers)
    own, shapes = ([fit.place(name) for name in group] for group in (names, hidden.shapes))
    covariance = fit.covariance()
    beside = covariance[np.ix_(own, shapes)]
    variance = np.sum(covariance[np.ix_(own, own)]) - np.sum(
        beside @ np.linalg.pinv(covariance[np.ix_(shapes, shapes)]) @ beside.T
    )
    return sum(fit.machine.value(name) for name in names), float(np.sqrt(max(variance, 0.0)))


def _with(problem: Problem, fit: Fit, machine: Machine, hidden: Hidden) -> Fit:
    """Refitted with the cause, its powers and shapes free once it has a size: without one it says nothing."""
    size, *more = (Column("p", AT[name]) for name in hidden.names)
    fit = refine(problem, machine, (*fit.columns, size), is_final=not more)
    return refine(problem, fit.machine, (*fit.columns, *more)) if more else fit


def _best_form(problem: Problem, fit: Fit, forms: Sequence[tuple[Machine, Hidden]]) -> Fit:
    """Refitted with the form that fits best; the first that leaves nothing is as good as any."""
    tried = []
    for machine, hidden in forms:
        tried.append(_with(problem, fit, machine, hidden))
        if _left(tried[-1]) < _by_chance(tried[-1]):
            break
    return min(tried, key=lambda form: form.chi2)


def _best(problem: Problem, fit: Fit, hidden: Hidden) -> tuple[float, Machine]:
    """Chi-square that the cause gains by a straight line, and the machine with the corner at which it gains most."""
    machines = _at_corners(fit.machine, hidden)
    gains = []
    for machine in machines:
        own, _ = _beside(problem, fit, machine, [Column("p", AT[name]) for name in hidden.told_by])
        along, squares = own @ fit.rest, np.maximum(np.sum(own**2, axis=1), 1e-300)
        gains.append(float(np.max(np.where(hidden.has_sign | (along > 0.0), along**2 / squares, 0.0))))
    best = int(np.argmax(gains))
    return gains[best], machines[best]


def _at_corners(machine: Machine, hidden: Hidden) -> list[Machine]:
    return [machine.with_values({hidden.corner: x}) for x in hidden.corners] or [machine]


def _beside(problem: Problem, fit: Fit, machine: Machine, columns: Sequence[Column]) -> tuple[Array, Array]:
    """What the columns' sensitivities have that those of the fit do not take up, and (columns, the fit's columns) what these take up."""
    along = jacobian(problem, machine, columns)
    taken = along @ fit.jacobian.T @ fit.influence()
    return along - taken @ fit.jacobian, taken


def drawn_aside(problem: Problem, fit: Fit) -> Array:
    """(causes, columns): one standard deviation of the columns' numbers by each cause that is in every motor and not in the fit.

    Its size is what a usual one and the residual tell together (a Gaussian prior, and what its sensitivity has that the columns do not
    take up): a start tells the bars, one steady load leaves them as they are usual. Of several corners the one that the residual tells best.
    """
    moves, told = [np.zeros((0, len(fit.columns)))], told_in(fit)
    for hidden, name in ((h, name) for h in HIDDEN if h.usual and h not in told for name in h.told_by):
        tried = []
        for machine in _at_corners(fit.machine, hidden):
            own, taken = _beside(problem, fit, machine, [Column("p", AT[name])])
            size2 = 1.0 / (1.0 / hidden.usual**2 + float(np.sum(own**2)) / fit.scale)
            found = size2 * float((own @ fit.rest)[0]) / fit.scale
            tried.append((found**2 / size2, np.sqrt(found**2 + size2) * taken))
        first, best = tried[0], max(tried, key=lambda x: x[0])
        moves.append((best if best[0] > first[0] + LEAST_GAIN / 2.0 else first)[1])
    return np.concatenate(moves)


def by_laws(fit: Fit, moves: Array) -> Array:
    """(causes, rows): what is not known of what the columns move by `moves` (rows, columns), for the law of a cause in the fit is not known: a
    share of what it moved them by, through the other numbers and by itself (of bars, what leaks in them at small slip)."""
    covariance, rows = fit.covariance(), []
    for hidden in told_in(fit):
        if hidden.of_law:
            own = fit.place(hidden.size)
            size = hidden.of_law * fit.machine.value(hidden.size)
            rows += [size * (moves @ covariance[:, own]) / covariance[own, own], size * moves[:, own]]
    return np.array(rows).reshape(-1, len(moves))


def at_small_slip(values: Mapping[str, float]) -> InverseGamma:
    """The four as a running motor's slip shows them: of bars the part that leaks, k R_R / w_b, is leakage there.

    What the fit calls L_sigma is that of currents faster than the bars' corner, which another form of bars has elsewhere or nowhere: of three
    rotors of deep bars (tanh law) it was 3.1, 7.6 and 9.9 % below that of small slip at stated 0.02 to 0.4 %, R_R 0.4 to 1.4 % above; so 0.03 to 0.1 %.
    """
    fast = InverseGamma(*(values[name] for name in FOUR))
    return fast.with_rotor_leakage(values["bar_resistance"] * values["rotor_resistance"] / values["bar_corner"])
