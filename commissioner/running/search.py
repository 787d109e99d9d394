"""The search: nominal fit, noise through the machine, then causes forward, exchanged, backward, and whoever fits alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from commissioner.estimation.cancelling import TimeOver, given_up_by
from commissioner.estimation.fit import (
    Column,
    Fit,
    Machine,
    Problem,
    jacobian,
    numbers_of,
    refine,
    refreshed,
    with_knot_times,
)
from commissioner.estimation.noisy_input import chi2_by_own_noise, unbiased, with_noise_of
from commissioner.estimation.numbers import AT, NAMES
from commissioner.estimation.record import Record
from commissioner.estimation.told import Slopes
from commissioner.running.causes import CATALOGUE, always_tied
from commissioner.running.causes.cause import Form
from commissioner.running.nominal import (
    NEAR,
    grown_anew,
    held_at_plate,
    nominal,
    with_load_changes,
    with_turns_of_swing,
)
from commissioner.running.rules import RULES

Array = NDArray[np.float64]


MOST_ANEW = 30
"""Steps of a law's shape, once its size is found anew."""


@dataclass(frozen=True)
class Named:
    """A cause in one of its forms."""

    cause: str
    form: Form

    @property
    def numbers(self) -> tuple[str, ...]:
        """Those that are fitted."""
        return (*self.form.numbers, *self.form.spare)


@dataclass(frozen=True)
class Step:
    """One decision of the search: `screened`, `accepted`, `refused`, `exchanged`, `dropped`."""

    what: str
    cause: str
    form: str
    gain: float
    why: str = ""


WORSE = "what was held out gets worse"
BEYOND = "its size is one that physics does not allow"
OF_NOISE = "noise of the voltage alone may make all of it"
TRIFLE = "too small to matter"


@dataclass(frozen=True)
class Tried:
    """A candidate refitted: chi-square it gains, and why it is refused (empty where it is not)."""

    cause: Named
    fit: Fit
    gain: float
    why: str

    @property
    def worth(self) -> float:
        """Gain less what its numbers, among all that are free, would gain by chance: of those beside the same causes it tells the order."""
        return self.gain - RULES.each_further_number * self.fit.scale * len(self.fit.columns)

    @property
    def explains_all(self) -> bool:
        """Whether nothing is left for another."""
        return not self.why and self.fit.chi2 < RULES.nothing_left * self.fit.count


def so_far(steps: Iterable[Step]) -> tuple[str, ...]:
    """The causes that stand accepted after these steps."""
    names: list[str] = []
    for step in steps:
        if step.what == "accepted":
            names.append(step.cause)
        elif step.what == "dropped":
            names.remove(step.cause)
        elif step.what == "exchanged":
            names[names.index(step.cause)] = step.why
    return tuple(names)


@dataclass(frozen=True)
class Found:
    """What the search leaves: nominal and final fit, the causes taken in, gain of each, rivals (chi-square lost by taking them instead).

    `nearest`: the machine nearest to the currents, by which what is left is judged: what the noise of the input does is taken off the final fit's
    numbers, up to a twentieth of chi-square further off (30 000 samples of a healthy motor without a speed had 1.2 times the noise left in one block)."""

    problem: Problem
    nominal: Fit
    fit: Fit
    nearest: Machine
    accepted: tuple[Named, ...]
    gain: dict[str, float]
    rivals: dict[str, dict[str, float]]
    limits: dict[str, float]
    steps: tuple[Step, ...]
    is_complete: bool
    trifles: tuple[Tried, ...] = ()
    """What beside them gains enough, is surely there, and is too small to be named."""


@dataclass
class Search:
    """Fits with sets of causes; remembers the decisions."""

    problem: Problem
    base: Fit
    excluded: frozenset[str]
    observe: Callable[[Step], None]
    steps: list[Step] = field(default_factory=list)
    trifles: tuple[Tried, ...] = ()
    """Of the last round: what was too small to matter."""

    def say(self, step: Step) -> None:
        """Remember, and tell who listens."""
        self.steps.append(step)
        self.observe(step)

    def accept(self, one: Tried) -> None:
        """Remember that it was taken in."""
        self.say(Step("accepted", one.cause.cause, one.cause.form.name, one.gain / one.fit.scale))

    def candidates(self, without: Iterable[str]) -> list[Named]:
        """Every form that this recording could show."""
        record, known = self.problem.record, {*without, *self.excluded}
        return [
            Named(c.name, form) for c in CATALOGUE.values() if c.name not in known and c.needs(record)
            for form in c.forms if form.needs(record)
        ]  # fmt: skip

    def columns(self, causes: Sequence[Named]) -> tuple[Column, ...]:
        """All that is free with these causes."""
        return (*self.base.columns, *(column for c in causes for column in self.own(c.numbers)))

    def own(self, numbers: Sequence[str]) -> tuple[Column, ...]:
        """The columns of a cause's numbers in this recording."""
        return numbers_of(numbers, self.problem.record)

    def fitted(
        self, start: Machine, causes: Sequence[Named], near: Fit, *, first: Array | None = None, promised: float = 0.0
    ) -> Fit:
        """With these causes free; `near` is a fit near by, whose sensitivities serve as long as they do. `first`: Jacobian for the first
        step, without spare numbers then. `promised`: what the last cause is to gain beside `near`, else its way is sought anew."""
        if first is not None:
            own = [column for c in causes[-1:] for column in self.own(c.form.numbers)]
            before = self.columns(causes[:-1])
            start = refine(self.problem, start, (*before, *own), most=1, first_jacobian=first, is_final=False).machine
        start, columns = self._inside(start, causes), self.columns(causes)
        place = {column: row for row, column in enumerate(near.columns)}
        new = [c for c in columns if c not in place]
        rows = np.empty((len(columns), near.rest.size))
        rows[[j for j, c in enumerate(columns) if c in place]] = near.jacobian[
            [place[c] for c in columns if c in place]
        ]
        if new:
            rows[[j for j, c in enumerate(columns) if c not in place]] = jacobian(self.problem, start, new)
        fit = refine(self.problem, start, columns, most=10, first_jacobian=rows, is_final=False)
        return self._found_anew(fit, causes, near) if near.chi2 - fit.chi2 < promised else fit

    def _found_anew(self, fit: Fit, causes: Sequence[Named], near: Fit) -> Fit:
        """The better of this fit and of one that grows with the start, the last of the causes free all along: a search that ends worse than without
        it, or gains little of what a straight line tells, has lost its way along load and inertia of a run-up, and 50 steps do not lead it back."""
        record = self.problem.record
        if record.has_speed or not record.has_start or not {*near.columns} < {*fit.columns}:
            return fit
        *others, last = causes
        start = self._inside(near.machine.with_values(dict.fromkeys(last.form.numbers, 0.0)), causes)
        start = grown_anew(self.problem, start, last.form.numbers)
        bare = (*self.columns(others), *self.own(last.form.numbers))
        grown = refine(self.problem, start, bare, is_final=False)
        if last.form.spare:
            start = self._inside(grown.machine, causes)
            grown = refine(self.problem, start, fit.columns, most=MOST_ANEW, is_final=False)
        return min(fit, grown, key=lambda f: f.chi2)

    def _inside(self, machine: Machine, causes: Sequence[Named]) -> Machine:
        """A first step that left what a sign allows begins from little instead."""
        for one in causes:
            first = one.form.numbers[0]
            if one.form.spare and not one.form.is_signed and machine.value(first) <= 0.0:
                machine = machine.with_values({first: 0.02})
        return machine

    def is_plausible(self, fit: Fit, causes: Iterable[Named]) -> bool:
        """Whether every cause has a size that physics allows."""
        return not self.beyond(fit, causes)

    def beyond(self, fit: Fit, causes: Iterable[Named]) -> tuple[Named, ...]:
        """Those whose size is one that physics does not allow."""
        values, scales = fit.machine.values(), self.problem.record.scales
        return tuple(c for c in causes if not CATALOGUE[c.cause].is_plausible(values, scales))


def search(
    problem: Problem,
    *,
    excluded: Sequence[str] = (),
    observe: Callable[[Step], None] = lambda _: None,
    go_on: Callable[[], bool] = lambda: True,
) -> Found:
    """Names what the four-parameter machine gets wrong. DataRefused where not even that one can be fitted, TimeOver where `go_on` said
    no before it was: later the plain machine is what is left."""
    with given_up_by(go_on):
        problem, base = nominal(problem)
    seeking = Search(problem, base, frozenset(excluded), observe)
    try:
        with given_up_by(go_on):
            return _found(seeking)
    except TimeOver:
        plain = unbiased(seeking.problem, seeking.base)
        seen = seeking.base.machine
        return Found(seeking.problem, plain, plain, seen, (), {}, {}, {}, tuple(seeking.steps), is_complete=False)


def _found(seeking: Search) -> Found:
    fit = seeking.base
    accepted: tuple[Named, ...] = ()
    for round_ in range(RULES.most_causes):
        taken = (_beside_plate(seeking) if round_ == 0 else None) or _forward(seeking, fit, accepted)
        if taken is None:
            break
        fit, accepted = taken
        if round_ == 0:
            fit, accepted = _weighted(seeking, fit, accepted)
        fit = _settled(seeking, fit, accepted)
        fit, accepted = _exchanged(seeking, fit, accepted)
    fit, accepted = _backward(seeking, fit, accepted)
    shown, fit, accepted = _shown(seeking, fit, accepted)
    gain, rivals = _judged(seeking, fit, accepted)
    return Found(
        seeking.problem,
        shown if fit is seeking.base else unbiased(seeking.problem, seeking.base),
        shown,
        fit.machine,
        accepted,
        gain,
        rivals,
        _limits(seeking, fit, accepted),
        tuple(seeking.steps),
        is_complete=True,
        trifles=_surely_there(seeking, accepted),
    )


def _weighted(seeking: Search, fit: Fit, accepted: tuple[Named, ...]) -> tuple[Fit, tuple[Named, ...]]:
    """Both fits with the weights of a machine that is nearly right. Causes that have no size in physics by these are not taken: the next
    round tries anew, from nothing."""
    seeking.problem = with_noise_of(seeking.problem, fit.machine)
    seeking.base = refine(seeking.problem, seeking.base.machine, seeking.base.columns)
    fit = refine(seeking.problem, fit.machine, fit.columns)
    if seeking.is_plausible(fit, accepted):
        return fit, accepted
    for one in accepted:
        seeking.say(Step("dropped", one.cause, one.form.name, (seeking.base.chi2 - fit.chi2) / fit.scale, BEYOND))
    return seeking.base, ()


def _settled(seeking: Search, fit: Fit, accepted: tuple[Named, ...]) -> Fit:
    """Where something is left without a speed: the fit to its end, sought anew from the start on, and both it and the plain one with knots where
    the load changes: beside a cause that was not yet known nobody saw that, nor the valley that is the motor's."""
    problem, record = seeking.problem, seeking.problem.record
    if record.has_speed or fit.chi2 < RULES.nothing_left * fit.count:
        return fit
    denser = with_load_changes(problem, refine(problem, fit.machine, fit.columns))
    if record.has_start and denser.chi2 > RULES.nothing_left * denser.count:
        numbers = [n for c in accepted for n in c.form.numbers]
        anew = refine(problem, grown_anew(problem, denser.machine, numbers), denser.columns)
        denser = with_load_changes(problem, anew) if anew.chi2 < denser.chi2 else denser
    if not seeking.is_plausible(denser, accepted):
        return fit
    times = denser.machine.knot_times_s
    if times.shape != fit.machine.knot_times_s.shape or np.any(times != fit.machine.knot_times_s):
        seeking.base = refine(problem, *with_knot_times(record, seeking.base, times), tolerance=NEAR)
    return denser


def _shown(seeking: Search, fit: Fit, accepted: tuple[Named, ...]) -> tuple[Fit, Fit, tuple[Named, ...]]:
    """The fit less what the noise of the input does to it, with the fit and the causes that it stands for.

    A cause whose whole size that noise makes (nothing, or less, is left; or less than it may make) is none. Where only a limit of another
    kind is passed nothing is taken off: what is shown has sizes that physics allows.
    """
    shown = unbiased(seeking.problem, fit)
    beyond = seeking.beyond(shown, accepted)
    values, scales = shown.machine.values(), seeking.problem.record.scales
    nothing = [c for c in beyond if CATALOGUE[c.cause].is_less_than_nothing(values, scales)]
    for one in (*nothing, *(c for c in accepted if c not in nothing and _is_lost(shown, c))):
        others = tuple(c for c in accepted if c != one)
        less = _less(seeking, fit, accepted, accepted.index(one))
        if seeking.is_plausible(less, others):
            why = BEYOND if one in nothing else OF_NOISE
            seeking.say(Step("dropped", one.cause, one.form.name, (less.chi2 - fit.chi2) / fit.scale, why))
            return _shown(seeking, refreshed(seeking.problem, less), others)
    return (fit if beyond else shown), fit, accepted


def _surely_there(seeking: Search, accepted: tuple[Named, ...]) -> tuple[Tried, ...]:
    """The trifles that the noise of the input does not make, without what it does to their fits."""
    named = {one.cause for one in accepted}
    freed = (replace(t, fit=unbiased(seeking.problem, t.fit)) for t in seeking.trifles if t.cause.cause not in named)
    return tuple(t for t in freed if not _is_lost(t.fit, t.cause) and seeking.is_plausible(t.fit, (t.cause,)))


def _is_lost(shown: Fit, one: Named) -> bool:
    """Whether a cause that the currents tell is within three standard deviations of nothing, once the noise of the input is counted."""
    at = [shown.place(name) for name in one.form.numbers]
    values = np.array([shown.machine.value(name) for name in one.form.numbers])
    counted, bare = (
        float(values @ np.linalg.pinv(spread[np.ix_(at, at)]) @ values)
        for spread in (shown.covariance(), shown.influence() * shown.scale)
    )
    return counted < RULES.least_told and bare > RULES.least_gain


def _screen(seeking: Search, fit: Fit, causes: Sequence[Named]) -> list[tuple[float, Named, Array]]:
    """Linear gain of each form beside all that is free, best first, with its own sensitivities."""
    columns = [column for c in causes for column in seeking.own(c.form.numbers)]
    if not columns:
        return []
    all_own = jacobian(seeking.problem, fit.machine, columns)
    rest = fit.slopes.apart(fit.rest[None])[0]
    all_apart = fit.slopes.apart(all_own)
    out, at = [], 0
    for one in causes:
        size = len(seeking.own(one.form.numbers))
        own, apart = all_own[at : at + size], all_apart[at : at + size]
        at += size
        gram = apart @ apart.T + np.diag(1e-9 * np.maximum(np.sum(own * own, axis=1), 1e-30))
        best = np.linalg.solve(gram, apart @ rest)
        values = dict(zip(NAMES, fit.machine.physical(), strict=True)) | dict(zip(one.form.numbers, best, strict=False))
        gain = float(best @ (apart @ rest))
        if size == 1 and not CATALOGUE[one.cause].is_plausible(values, seeking.problem.record.scales):
            lowest = CATALOGUE[one.cause].range[0]
            gain = 0.0 if lowest == 0.0 and best[0] < 0.0 else gain
        out.append((gain, one, own))
    return sorted(out, key=lambda item: -item[0])


def _needed(seeking: Search, one: Named) -> float:
    return RULES.least_gain + RULES.each_further_number * (len(seeking.own(one.numbers)) - 1)


def _forward(seeking: Search, fit: Fit, accepted: tuple[Named, ...]) -> tuple[Fit, tuple[Named, ...]] | None:
    """The cause that gains most and holds on what was kept aside, or two that do so together; None where none does."""
    fit = fit if seeking.problem.record.has_speed or not accepted else with_turns_of_swing(seeking.problem, fit)
    tried = _tried(seeking, fit, fit, accepted)
    first = next((t for t in tried if not t.why), None)
    alone = next((t for t in tried if t.why == WORSE), None)
    if alone is not None and (first is None or alone.gain > first.gain + RULES.tie * alone.fit.scale):
        pair = (*accepted, alone.cause)
        both = next((t for t in _tried(seeking, fit, alone.fit, pair) if not t.why), None)
        if both is not None:
            seeking.accept(alone)
            seeking.accept(both)
            return refreshed(seeking.problem, both.fit), (*pair, both.cause)
    for one in tried:
        if not one.why:
            seeking.accept(one)
            return refreshed(seeking.problem, one.fit), (*accepted, one.cause)
        seeking.say(Step("refused", one.cause.cause, one.cause.form.name, one.gain / one.fit.scale, one.why))
    seeking.trifles = tuple(t for t in tried if t.why == TRIFLE)
    return None


def _beside_plate(seeking: Search) -> tuple[Fit, tuple[Named, ...]] | None:
    """The first cause from a motor that has the plate's values where something is left and noise alone tells a number; None where nothing is open.

    A fit that makes such a number explain what is left ends far off, where no cause gains anything: a broken bar under one steady load has
    its side bands at twice the slip, which R_R at 3.5 times the true put elsewhere.
    """
    problem, base = seeking.problem, seeking.base
    if problem.record.has_speed or base.chi2 < RULES.nothing_left * base.count:
        return None
    opened = unbiased(problem, base).not_told()
    if not opened:
        return None
    held = held_at_plate(problem, base, opened)
    taken = _forward(replace(seeking, base=held, steps=[], observe=lambda _: None), held, ())
    if taken is None:
        return None
    fit = refine(problem, taken[0].machine, seeking.columns(taken[1]))
    gain = base.chi2 - fit.chi2
    if _refusal(seeking, base, base, fit, taken[1], gain):
        return None
    seeking.accept(Tried(taken[1][-1], fit, gain, ""))
    return fit, taken[1]


def _tried(seeking: Search, held: Fit, fit: Fit, accepted: tuple[Named, ...]) -> list[Tried]:
    """The candidates that promise most beside `accepted`, refitted, best first; what was held out is judged against `held`."""
    screened = _screen(seeking, fit, seeking.candidates(c.cause for c in accepted))
    tried: list[Tried] = []
    for place, (gain, one, own) in enumerate(screened):
        if place >= RULES.tried and one.cause not in {t.cause.cause for t in tried if not t.why}:
            continue
        seeking.say(Step("screened", one.cause, one.form.name, gain / fit.scale))
        if gain < least_promise(seeking.problem.record, fit.count, fit.scale):
            continue
        if any(t.explains_all and t.cause.cause != one.cause for t in tried):
            continue  # whoever explains as much is told apart as its rival; another form of the same cause is not
        first = np.concatenate([fit.jacobian, own])
        hoped = RULES.kept_promise * gain if gain > max((t.gain for t in tried), default=0.0) else 0.0
        other = seeking.fitted(fit.machine, (*accepted, one), fit, first=first, promised=hoped)
        won = fit.chi2 - other.chi2
        tried.append(Tried(one, other, won, _refusal(seeking, held, fit, other, (*accepted, one), won)))
    return sorted(tried, key=lambda t: -t.worth)


def least_strength(record: Record) -> float:
    """Strength over noise that a name needs in such a recording."""
    if record.is_steady or record.has_one_load:
        return RULES.material_steady_sigma
    return RULES.material_sigma if record.has_speed else RULES.material_unheld_sigma


def least_promise(record: Record, count: int, scale: float) -> float:
    """Linear gain, in chi-square of so many samples, below which no refit would end in a name, or at one load in what moves a parameter
    though it is none."""
    material = 0.0 if record.has_one_load else least_strength(record) ** 2 * count
    return max(RULES.promising * RULES.least_gain * scale, RULES.promising_material * material)


def _refusal(seeking: Search, held: Fit, fit: Fit, other: Fit, causes: Sequence[Named], gain: float) -> str:
    """Why the last of these causes is not taken in beside those of `fit`; empty where it is."""
    if gain / other.scale < _needed(seeking, causes[-1]):
        return "gains too little"
    left = fit.chi2 - fit.count
    is_all_of_it = left > RULES.certain_left * fit.count and gain > RULES.all_of_it * left
    if gain < RULES.least_share * max(seeking.base.chi2 - fit.chi2, 0.0) and not is_all_of_it:
        return "gains less than what the laws of the accepted causes leave"
    if np.sqrt(gain / fit.count) < least_strength(seeking.problem.record):
        return TRIFLE
    if not seeking.is_plausible(other, causes):
        return BEYOND
    worse = other.held - held.held
    if worse / max(held.held / max(held.held_count, 1), 1.0) > RULES.hold_out_loss + 0.01 * gain:
        return WORSE
    return "" if _gains_by_own_noise(seeking, fit, other, causes[-1]) else OF_NOISE


def _gains_by_own_noise(seeking: Search, fit: Fit, other: Fit, one: Named) -> bool:
    """Whether the cause gains what a name asks for where each machine is weighted by the noise that it leaves itself.

    Under one load with 0.24 % of noise a healthy motor had a stator asymmetry of 3.0 +- 0.9 %: from a chi-square of 1.017 a sample, six times
    the true R_s gained 2701 by passing less of that noise; by each one's own nothing was gained.
    """
    before, after = (chi2_by_own_noise(seeking.problem, f.machine) for f in (fit, other))
    gain, scale = before - after, max(after / fit.count, 1.0)
    return gain / scale >= _needed(seeking, one) and gain >= least_strength(seeking.problem.record) ** 2 * fit.count


def _exchanged(seeking: Search, fit: Fit, accepted: tuple[Named, ...]) -> tuple[Fit, tuple[Named, ...]]:
    """Each cause against whoever looks alike, until none is better: another form beside it may have made its own the wrong one."""
    for k, one in enumerate(accepted[:-1]):  # the last one has just won against all
        others = tuple(c for j, c in enumerate(accepted) if j != k)
        for lost, rival, other in _rivals(seeking, fit, accepted, k, most=2):
            if lost < -RULES.tie * other.scale and seeking.is_plausible(other, (*others, rival)):
                seeking.say(Step("exchanged", one.cause, rival.form.name, -lost / other.scale, rival.cause))
                return _exchanged(seeking, refreshed(seeking.problem, other), (*others, rival))
    return fit, accepted


def _backward(seeking: Search, fit: Fit, accepted: tuple[Named, ...]) -> tuple[Fit, tuple[Named, ...]]:
    """Without each cause that the others make needless."""
    for one in accepted if len(accepted) > 1 else ():
        others = tuple(c for c in accepted if c != one)
        less = seeking.fitted(_without(fit.machine, one), others, fit)
        # without one that only bent a law, another may end where physics has no such size: the two stand together then
        if (less.chi2 - fit.chi2) / fit.scale < _needed(seeking, one) and seeking.is_plausible(less, others):
            seeking.say(Step("dropped", one.cause, one.form.name, (less.chi2 - fit.chi2) / fit.scale))
            return _backward(seeking, refreshed(seeking.problem, less), others)
    return fit, accepted


def _without(machine: Machine, one: Named) -> Machine:
    return machine.with_values(dict.fromkeys(one.form.numbers, 0.0))


def _less(seeking: Search, fit: Fit, accepted: Sequence[Named], k: int) -> Fit:
    """Without cause k. Of a single one that is the nominal fit, which is known."""
    others = tuple(c for j, c in enumerate(accepted) if j != k)
    return seeking.fitted(_without(fit.machine, accepted[k]), others, fit) if others else seeking.base


def _rivals(
    seeking: Search, fit: Fit, accepted: Sequence[Named], k: int, most: int, less: Fit | None = None
) -> list[tuple[float, Named, Fit]]:
    """Fits with cause k replaced by those that look alike: (chi-square lost, rival, fit); `less` is the one without either."""
    one, names = accepted[k], {c.cause for c in accepted}
    own_columns = set(seeking.own(one.numbers))
    own = np.array([j for j, c in enumerate(fit.columns) if c in own_columns])
    kept = np.array([j for j in range(len(fit.columns)) if j not in set(own.tolist())])
    others_free = Slopes.known(fit.jacobian[kept])
    mine = others_free.apart(fit.jacobian[own])
    candidates = [c for c in seeking.candidates(names) if c.cause not in always_tied(one.cause)]
    forms = (f for f in CATALOGUE[one.cause].forms if f.needs(seeking.problem.record))
    candidates += [Named(one.cause, f) for f in forms if f != one.form]
    columns = [column for c in candidates for column in seeking.own(c.form.numbers)]
    theirs = others_free.apart(jacobian(seeking.problem, fit.machine, columns))
    alike, at = [], 0
    for c in candidates:
        size = len(seeking.own(c.form.numbers))
        alike.append((_canonical(mine, theirs[at : at + size]), c))
        at += size
    alike.sort(key=lambda item: -item[0])
    out = []
    others = tuple(c for j, c in enumerate(accepted) if j != k)
    for place, (cosine, rival) in enumerate(alike):
        if cosine < RULES.least_cosine:
            break
        if place >= most and rival.cause != one.cause:
            continue
        less = less or _less(seeking, fit, accepted, k)
        other = seeking.fitted(less.machine, (*others, rival), less)
        out.append((other.chi2 - fit.chi2, rival, other))
    return out


def _canonical(a: Array, b: Array) -> float:
    qa, qb = np.linalg.qr(a.T)[0], np.linalg.qr(b.T)[0]
    return float(np.linalg.svd(qa.T @ qb, compute_uv=False).max(initial=0.0))


def _judged(
    seeking: Search, fit: Fit, accepted: Sequence[Named]
) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Of each cause: chi-square that comes back without it, and what each rival in its place loses."""
    gain: dict[str, float] = {}
    rivals: dict[str, dict[str, float]] = {}
    for k, one in enumerate(accepted):
        others = tuple(c for c in accepted if c != one)
        less = _less(seeking, fit, accepted, k)
        gain[one.cause] = max(less.chi2 - fit.chi2, 0.0)
        rivals[one.cause] = {}
        for lost, rival, other in _rivals(seeking, fit, accepted, k, 4, less):
            if rival.cause != one.cause and seeking.is_plausible(other, (*others, rival)):
                known = rivals[one.cause].get(rival.cause, np.inf)
                rivals[one.cause][rival.cause] = min(known, max(lost, 0.0))
    return gain, rivals


def _limits(seeking: Search, fit: Fit, accepted: Sequence[Named]) -> dict[str, float]:
    """Six standard deviations of each cause that was not found, in its first number's unit, beside all that was."""
    out: dict[str, float] = {}
    causes = seeking.candidates(c.cause for c in accepted)
    columns = [Column("p", AT[c.form.numbers[0]]) for c in causes]
    apart = fit.slopes.apart(jacobian(seeking.problem, fit.machine, columns))
    for one, x in zip(causes, apart, strict=True):
        limit = 6.0 * np.sqrt(fit.scale) / max(float(np.linalg.norm(x)), 1e-30)
        out[one.cause] = min(out.get(one.cause, np.inf), limit)
    return out
