"""What sensitivities tell that are noisy themselves: an independent draw of regressors decides."""

import numpy as np
import pytest

from commissioner.estimation.fit import Column, Fit, Machine, _Sensitivity
from commissioner.estimation.kernels.march import STATES
from commissioner.estimation.numbers import AT
from commissioner.estimation.numbers import COUNT as NUMBERS
from commissioner.estimation.told import Slopes, inverse, told

RNG = np.random.default_rng(3)
COUNT, SIGMA = 400, 0.1
STRONG = RNG.standard_normal(COUNT)


def _fitted(weak: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Least squares of (1, 1) on two regressors that differ by `weak`, each seen with noise of `SIGMA`; its Gram matrix."""
    ideal = np.stack([STRONG, STRONG + weak * np.cos(np.arange(COUNT))])
    seen = ideal + SIGMA * rng.standard_normal(ideal.shape)
    gram = seen @ seen.T
    return np.linalg.solve(gram, seen @ (ideal.sum(axis=0) + rng.standard_normal(COUNT))), gram


BY_NOISE = COUNT * SIGMA**2 * np.eye(2)


def test_what_only_noise_tells_is_open_and_wide() -> None:
    """Two regressors that are one: their difference is nothing but noise, and the plain error of it far too small."""
    _, gram = _fitted(0.0, RNG)
    told_of = told(gram, BY_NOISE)
    along = np.array([1.0, -1.0]) / np.sqrt(2.0)
    assert along @ told_of.covariance @ along > 50.0 * along @ inverse(gram) @ along
    assert along @ told_of.open @ along == pytest.approx(along @ told_of.covariance @ along, rel=0.01)
    across = np.array([1.0, 1.0]) / np.sqrt(2.0)
    assert across @ told_of.open @ across < 0.01 * along @ told_of.open @ along


def test_what_is_told_has_the_error_of_its_own_part() -> None:
    """With three quarters of a direction its own, the spread about the truth is within the stated one, which the plain one is not told from."""
    fits = [_fitted(0.35, np.random.default_rng(k)) for k in range(300)]
    stated = np.sqrt(np.mean([np.diag(told(gram, BY_NOISE).covariance) for _, gram in fits], axis=0))
    spread = np.std([found for found, _ in fits], axis=0)
    assert np.all(stated > 0.95 * spread) and np.all(stated < 2.0 * spread)
    assert not any(told(gram, BY_NOISE).open.any() for _, gram in fits)


def test_without_noise_it_is_the_inverse() -> None:
    """Also before anybody has asked."""
    _, gram = _fitted(0.35, RNG)
    assert told(gram, 0.0).covariance == pytest.approx(np.linalg.inv(gram), rel=1e-6)
    assert told(gram, 1e-9 * gram).covariance == pytest.approx(np.linalg.inv(gram), rel=1e-5)


@pytest.mark.parametrize(
    ("along", "opened"), [((1.0, -1.0, 0.05), {"stator_resistance", "rotor_resistance"}), ((0.02, -0.01, 1.0), set())]
)
def test_a_long_recording_does_not_tell_what_only_its_noise_does(along: tuple[float, ...], opened: set[str]) -> None:
    """Deviations of half a per cent along a direction that noise makes: open where the four move along it, not where the inertia does."""
    columns = tuple(Column("p", AT[n]) for n in ("stator_resistance", "rotor_resistance", "inertia"))
    turned, _ = np.linalg.qr(np.column_stack([along, np.eye(3)[:, :2]]))
    jacobian = turned @ np.diag([200.0, 1e3, 1e3])
    by_noise = 0.6 * np.outer(turned[:, 0], turned[:, 0]) * 200.0**2
    machine = Machine(
        np.zeros(NUMBERS), np.zeros((1, STATES)), np.zeros((1, 2)), np.zeros((1, 2)), np.zeros((1, NUMBERS))
    )
    fit = Fit(machine, columns, 3.0, np.ones(3), Slopes.known(jacobian), 0.0, 0, by_noise)
    assert set(fit.not_told()) == opened


def test_sensitivities_are_made_once_and_when_they_are_asked_for() -> None:
    made: list[int] = []

    def make() -> np.ndarray:
        made.append(1)
        return np.eye(2, 5)

    slopes = Slopes(make)
    assert not made
    assert slopes.gram.tolist() == np.eye(2).tolist()
    assert slopes.jacobian.shape == (2, 5)
    assert made == [1]


def test_what_sensitivities_do_not_take_up_is_what_an_orthogonal_basis_leaves() -> None:
    """Two of them alike to 1e-4, and of sizes from 1 to 1e6."""
    rng = np.random.default_rng(2)
    known, rows = rng.standard_normal((6, 400)), rng.standard_normal((3, 400))
    known[1] = known[0] + 1e-4 * known[1]
    known *= 10.0 ** np.arange(6)[:, None]
    basis, _ = np.linalg.qr(known.T)
    left = Slopes.known(known).apart(rows)
    assert np.abs(left - (rows - rows @ basis @ basis.T)).max() < 1e-7


def test_a_jacobian_that_learnt_tells_each_change_that_it_was_taught_last() -> None:
    """Broyden's condition, and products that are those of the Jacobian."""
    rng = np.random.default_rng(3)
    learning = _Sensitivity(rng.standard_normal((3, 50)))
    for _ in range(3):
        step, change = rng.standard_normal(3), rng.standard_normal(50)
        learning.learn(step, change)
        assert np.abs(step @ learning.jacobian() - change).max() < 1e-9
    columns = [Column("k", j) for j in range(3)]
    plain, rest = learning.jacobian(), rng.standard_normal(50)
    wanted = np.linalg.solve(plain @ plain.T, plain @ rest)
    assert np.abs(learning.step(rest, columns, 0.0) - wanted).max() < 1e-6 * np.abs(wanted).max()
