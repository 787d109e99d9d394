"""Which machine parameter an error of the simulation had moved, from where to where, and by which cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from commissioner.diagnose.fit.gauss_newton import Fit
from commissioner.diagnose.fit.spread import covariance_of
from commissioner.diagnose.plant.model import Layout
from commissioner.motor.circuit import PARAMETERS

LEAST_SHARE, LEAST_SIGMAS = 0.01, 3.0
"""A move below a per cent, or within three standard errors of the better value, is not worth a sentence."""


@dataclass(frozen=True)
class ParameterShift:
    """One parameter fitted by four numbers alone, and with the accepted causes; `cause` had most of the move."""

    parameter: str
    four_parameters: float
    with_causes: float
    cause: str


def parameter_shifts(nominal: Fit, extended: Fit, layout: Layout) -> tuple[ParameterShift, ...]:
    """Parameters of slow currents that the accepted causes moved, largest first."""
    before = np.array(nominal.model.nominal)
    after, derivatives = extended.model.at_rest(layout)
    relative = derivatives / after[:, None]
    error = np.sqrt(np.maximum(np.diag(relative @ covariance_of(extended, layout) @ relative.T), 0.0))
    apart = np.abs(np.log(before / after))
    causes = list(dict.fromkeys(t.effect for t in extended.model.terms if t.effect))
    if not causes:
        return ()
    shifts = np.array([np.abs(relative @ _change_without(extended, name)) for name in causes])
    order = [k for k in np.argsort(-apart) if apart[k] > max(LEAST_SHARE, LEAST_SIGMAS * error[k])]
    return tuple(
        ParameterShift(PARAMETERS[k], float(before[k]), float(after[k]), causes[int(np.argmax(shifts[:, k]))])
        for k in order
    )


def _change_without(fitted: Fit, name: str) -> NDArray[np.float64]:
    """(4 + terms,) change of theta, to first order, when one cause is taken out and the rest re-adjusts."""
    gram, mine, others, inner = fitted.set_apart(name)
    change = np.zeros(fitted.model.theta.size)
    change[mine] = -fitted.model.theta[mine]
    change[others] = inner @ gram[np.ix_(others, mine)] @ fitted.model.theta[mine]
    return change
