"""Which extensions of the linear machine the data ask for: leg loss, delay, saturating iron, drifting offsets."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from commissioner.errors import DataRefused
from commissioner.identify.batch.fit import fit_segments
from commissioner.identify.batch.model import CIRCUIT, IRON, Matrix, ModelChoice, start_theta
from commissioner.identify.batch.segments import BatchFit, Segment, extended
from commissioner.identify.inverter.leg_law import LegLaw
from commissioner.identify.inverter.staircase import InverterError, knee_shape
from commissioner.motor.circuit import InverseGamma

BETTER = 4.0
"""What a criterion must gain for another model to be tried from there."""
BLIND_LOSSES = (0.1, 0.4)
COARSE, MOST_COARSE_STEPS = 0.03, 20
"""While models are compared: steps, in standard errors, that count as none, and how many are tried."""
FINAL_STEPS = 200
"""The chosen model is fitted until it stays: from another machine the way behind a steep loss is long."""


def select_model(
    segments: Sequence[Segment], period_s: float, starts: Sequence[InverseGamma], leg: InverterError | None
) -> BatchFit:
    """Greedy choice by the fit's criterion: whichever of delay, inverter error, saturation and drift helps most is
    added, then the next, and what has become superfluous is dropped. A staircase's inverter error is in from the start;
    without one it is unknown, and the fit begins with none, a small and a large one, from every start."""
    law = LegLaw(max(float(np.max(np.abs(s.current_a))) for s in segments))
    rms_v = max(float(np.std(s.voltage_v)) for s in segments)
    legs = [leg] if leg else [None, *(knee_shape(share * rms_v, law.corner_a, 2.0) for share in BLIND_LOSSES)]
    begun = _those_simulated(
        [partial(_begin, segments, period_s, start, each, law) for start in starts for each in legs]
    )
    if not begun:
        raise DataRefused(
            "the model cannot be simulated from any start", step="identify", value=f"{len(starts)} starts", limit="one",
            remedy="check that the nameplate belongs to the motor",
        )  # fmt: skip
    best = min(begun, key=lambda f: f.criterion())
    start = best.gamma.as_inverse_gamma()
    model = replace(best.model, flux_scale_wb=best.peak_flux_wb)
    best, tried = replace(best, model=model), {model}
    while True:
        m = best.model
        toggled = (
            *(replace(m, extra_powers=n) for n in _more_or_less_iron(m.extra_powers)),
            replace(m, with_delay=not m.with_delay),
            replace(m, with_drift=not m.with_drift),
            replace(m, leg=None if m.leg and not _loses_voltage(best) else law),
        )
        untried = [t for t in toggled if t not in tried]
        trials = _those_simulated(
            [partial(_coarse, segments, period_s, start, t, extended(best, t), best.own) for t in untried]
        )
        tried.update(toggled)
        better = [t for t in trials if t.criterion() < best.criterion() - BETTER and np.all(t.theta[:4] > 0.0)]
        if not better:
            return _from_every_start(segments, period_s, starts, _with_iron(segments, period_s, start, best))
        best = min(better, key=lambda t: t.criterion())


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
    model = replace(best.model, extra_powers=1, flux_scale_wb=best.peak_flux_wb)
    return next(
        iter(_those_simulated([partial(_coarse, segments, period_s, start, model, extended(best, model), best.own)])),
        best,
    )


def _from_every_start(
    segments: Sequence[Segment], period_s: float, starts: Sequence[InverseGamma], best: BatchFit
) -> BatchFit:
    """The chosen model once more from the other machines: a way through simpler models may have led into a wrong
    minimum."""
    attempts = []
    for start in starts:
        theta = best.theta.copy()
        theta[:CIRCUIT] = start_theta(start, best.model)[:CIRCUIT]
        attempts.append(partial(_coarse, segments, period_s, start, best.model, theta))
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
) -> BatchFit:
    return fit_segments(segments, period_s, start, model, theta, MOST_COARSE_STEPS, COARSE, own)


def _loses_voltage(fit: BatchFit) -> bool:
    """The leg error's plateau is beyond doubt, so that a fit without it need not be tried."""
    leg = fit.inverter()
    return leg is not None and abs(leg.plateau_v) > 10.0 * leg.std_v[-1]
