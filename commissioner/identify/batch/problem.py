"""The joint least-squares problem of a batch fit: residuals, their derivatives, what is known beforehand.

Exact sensitivities come from `output_error` (one compiled pass per evaluation); the held and ramp responses of the
linear circuit and their derivatives from matrix exponentials.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from commissioner.identify.batch import modal, output_error
from commissioner.identify.batch.model import CIRCUIT, DELAY, OWN, SHARED, SPLIT, Matrix, ModelChoice
from commissioner.identify.batch.output_error import Asked, Held, Machine, Measured, Room, Shapes
from commissioner.identify.batch.segments import TABLE_ROWS, Segment
from commissioner.records import Signal, peak

SCORE_BLOCK_S = 0.25
CURRENT_MARGIN = 1.5
NEAR_ZERO, NEAR_ZERO_WHEN_LATE = 0.03, 0.25
"""Currents, of the largest, below which a period is taken in parts. Where the voltage arrives late, the current bends inside
the period and the loss, while it still rises, does not see the mean of its ends: L_M 1.6 %, R_R 0.5 % off at 150 of 200 us."""


MOST_KEPT = 4_000_000
"""Sensitivities that are kept for what is evaluated near by, 32 MB: a longer record is linearised at every step."""


@dataclass
class Evaluation:
    """`is_near`: with the sensitivities, and so the information, of a place near by."""

    squares: float
    information: Matrix
    score: Matrix
    block_scores: list[Matrix]
    residuals: list[Signal]
    flux: list[Signal]
    is_near: bool = False

    @property
    def is_finite(self) -> bool:
        """Whether the model could be simulated to the end of every segment."""
        return bool(np.isfinite(self.squares) and np.all(np.isfinite(self.information)))


class Problem:
    """The joint least-squares problem: shared parameters first, then three of each segment. `is_coarse`: for comparing
    models; only periods in which the current passes zero are done in parts."""

    def __init__(
        self, segments: Sequence[Segment], period_s: float, model: ModelChoice, *, is_coarse: bool = False
    ) -> None:
        self.segments = segments
        self.bounds = (np.zeros(CIRCUIT), np.full(CIRCUIT, np.inf))
        self.period_s = period_s
        self.model = model
        self.plateau_v = 1.0
        shared, count = model.size, len(segments)
        assert shared + OWN <= output_error.WIDTH, "of more numbers the compiled pass has no room"
        self.free = np.concatenate([model.free_shared, *[self._own_free(s) for s in segments]])
        self.current_span_a = CURRENT_MARGIN * max(peak(s.current_a) for s in segments)
        tables = {axis_deg: self._tables(axis_deg) for axis_deg in {s.axis_deg for s in segments}}
        self.tables = [tables[s.axis_deg] for s in segments]
        near = NEAR_ZERO_WHEN_LATE if model.with_delay and not is_coarse else NEAR_ZERO
        self.passes_zero = [self._passes_zero(s.current_a, near) for s in segments]
        self.weights = [np.ones_like(s.voltage_v) if s.weight is None else s.weight for s in segments]
        self.noise_a2 = float(np.median([np.var(np.diff(s.measured(s.current_a), 2)) for s in segments])) / 6.0
        self.samples = int(sum(float(np.sum(w > 0)) for w in self.weights))
        self.columns = [np.concatenate([np.arange(shared), shared + OWN * k + np.arange(OWN)]) for k in range(count)]
        self.total = shared + OWN * count
        self._keeps = sum(s.current_a.size for s in segments) * (shared + OWN) <= MOST_KEPT
        self._rows: list[Matrix] = []
        self._rows_of: Matrix | None = None
        """Of the place where the kept sensitivities were computed, its information."""
        if not model.with_drift:
            self.free[shared + OWN :: OWN] = False
            for columns in self.columns:
                columns[shared] = shared

    @staticmethod
    def _own_free(segment: Segment) -> NDArray[np.bool_]:
        return np.array([True, not segment.starts_at_rest, not segment.starts_at_rest])

    def _tables(self, axis_deg: float) -> tuple[Matrix, Matrix]:
        """(rows, coefficients): the axis voltage that a unit of each leg coefficient makes, over the axis current; its integral."""
        if self.model.leg is None:
            return np.zeros((TABLE_ROWS, 0)), np.zeros((TABLE_ROWS, 0))
        current_a = np.linspace(0.0, self.current_span_a, TABLE_ROWS)
        basis = np.ascontiguousarray(self.model.leg.on_axis(current_a, axis_deg))
        return basis, _from_zero(basis)

    def _passes_zero(self, current_a: Signal, near: float) -> NDArray[np.bool_]:
        """Periods in which the leg loss may turn round or bend, by the measured current: near zero beside what it moves in
        one."""
        if self.model.leg is None:
            return np.zeros(current_a.size, dtype=bool)
        moves = np.abs(np.diff(current_a, append=current_a[-1]))
        return np.asarray(np.abs(current_a) < near * self.model.leg.largest_a + 1.5 * moves)

    def _held(self, circuit: Matrix, *, is_linearised: bool) -> Held:
        """Responses and derivatives (zero where nothing is linearised) over a period and over a part of one, stacked."""
        periods = (self.period_s / parts for parts in (1, output_error.PARTS))
        both = (_held_with_derivatives(circuit, period_s, is_linearised=is_linearised) for period_s in periods)
        return Held(*(np.stack(pair) for pair in zip(*both, strict=True)))

    def expect_leg(self, theta: Matrix) -> None:
        """Of the leg error is expected what its kind allows at the plateau it has in `theta`."""
        self.plateau_v = max(float(np.max(np.abs(theta[self.model.leg_slice]), initial=0.0)), 1e-3)

    def squares(self, theta: Matrix) -> float:
        """The sum of squares with every segment from rest; infinite where the model runs away."""
        self.expect_leg(theta)
        found = self.evaluate(theta, np.zeros((len(self.segments), OWN)))
        return found.squares if found.is_finite else math.inf

    def knows(self, near: Evaluation) -> bool:
        """Whether the sensitivities of this evaluation are kept."""
        return near.information is self._rows_of

    def sensitivities(self, theta: Matrix, own: Matrix) -> tuple[Matrix, list[tuple[NDArray[np.int64], Matrix]]]:
        """Information (total, total), and what it is the sum of: of each segment the numbers it depends on, and how (samples, numbers).
        Of `beginnings`."""
        information = self.evaluate(theta, own, is_general=True).information
        scale = np.ones(self.model.size + OWN)
        scale[DELAY] = 1.0 / self.period_s
        return information, [(columns, rows * scale) for columns, rows in zip(self.columns, self._rows, strict=True)]

    def evaluate(
        self,
        theta: Matrix,
        own: Matrix,
        over: Evaluation | None = None,
        near: Evaluation | None = None,
        *,
        is_general: bool = False,
    ) -> Evaluation:
        """All segments simulated; the signals of `over`, which is not needed any more, are written over. With the sensitivities of
        `near`, where they are kept: under half the time. `is_general`: with sensitivities also where two modes would do."""
        is_linear = self.model.is_linear and theta[DELAY] == 0.0 and not is_general
        is_near = near is not None and self.knows(near)
        held = None if is_linear else self._held(theta[:CIRCUIT], is_linearised=not is_near)
        information = near.information if near is not None and is_near else np.zeros((self.total, self.total))
        out = Evaluation(0.0, information, np.zeros(self.total), [], [], [], is_near)
        if not is_near and not is_linear:
            self._rows = self._rows or self._room()
            self._rows_of = information if self._keeps else None
        block = max(1, round(SCORE_BLOCK_S / self.period_s))
        for k, segment in enumerate(self.segments):
            columns = self.columns[k]
            information, score = np.zeros((columns.size, columns.size)), np.zeros(columns.size)
            scores = np.zeros((segment.voltage_v.size // block + 1, columns.size))
            residual = over.residuals[k] if over else np.empty_like(segment.current_a)
            flux = over.flux[k] if over else np.empty_like(segment.current_a)
            shared = (information, score, block, scores, residual, flux)
            with np.errstate(over="ignore", invalid="ignore"):  # a trial step may run away
                if held is None:
                    squares = self._simulate_linear(k, theta, own[k], shared)
                else:
                    squares = self._simulate(k, held, theta, own[k], shared, is_linearised=not is_near)
                scale = np.ones(columns.size)
                scale[DELAY] = 1.0 / self.period_s
                information *= np.outer(scale, scale)
                out.squares += squares if math.isfinite(squares) else math.inf
                if not is_near:
                    out.information[np.ix_(columns, columns)] += information
                out.score[columns] += score * scale
            wide = np.zeros((scores.shape[0], self.total))
            wide[:, columns] = scores * scale
            out.block_scores.append(wide)
            out.residuals.append(residual)
            out.flux.append(flux)
        self._hold_leg(theta, out)
        return out

    def _hold_leg(self, theta: Matrix, out: Evaluation) -> None:
        """Add, in units of the noise's variance, what is known of a leg error beforehand: it rises with current, and its
        tail bends no more than a dead time's."""
        if self.model.leg is None:
            return
        part = self.model.leg_slice
        rows, missed = self.model.leg.expected(theta[part], self.plateau_v)
        out.squares += self.noise_a2 * float(missed @ missed)
        if not out.is_near:
            out.information[part, part] += self.noise_a2 * rows.T @ rows
        out.score[part] -= self.noise_a2 * rows.T @ missed

    def _simulate_linear(
        self, k: int, theta: Matrix, own: Matrix, shared: tuple[Matrix, Matrix, int, Matrix, Matrix, Matrix]
    ) -> float:
        """`_simulate` for ideal inverter, unsaturated iron and no delay: two modes, a tenth of the time."""
        segment = self.segments[k]
        information, score, block, scores, residual, flux = shared
        mode, flux_per_a, jacobian = modal.modes(theta[:CIRCUIT], own[1:], self.period_s)
        kept = np.delete(np.arange(SHARED + OWN), [DELAY, SPLIT])
        wanted = self.free[self.columns[k]].astype(np.float64)[kept]
        columns = np.where(np.arange(modal.MODAL) < CIRCUIT, 1.0, wanted)
        gathered = np.zeros((kept.size, kept.size)), np.zeros(kept.size), np.zeros((scores.shape[0], kept.size))
        root = np.zeros(0) if segment.weight is None else np.sqrt(segment.weight)
        asked = Asked(columns, *gathered[:2], block, gathered[2], residual, flux, np.zeros((0, 0)))
        squares = modal.modal_pass(segment.voltage_v, segment.current_a, root, mode, flux_per_a, own[0], asked)
        chain = jacobian * wanted
        information[np.ix_(kept, kept)] = chain.T @ gathered[0] @ chain
        score[kept], scores[:, kept] = chain.T @ gathered[1], gathered[2] @ chain
        return float(squares)

    def _simulate(
        self,
        k: int,
        held: Held,
        theta: Matrix,
        own: Matrix,
        shared: tuple[Matrix, Matrix, int, Matrix, Matrix, Matrix],
        *,
        is_linearised: bool,
    ) -> float:
        """One segment's pass; what it finds is written into `shared`. Not linearised: with the sensitivities that are kept."""
        segment, model = self.segments[k], self.model
        wanted = self.free[self.columns[k]].astype(np.float64)
        information, score, block, scores, residual, _ = shared
        before = 0.0 if segment.starts_at_rest else float(segment.voltage_v[0])
        machine = Machine(theta, np.array(model.exponents, dtype=np.int64), model.flux_scale_wb)
        shapes = Shapes(*self.tables[k], self.current_span_a)
        squares = output_error.simulate(
            Measured(segment.voltage_v, before, segment.current_a, self.weights[k], self.passes_zero[k]),
            held,
            machine,
            shapes,
            own,
            theta[DELAY] / self.period_s,
            Asked(wanted, *shared, self._rows[k]),
            is_linearised,
            Room.of(machine, shapes),
        )
        rows = self._rows[k]
        if rows.shape[0] == residual.size and math.isfinite(squares):
            if is_linearised:
                information += rows.T @ rows
            output_error.add_scores(rows, self.weights[k], residual, score, block, scores)
        return float(squares)

    def _room(self) -> list[Matrix]:
        """For the sensitivities of every sample, or where these are too many of one."""
        width = self.model.size + OWN
        return [np.empty((s.current_a.size if self._keeps else 1, width)) for s in self.segments]


def beginnings(segments: Sequence[Segment], model: ModelChoice) -> Sequence[Segment]:
    """The segments, of a record too long to keep its sensitivities the same share of each."""
    share = MOST_KEPT / ((model.size + OWN) * sum(s.current_a.size for s in segments))
    return segments if share >= 1.0 else [_beginning(s, max(int(share * s.current_a.size), 1)) for s in segments]


def _beginning(segment: Segment, rows: int) -> Segment:
    weight = None if segment.weight is None else segment.weight[:rows]
    return replace(segment, voltage_v=segment.voltage_v[:rows], current_a=segment.current_a[:rows], weight=weight)


def _from_zero(table: Matrix) -> Matrix:
    """Integral over the rows of a table, from the first on."""
    return np.vstack([np.zeros(table.shape[1]), np.cumsum(0.5 * (table[1:] + table[:-1]), axis=0)])


def _held_with_derivatives(circuit: Matrix, period_s: float, *, is_linearised: bool) -> tuple[Matrix, ...]:
    """(Ad, b1, b2, b_r, dAd, db1, db2, db_r): held and ramp response of (psi_s, psi_R), that to a voltage held on the rotor, and
    derivatives, by complex steps."""
    at = tuple(x.real.copy() for x in _held(circuit.astype(np.complex128), period_s))
    if not is_linearised:
        return (*at, *(np.zeros((CIRCUIT, *x.shape)) for x in at))
    derivatives = []
    for j in range(CIRCUIT):
        moved = circuit.astype(np.complex128)
        moved[j] += 1e-30j
        derivatives.append([x.imag / 1e-30 for x in _held(moved, period_s)])
    return (*at, *(np.ascontiguousarray(np.array(each)) for each in zip(*derivatives, strict=True)))


def _held(circuit: NDArray[np.complex128], period_s: float) -> tuple[NDArray[np.complex128], ...]:
    r_s, r_r, l_l, l_0 = circuit
    block = np.zeros((5, 5), dtype=np.complex128)
    block[0, :3] = -r_s * (1.0 / l_0 + 1.0 / l_l), r_s / l_l, 1.0
    block[1, :2] = r_r / l_l, -r_r / l_l
    block[1, 4] = 1.0
    block[:2] *= period_s
    block[2, 3] = 1.0
    exponential = expm(block)
    return tuple(exponential[:2, part] for part in (slice(0, 2), 2, 3, 4))
