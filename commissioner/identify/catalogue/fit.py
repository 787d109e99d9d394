"""The machine that meets a sheet, and how far each of its numbers may be off: rounding, assumptions, tolerances apart.

Maximum a posteriori of the numbers' logarithms by Levenberg-Marquardt on the sheet as printed: the circuit of the type. Errors are
linearised there; a tolerance moves the printed values against those of the motor at hand, and through the same estimator the numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from commissioner.identify.catalogue.evidence import Evidence
from commissioner.identify.catalogue.machine import NUMBERS, Array

STEP, MOST_STEPS, LARGEST_MOVE, SETTLED = 1e-4, 60, 0.7, 1e-6


@dataclass(frozen=True)
class Spread:
    """Covariances of a quantity's parts, `(m, m)` each: of rounding, of what is assumed, of the tolerances."""

    rounding: Array
    assumptions: Array
    tolerances: Array

    @property
    def of_type(self) -> Array:
        """As the sheet describes the type."""
        return self.rounding + self.assumptions

    @property
    def of_motor(self) -> Array:
        """Of a motor of this type."""
        return self.of_type + self.tolerances


@dataclass(frozen=True)
class Fit:
    """`numbers` (11,) of the machine, per unit; `jacobian` (data, 11) of the data by the numbers' logarithms, `prior` of assumptions."""

    evidence: Evidence
    numbers: Array
    jacobian: Array
    prior: Array

    @cached_property
    def _inverse(self) -> Array:
        a, b = self.jacobian / _std(self.evidence)[:, None], self.prior / _assumed_std(self.evidence)[:, None]
        return np.asarray(np.linalg.inv(a.T @ a + b.T @ b))

    @cached_property
    def _gain(self) -> Array:
        """(11, data): how the numbers' logarithms follow the printed values."""
        return np.asarray(self._inverse @ (self.jacobian / _std(self.evidence)[:, None] ** 2).T)

    def spread(self, of: Callable[[Array], Array]) -> Spread:
        """Of quantities `of(numbers)`: (n, 11) to (n, m)."""
        g = gradient(of, self.numbers)
        prior = self._inverse @ (self.prior / _assumed_std(self.evidence)[:, None] ** 2).T
        return Spread(
            self.misfit * _square(g @ self._gain * _std(self.evidence)), _square(g @ prior * _assumed_std(self.evidence)),
            _square(g @ self._gain @ _shifts(self.evidence)),
        )  # fmt: skip

    @property
    def left(self) -> Array:
        """(data,) predicted less printed, in standard deviations of rounding and model."""
        return np.asarray(
            (self.evidence.predicted(self.numbers[None])[0] - _values(self.evidence)) / _std(self.evidence)
        )

    @property
    def misfit(self) -> float:
        """Factor on the variance of rounding where the circuit does not meet the values to their digits, 1 where it does."""
        return max(1.0, float(np.mean(self.left**2))) if self.left.size else 1.0

    @property
    def told(self) -> Array:
        """(assumptions,): how much of each assumption's spread is left, 1 where the sheet tells nothing of it."""
        mine = self.prior @ self._inverse @ self.prior.T
        return np.asarray(np.sqrt(np.diag(mine)) / _assumed_std(self.evidence))


def fit(evidence: Evidence) -> Fit:
    """Deterministic; starts from the assumptions' medians."""
    logs = _start(evidence)
    damping, cost = 1e-2, _cost(evidence, logs)
    for _ in range(MOST_STEPS):
        residual, jacobian = _linear(evidence, logs)
        normal, slope = jacobian.T @ jacobian, jacobian.T @ residual
        for _ in range(8):
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), slope)
            step *= min(1.0, LARGEST_MOVE / np.abs(step).max())
            new = _cost(evidence, logs + step)
            if new < cost:
                break
            damping *= 6.0
        else:
            break
        gained, cost, logs, damping = cost - new, new, logs + step, max(damping / 8.0, 1e-9)
        if gained < SETTLED * (1.0 + cost):
            break
    numbers = np.exp(logs)
    return Fit(evidence, numbers, gradient(evidence.predicted, numbers), gradient(evidence.assumed, numbers))


def gradient(of: Callable[[Array], Array], numbers: Array) -> Array:
    """(m, 11): central differences by the logarithms of the numbers."""
    steps = STEP * np.eye(len(NUMBERS))
    values = of(np.exp(np.log(numbers) + np.concatenate([steps, -steps])))
    return np.asarray((values[: len(NUMBERS)] - values[len(NUMBERS) :]).T / (2.0 * STEP))


def _start(evidence: Evidence) -> Array:
    r_s, x_m, r_0, leak, split, d, t, iron, friction, stray, saturation = (a.median for a in evidence.assumptions)
    rotor = leak / (1.0 + split)
    d = min(d, 0.5 * rotor / (r_0 * t))
    return np.log([r_s, x_m, r_0, rotor - r_0 * d * t, leak - rotor, d, t, iron, friction, stray, saturation])


def _linear(evidence: Evidence, logs: Array) -> tuple[Array, Array]:
    def both(numbers: Array) -> Array:
        return _residual(evidence, numbers)

    numbers = np.exp(logs)
    return both(numbers[None])[0], gradient(both, numbers)


def _residual(evidence: Evidence, numbers: Array) -> Array:
    """(n, data + assumptions), each over its standard deviation."""
    medians = np.log([a.median for a in evidence.assumptions])
    return np.concatenate(
        [(evidence.predicted(numbers) - _values(evidence)) / _std(evidence), (evidence.assumed(numbers) - medians) / _assumed_std(evidence)],
        axis=1,
    )  # fmt: skip


def _cost(evidence: Evidence, logs: Array) -> float:
    return float(np.sum(_residual(evidence, np.exp(logs)[None]) ** 2))


def _values(evidence: Evidence) -> Array:
    return np.array([d.value for d in evidence.data])


def _std(evidence: Evidence) -> Array:
    return np.array([d.std for d in evidence.data])


def _assumed_std(evidence: Evidence) -> Array:
    return np.array([a.std for a in evidence.assumptions])


def _shifts(evidence: Evidence) -> Array:
    """(data, causes) of the tolerances."""
    causes = sorted({name for d in evidence.data for name in d.tolerance})
    return np.array([[d.tolerance.get(name, 0.0) for name in causes] for d in evidence.data]).reshape(
        len(evidence.data), -1
    )


def _square(a: Array) -> Array:
    return np.asarray(a @ a.T)
