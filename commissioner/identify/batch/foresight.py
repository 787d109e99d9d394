"""What a fit would come to with another model, foreseen from one evaluation: the quadratic that the normal equations of a
larger model make at the present optimum, minimised over what the other model leaves free (score and Wald test at once;
C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from commissioner.identify.batch.model import DELAY, OWN, SHARED, SPLIT, Matrix, ModelChoice
from commissioner.identify.batch.problem import Evaluation, Problem
from commissioner.identify.batch.segments import PRICE


@dataclass(frozen=True)
class Foresight:
    """The normal equations of `problem`, whose model has all that others may have, at `theta` (in its layout) and `own`
    (segments, 3)."""

    problem: Problem
    theta: Matrix
    own: Matrix
    seen: Evaluation

    @classmethod
    def at(cls, problem: Problem, theta: Matrix, own: Matrix) -> Foresight | None:
        """None where the model cannot be simulated there."""
        problem.expect_leg(theta)
        seen = problem.evaluate(theta, own)
        return cls(problem, theta, own, seen) if seen.is_finite else None

    def criterion(self, model: ModelChoice) -> float:
        """`BatchFit.criterion` that a fit of `model` would reach, were residuals linear in what is fitted."""
        point = np.concatenate([self.theta, self.own.ravel()])
        free, fixed = self._free(model)
        moved = np.where(fixed, -point, 0.0)
        information, score = self.seen.information, self.seen.score
        left = score - information @ moved
        reduced = free.T @ information @ free
        scale = np.sqrt(np.maximum(np.diag(reduced), 1e-300))
        normal = reduced / np.outer(scale, scale) + 1e-12 * np.eye(scale.size)
        gain = np.linalg.solve(normal, free.T @ left / scale) / scale
        squares = float(self.seen.squares - 2.0 * moved @ score + moved @ information @ moved - gain @ (free.T @ left))
        n = self.problem.samples
        return float(n * math.log(max(float(squares), 1e-9 * self.seen.squares) / n + 1e-300) + PRICE * free.shape[1])

    def _free(self, model: ModelChoice) -> tuple[Matrix, np.ndarray]:
        """(all numbers, those of `model`): what each free number of `model` moves; and which numbers it holds at zero."""
        everything = self.problem.model
        kept = np.concatenate([everything.free_shared, np.ones(self.own.size, dtype=bool)]) & self.problem.free
        kept[DELAY], kept[SPLIT] = model.with_delay, model.with_split
        for m, n in enumerate(everything.exponents):
            kept[SHARED + m] = n in model.exponents
        offsets = everything.size + OWN * np.arange(len(self.own))
        fixed = ~kept & (np.arange(kept.size) < everything.size)
        free = np.eye(kept.size)[:, kept]
        if not model.with_drift:
            common = np.zeros((kept.size, 1))
            common[offsets] = 1.0
            free = np.hstack([np.eye(kept.size)[:, kept & ~np.isin(np.arange(kept.size), offsets)], common])
            fixed[offsets] = True
        return free, fixed
