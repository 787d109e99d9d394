"""Weights of the confidence: logistic regression on blind cases, printed by `python -m tests.hidden_effects.calibrate`.

Features in the order of `evidence.claim_features`; the first weight is the constant.
"""

WEIGHTS: tuple[float, ...] = (1.5, 0.5, -1.0, 1.5, 0.3, 0.5, 0.3)
UNKNOWN_NOISE_FACTOR = 0.8
"""Applied where the noise could not be measured: what looks like the floor may be structure."""
