"""Weights of the confidence: logistic regression on blind cases, printed by `python -m tests.hidden_effects.calibrate`.

Features in the order of `evidence.claim_features`; the first weight is the constant.
"""

WEIGHTS: tuple[float, ...] = (-1.1, -0.297, -1.6, 1.3, 0.188, 0.0127, -0.0119)
UNKNOWN_NOISE_FACTOR = 0.8
"""Applied where the noise could not be measured: what looks like the floor may be structure."""
