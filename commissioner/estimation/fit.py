"""The fit of one machine to windows: simulation, exact sensitivities, Levenberg-Marquardt, covariance, what was held out."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from commissioner.estimation.cancelling import ask_for_time
from commissioner.estimation.checks import BLOCK_S
from commissioner.estimation.kernels.march import NO_ROW, STATES, UNSET, Directions, Load, march, tangents
from commissioner.estimation.kernels.whitening import whiten
from commissioner.estimation.noise import Noise, plain_noise
from commissioner.estimation.numbers import AT, COUNT, DEFAULTS, FOUR, LOGARITHMIC, NAMES, OF_ANGLE
from commissioner.estimation.record import STATES as RECORD_STATES
from commissioner.estimation.record import Record
from commissioner.estimation.told import Slopes, Told, told
from commissioner.estimation.window import Window, first_part

Array = NDArray[np.float64]
BUSY = RECORD_STATES.index("transient")
FIRST = (0, 1, 2, 3)
"""Numbers of a window's first state that are free: both fluxes. (8 is the speed, where the shaft is modelled and already turns.)"""
LARGEST_STEP = 0.7
"""Of a logarithm in one step: a factor of 2."""
ENDED = 0.05
"""Change of chi-square below which a fit has ended; a name needs 36."""
MOST_STEPS = 50
"""Of a fit that is to end by itself. Along the valley of an unknown shaft 12 and 25 ended early: what was left to gain, 200 of chi-square, was
gained by whatever cause was tried next."""
SLOW = 0.3
"""Of the last step's gain: a step that gains more asks for a new Jacobian."""
LEAST_OPEN = 0.05
"""Standard deviation of a logarithm that is worth a word."""
OPEN_SHARE = 0.2
"""Of what an open direction moves most among the machine's numbers, from which one of the four is open however long the recording: its deviation shrinks with
the samples, the noise's share in it does not. (Eleven steady seconds: R_R 88 % off with 1.3 % stated. A load's ripple tells the inertia so: 0.02.)"""
AT_FOUR = frozenset(AT[n] for n in FOUR)
EDGE = 2
"""Samples at each end of a window that an interpolated delay has no neighbours for."""


@dataclass(frozen=True)
class Column:
    """One free number: `kind` p (a number of the machine), w (what a window has beside it), x (first state of a window), k (knot of the
    load torque)."""

    kind: str
    index: int
    window: int = 0


INERTIA = Column("p", AT["inertia"])


@dataclass(frozen=True)
class Machine:
    """Numbers in fit coordinates (logarithms of the positive ones), first states (windows, states), knots of the load and their
    times (windows, knots); `beside` (windows, numbers): what each window has beside the numbers."""

    theta: Array
    first: Array
    knots: Array
    knot_times_s: Array
    beside: Array
    has_shaft: bool = False

    def load(self, window: int, count: int, period_s: float) -> Load:
        """The window's knots, and where its samples and what lies between them fall among them."""
        if not self.has_shaft:
            return Load(self.knots[window], np.zeros(2 * count - 1))
        times = self.knot_times_s[window]
        places = np.interp(0.5 * period_s * np.arange(2 * count - 1), times, np.arange(times.size))
        return Load(self.knots[window], np.asarray(places))

    def physical(self, window: int = 0) -> Array:
        """As the kernel takes them for a window."""
        p = self.theta + self.beside[window]
        for k in LOGARITHMIC:
            p[k] = np.exp(p[k])
        return np.asarray(p)

    def values(self) -> dict[str, float]:
        """All numbers by name, as the first window has them."""
        return dict(zip(NAMES, self.physical().tolist(), strict=True))

    def slope(self) -> Array:
        """d physical / d theta."""
        d = np.ones(COUNT)
        for k in LOGARITHMIC:
            d[k] = np.exp(self.theta[k])
        return d

    def value(self, name: str) -> float:
        """A number by name, SI or relative."""
        return float(self.physical()[AT[name]])

    def moved(self, columns: Sequence[Column], step: Array) -> Machine:
        """With the columns' numbers changed by `step`."""
        theta, beside, first, knots = self.theta.copy(), self.beside.copy(), self.first.copy(), self.knots.copy()
        for column, s in zip(columns, step, strict=True):
            if column.kind == "p":
                theta[column.index] += s
            elif column.kind == "w":
                beside[column.window, column.index] += s
            elif column.kind == "x":
                first[column.window, column.index] += s
            else:
                knots[column.window, column.index] += s
        return replace(self, theta=theta, beside=beside, first=first, knots=knots)

    def with_values(self, values: dict[str, float]) -> Machine:
        """With numbers set, in physical units, alike in every window."""
        theta, beside = self.theta.copy(), self.beside.copy()
        for name, value in values.items():
            k = AT[name]
            theta[k] = np.log(value) if k in LOGARITHMIC else value
            beside[:, k] = 0.0
        return replace(self, theta=theta, beside=beside)


def plain_machine(four: Sequence[float], record: Record, *, inertia: float = 0.0, has_shaft: bool = False) -> Machine:
    """Four numbers, nothing added, motors at rest or with the flux of their voltage."""
    theta = np.zeros(COUNT)
    values = dict(DEFAULTS) | dict(zip(NAMES[:4], four, strict=True)) | ({"inertia": inertia} if inertia else {})
    times = knot_times(record) if has_shaft else np.zeros((len(record.windows), 2))
    first = np.zeros((len(record.windows), STATES))
    for k, w in enumerate(record.windows):
        if not w.is_from_rest:
            first[k, 10] = UNSET
            first[k, 0:4] = [w.voltage[0, 1], -w.voltage[0, 0]] * 2 / np.array(record.scales.frequency_rad_per_s)
            before = record.windows[max(k - 1, 0)]  # the shaft still turns with its field
            first[k, 8] = before.direction * (1 - record.plate.rated_slip) * record.scales.frequency_rad_per_s
    beside = np.zeros((len(record.windows), COUNT))
    return Machine(theta, first, np.zeros(times.shape), times, beside, has_shaft).with_values(values)


CALM_S, BUSY_S, AROUND_S = 0.15, 5e-3, 0.03
"""Between knots of an unknown load where nothing changes, and around a load step, which reaches so far."""
MOST_BUSY = 160
"""Knots around all changes: a load that changes all the time has them wider apart (1200 took minutes)."""


def knot_times(record: Record, also: Sequence[NDArray[np.bool_]] = ()) -> Array:
    """(windows, knots), denser where the current changes after the start, and as dense as if nothing else did at the samples `also` of each window;
    short rows are filled up far beyond the end."""
    also = also or [np.zeros(w.count, bool) for w in record.windows]
    others = [(w.state == BUSY) & ~a for w, a in zip(record.windows, also, strict=True)]
    rows = []
    for w, *parts in zip(record.windows, _among_changes(record, others), _among_changes(record, also), strict=True):
        calm = np.arange(0.0, float(w.time_s[-1]) + CALM_S, CALM_S)
        rows.append(np.unique(np.concatenate([calm, *parts])))
    widest = max(r.size for r in rows)
    return np.array([np.concatenate([r, r[-1] + 1e3 * (1.0 + np.arange(widest - r.size))]) for r in rows])


def _among_changes(record: Record, is_busy: Sequence[NDArray[np.bool_]]) -> list[Array]:
    """Times of each window near what changes in it, as near each other as `MOST_BUSY` of all windows together allow."""
    spans = [_changes(w, mask, record.period_s) for w, mask in zip(record.windows, is_busy, strict=True)]
    apart = max(BUSY_S, sum(high - low for own in spans for low, high in own) / MOST_BUSY)
    return [np.concatenate([np.empty(0), *(np.arange(low, high, apart) for low, high in own)]) for own in spans]


def _changes(w: Window, is_busy: NDArray[np.bool_], period_s: float) -> list[tuple[float, float]]:
    """Begin and end of what is near a change, s."""
    is_near = np.pad(maximum_filter1d(is_busy, 2 * round(AROUND_S / period_s) + 1, mode="constant"), 1)
    begins, ends = (np.flatnonzero(np.diff(is_near.astype(int)) == sign) for sign in (1, -1))
    return [(float(w.time_s[b]), float(w.time_s[e - 1]) + period_s) for b, e in zip(begins, ends, strict=True)]


def with_knots_at(record: Record, fit: Fit, also: Sequence[NDArray[np.bool_]]) -> tuple[Machine, tuple[Column, ...]]:
    """The fitted machine with the same load told by denser knots at these samples of each window, and its columns."""
    return with_knot_times(record, fit, knot_times(record, also))


def with_knot_times(record: Record, fit: Fit, times: Array) -> tuple[Machine, tuple[Column, ...]]:
    """The fitted machine with the same load told by knots at these times (windows, knots), and its columns."""
    machine = fit.machine
    knots = np.array([np.interp(t, *own) for t, *own in zip(times, machine.knot_times_s, machine.knots, strict=True)])
    columns = tuple(c for c in fit.columns if c.kind != "k")
    denser = replace(machine, knots=knots, knot_times_s=times)
    return denser, (*columns, *_knots_of(record, denser))


@dataclass(frozen=True)
class Problem:
    """`until[k]`: samples of window k that are fitted; what follows is held out."""

    record: Record
    noise: Noise
    until: tuple[int, ...]

    @property
    def period(self) -> float:
        return self.record.period_s

    def whiten(self, x: Array) -> None:
        """(C, n, channels of the noise) in place: unit variance where only chance is left."""
        whiten(x, self.noise.taps, self.noise.per_zero)

    def cut(self, seconds: float) -> Problem:
        """Only so much of each window, for a fit that begins with little."""
        shorter = tuple(min(u, max(round(seconds / self.period), 60)) for u in self.until)
        windows = tuple(first_part(w, u) for w, u in zip(self.record.windows, shorter, strict=True))
        return replace(self, record=replace(self.record, windows=windows), until=shorter)


def problem_of(record: Record, held_out: float = 0.3) -> Problem:
    """White noise, and the last share of each window held out."""
    until = tuple(w.count if held_out == 0.0 else round((1.0 - held_out) * w.count) for w in record.windows)
    return Problem(record, plain_noise(record.sigma_a, record.has_zero), until)


def simulate(problem: Problem, machine: Machine) -> list[tuple[Array, Array]]:
    """Current (n, 3) and shaft (n, 2: electrical speed, torque) of each window. TimeOver: given up."""
    out = []
    scales = problem.record.scales.as_tuple()
    for k, w in enumerate(problem.record.windows):
        ask_for_time()
        run, shaft = np.empty((w.count, 3)), np.empty((w.count, 2))
        x = machine.first[k].copy()
        march(
            machine.physical(k),
            scales,
            x,
            w.voltage,
            w.speed,
            machine.load(k, w.count, problem.period),
            problem.period,
            machine.has_shaft,
            run,
            shaft,
        )
        out.append((run, shaft))
    return out


def residuals(problem: Problem, machine: Machine) -> list[Array]:
    """Measured less simulated, whitened, each window (n, 2 or 3); a run that flies away counts as enormous."""
    out = []
    for w, (run, _) in zip(problem.record.windows, simulate(problem, machine), strict=True):
        with np.errstate(all="ignore"):
            left = w.current - np.nan_to_num(run, nan=1e6, posinf=1e6, neginf=-1e6)
        rest = left[:, : problem.noise.channels].copy()
        problem.whiten(rest[None])
        rest[:EDGE] = 0.0
        rest[-EDGE:] = 0.0
        out.append(rest)
    return out


def fitted_part(problem: Problem, parts: Sequence[Array]) -> Array:
    """The fitted samples of all windows in one row; (C, n, m) gives (C, all)."""
    return np.concatenate(
        [x[..., :u, :].reshape(*x.shape[:-2], -1) for x, u in zip(parts, problem.until, strict=True)], axis=-1
    )


def held_part(problem: Problem, parts: Sequence[Array]) -> Array:
    """The held-out samples in one row."""
    return np.concatenate([x[u:].reshape(-1) for x, u in zip(parts, problem.until, strict=True)])


def jacobian(problem: Problem, machine: Machine, columns: Sequence[Column]) -> Array:
    """Whitened sensitivities of the simulated current, (columns, fitted samples x channels), cut as the residuals are. TimeOver: given up."""
    parts = []
    for k, (w, u) in enumerate(zip(problem.record.windows, problem.until, strict=True)):
        ask_for_time()
        own = [j for j, c in enumerate(columns) if c.kind == "p" or (c.kind in "wx" and c.window == k)]
        by_load = [j for j, c in enumerate(columns) if c.kind == "k" and c.window == k]
        knots = [columns[j].index for j in by_load]
        rows = np.full(len(own) + max(knots, default=-1) + 1, NO_ROW)
        rows[: len(own)] = own
        rows[len(own) + np.array(knots, dtype=np.int64)] = by_load
        white = np.empty((len(columns), u, problem.noise.channels))
        white[sorted({*range(len(columns))} - {*own, *by_load})] = 0.0
        _sensitivities(problem, machine, k, columns, rows, white)
        problem.whiten(white)
        white[:, :EDGE] = 0.0
        if u == w.count:
            white[:, -EDGE:] = 0.0
        parts.append(white.reshape(len(columns), -1))
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=1)


def _sensitivities(
    problem: Problem, machine: Machine, k: int, columns: Sequence[Column], rows: NDArray[np.int64], out: Array
) -> None:
    """Currents of window k by the numbers of the machine and of its own first state, and by the first knots of its load, into their `rows` of
    `out` (columns, n, channels)."""
    slope, w, u = machine.slope(), problem.record.windows[k], problem.until[k]
    numbers = sum(c.kind == "p" or (c.kind in "wx" and c.window == k) for c in columns)
    dp, dx = np.zeros((numbers, COUNT)), np.zeros((numbers, STATES))
    for row, column in enumerate(columns[j] for j in rows[:numbers]):
        if column.kind in "pw":
            dp[row, column.index] = slope[column.index]
        else:
            dx[row, column.index] = 1.0
    tangents(
        machine.physical(k), problem.record.scales.as_tuple(), machine.first[k], Directions(dp, dx, rows), w.voltage[: 2 * u - 1],
        w.speed[: 2 * u - 1], machine.load(k, u, problem.period), problem.period, machine.has_shaft, out,
    )  # fmt: skip


@dataclass(frozen=True)
class Fit:
    """`rest`: whitened residual of the fitted part, `slopes` where it ended; `held`: chi-square of the held-out part.
    `by_noise`: what the input's noise makes of the Jacobian's Gram matrix, `aside` (k, columns): by how much it may draw them aside besides; both from
    `unbiased`, nothing before."""

    machine: Machine
    columns: tuple[Column, ...]
    chi2: float
    rest: Array
    slopes: Slopes
    held: float
    held_count: int
    by_noise: Array | float = 0.0
    aside: Array | float = 0.0

    @property
    def jacobian(self) -> Array:
        """Whitened sensitivities (columns, samples)."""
        return self.slopes.jacobian

    @property
    def count(self) -> int:
        """Fitted numbers of the recording."""
        return int(self.rest.size)

    @property
    def scale(self) -> float:
        """Chi-square a sample, never below 1."""
        return max(self.chi2 / max(self.count - len(self.columns), 1), 1.0)

    def influence(self) -> Array:
        """By how much of its number each column's gradient moves the fit: the inverse of the Gram matrix."""
        return self.slopes.influence

    def covariance(self) -> Array:
        """Of the columns' numbers in fit coordinates, widened by what is left."""
        own, aside = self.told().covariance * self.scale, np.atleast_2d(self.aside)
        return np.asarray(own + aside.T @ aside)

    def not_told(self) -> tuple[str, ...]:
        """Of the four numbers those that noise of the input moves more than the motor does, by more than `LEAST_OPEN` or more than others."""
        return self._opened(self.told())

    def told(self) -> Told:
        """What the sensitivities tell of the columns' numbers, nothing else left. An open direction along which none of the four numbers
        is wide (the inertia that a load's ripple tells) is as far off as any other."""
        return self._told

    @cached_property
    def _told(self) -> Told:
        whole = told(self.slopes.gram, self.by_noise)
        return whole if self._opened(whole) else told(self.slopes.gram, 0.0)

    def _opened(self, whole: Told) -> tuple[str, ...]:
        reach = np.sqrt(whole.open.diagonal())
        most = max((x for c, x in zip(self.columns, reach, strict=True) if c.kind == "p"), default=0.0)
        is_open = (reach * np.sqrt(self.scale) > LEAST_OPEN) | ((reach > OPEN_SHARE * most) & (most > 0.0))
        return tuple(
            NAMES[c.index]
            for c, x in zip(self.columns, is_open, strict=True)
            if x and c.kind == "p" and c.index in AT_FOUR
        )

    def place(self, name: str) -> int:
        """Of a number among the columns; ValueError where it is not free."""
        return self.columns.index(Column("p", AT[name]))

    def std(self, name: str) -> float:
        """Of a number in its own unit; 0 where it is not free."""
        if Column("p", AT[name]) not in self.columns:
            return 0.0
        place = self.place(name)
        return float(np.sqrt(self.covariance()[place, place]) * self.machine.slope()[AT[name]])


def scattered(problem: Problem, fit: Fit) -> Array:
    """Covariance of the columns' numbers, never below what the sums of gradient over blocks of 20 ms scatter by, which hold what is left with a
    structure of its own (cluster-robust: Liang, Zeger 1986, DOI 10.1093/biomet/73.1.13)."""
    block = max(round(BLOCK_S / problem.period), 1) * (3 if problem.noise.has_zero else 2)
    sums = np.add.reduceat(fit.jacobian * fit.rest, np.arange(0, fit.count, block), axis=1)
    moves = fit.influence()
    scatter = np.sum((moves @ sums) ** 2, axis=1)
    wider = np.sqrt(np.maximum(scatter / np.maximum(fit.scale * moves.diagonal(), 1e-300), 1.0))
    return np.asarray(fit.covariance() * np.outer(wider, wider))


def made_of(fit: Fit, made: Callable[[Mapping[str, float]], Mapping[str, float]]) -> dict[str, tuple[float, Array]]:
    """What is made of the machine's numbers, by name: its value and by how much each column of the fit moves it."""
    values, slope = fit.machine.values(), fit.machine.slope()
    known = made(values)
    gradient = {name: np.zeros(len(fit.columns)) for name in known}
    for j, number in ((j, NAMES[c.index]) for j, c in enumerate(fit.columns) if c.kind == "p"):
        h = 1e-5 * max(abs(values[number]), 1e-4)
        for sign in (1.0, -1.0):
            moved = made({**values, number: values[number] + sign * h})
            for name in known:
                gradient[name][j] += sign * moved.get(name, known[name]) / (2.0 * h) * slope[AT[number]]
    return {name: (float(x), gradient[name]) for name, x in known.items()}


def numbers_of(names: Sequence[str], record: Record) -> tuple[Column, ...]:
    """The named numbers; of those that go with the shaft's angle also what each further window has beside the first, behind all."""
    places = [AT[name] for name in names]
    later = range(1, len(record.windows))
    return (*(Column("p", j) for j in places), *(Column("w", j, k) for k in later for j in places if j in OF_ANGLE))


def columns_of(names: Sequence[str], record: Record, machine: Machine, *, knots: bool = False) -> tuple[Column, ...]:
    """The named numbers, both fluxes of every window, the speed of one that turns already, knots of the load."""
    out = [*numbers_of(names, record)]
    for k, w in enumerate(record.windows):
        out += [Column("x", j, k) for j in FIRST]
        if machine.has_shaft and not w.is_from_rest:
            out.append(Column("x", 8, k))
    return (*out, *(_knots_of(record, machine) if knots else ()))


def _knots_of(record: Record, machine: Machine) -> Iterator[Column]:
    for k, w in enumerate(record.windows):
        yield from (Column("k", j, k) for j, t in enumerate(machine.knot_times_s[k]) if t < w.time_s[-1] + CALM_S)


class _Sensitivity:
    """A Jacobian (columns, samples), its products, and what steps with it have taught: Broyden's update, a simulation's worth, where the
    Jacobian of an unknown load costs some forty (C. G. Broyden, Math. Comp. 19, 1965; in units of each column's size)."""

    def __init__(self, jacobian: Array) -> None:
        self._first = jacobian
        self._learnt: list[tuple[Array, Array]] = []
        self._gram = jacobian @ jacobian.T

    def jacobian(self) -> Array:
        """With what was learnt."""
        learnt = self._first.copy() if self._learnt else self._first
        for weight, missed in self._learnt:
            for j, share in enumerate(weight):  # an outer product would be as large as the Jacobian
                learnt[j] += share * missed
        return learnt

    def _along(self, change: Array) -> Array:
        """The Jacobian times a row of samples."""
        out = self._first @ change
        for weight, missed in self._learnt:
            out += float(missed @ change) * weight
        return np.asarray(out)

    def step(self, rest: Array, columns: Sequence[Column], damping: float) -> Array:
        """Levenberg-Marquardt."""
        size = np.sqrt(np.maximum(np.diag(self._gram), 1e-30))
        scaled = self._gram / np.outer(size, size) + (damping + 1e-11) * np.eye(size.size)
        wanted = self._along(rest) / size
        try:
            step = np.linalg.solve(scaled, wanted) / size
        except np.linalg.LinAlgError:
            step = np.linalg.lstsq(scaled, wanted, rcond=None)[0] / size
        largest = max(
            (abs(s) for c, s in zip(columns, step, strict=True) if c.kind == "p" and c.index in LOGARITHMIC),
            default=0.0,
        )
        return np.asarray(step * min(1.0, LARGEST_STEP / max(largest, 1e-30)))

    def learn(self, step: Array, change: Array) -> None:
        """`change`: of the simulated current, which the Jacobian had told as `step` times itself."""
        missed = change - step @ self._first
        for earlier, own in self._learnt:
            missed -= float(step @ earlier) * own
        weight = step * np.maximum(np.diag(self._gram), 1e-30)
        weight /= max(float(step @ weight), 1e-300)
        along = self._along(missed)
        self._gram += (
            np.outer(weight, along) + np.outer(along, weight) + float(missed @ missed) * np.outer(weight, weight)
        )
        self._learnt.append((weight, missed))


@dataclass(frozen=True)
class Expected:
    """What the numbers are before a recording is seen: in fit coordinates, with standard deviations by name, and the chi-square a sample of what the
    machine cannot follow, which counts as noise beside them."""

    theta: Array
    stds: Mapping[str, float]
    scale: float = 1.0

    def rest(self, machine: Machine, columns: Sequence[Column]) -> Array:
        """Rows that draw the numbers there."""
        off = [self.theta[c.index] - machine.theta[c.index] if c.kind == "p" else 0.0 for c in columns]
        return np.asarray(off) * self.weights(columns)

    def weights(self, columns: Sequence[Column]) -> Array:
        """Of each column's row; none of one that may be anything."""
        stds = [self.stds.get(NAMES[c.index], np.inf) if c.kind == "p" else np.inf for c in columns]
        return np.asarray(np.sqrt(self.scale) / np.array(stds))


def refine(
    problem: Problem, machine: Machine, columns: Sequence[Column], *, most: int = MOST_STEPS, first_jacobian: Array | None = None,
    tolerance: float = ENDED, is_final: bool = True, expected: Expected | None = None,
) -> Fit:  # fmt: skip
    """Levenberg-Marquardt from `machine`; `first_jacobian` as known from near by.

    A Jacobian serves, and learns, as long as steps with it shrink fast (a simulation costs a fortieth of it). `is_final`: end
    with a fresh one.
    """

    def with_expected(rest: Array, machine: Machine) -> Array:
        return rest if expected is None else np.concatenate([rest, expected.rest(machine, columns)])

    def sensitivity() -> _Sensitivity:
        own = jacobian(problem, machine, columns)
        return _Sensitivity(own if expected is None else np.hstack([own, np.diag(expected.weights(columns))]))

    parts = residuals(problem, machine)
    rest = with_expected(fitted_part(problem, parts), machine)
    chi2, damping, is_fresh, before = float(rest @ rest), 0.0, False, np.inf
    known = None if first_jacobian is None else _Sensitivity(first_jacobian)
    for _ in range(most):
        if known is None:
            known, is_fresh, before = sensitivity(), True, np.inf
        step = known.step(rest, columns, damping)
        trial = machine.moved(columns, step)
        trial_parts = residuals(problem, trial)
        trial_rest = with_expected(fitted_part(problem, trial_parts), trial)
        gained = chi2 - float(trial_rest @ trial_rest)
        if gained > 0.0:
            known.learn(step, rest - trial_rest)
            machine, parts, rest, chi2 = trial, trial_parts, trial_rest, chi2 - gained
            damping *= 0.1
            if gained < tolerance * max(chi2 / rest.size, 1.0):
                break
            if gained > SLOW * before:
                known = None
            is_fresh, before = False, gained
        elif not is_fresh:
            if before < np.inf and -gained < tolerance:
                break
            known = None
        elif -gained < tolerance or damping > 1e6:
            break
        else:
            damping = max(10.0 * damping, 1e-3)
    if known is None or (is_final and not is_fresh):
        slopes = Slopes(lambda: jacobian(problem, machine, columns))
    else:
        slopes = Slopes(known.jacobian)
    held = held_part(problem, parts)
    return Fit(machine, tuple(columns), chi2, rest, slopes, float(held @ held), int(held.size))


def refreshed(problem: Problem, fit: Fit) -> Fit:
    """The same fit with the Jacobian of where it ended."""
    return replace(fit, slopes=Slopes(lambda: jacobian(problem, fit.machine, fit.columns)))
