"""Weights of the confidence: logistic regression on the blind cases of releases 18 and 19, printed by `python -m tests.hidden_effects.calibrate`.

Features in the order of `evidence.claim_features`; the first weight is the constant.
"""

WEIGHTS: tuple[float, ...] = (-5.16, -0.392, -4.32, 3.93, -0.165, -0.104)
UNKNOWN_NOISE_FACTOR = 0.8
"""Applied where the noise could not be measured: what looks like the floor may be structure."""
TRACE_SIGMA, TRACE_FACTOR = 0.04, 0.88
"""Below so much of the noise a cause that is in no catalogue takes the form of one that is: of 55 such names in releases 17 and 18, 14
were wrong, 13 of these where the true cause was forbidden or unlisted; their mean confidence had been 0.85.
"""
