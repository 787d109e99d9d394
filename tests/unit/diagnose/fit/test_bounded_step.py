"""The step of a fit within bounds, against a solver that sees the directions themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from commissioner.diagnose.fit.gauss_newton import bounded_step


def _drawn(seed: int, numbers: int, bounded: int):
    random = np.random.default_rng(seed)
    directions = random.standard_normal((300, numbers)) * 10.0 ** random.uniform(-3.0, 3.0, numbers)
    residual = random.standard_normal(300) + directions @ (
        3.0 * random.standard_normal(numbers) / np.abs(directions).max(0)
    )
    low, high = np.full(numbers, -np.inf), np.full(numbers, np.inf)
    few = random.choice(numbers, bounded, replace=False)
    low[few], high[few] = 0.0, 1.0 / np.abs(directions).max(0)[few]
    return directions, residual, low, high


@pytest.mark.parametrize("numbers, bounded", [(6, 0), (6, 2), (20, 8), (20, 20), (60, 5)])
def test_bounded_step_is_the_constrained_least_squares_solution(numbers: int, bounded: int) -> None:
    for seed in range(5):
        directions, residual, low, high = _drawn(seed, numbers, bounded)
        step = bounded_step(directions.T @ directions, directions.T @ residual, low, high, 0.0)
        scale = np.linalg.norm(directions, axis=0)
        peer = lsq_linear(directions / scale, residual, (low * scale, high * scale), method="bvls", tol=1e-14).x
        assert step * scale == pytest.approx(peer, rel=1e-6, abs=1e-6 * np.abs(peer).max())
        assert np.all((step >= low - 1e-9 / scale) & (step <= high + 1e-9 / scale))


def test_many_numbers_that_the_data_do_not_tell_beside_some_with_bounds() -> None:
    """The angles of a shaft in segments of which a part is used: hundreds of numbers without a bound, most untold or nearly
    twins; a solver of all of them together broke off here.
    """
    random = np.random.default_rng(7)
    directions, residual, low, high = _drawn(3, 24, 12)
    untold = np.zeros((300, 160))
    few = random.standard_normal((300, 4))
    twins = few @ random.standard_normal((4, 40)) + 1e-9 * random.standard_normal((300, 40))
    every = np.hstack([directions, untold, twins])
    lower, upper = (np.r_[bound, np.full(200, sign * np.inf)] for bound, sign in ((low, -1.0), (high, 1.0)))
    step = bounded_step(every.T @ every, every.T @ residual, lower, upper, 0.0)
    rest = np.hstack([directions, few])
    scale = np.linalg.norm(rest, axis=0)
    lower, upper = (np.r_[bound, np.full(4, sign * np.inf)] * scale for bound, sign in ((low, -1.0), (high, 1.0)))
    peer = lsq_linear(rest / scale, residual, (lower, upper), method="bvls", tol=1e-14)
    assert np.abs(step[24:184]).max() < 1e-9
    assert 0.5 * np.sum((residual - every @ step) ** 2) == pytest.approx(peer.cost, rel=1e-6)
