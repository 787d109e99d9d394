"""Weights of the confidence: logistic regression on blind cases, printed by `python -m tests.hidden_effects.calibrate`.

Features in the order of `evidence.claim_features`; the first weight is the constant.
"""

WEIGHTS: tuple[float, ...] = (-0.747, -0.289, -1.67, 1.38, 0.184, -0.0617, -0.0377)
UNKNOWN_NOISE_FACTOR = 0.8
"""Applied where the noise could not be measured: what looks like the floor may be structure."""
