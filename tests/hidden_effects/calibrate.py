"""Weights of the confidence from blind rows: `python -m tests.hidden_effects.calibrate rows.json ...`.

Logistic regression with a small ridge; five folds by case, so that no case judges itself. Rows must be of another release
than those the protocol reports. Prints the tuple for `commissioner/diagnose/verdict/calibration.py`.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from tests.hidden_effects.scoring import claims, sweep_error

RIDGE = 1.0
FOLDS = 5


def weights(features: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Constant first, then one weight per feature."""
    rows = np.column_stack([np.ones(right.size), features])

    def loss(w: np.ndarray) -> tuple[float, np.ndarray]:
        z = rows @ w
        p = 1.0 / (1.0 + np.exp(-z))
        value = np.sum(np.logaddexp(0.0, z) - right * z) + 0.5 * RIDGE * np.sum(w[1:] ** 2)
        return float(value), rows.T @ (p - right) + RIDGE * np.r_[0.0, w[1:]]

    return np.asarray(minimize(loss, np.zeros(rows.shape[1]), jac=True, method="L-BFGS-B").x)


def confidence(w: np.ndarray, features: np.ndarray) -> np.ndarray:
    return np.asarray(1.0 / (1.0 + np.exp(-(w[0] + features @ w[1:]))))


def main(paths: Sequence[Path]) -> None:
    rows = [json.loads(line) for path in paths for line in path.read_text().splitlines()]
    cases = [claims([row]) + claims([row], "unsure") for row in rows]
    fold = np.array([k % FOLDS for k, case in enumerate(cases) for _ in case])
    said = [claim for case in cases for claim in case]
    features = np.array([f for _, _, f in said])
    right = np.array([ok for _, ok, _ in said], dtype=float)
    blind = np.zeros(right.size)
    for k in range(FOLDS):
        blind[fold == k] = confidence(weights(features[fold != k], right[fold != k]), features[fold == k])
    now = np.array([p for p, _, _ in said])
    print(f"{right.size} claims, {right.mean():.1%} right")
    print(f"as it is:  ECE {sweep_error(now, right):.3f}, Brier {np.mean((now - right) ** 2):.3f}")
    print(f"new, blind: ECE {sweep_error(blind, right):.3f}, Brier {np.mean((blind - right) ** 2):.3f}")
    print("WEIGHTS = (" + ", ".join(f"{x:.3g}" for x in weights(features, right)) + ")")


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
