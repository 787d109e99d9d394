"""R_s, R_R, L_sigma, L_M and T_R of a fit, with what the recording leaves open of each."""

from __future__ import annotations

import numpy as np

from commissioner.diagnose.causes.inverter.legs import tail_of_legs
from commissioner.diagnose.fit.gauss_newton import Fit
from commissioner.diagnose.fit.spread import covariance_of
from commissioner.diagnose.plant.model import Layout
from commissioner.motor.circuit import PARAMETERS, Quantity


def parameters_of(one: Fit, layout: Layout) -> dict[str, Quantity]:
    """Of slow currents, as a drive controls them: what bars displace at the tones is the cause's, not R_R's and L_sigma's."""
    values, derivatives = one.model.at_rest(layout)
    covariance = derivatives @ covariance_of(one, layout) @ derivatives.T
    spreads = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    spreads[0] = np.hypot(spreads[0], tail_of_legs(one.model, layout)[1])
    out = {n: Quantity(float(v), float(s)) for n, v, s in zip(PARAMETERS, values, spreads, strict=True)}
    shares = np.array([0.0, -1.0 / values[1], 0.0, 1.0 / values[3]])
    t = float(values[3] / values[1])
    out["rotor_time_constant_s"] = Quantity(t, t * float(np.sqrt(max(shares @ covariance @ shares, 0.0))))
    return out
