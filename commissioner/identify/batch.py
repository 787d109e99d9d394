"""Batch nonlinear least squares over segments: shared machine, inverter and iron, each segment's own offset and state.

Levenberg-Marquardt on the output error with the exact sensitivities of `output_error` (one compiled pass per
iteration). Covariance: inverse information times the residual variance, widened where scores of stretches of the
record scatter more than a white residual would make them (block sandwich; P. J. Huber 1967, H. White, Econometrica 48,
1980).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

from commissioner.identify import output_error
from commissioner.identify.compensation import Compensation
from commissioner.identify.resistance import InverterError
from commissioner.identify.whiteness import Whiteness, whiteness
from commissioner.motor.circuit import Gamma, InverseGamma, Quantity
from commissioner.motor.standstill import held_input
from commissioner.records import Signal

Matrix = NDArray[np.float64]
TABLE_ROWS = 2049
SCORE_BLOCK_S = 0.25
CURRENT_MARGIN = 1.5
LEG_DOUBT = 0.004
"""What the drawn leg error may be off from the real one, of its plateau: it goes into R_s, over the largest current."""
FALL_OF_LEG = 0.001
"""How much of its largest value a leg error may fall from knot to knot, one standard deviation: physics lets it rise only."""
WIDEST = 50.0
"""A circuit value may move by this factor from its start: data that want more do not determine it."""
CIRCUIT, DELAY, SHARED, OWN = output_error.CIRCUIT, output_error.DELAY, output_error.SHARED, output_error.OWN


@dataclass(frozen=True)
class Segment:
    """One uninterrupted stretch: voltage along the axis held over each period, current along it at the period's
    start."""

    voltage_v: Signal
    current_a: Signal
    axis_deg: float
    starts_at_rest: bool
    kind: str = "multitone"
    weight: Signal | None = None


@dataclass(frozen=True)
class ModelChoice:
    """What beyond the linear circuit is fitted: `extra_powers` odd powers (3, 5, ...) of flux in the magnetizing
    current relative to `flux_scale_wb`, the inverter's leg error at `knots_a` (the first, 0, is not among them) and
    the height of its tail beyond the last knot, v_K + t (1 - x_K / x), a delay."""

    extra_powers: int = 0
    flux_scale_wb: float = 1.0
    knots_a: tuple[float, ...] = ()
    with_delay: bool = False
    with_offset: bool = True

    @property
    def size(self) -> int:
        return SHARED + self.extra_powers + self.leg_size

    @property
    def leg_size(self) -> int:
        return len(self.knots_a) + 1 if self.knots_a else 0

    def leg_points(self) -> Signal:
        """Currents at which a leg error is tabulated: the knots, then the tail to 30 times the last."""
        return np.concatenate([[0.0], self.knots_a, self.knots_a[-1] * np.geomspace(1.15, 30.0, 14)])

    def leg_basis(self) -> Matrix:
        """(points, coefficients): leg voltage at `leg_points` per unit of each coefficient."""
        points, count = self.leg_points(), len(self.knots_a)
        basis = np.zeros((points.size, count + 1))
        basis[1 : count + 1, :count] = np.eye(count)
        basis[count + 1 :, count - 1] = 1.0
        basis[count + 1 :, count] = 1.0 - self.knots_a[-1] / points[count + 1 :]
        return basis

    def leg_coefficients(self, leg: InverterError) -> Matrix:
        """The coefficients that come nearest to a leg error known otherwise."""
        knots = np.array(self.knots_a)
        at_knots = leg.leg_voltage_v(knots)
        far = leg.leg_voltage_v(knots[-1:] * 4.0)[0]
        return np.append(at_knots, (far - at_knots[-1]) / 0.75)

    @property
    def free_shared(self) -> NDArray[np.bool_]:
        free = np.ones(self.size, dtype=bool)
        free[DELAY] = self.with_delay
        return free


@dataclass(frozen=True)
class BatchFit:
    """The fit. `theta` holds (R_s, R_r, L_l, L_0, delay in s, magnetizing coefficients in A, leg voltages in V) of the
    Gamma circuit, `covariance` theirs (zero rows where not fitted)."""

    model: ModelChoice
    theta: Matrix
    covariance: Matrix
    sum_of_squares: float
    samples: int
    free_parameters: int
    residuals: tuple[Signal, ...]
    stator_flux_wb: tuple[Signal, ...]
    offsets_a: tuple[float, ...]
    iterations: int
    has_converged: bool
    condition: float
    sample_period_s: float
    sandwich_ratio: float

    @property
    def noise_a(self) -> float:
        return math.sqrt(self.sum_of_squares / max(self.samples - self.free_parameters, 1))

    @property
    def delay(self) -> Quantity:
        return Quantity(float(self.theta[DELAY]), math.sqrt(self.covariance[DELAY, DELAY]))

    @property
    def peak_flux_wb(self) -> float:
        return max(float(np.max(np.abs(f))) for f in self.stator_flux_wb)

    @property
    def gamma(self) -> Gamma:
        """The unsaturated machine."""
        r_s, r_r, l_l, l_0 = map(float, self.theta[:CIRCUIT])
        return Gamma(r_s, r_r, l_l, l_0)

    def criterion(self) -> float:
        """Bayesian information criterion: N ln(SSE/N) + p ln N."""
        n = self.samples
        return n * math.log(self.sum_of_squares / n + 1e-300) + self.free_parameters * math.log(n)

    def inverse_gamma_at(self, flux_wb: float) -> tuple[InverseGamma, Matrix]:
        """The secant machine at this peak stator flux and its (4, 4) covariance."""
        values = _secant(self.theta, self.model, flux_wb)
        jacobian = np.empty((4, self.theta.size))
        for j in range(self.theta.size):
            step = 1e-5 * abs(self.theta[j]) or 1e-7
            up, down = self.theta.copy(), self.theta.copy()
            up[j] += step
            down[j] -= step
            jacobian[:, j] = (_secant(up, self.model, flux_wb) - _secant(down, self.model, flux_wb)) / (2.0 * step)
        a, b, c, d = map(float, values)
        return InverseGamma(a, b, c, d), jacobian @ self.covariance @ jacobian.T

    def magnetizing_curve(self, points: int = 12) -> tuple[Signal, Signal, Signal]:
        """(stator flux, secant L_M, its std) over the range visited; nothing beyond it."""
        flux = np.linspace(0.05, 1.0, points) * self.peak_flux_wb
        machines = [self.inverse_gamma_at(float(f)) for f in flux]
        inductance = np.array([m.magnetizing_inductance_h for m, _ in machines])
        return flux, inductance, np.sqrt(np.array([c[3, 3] for _, c in machines]))

    def inverter(self) -> InverterError | None:
        """The leg error at its knots, None where it was not fitted."""
        if not self.model.leg_size:
            return None
        start = SHARED + self.model.extra_powers
        basis = self.model.leg_basis()
        std = np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", basis, self.covariance[start:, start:], basis), 0.0))
        values = basis @ self.theta[start:]
        return InverterError(tuple(self.model.leg_points().tolist()), tuple(values.tolist()), tuple(std.tolist()))

    def compensation(self, axis_deg: float, current_span_a: float) -> Compensation:
        """What an observer has to take off along this axis to see the unsaturated linear machine."""
        inverter = self.inverter()
        lost = inverter.on_axis(np.linspace(0.0, current_span_a, TABLE_ROWS), axis_deg) if inverter else np.zeros(1)
        flux = np.linspace(0.0, 1.2 * self.peak_flux_wb, TABLE_ROWS)
        extra = _extra_current(self.theta, self.model, flux) if self.model.extra_powers else np.zeros(1)
        return Compensation(lost, current_span_a, extra, float(flux[-1]), float(self.theta[DELAY]))

    def whiteness(self) -> Whiteness:
        return whiteness(self.residuals)


def fit_segments(
    segments: Sequence[Segment],
    sample_period_s: float,
    start: InverseGamma,
    model: ModelChoice | None = None,
    theta_start: Matrix | None = None,
    max_iterations: int = 40,
    tolerance: float = 1e-5,
) -> BatchFit:
    """Fit all segments jointly. `theta_start` (in the model's layout) overrides `start`.

    Stops when a step is below `tolerance` standard errors of every shared parameter (or 1e-10 of its value);
    `has_converged` says whether that was reached.
    """
    choice = model or ModelChoice()
    problem = _Problem(segments, sample_period_s, choice)
    theta = start_theta(start, choice) if theta_start is None else theta_start.copy()
    problem.bounds = (theta[:CIRCUIT] / WIDEST, theta[:CIRCUIT] * WIDEST)
    own = np.zeros((len(segments), OWN))
    present = problem.evaluate(theta, own)
    damping, converged, iterations = 1e-4, False, 0
    for _ in range(max_iterations):
        iterations += 1
        step = problem.step(present, theta, damping)
        new_theta, new_own = problem.apply(theta, own, step)
        trial = problem.evaluate(new_theta, new_own)
        if trial.squares <= present.squares * (1.0 + 1e-13):
            small = problem.is_small(step, present, theta, tolerance)
            flat = present.squares - trial.squares <= 1e-12 * present.squares
            theta, own, present = new_theta, new_own, trial
            damping = max(damping * 0.1, 1e-12)
            if small or (flat and damping <= 1e-8):
                converged = True
                break
        else:
            if damping > 1e8:
                break
            damping = max(damping, 1e-8) * 20.0
            if problem.is_small(step, present, theta, tolerance):
                converged = True
                break
    return problem.result(theta, own, present, iterations, converged)


@dataclass
class _Evaluation:
    squares: float
    information: Matrix
    score: Matrix
    block_scores: list[Matrix]
    residuals: list[Signal]
    flux: list[Signal]


class _Problem:
    """The joint least-squares problem: shared parameters first, then three of each segment."""

    def __init__(self, segments: Sequence[Segment], period_s: float, model: ModelChoice) -> None:
        self.segments = segments
        self.bounds = (np.zeros(CIRCUIT), np.full(CIRCUIT, np.inf))
        self.period_s = period_s
        self.model = model
        shared, count = model.size, len(segments)
        self.free = np.concatenate([model.free_shared, *[self._own_free(s) for s in segments]])
        self.current_span_a = CURRENT_MARGIN * max(float(np.max(np.abs(s.current_a))) for s in segments)
        self.bases = [self._basis(s.axis_deg) for s in segments]
        self.weights = [np.ones_like(s.voltage_v) if s.weight is None else s.weight for s in segments]
        self.noise_a2 = float(np.median([np.var(np.diff(s.current_a, 2)) for s in segments])) / 6.0
        self.samples = int(sum(float(np.sum(w > 0)) for w in self.weights))
        self.columns = [np.concatenate([np.arange(shared), shared + OWN * k + np.arange(OWN)]) for k in range(count)]
        self.total = shared + OWN * count

    def _own_free(self, segment: Segment) -> NDArray[np.bool_]:
        return np.array([self.model.with_offset, not segment.starts_at_rest, not segment.starts_at_rest])

    def _basis(self, axis_deg: float) -> Matrix:
        """(rows, coefficients): the axis voltage that a unit of each leg coefficient makes, over the axis current."""
        if not self.model.leg_size:
            return np.zeros((TABLE_ROWS, 0))
        points = tuple(self.model.leg_points().tolist())
        grid = np.linspace(0.0, self.current_span_a, TABLE_ROWS)
        legs = (InverterError(points, tuple(column)) for column in self.model.leg_basis().T.tolist())
        return np.ascontiguousarray(np.column_stack([leg.on_axis(grid, axis_deg) for leg in legs]))

    def evaluate(self, theta: Matrix, own: Matrix) -> _Evaluation:
        held = _held_with_derivatives(theta[:CIRCUIT], self.period_s)
        out = _Evaluation(0.0, np.zeros((self.total, self.total)), np.zeros(self.total), [], [], [])
        block = max(1, round(SCORE_BLOCK_S / self.period_s))
        for k, segment in enumerate(self.segments):
            columns = self.columns[k]
            information, score = np.zeros((columns.size, columns.size)), np.zeros(columns.size)
            scores = np.zeros((segment.voltage_v.size // block + 1, columns.size))
            residual, flux = np.empty_like(segment.current_a), np.empty_like(segment.current_a)
            shared = (information, score, block, scores, residual, flux)
            with np.errstate(over="ignore", invalid="ignore"):
                squares = self._simulate(k, held, theta, own[k], shared)
            scale = np.ones(columns.size)
            scale[DELAY] = 1.0 / self.period_s
            information = (information + np.tril(information, -1).T) * np.outer(scale, scale)
            out.squares += squares if math.isfinite(squares) else math.inf
            out.information[np.ix_(columns, columns)] += information
            out.score[columns] += score * scale
            wide = np.zeros((scores.shape[0], self.total))
            wide[:, columns] = scores * scale
            out.block_scores.append(wide)
            out.residuals.append(residual)
            out.flux.append(flux)
        self._hold_leg_rising(theta, out)
        return out

    def _hold_leg_rising(self, theta: Matrix, out: _Evaluation) -> None:
        """Add ((v_j - v_j+1) / s)^2 of the noise's variance where the leg error falls, and the same for a falling tail.

        A loss that falls with current and a larger R_s look alike; the data alone do not choose between them.
        """
        if not self.model.leg_size:
            return
        first, last = SHARED + self.model.extra_powers, self.model.size - 1
        weight = self.noise_a2 / (FALL_OF_LEG * max(float(np.max(np.abs(theta[first:last]))), 1e-3)) ** 2
        for lower, upper in ((k, k + 1) for k in range(first, last)):
            is_tail = upper == last
            fall = -theta[upper] if is_tail else theta[lower] - theta[upper]
            if fall <= 0.0:
                continue
            row = np.zeros(self.total)
            row[upper] = 1.0
            if not is_tail:
                row[lower] = -1.0
            out.squares += weight * fall * fall
            out.information += weight * np.outer(row, row)
            out.score += weight * fall * row

    def _simulate(
        self,
        k: int,
        held: tuple[Matrix, ...],
        theta: Matrix,
        own: Matrix,
        shared: tuple[Matrix, Matrix, int, Matrix, Matrix, Matrix],
    ) -> float:
        """One segment's pass; what it finds is written into `shared`. The linear machine has a kernel of its own."""
        segment, model = self.segments[k], self.model
        wanted = self.free[self.columns[k]].astype(np.float64)
        information, score, block, scores, residual, flux = shared
        if model.size == SHARED and not model.with_delay and theta[DELAY] == 0.0:
            kept = np.delete(np.arange(SHARED + OWN), DELAY)
            small = np.zeros((kept.size, kept.size)), np.zeros(kept.size), np.zeros((scores.shape[0], kept.size))
            ad, b1, _, dad, db1, _ = held
            squares = output_error.simulate_linear(
                segment.voltage_v,
                segment.current_a,
                self.weights[k],
                ad,
                b1,
                dad,
                db1,
                theta,
                own,
                wanted[kept],
                small[0],
                small[1],
                block,
                small[2],
                residual,
                flux,
            )
            information[np.ix_(kept, kept)], score[kept], scores[:, kept] = small
            return float(squares)
        before = 0.0 if segment.starts_at_rest else float(segment.voltage_v[0])
        ad, b1, b2, dad, db1, db2 = held
        return float(
            output_error.simulate(
                segment.voltage_v,
                segment.current_a,
                self.weights[k],
                before,
                ad,
                b1,
                b2,
                dad,
                db1,
                db2,
                theta,
                model.extra_powers,
                model.flux_scale_wb,
                self.bases[k],
                self.current_span_a,
                own,
                theta[DELAY] / self.period_s,
                wanted,
                information,
                score,
                block,
                scores,
                residual,
                flux,
            )
        )

    def step(self, at: _Evaluation, theta: Matrix, damping: float) -> Matrix:
        free = np.flatnonzero(self.free)
        information = at.information[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        normal = information / np.outer(scale, scale)
        normal[np.diag_indices_from(normal)] += damping + 1e-12
        step = np.zeros(self.total)
        step[free] = np.linalg.solve(normal, at.score[free] / scale) / scale
        relative = float(np.max(np.abs(step[:CIRCUIT]) / theta[:CIRCUIT]))
        leg = slice(SHARED + self.model.extra_powers, self.model.size)
        if self.model.leg_size:
            relative = max(relative, float(np.max(np.abs(step[leg]))) / max(float(np.max(np.abs(theta[leg]))), 1e-2))
        return np.asarray(step * min(1.0, 0.5 / max(relative, 1e-300)))

    def apply(self, theta: Matrix, own: Matrix, step: Matrix) -> tuple[Matrix, Matrix]:
        new_theta = theta + step[: self.model.size]
        new_theta[:CIRCUIT] = np.clip(new_theta[:CIRCUIT], *self.bounds)
        new_theta[DELAY] = float(np.clip(new_theta[DELAY], -self.period_s, 2.0 * self.period_s))
        return new_theta, own + step[self.model.size :].reshape(own.shape)

    def is_small(self, step: Matrix, at: _Evaluation, theta: Matrix, tolerance: float) -> bool:
        sigma2 = at.squares / max(self.samples, 1)
        shared = np.flatnonzero(self.model.free_shared)
        information = np.diag(at.information)[shared]
        steps = np.abs(step[shared])
        in_std = steps * np.sqrt(information / max(sigma2, 1e-300))
        return bool(np.all((in_std < tolerance) | (steps < 1e-10 * np.abs(theta[shared]))))

    def result(self, theta: Matrix, own: Matrix, at: _Evaluation, iterations: int, converged: bool) -> BatchFit:
        free = np.flatnonzero(self.free)
        information = at.information[np.ix_(free, free)]
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        normal = information / np.outer(scale, scale)
        inverse = np.linalg.pinv(normal, rcond=1e-14) / np.outer(scale, scale)
        sigma2 = at.squares / max(self.samples - free.size, 1)
        white = sigma2 * inverse
        scores = np.vstack(at.block_scores)[:, free]
        sandwich = inverse @ (scores.T @ scores) @ inverse
        ratio = np.sqrt(np.maximum(np.diag(sandwich) / np.maximum(np.diag(white), 1e-300), 1.0))
        # With few blocks the sandwich itself scatters: only what a white residual would not show counts.
        blocks = max(int(np.sum(np.any(scores != 0.0, axis=1))), 1)
        doubt = 1.0 + 2.0 / math.sqrt(2.0 * blocks)
        widen = np.where(ratio > doubt, ratio, 1.0)
        covariance = np.zeros((self.total, self.total))
        covariance[np.ix_(free, free)] = white * np.outer(widen, widen)
        shared = self.model.size
        if self.model.leg_size:
            plateau_v = float(np.max(np.abs(theta[SHARED + self.model.extra_powers : shared])))
            covariance[0, 0] += (LEG_DOUBT * plateau_v / (self.current_span_a / CURRENT_MARGIN)) ** 2
        return BatchFit(
            model=self.model,
            theta=theta,
            covariance=covariance[:shared, :shared],
            sum_of_squares=at.squares,
            samples=self.samples,
            free_parameters=int(free.size),
            residuals=tuple(at.residuals),
            stator_flux_wb=tuple(at.flux),
            offsets_a=tuple(map(float, own[:, 0])),
            iterations=iterations,
            has_converged=converged,
            condition=float(np.linalg.cond(normal)),
            sample_period_s=self.period_s,
            sandwich_ratio=float(np.max(ratio[:CIRCUIT])),
        )


def extended(fit: BatchFit, model: ModelChoice) -> Matrix:
    """A start for another model from a finished fit: what both have is kept, what is new starts at zero."""
    theta = np.zeros(model.size)
    theta[:SHARED] = fit.theta[:SHARED]
    old, new = fit.model.extra_powers, model.extra_powers
    common = min(old, new)
    ratio = model.flux_scale_wb / fit.model.flux_scale_wb
    powers = np.array([ratio ** (2 * m + 3) for m in range(common)])
    theta[SHARED : SHARED + common] = fit.theta[SHARED : SHARED + common] * powers
    leg = fit.inverter()
    if leg is not None and model.leg_size:
        theta[SHARED + new :] = model.leg_coefficients(leg)
    return theta


def cramer_rao(machine: InverseGamma, voltage_v: Signal, sample_period_s: float, noise_a: float) -> Matrix:
    """(4, 4): the bound on the covariance of (R_s, R_R, L_sigma, L_M) from this voltage, white noise, known start at
    rest."""
    columns = []
    for j, value in enumerate(machine.as_tuple()):
        pair = []
        for sign in (1.0, -1.0):
            moved = list(machine.as_tuple())
            moved[j] = value * (1.0 + sign * 1e-5)
            matrix, gain = held_input(InverseGamma(*moved), sample_period_s)
            b = [0.0, gain[0], matrix[0, 1] * gain[1] - matrix[1, 1] * gain[0]]
            a = [1.0, -float(np.trace(matrix)), float(np.linalg.det(matrix))]
            pair.append(lfilter(b, a, voltage_v))
        columns.append((pair[0] - pair[1]) / (2e-5 * value))
    jacobian = np.column_stack(columns)
    return np.asarray(noise_a**2 * np.linalg.inv(jacobian.T @ jacobian))


def start_theta(start: InverseGamma, model: ModelChoice, leg: InverterError | None = None) -> Matrix:
    """The model's parameter vector for a machine and, where it is modelled, a leg error."""
    gamma = Gamma.from_inverse_gamma(start)
    theta = np.zeros(model.size)
    theta[:CIRCUIT] = (
        gamma.stator_resistance_ohm,
        gamma.rotor_resistance_ohm,
        gamma.leakage_inductance_h,
        gamma.stator_inductance_h,
    )
    if leg is not None and model.leg_size:
        theta[SHARED + model.extra_powers :] = model.leg_coefficients(leg)
    return theta


def _extra_current(theta: Matrix, model: ModelChoice, flux_wb: Signal) -> Signal:
    relative = flux_wb / model.flux_scale_wb
    return np.asarray(sum(theta[SHARED + m] * relative ** (2 * m + 3) for m in range(model.extra_powers)))


def _secant(theta: Matrix, model: ModelChoice, flux_wb: float) -> Matrix:
    inductance = float(theta[3])
    if model.extra_powers and flux_wb > 0.0:
        extra = float(_extra_current(theta, model, np.array([flux_wb]))[0])
        inductance = flux_wb / (flux_wb / inductance + extra)
    machine = Gamma(float(theta[0]), float(theta[1]), float(theta[2]), inductance)
    return np.array(machine.as_inverse_gamma().as_tuple())


def _held_with_derivatives(circuit: Matrix, period_s: float) -> tuple[Matrix, ...]:
    """(Ad, b1, b2, dAd, db1, db2): held and ramp response of (psi_s, psi_R) and derivatives, by complex steps."""
    ad, b1, b2 = (x.real.copy() for x in _held(circuit.astype(np.complex128), period_s))
    derivatives = []
    for j in range(CIRCUIT):
        moved = circuit.astype(np.complex128)
        moved[j] += 1e-30j
        derivatives.append([x.imag / 1e-30 for x in _held(moved, period_s)])
    dad, db1, db2 = (np.ascontiguousarray(np.array([d[k] for d in derivatives])) for k in range(3))
    return ad, b1, b2, dad, db1, db2


def _held(circuit: NDArray[np.complex128], period_s: float) -> tuple[NDArray[np.complex128], ...]:
    r_s, r_r, l_l, l_0 = circuit
    block = np.zeros((4, 4), dtype=np.complex128)
    block[0, :3] = -r_s * (1.0 / l_0 + 1.0 / l_l), r_s / l_l, 1.0
    block[1, :2] = r_r / l_l, -r_r / l_l
    block[:3] *= period_s
    block[2, 3] = 1.0
    exponential = expm(block)
    return exponential[:2, :2], exponential[:2, 2], exponential[:2, 3]
