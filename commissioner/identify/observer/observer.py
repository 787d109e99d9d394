"""The parallel adaptive observer: sample by sample from held voltages and sampled currents to the four parameters.

Two laws on the same observer (equations: `kernels`). `fast` is the recursive prediction-error method: least-squares
gain with the exact sensitivity, in UD form, no forgetting. What forgetting is usually needed for - a start far from
the truth - is done by (a) weighting each sample with the present residual's spectral density, so that data seen with a
wrong model weigh little, and (b) going over the stored data again from the present estimate whenever their number has
doubled, until `memory_s`; from then on the recursion runs alone in constant memory. `lyapunov` is the gradient law of
Castaldi & Tilli 2005 (h = 0, k = 1) with a constant gain matrix, dead zone and the SPR condition checked over the
prior box.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from commissioner.compiled import writable
from commissioner.identify.inverter.compensation import NOTHING, Compensation
from commissioner.identify.observer import kernels
from commissioner.identify.observer.coordinates import (
    PRIOR_LOG_STD,
    filter_poles,
    prior_covariance,
    regressor,
    require_margin,
    theta_jacobian,
    to_theta,
    ud_factors,
)
from commissioner.motor.circuit import InverseGamma
from commissioner.motor.nameplate import ParameterBox
from commissioner.records import Signal

Law = Literal["fast", "lyapunov"]
Errors = tuple[float, float, float, float]
Matrix = NDArray[np.float64]

OFFSET_STD = 0.02
"""Standard deviation of a current sensor's offset, of the current scale, before anything is known."""
NOISE_MEMORY_S = 0.1
FIRST_REVIEW_S = 0.3
LYAPUNOV_TIME_CONSTANT_S = 2.0


@dataclass(frozen=True)
class BlockEstimate:
    """What the observer knows after a block. Signals are `(n,)`, a posteriori, aligned with the block's samples.

    `errors()` makes `std`, one standard deviation of (R_s, R_R, L_sigma, L_M), when it is first asked for. `rotor_flux_wb` and `stator_flux_wb` are those of the
    linear machine at each sample's instant.
    """

    parameters: InverseGamma
    errors: Callable[[], Errors]
    residual_rms_a: float
    noise_a: float
    current_a: Signal
    rotor_flux_wb: Signal
    stator_flux_wb: Signal
    samples: int
    lost_samples: int
    restarts: int

    @cached_property
    def std(self) -> Errors:
        return self.errors()


@dataclass
class _Shell:
    """All that changes from block to block."""

    state: Matrix
    theta: Matrix
    upper: Matrix
    diagonal: Matrix
    machine: Matrix

    def kept(self) -> _Shell:
        """As it is now, without the state, for the standard errors."""
        return _Shell(np.zeros(0), self.theta, self.upper.copy(), self.diagonal.copy(), self.machine.copy())


@dataclass(frozen=True)
class StoredBlock:
    """A block as `advance` took it in (or a part of one)."""

    voltage_v: Signal
    current_a: Signal
    restarts: bool
    begins_at_rest: bool = False
    open_loop_v: Signal | None = None
    adapts: bool = True


@dataclass
class ParallelObserver:
    """Feed blocks with `advance`; nothing is read from or written to anywhere else.

    `prior` bounds the machine (from the nameplate), `current_scale_a` its currents (rated peak). `starts_at_rest` says
    that current and flux are zero at the first sample; otherwise, and after every gap, the unknown state is estimated
    along with the parameters, which needs parameters known to some per cent (`start`, `start_log_std`). Raises
    UsageError where the Lyapunov law has no positive-real margin over the prior.
    """

    prior: ParameterBox
    sample_period_s: float
    current_scale_a: float
    law: Law = "fast"
    start: InverseGamma | None = None
    start_log_std: float = PRIOR_LOG_STD
    compensation: Compensation = NOTHING
    starts_at_rest: bool = True
    memory_s: float = 240.0
    dead_zone_a: float = 0.0
    expected_voltage_v: Signal | None = None
    lost_samples: int = field(default=0, init=False)
    restarts: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        first = self.start or self.prior.typical
        self._filter = filter_poles(self.prior, self.sample_period_s)
        self._law = kernels.FAST if self.law == "fast" else kernels.LYAPUNOV
        self._gamma = np.zeros((4, 4))
        if self.law == "lyapunov":
            require_margin(self.prior, self._filter, self.sample_period_s)
            if self.expected_voltage_v is not None:
                self._gamma = self._gain_matrix(self.expected_voltage_v)
        self._is_known = self.start is not None and self.start_log_std < PRIOR_LOG_STD
        self._shell = self._fresh(first, self.current_scale_a**2, around_start=self._is_known)
        self._history: list[StoredBlock] = []
        self._samples = 0
        self._next_review = max(FIRST_REVIEW_S / self.sample_period_s, 100.0)
        self._first = True

    def advance(
        self,
        voltage_v: Signal,
        current_a: Signal,
        lost_before: int = 0,
        lost_voltage_v: Signal | None = None,
        begins_at_rest: bool = False,
        adapts: bool = True,
    ) -> BlockEstimate:
        """Take in one block of `(n,)` voltages along the axis (held over each period) and currents (at its start).

        `lost_before` samples are missing between the last block and this one. Where their voltage is known
        (`lost_voltage_v`) the observer runs through the hole open loop with adaptation frozen; otherwise its states
        restart as unknowns. Either way no sample is invented. `begins_at_rest`: the motor was de-energised before this
        block and has come to rest; known parameters stay, states start from zero. Without `adapts` only the states
        follow the voltage: for samples that tell about the inverter's dead band and not about the machine.
        """
        voltage_v, current_a = writable(voltage_v), writable(current_a)
        if voltage_v.ndim != 1 or voltage_v.shape != current_a.shape:
            raise ValueError(f"voltage {voltage_v.shape} and current {current_a.shape} must be equal (n,)")
        if self.law == "lyapunov" and not self._gamma.any():
            self._gamma = self._gain_matrix(voltage_v)
        self.lost_samples += lost_before
        bridged = lost_voltage_v if lost_before else None
        restarts = (self._first and not self.starts_at_rest) or (lost_before > 0 and bridged is None)
        restarts &= not begins_at_rest
        self.restarts += int(restarts and not self._first)
        self._first = False
        return self._advance_with_reviews(StoredBlock(voltage_v, current_a, restarts, begins_at_rest, bridged, adapts))

    # -- the parts ------------------------------------------------------------------------------------------------

    def _advance_with_reviews(self, piece: StoredBlock) -> BlockEstimate:
        """Split the block where the stored data have doubled, and go over them again there."""
        signals: list[tuple[Signal, Signal, Signal]] = []
        squares = 0.0
        total = piece.voltage_v.shape[0]
        done = 0
        while done < total or not signals:
            due = int(self._next_review) - self._samples
            cut = min(total, done + due) if self._remembers and due > 0 else total
            part = StoredBlock(
                piece.voltage_v[done:cut],
                piece.current_a[done:cut],
                piece.restarts and done == 0,
                piece.begins_at_rest and done == 0,
                piece.open_loop_v if done == 0 else None,
                piece.adapts,
            )
            signals.append(self._run(self._shell, part))
            squares += float(self._shell.state[kernels.SQUARES])
            self._samples += cut - done
            done = cut
            self._remember(part)
        current, rotor, stator = signals[0] if len(signals) == 1 else map(np.concatenate, zip(*signals, strict=True))
        return BlockEstimate(
            parameters=self.parameters,
            errors=partial(_std, self.law, self._shell.kept(), self._filter, self.sample_period_s),
            residual_rms_a=math.sqrt(squares / max(total, 1)),
            noise_a=math.sqrt(float(self._shell.state[kernels.NOISE])),
            current_a=current,
            rotor_flux_wb=rotor,
            stator_flux_wb=stator,
            samples=self._samples,
            lost_samples=self.lost_samples,
            restarts=self.restarts,
        )

    def _remember(self, part: StoredBlock) -> None:
        if not self._remembers:
            self._history.clear()
            return
        self._history.append(part)
        if self.law == "fast" and self._samples >= int(self._next_review):
            self.review()
            self._next_review *= 2.0

    @property
    def _remembers(self) -> bool:
        return self._samples * self.sample_period_s <= self.memory_s

    def review(self) -> None:
        """Go over the stored data once more from the present estimate (one Gauss-Newton step of the recursion)."""
        if not self._history or self.law != "fast" or self._is_known:
            return
        # The noise of the last pass includes the model's error, which the new pass starts without.
        noise_a2 = float(self._shell.state[kernels.NOISE])
        fresh = self._fresh(self.parameters, noise_a2, around_start=True)
        # A recursion that starts wide runs through machines far away; sensitivities along the present one do not. Unknown
        # initial states need the recursion, which sets them as it goes.
        is_linearised = not any(piece.restarts for piece in self._history)
        for piece in self._history:
            self._run(fresh, piece, kernels.REVIEW if is_linearised else None)
        if is_linearised:
            fresh.theta += fresh.state[kernels.DEVIATION + kernels.OFFSET :][[1, 2, 3, 4, 0]]
        if not (np.all(np.isfinite(fresh.theta)) and self._is_machine(fresh.theta)):
            return
        if is_linearised:
            self._bring_up(fresh, noise_a2)
        self._shell = fresh

    def _bring_up(self, shell: _Shell, noise_a2: float) -> None:
        """The shell's state at the end of the stored data, run with its parameters."""
        held = self._fresh(self.parameters, noise_a2)
        held.theta[:], held.state[:] = shell.theta, 0.0
        for piece in self._history:
            self._run(held, piece, kernels.FROZEN)
        held.state[kernels.NOISE : kernels.LAST_ERROR + 1] = shell.state[kernels.NOISE : kernels.LAST_ERROR + 1]
        shell.state[:], shell.machine[:] = held.state, held.machine

    @property
    def history(self) -> tuple[StoredBlock, ...]:
        """The blocks still stored, as they came in."""
        return tuple(self._history)

    def predicted(self, machine: InverseGamma | None = None) -> list[tuple[Signal, Signal, Signal]]:
        """(current, rotor flux, stator flux) of the stored blocks, simulated with a machine (the present one) held."""
        held = self._fresh(machine or self.parameters, 0.0)
        held.theta[4] = self._shell.theta[4]
        out = []
        for piece in self._history:
            if piece.restarts or piece.begins_at_rest:
                _restart(held, self.current_scale_a, True)
            out.append(self._kernel(held, piece.voltage_v, piece.current_a, kernels.FROZEN))
        return out

    def _is_machine(self, theta: Matrix) -> bool:
        return bool(kernels.machine_from_theta(theta, self._filter, self.sample_period_s, np.empty(4)))

    def _run(self, shell: _Shell, piece: StoredBlock, law: int | None = None) -> tuple[Signal, Signal, Signal]:
        if piece.restarts or piece.begins_at_rest:
            _restart(shell, self.current_scale_a, piece.begins_at_rest)
        if piece.open_loop_v is not None:
            known = writable(piece.open_loop_v)
            self._kernel(shell, known, np.zeros_like(known), kernels.FROZEN)
        chosen = self._law if law is None else law
        return self._kernel(shell, piece.voltage_v, piece.current_a, chosen if piece.adapts else kernels.FROZEN)

    def _kernel(self, shell: _Shell, voltage_v: Signal, current_a: Signal, law: int) -> tuple[Signal, Signal, Signal]:
        course = kernels.Course(*(np.empty_like(voltage_v) for _ in range(3)))
        period_s, off = self.sample_period_s, self.compensation
        memory_samples, floor_a2 = NOISE_MEMORY_S / period_s, (1e-9 * self.current_scale_a) ** 2
        kernels.advance(
            kernels.Samples(voltage_v, current_a, period_s),
            kernels.Adaptation(law, self._filter, self._gamma, memory_samples, self.dead_zone_a, floor_a2),
            kernels.TakenOff(off.delay_s / period_s, off.lost_v, off.lost_span_a, off.extra_a, off.extra_span_wb),
            kernels.Memory(shell.state, shell.theta, shell.upper, shell.diagonal, shell.machine),
            course,
        )
        return course

    @property
    def parameters(self) -> InverseGamma:
        """The last estimate that is a passive machine, projected into the prior box widened twofold."""
        values = self._shell.machine
        low, high = self.prior.lower.as_tuple(), self.prior.upper.as_tuple()
        return InverseGamma(*(float(min(max(v, 0.5 * a), 2.0 * b)) for v, a, b in zip(values, low, high, strict=True)))

    def covariance(self) -> Matrix:
        """(4, 4) of (R_s, R_R, L_sigma, L_M); for the Lyapunov law, which has none, zeros."""
        return _covariance(self.law, self._shell, self._filter, self.sample_period_s)

    def std(self) -> Errors:
        """Standard errors of (R_s, R_R, L_sigma, L_M)."""
        return _std(self.law, self._shell, self._filter, self.sample_period_s)

    def _fresh(self, machine: InverseGamma, variance_a2: float, around_start: bool = False) -> _Shell:
        state = np.zeros(kernels.STATE_SIZE)
        state[kernels.NOISE] = variance_a2
        theta = to_theta(machine, self._filter, self.sample_period_s)
        if around_start:
            jacobian = theta_jacobian(machine, self._filter, self.sample_period_s) * np.array(machine.as_tuple())
            covariance = self.start_log_std**2 * jacobian @ jacobian.T
        else:
            covariance = prior_covariance(self.prior, self._filter, self.sample_period_s)
        upper, diagonal = np.eye(kernels.PARAMETERS), np.zeros(kernels.PARAMETERS)
        upper[kernels.THETA :, kernels.THETA :], diagonal[kernels.THETA :] = ud_factors(covariance)
        diagonal[kernels.OFFSET] = (OFFSET_STD * self.current_scale_a) ** 2
        return _Shell(state, np.append(theta, 0.0), upper, diagonal, np.array(machine.as_tuple()))

    def _gain_matrix(self, voltage_v: Signal) -> Matrix:
        """Gamma = (T / time constant) x (regressor power of the typical machine)^-1: the same speed for every
        machine."""
        w = regressor(self.prior.typical, self._filter, self.sample_period_s, voltage_v)
        power = w.T @ w / max(w.shape[0], 1)
        power += 1e-6 * np.trace(power) * np.eye(4) + 1e-30 * np.eye(4)
        return np.asarray(self.sample_period_s / LYAPUNOV_TIME_CONSTANT_S * np.linalg.inv(power))


def _covariance(law: Law, shell: _Shell, filter_z: Matrix, period_s: float) -> Matrix:
    if law != "fast":
        return np.zeros((4, 4))
    back = np.linalg.inv(theta_jacobian(InverseGamma(*map(float, shell.machine)), filter_z, period_s))
    upper, diagonal = shell.upper[kernels.THETA :, kernels.THETA :], shell.diagonal[kernels.THETA :]
    root = back @ upper * np.sqrt(diagonal)
    return np.asarray(root @ root.T)


def _std(law: Law, shell: _Shell, filter_z: Matrix, period_s: float) -> Errors:
    a, b, c, d = np.sqrt(np.diag(_covariance(law, shell, filter_z, period_s)))
    return float(a), float(b), float(c), float(d)


def _restart(shell: _Shell, current_scale_a: float, is_at_rest: bool) -> None:
    """Filters at zero; unless at rest, the free response becomes two more parameters, known to a few rated currents."""
    shell.state[kernels.ZHAT : kernels.NOISE] = 0.0
    shell.state[kernels.FREE], shell.state[kernels.FREE + 3] = 1.0, 1.0
    shell.state[kernels.LAST_VOLTAGE : kernels.ABSORBING] = 0.0
    shell.state[kernels.ABSORBING] = 0.0 if is_at_rest else 1.0
    shell.state[kernels.LOOP : kernels.DEVIATION + kernels.OFFSET] = 0.0
    shell.upper[:2, :] = np.eye(2, kernels.PARAMETERS)
    shell.diagonal[:2] = (4.0 * current_scale_a) ** 2
