"""Which extensions of the linear machine the data ask for: leg loss, delay, saturating iron and its place, drifting offsets."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from commissioner.errors import DataRefused
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.foresight import Foresight
from commissioner.identify.batch.model import CIRCUIT, IRON, Matrix, ModelChoice, start_theta
from commissioner.identify.batch.problem import Problem
from commissioner.identify.batch.segments import BatchFit, Segment, extended
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.staircase import InverterError, knee_shape
from commissioner.motor.circuit import InverseGamma

BETTER = 4.0
"""What a criterion must gain for another model to be tried from there."""
PROMISE = 2.0
"""What it must be foreseen to gain for the model to be fitted."""
BLIND_LOSSES = (0.1, 0.4)
COARSE, MOST_COARSE_STEPS = 0.03, 20
"""While models are compared: steps, in standard errors, that count as none, and how many are tried. Fewer periods are then
done in parts, which moves L_sigma by a fifth of its error: the chosen model is fitted with all of them."""
FINAL_STEPS = 200
"""The chosen model is fitted until it stays: from another machine the way behind a steep loss is long."""


def select_model(
    segments: Sequence[Segment],
    period_s: float,
    starts: Sequence[InverseGamma],
    leg: InverterError | None,
    law: LegLaw | None = None,
) -> BatchFit:
    """Greedy choice by the fit's criterion: whichever of delay, inverter error, saturation and drift helps most is
    added, then the next, and what has become superfluous is dropped. What a change would bring is foreseen from one
    evaluation (`Foresight`); what promises enough is fitted. A staircase's inverter error is in from the start; without
    one it is unknown, and the fit begins with none, a small and a large one, from every start. `law`: another test's, for
    curves of one inverter are put together knot by knot; else one for the currents of these segments."""
    law = law or LegLaw(max(float(np.max(np.abs(s.current_a))) for s in segments))
    begun, others = _begun(segments, period_s, starts, leg, law)
    best = min(begun, key=lambda f: f.criterion())
    start = best.gamma.as_inverse_gamma()
    best = replace(best, model=replace(best.model, flux_scale_wb=best.peak_iron_flux_wb))
    tried = {best.model}
    while True:
        better = _first_better(segments, period_s, start, best, law, tried)
        if better is None:
            return _from_other_starts(segments, period_s, others, _with_iron(segments, period_s, start, best))
        best = better


def _begun(
    segments: Sequence[Segment],
    period_s: float,
    starts: Sequence[InverseGamma],
    leg: InverterError | None,
    law: LegLaw,
) -> tuple[list[BatchFit], list[InverseGamma]]:
    """Fits of the linear machine, and the starts that are still to be tried with the model that is chosen: behind a known
    leg only the start that explains more is carried on, the others then show whether its way led astray."""
    if leg is None:
        rms_v = max(float(np.std(s.voltage_v)) for s in segments)
        legs = [None, *(knee_shape(share * rms_v, law.corner_a, 2.0) for share in BLIND_LOSSES)]
        attempts = [partial(_begin, segments, period_s, start, each, law) for start in starts for each in legs]
        begun, others = _those_simulated(attempts), list(starts)
    else:
        model = ModelChoice(leg=law, with_drift=False)
        problem = Problem(segments, period_s, model, is_coarse=True)
        squares = [problem.squares(start_theta(start, model, leg)) for start in starts]
        ranked = [starts[k] for k in np.argsort(squares)]
        begun, others = [], ranked
        while not begun and others:
            begun, others = _those_simulated([partial(_begin, segments, period_s, others[0], leg, law)]), others[1:]
    if not begun:
        raise DataRefused(
            "the model cannot be simulated from any start", step="identify", value=f"{len(starts)} starts", limit="one",
            remedy="check that the nameplate belongs to the motor",
        )  # fmt: skip
    return begun, others


def _first_better(
    segments: Sequence[Segment],
    period_s: float,
    start: InverseGamma,
    best: BatchFit,
    law: LegLaw,
    tried: set[ModelChoice],
) -> BatchFit | None:
    """The neighbour of the best model that promises most and keeps it when fitted; None where there is none. `tried` grows
    by what was looked at."""
    m = best.model
    promised = {t: gain for t, gain in _promised(segments, period_s, best).items() if t not in tried}
    in_order = [t for t in sorted(promised, key=promised.__getitem__, reverse=True) if promised[t] > PROMISE]
    other_leg = replace(m, leg=None if m.leg and not _loses_voltage(best) else law)
    if other_leg not in tried:
        in_order.insert(0, other_leg)
    tried.update(promised, [other_leg])
    for model in in_order:
        for fit in _those_simulated(
            [partial(_coarse, segments, period_s, start, model, extended(best, model), best.own)]
        ):
            if fit.criterion() < best.criterion() - BETTER and np.all(fit.theta[:CIRCUIT] > 0.0):
                return fit
    return None


def _promised(segments: Sequence[Segment], period_s: float, best: BatchFit) -> dict[ModelChoice, float]:
    """What the criterion is foreseen to gain by more or less iron, by having or not having delay and drift."""
    m = best.model
    neighbours = (
        *(replace(m, extra_powers=n, with_split=m.with_split and n > 0) for n in _more_or_less_iron(m.extra_powers)),
        *([replace(m, with_split=not m.with_split)] if m.extra_powers else []),
        replace(m, with_delay=not m.with_delay),
        replace(m, with_drift=not m.with_drift),
    )
    most = max(m.extra_powers, *(n.extra_powers for n in neighbours))
    everything = replace(m, extra_powers=most, with_delay=True, with_split=True, with_drift=True)
    seen = Foresight.at(Problem(segments, period_s, everything, is_coarse=True), extended(best, everything), best.own)
    if seen is None:
        return dict.fromkeys(neighbours, math.inf)
    present = seen.criterion(m)
    return {n: present - seen.criterion(n) for n in neighbours}


def _more_or_less_iron(powers: int) -> tuple[int, ...]:
    """Neighbours in `IRON`; from straight iron also the middle of it at once."""
    steps = tuple(IRON)
    at = steps.index(powers)
    return (1, 4) if powers == 0 else steps[at - 1 : at] + steps[at + 1 : at + 2]


def _with_iron(segments: Sequence[Segment], period_s: float, start: InverseGamma, best: BatchFit) -> BatchFit:
    """Iron saturates, seen or not: behind a real inverter a trace of it stays in the model, so that what it may do to L_M
    stays in the standard errors."""
    if best.model.leg is None or best.model.extra_powers:
        return best
    model = replace(best.model, extra_powers=1, flux_scale_wb=best.peak_iron_flux_wb)
    return next(
        iter(_those_simulated([partial(_coarse, segments, period_s, start, model, extended(best, model), best.own)])),
        best,
    )


def _from_other_starts(
    segments: Sequence[Segment], period_s: float, starts: Sequence[InverseGamma], best: BatchFit
) -> BatchFit:
    """The chosen model once more from the other machines, until they come to the same minimum: a way through simpler
    models may have led into a wrong one."""
    attempts = []
    for start in starts:
        theta = best.theta.copy()
        theta[:CIRCUIT] = start_theta(start, best.model)[:CIRCUIT]
        attempts.append(partial(_coarse, segments, period_s, start, best.model, theta, known=best.sum_of_squares))
    finalists = [best, *_those_simulated(attempts)]
    chosen = min(finalists, key=lambda f: f.criterion())
    gamma = chosen.gamma.as_inverse_gamma()
    return fit_segments(segments, period_s, gamma, chosen.model, chosen.theta, FINAL_STEPS, own_start=chosen.own)


def _those_simulated(attempts: Sequence[Callable[[], BatchFit]]) -> list[BatchFit]:
    """Fits that could begin: iron or inverter found so far may run away in another machine."""
    fits = []
    for attempt in attempts:
        with contextlib.suppress(DataRefused):
            fits.append(attempt())
    return fits


def _begin(
    segments: Sequence[Segment], period_s: float, start: InverseGamma, leg: InverterError | None, law: LegLaw
) -> BatchFit:
    model = ModelChoice(leg=law if leg else None, with_drift=False)
    return _coarse(segments, period_s, start, model, start_theta(start, model, leg))


def _coarse(
    segments: Sequence[Segment],
    period_s: float,
    start: InverseGamma,
    model: ModelChoice,
    theta: Matrix,
    own: Matrix | None = None,
    known: float | None = None,
) -> BatchFit:
    return fit_segments(
        segments, period_s, start, model, theta, MOST_COARSE_STEPS, COARSE, own, is_coarse=True, known=known
    )


def _loses_voltage(fit: BatchFit) -> bool:
    """The leg error's plateau is beyond doubt, so that a fit without it need not be tried."""
    leg = fit.inverter()
    return leg is not None and abs(leg.plateau_v) > 10.0 * leg.std_v[-1]
